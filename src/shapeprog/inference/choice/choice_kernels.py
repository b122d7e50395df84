"""The kernel that searches for the most valuable set of candidates, on rows of bits."""

from __future__ import annotations

import numpy as np

from shapeprog.kernels.bits import ones, uniform
from shapeprog.kernels.compile import helper, kernel

RUIN_LEAST, RUIN_MOST = 0.1, 0.6
"""Range of the share of selected candidates that a round drops, in addition to one that it always drops."""

THRESHOLD = 0.01
"""How much worse than the incumbent a set may be that takes its place; it falls to zero (Dueck and Scheuer 1990)."""

ROUNDING = 1e-12
"""How far rounding may take a gain above its upper bound."""


@helper
def gain(
    rows, interior, hidden, weights, words, bits, begins, inner, starts, exposed, sample_price, prices, penalty,
    cover, under, selected, count, candidate,
):  # fmt: skip
    """Increase in value of the selected candidates with one more candidate."""
    total, last = -prices[candidate], len(weights)
    for index in range(begins[candidate], begins[candidate + 1]):
        total += weights[words[index]] * ones(bits[index] & ~cover[words[index]])
    total -= sample_price[candidate] * ones(exposed[candidate] & ~cover[last + candidate])
    for index in range(count):  # samples of the others that it hides are no longer charged
        peer = selected[index]
        total += sample_price[peer] * ones(exposed[peer] & hidden[peer, candidate] & ~cover[last + peer])
    for index in range(starts[candidate], starts[candidate + 1]):  # explained points in its interior; and the penalty
        word = inner[index]
        new = interior[candidate, word] & ~under[word]
        total -= weights[word] * (ones(new & cover[word]) + penalty * ones(new))
    return total


@helper
def copy(values, count, result):
    """Write the first values over those of another array; a loop compiles faster than an assignment of slices."""
    for k in range(count):
        result[k] = values[k]


@helper
def include(rows, interior, cover, under, candidate):
    """Add the cover and the interior of one more candidate: no later candidate gains there."""
    for word in range(len(cover)):
        cover[word] |= rows[candidate, word]
    for word in range(len(under)):
        cover[word] |= interior[candidate, word]
        under[word] |= interior[candidate, word]


@helper
def relate(
    rows, interior, hidden, weights, words, bits, begins, inner, starts, exposed, sample_price, penalty,
    overlap, slack, candidate,
):  # fmt: skip
    """How much the gain of every candidate falls, at least, and rises, at most, when this candidate is selected.

    It falls by the points that both explain, and rises by the free points that both fill, the interior that they
    share, and the samples of one that the other hides.
    """
    last, held = len(weights), interior.shape[1]
    for other in range(len(exposed)):
        both, more = 0.0, ROUNDING
        for index in range(begins[other], begins[other + 1]):
            word = words[index]
            cover = rows[candidate, word] | interior[candidate, word] if word < held else rows[candidate, word]
            common = weights[word] * ones(bits[index] & cover)
            both += max(common, 0.0)
            more -= min(common, 0.0)
        for index in range(starts[other], starts[other + 1]):
            word = inner[index]
            more += (1.0 + penalty) * weights[word] * ones(interior[other, word] & interior[candidate, word])
        more += sample_price[candidate] * ones(exposed[candidate] & hidden[candidate, other])
        more += sample_price[other] * ones(exposed[other] & rows[candidate, last + other])
        overlap[candidate, other], slack[candidate, other] = both, more


@kernel(
    "void(u8[:, ::1], u8[:, ::1], u8[:, ::1], f8[::1], i8[::1], u8[::1], i8[::1], i8[::1], i8[::1], u8[::1], f8[::1],"
    " f8[::1], f8, i8, f8, i8, i8[::1], f8[::1], i8[:, ::1])"
)
def search(
    rows, interior, hidden, weights, words, bits, begins, inner, starts, exposed, sample_price, prices, penalty,
    rounds, blink, seed, initial_set, values, sets,
):  # fmt: skip
    """Ruin and recreate: drop some of the selected, refill greedily, accept a set that is no worse; best of each size.

    The greedy step computes few gains: an upper bound of a gain is one computed earlier in the round, less the largest
    overlap with a candidate selected since then, plus all that those may add.  With probability ``blink`` it overlooks
    a candidate (Christiaens and Vanden Berghe 2020).

    Parameters
    ----------
    rows, interior, weights, exposed, sample_price, prices
        See ``CoverageTable``.
    hidden
        The last columns of ``rows``, transposed: the samples of each candidate (C, C) that every other hides.
    words, bits, begins
        Indices and bits of the weighted words of each candidate, one candidate after another, and the first of each.
    inner, starts
        Indices of the words of each interior, likewise.
    penalty
        Price of interior points as a multiple of their weight, whether others explain them or not.
    rounds, blink, seed
        Number of rounds; see above; seed of the random numbers.
    initial_set
        Initial candidates (S,).
    values, sets
        Input and output: the best value for each number of blocks (M + 1,) and its candidates (M + 1, M), initially
        those of another search, or minus infinity and -1.
    """
    max_size, total = sets.shape[1], len(exposed)
    cover, under = np.empty(rows.shape[1], np.uint64), np.empty(interior.shape[1], np.uint64)
    incumbent, selected = np.empty(max_size, np.int64), np.empty(max_size, np.int64)
    alone, base, less, more = np.empty(total), np.empty(total), np.empty(total), np.empty(total)
    known, overlap, slack = np.empty(total, np.bool_), np.empty((total, total)), np.empty((total, total))
    size, best_value, draws = len(initial_set), 0.0, 0
    copy(initial_set, size, incumbent)
    cover[:] = np.uint64(0)
    under[:] = np.uint64(0)
    known[:] = False
    for candidate in range(total):
        alone[candidate] = gain(
            rows, interior, hidden, weights, words, bits, begins, inner, starts, exposed, sample_price, prices, penalty,
            cover, under, selected, 0, candidate,
        )  # fmt: skip
    for turn in range(rounds + 1):
        share = RUIN_LEAST + (RUIN_MOST - RUIN_LEAST) * uniform(seed, draws)
        dropped = int(uniform(seed, draws + 1) * size)
        draws += 2
        count, step, value = 0, 0, 0.0
        cover[:] = np.uint64(0)
        under[:] = np.uint64(0)
        copy(alone, total, base)
        less[:] = 0.0
        more[:] = 0.0
        while True:
            best, best_candidate, trial = 0.0, -1, -1
            if step < size:  # one of the incumbent that is not dropped
                best_candidate = incumbent[step]
                step += 1
                draws += 1
                if turn > 0 and (step - 1 == dropped or uniform(seed, draws) < share):
                    continue
                best = gain(
                    rows, interior, hidden, weights, words, bits, begins, inner, starts, exposed, sample_price, prices,
                    penalty, cover, under, selected, count, best_candidate,
                )  # fmt: skip
            else:
                if value > values[count]:
                    values[count] = value
                    copy(selected, count, sets[count])
                if count == max_size:
                    break
                first, upper = 0, 0.0
                for candidate in range(total):  # the largest bound first: with its gain, most others are no better
                    if base[candidate] - less[candidate] + more[candidate] > upper:
                        first, upper = candidate, base[candidate] - less[candidate] + more[candidate]
                while trial < total and upper > 0:
                    candidate = first if trial < 0 else trial
                    trial += 1
                    if base[candidate] - less[candidate] + more[candidate] <= best:
                        continue
                    if turn > 0 and uniform(seed, draws + candidate) < blink:
                        continue
                    base[candidate], less[candidate], more[candidate] = gain(
                        rows, interior, hidden, weights, words, bits, begins, inner, starts, exposed, sample_price,
                        prices, penalty, cover, under, selected, count, candidate,
                    ), 0.0, ROUNDING  # fmt: skip
                    if base[candidate] > best:
                        best, best_candidate = base[candidate], candidate
                draws += total
                if best_candidate < 0:
                    break
            value += best
            if not known[best_candidate]:
                known[best_candidate] = True
                relate(
                    rows, interior, hidden, weights, words, bits, begins, inner, starts, exposed, sample_price, penalty,
                    overlap, slack, best_candidate,
                )  # fmt: skip
            for candidate in range(total):
                less[candidate] = max(less[candidate], overlap[best_candidate, candidate])
                more[candidate] += slack[best_candidate, candidate]
            include(rows, interior, cover, under, best_candidate)
            selected[count] = best_candidate
            count += 1
        if value >= best_value - THRESHOLD * (1.0 - turn / (rounds + 1.0)):
            best_value, size = value, count
            copy(selected, count, incumbent)

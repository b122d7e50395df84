"""The kernel that searches for the most valuable set of candidates, on rows of bits."""

from __future__ import annotations

import numpy as np

from shapeprog.kernels.bits import ones, uniform
from shapeprog.kernels.compile import helper, kernel

RUIN_LEAST, RUIN_MOST = 0.1, 0.6
"""Range of the share of selected candidates that a round drops, in addition to one that it always drops."""

THRESHOLD = 0.01
"""How much worse than the incumbent a set may be that takes its place; it falls to zero (Dueck and Scheuer 1990)."""


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


@kernel(
    "void(u8[:, ::1], u8[:, ::1], u8[:, ::1], f8[::1], i8[::1], u8[::1], i8[::1], i8[::1], i8[::1], u8[::1], f8[::1],"
    " f8[::1], f8[::1], f8, i8, f8, i8, i8[::1], f8[::1], i8[::1])"
)
def search(
    rows, interior, hidden, weights, words, bits, begins, inner, starts, exposed, sample_price, prices, gains,
    penalty, rounds, blink, seed, initial_set, best_value, best_set,
):  # fmt: skip
    """Ruin and recreate: drop some of the selected, refill greedily, accept a set that is no worse.

    The greedy step is lazy (Minoux 1978): a gain computed earlier in the round bounds the present one, nearly, as gains
    rise only where a selected candidate hides samples or fills free space.  With probability ``blink`` it overlooks a
    candidate (Christiaens and Vanden Berghe 2020).

    Parameters
    ----------
    rows, interior, weights, exposed, sample_price, prices
        See ``CoverageTable``.
    gains
        Upper bounds (C,) of the gain of each candidate: what it explains, less the price of its text.
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
    best_value, best_set
        Input and output: the best value (1,) and its candidates (M,), -1 beyond the last, initially those of another
        search, or minus infinity and -1.
    """
    max_size, total = len(best_set), len(exposed)
    cover, under = np.empty(rows.shape[1], np.uint64), np.empty(interior.shape[1], np.uint64)
    incumbent, selected = np.empty(max_size, np.int64), np.empty(max_size, np.int64)
    bound = np.empty(total)
    size, accepted, draws = len(initial_set), 0.0, 0
    copy(initial_set, size, incumbent)
    for turn in range(rounds + 1):
        share = RUIN_LEAST + (RUIN_MOST - RUIN_LEAST) * uniform(seed, draws)
        dropped = int(uniform(seed, draws + 1) * size)
        draws += 2
        count, step, value = 0, 0, 0.0
        cover[:] = np.uint64(0)
        under[:] = np.uint64(0)
        copy(gains, total, bound)
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
                if value > best_value[0]:
                    best_value[0] = value
                    best_set[:] = -1
                    copy(selected, count, best_set)
                if count == min(max_size, total):
                    break
                first = int(np.argmax(bound))  # the largest bound first: with its gain, most others are no better
                while trial < total:
                    candidate = first if trial < 0 else trial
                    trial += 1
                    if bound[candidate] <= best:
                        continue
                    if turn > 0 and uniform(seed, draws + candidate) < blink:
                        continue
                    bound[candidate] = gain(
                        rows, interior, hidden, weights, words, bits, begins, inner, starts, exposed, sample_price,
                        prices, penalty, cover, under, selected, count, candidate,
                    )  # fmt: skip
                    if bound[candidate] > best:
                        best, best_candidate = bound[candidate], candidate
                draws += total
                if best_candidate < 0:
                    break
            value += best
            for candidate in range(total):  # samples of the one that the other hides are charged no longer
                bound[candidate] += sample_price[best_candidate] * ones(
                    exposed[best_candidate] & hidden[best_candidate, candidate]
                )
            for word in range(len(cover)):
                cover[word] |= rows[best_candidate, word]
            for word in range(len(under)):  # no later candidate gains there
                cover[word] |= interior[best_candidate, word]
                under[word] |= interior[best_candidate, word]
            selected[count] = best_candidate
            count += 1
        if value >= accepted - THRESHOLD * (1.0 - turn / (rounds + 1.0)):
            accepted, size = value, count
            copy(selected, count, incumbent)

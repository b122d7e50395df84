"""The kernel that searches for the most valuable set of candidates, on rows of bits."""

from __future__ import annotations

import numpy as np

from shapeprog.kernels.bits import ones, uniform
from shapeprog.kernels.compile import helper, kernel

RUIN_LEAST, RUIN_MOST = 0.1, 0.6
"""Range of the share of selected candidates that a round drops, in addition to one that it always drops."""


@helper
def gain(rows, weights, words, begins, exposed, sample_price, prices, cover, selected, count, candidate):
    """Increase in value of the selected candidates with one more candidate."""
    total, last = -prices[candidate], len(weights)
    for index in range(begins[candidate], begins[candidate + 1]):
        word = words[index]
        total += weights[word] * ones(rows[candidate, word] & ~cover[word])
    total -= sample_price[candidate] * ones(exposed[candidate] & ~cover[last + candidate])
    for index in range(count):  # samples of the others that it hides are no longer charged
        peer = selected[index]
        total += sample_price[peer] * ones(exposed[peer] & rows[candidate, last + peer] & ~cover[last + peer])
    return total


@helper
def occlusion_loss(interior, weights, inner, starts, penalty, cover, under, candidate):
    """Weight of the explained points that a candidate hides in its interior, plus the penalty of the interior."""
    total = 0.0
    for index in range(starts[candidate], starts[candidate + 1]):
        word = inner[index]
        new = interior[candidate, word] & ~under[word]
        total += weights[word] * (ones(new & cover[word]) + penalty * ones(new))
    return total


@helper
def include(rows, interior, cover, under, candidate):
    """Add the cover and the interior of one more candidate: no later candidate gains there."""
    cover |= rows[candidate]
    cover[: len(under)] |= interior[candidate]
    under |= interior[candidate]


@helper
def charge(exposed, sample_price, cover, last, candidate):
    """Cost of the exposed samples of a candidate, an upper bound on the gain from hiding them."""
    return sample_price[candidate] * ones(exposed[candidate] & ~cover[last + candidate])


@kernel(
    "void(u8[:, ::1], u8[:, ::1], f8[::1], i8[::1], i8[::1], i8[::1], i8[::1], u8[::1], f8[::1], f8[::1], f8, f8[::1],"
    " i8[::1], i8, f8, i8, i8[::1], f8[::1], i8[:, ::1])"
)
def search(
    rows, interior, weights, words, begins, inner, starts, exposed, sample_price, prices, penalty, bounds, order,
    rounds, blink, seed,
    initial_set, values, sets,
):  # fmt: skip
    """Ruin and recreate: drop some of the selected, refill greedily, accept a set that is no worse; best of each size.

    A gain does not grow while others are added, except by the cost of their samples that the candidate could hide.  An
    earlier gain without the occlusion loss plus that cost is therefore an upper bound, and few gains are computed
    again.  With probability ``blink`` the best candidate is overlooked (Christiaens and Vanden Berghe 2020).

    Parameters
    ----------
    rows, interior, weights, exposed, sample_price, prices
        See ``CoverageTable``.
    words, begins
        Indices of the weighted words with bits of each candidate, one candidate after another, and the first of each.
    inner, starts
        The same for the words of each interior.
    penalty
        Price of interior points as a multiple of their weight, whether others explain them or not.
    bounds, order
        Value of each candidate (C,) alone without the cost of its samples; and its descending order.
    rounds, blink, seed
        Number of rounds; see above; seed of the random numbers.
    initial_set
        Initial candidates (S,).
    values, sets
        Input and output: the best value for each number of blocks (M + 1,) and its candidates (M + 1, M), initially
        those of another search, or minus infinity and -1.
    """
    max_size, last = sets.shape[1], len(weights)
    cover, under = np.empty(rows.shape[1], np.uint64), np.empty(interior.shape[1], np.uint64)
    incumbent, selected = np.empty(max_size, np.int64), np.empty(max_size, np.int64)
    gains, since = np.empty(len(rows)), np.empty(len(rows))
    size, best_value, draws = len(initial_set), 0.0, 0
    incumbent[:size] = initial_set
    for turn in range(rounds + 1):
        share = RUIN_LEAST + (RUIN_MOST - RUIN_LEAST) * uniform(seed, draws)
        dropped = int(uniform(seed, draws + 1) * size)
        draws += 2
        count, value = 0, 0.0
        cover[:] = np.uint64(0)
        under[:] = np.uint64(0)
        for index in range(size):
            draws += 1
            if turn > 0 and (index == dropped or uniform(seed, draws) < share):
                continue
            candidate = incumbent[index]
            value += gain(
                rows, weights, words, begins, exposed, sample_price, prices, cover, selected, count, candidate
            )
            value -= occlusion_loss(interior, weights, inner, starts, penalty, cover, under, candidate)
            include(rows, interior, cover, under, candidate)
            selected[count] = candidate
            count += 1
        since[:] = 0.0
        gains[:] = bounds
        charged = 0.0
        for index in range(count):
            charged += charge(exposed, sample_price, cover, last, selected[index])
        while True:
            if value > values[count]:
                values[count] = value
                sets[count, :count] = selected[:count]
            if count == max_size:
                break
            best, best_candidate, first = 0.0, -1, -1
            for index in range(len(order)):
                candidate = order[index]
                if gains[candidate] + charged - since[candidate] > best:
                    best, first = gains[candidate] + charged - since[candidate], index
            best = 0.0
            for step in range(-1, len(order)):
                candidate = order[first if step < 0 else step]
                if first < 0 or bounds[candidate] + charged <= best:
                    break
                if step == first or gains[candidate] + charged - since[candidate] <= best:
                    continue
                draws += 1
                if turn > 0 and uniform(seed, draws) < blink:
                    continue
                more = gain(
                    rows, weights, words, begins, exposed, sample_price, prices, cover, selected, count, candidate
                )
                gains[candidate], since[candidate] = more, charged
                more -= occlusion_loss(interior, weights, inner, starts, penalty, cover, under, candidate)
                if more > best:
                    best, best_candidate = more, candidate
            if best_candidate < 0:
                break
            value += best
            include(rows, interior, cover, under, best_candidate)
            selected[count] = best_candidate
            count += 1
            charged += charge(exposed, sample_price, cover, last, best_candidate)
        if value >= best_value:
            best_value, size = value, count
            incumbent[:count] = selected[:count]

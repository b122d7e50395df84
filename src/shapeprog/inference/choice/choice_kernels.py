"""The kernel that searches for the most valuable few of many candidates, on rows of bits."""

from __future__ import annotations

import numpy as np

from shapeprog.kernels.bits import ones, uniform
from shapeprog.kernels.compile import helper, kernel

RUIN_LEAST, RUIN_MOST = 0.1, 0.6
"""Between these is the share of the chosen that a round drops, besides one that it always does."""


@helper
def gain(rows, weights, words, begins, own, sample_price, prices, cover, chosen, count, candidate):
    """What the value of the chosen grows by with one more candidate."""
    total, last = -prices[candidate], len(weights)
    for place in range(begins[candidate], begins[candidate + 1]):
        word = words[place]
        total += weights[word] * ones(rows[candidate, word] & ~cover[word])
    total -= sample_price[candidate] * ones(own[candidate] & ~cover[last + candidate])
    for place in range(count):  # what it hides of the others is no longer charged
        other = chosen[place]
        total += sample_price[other] * ones(own[other] & rows[candidate, last + other] & ~cover[last + other])
    return total


@helper
def occlusion_loss(interior, weights, inner, starts, penalty, cover, under, candidate):
    """What the chosen explain and one more candidate would hide in its interior; and the penalty of its interior."""
    total = 0.0
    for place in range(starts[candidate], starts[candidate + 1]):
        word = inner[place]
        new = interior[candidate, word] & ~under[word]
        total += weights[word] * (ones(new & cover[word]) + penalty * ones(new))
    return total


@helper
def include(rows, interior, cover, under, candidate):
    """Have one more candidate cover what it covers and hide its interior: nothing more is gained there."""
    cover |= rows[candidate]
    cover[: len(under)] |= interior[candidate]
    under |= interior[candidate]


@helper
def charge(own, sample_price, cover, last, candidate):
    """What is charged to a candidate: nobody can gain more by hiding it."""
    return sample_price[candidate] * ones(own[candidate] & ~cover[last + candidate])


@kernel(
    "void(u8[:, ::1], u8[:, ::1], f8[::1], i8[::1], i8[::1], i8[::1], i8[::1], u8[::1], f8[::1], f8[::1], f8, f8[::1],"
    " i8[::1], i8, f8, i8, i8[::1], f8[::1], i8[:, ::1])"
)
def search(
    rows, interior, weights, words, begins, inner, starts, own, sample_price, prices, penalty, bounds, order, rounds,
    blink, seed,
    known_set, values, sets,
):  # fmt: skip
    """Ruin and recreate: drop some of the chosen, fill up greedily, keep what is no worse; the best set of each size.

    A gain never grows while others are added, but for what is charged to these and could be hidden, and for what it
    buries of theirs: one that was known before, without the latter, bounds it, and few have to be found again.  With
    probability ``blink`` the best candidate is overlooked (Christiaens and Vanden Berghe 2020).

    Parameters
    ----------
    rows, interior, weights, own, sample_price, prices
        See ``CoverageTable``.
    words, begins
        Which of the words with a weight hold bits of each candidate, one after another, and where those of each begin.
    inner, starts
        The same for the words of what each buries.
    penalty
        Price of all that is interior, in what it weighs, whether others explain it or not.
    bounds, order
        What each candidate (C,) is worth alone, if nothing is charged to it but its price; and the falling order.
    rounds, blink, seed
        How often; see above; of the random numbers.
    known_set
        Candidates to begin with (S,).
    values, sets
        Output: the best value of each number of blocks (M + 1,) and its candidates (M + 1, M), come filled with those
        of another search, or with minus infinity and -1.
    """
    most, last = sets.shape[1], len(weights)
    cover, under = np.empty(rows.shape[1], np.uint64), np.empty(interior.shape[1], np.uint64)
    kept, chosen = np.empty(most, np.int64), np.empty(most, np.int64)
    known, since = np.empty(len(rows)), np.empty(len(rows))
    size, best_value, draws = len(known_set), 0.0, 0
    kept[:size] = known_set
    for turn in range(rounds + 1):
        share = RUIN_LEAST + (RUIN_MOST - RUIN_LEAST) * uniform(seed, draws)
        dropped = int(uniform(seed, draws + 1) * size)
        draws += 2
        count, value = 0, 0.0
        cover[:] = np.uint64(0)
        under[:] = np.uint64(0)
        for place in range(size):
            draws += 1
            if turn > 0 and (place == dropped or uniform(seed, draws) < share):
                continue
            one = kept[place]
            value += gain(rows, weights, words, begins, own, sample_price, prices, cover, chosen, count, one)
            value -= occlusion_loss(interior, weights, inner, starts, penalty, cover, under, one)
            include(rows, interior, cover, under, one)
            chosen[count] = one
            count += 1
        since[:] = 0.0
        known[:] = bounds
        charged = 0.0
        for place in range(count):
            charged += charge(own, sample_price, cover, last, chosen[place])
        while True:
            if value > values[count]:
                values[count] = value
                sets[count, :count] = chosen[:count]
            if count == most:
                break
            best, found, first = 0.0, -1, -1
            for place in range(len(order)):
                one = order[place]
                if known[one] + charged - since[one] > best:
                    best, first = known[one] + charged - since[one], place
            best = 0.0
            for step in range(-1, len(order)):
                one = order[first if step < 0 else step]
                if first < 0 or bounds[one] + charged <= best:
                    break
                if step == first or known[one] + charged - since[one] <= best:
                    continue
                draws += 1
                if turn > 0 and uniform(seed, draws) < blink:
                    continue
                more = gain(rows, weights, words, begins, own, sample_price, prices, cover, chosen, count, one)
                known[one], since[one] = more, charged
                more -= occlusion_loss(interior, weights, inner, starts, penalty, cover, under, one)
                if more > best:
                    best, found = more, one
            if found < 0:
                break
            value += best
            include(rows, interior, cover, under, found)
            chosen[count] = found
            count += 1
            charged += charge(own, sample_price, cover, last, found)
        if value >= best_value:
            best_value, size = value, count
            kept[:count] = chosen[:count]

"""The kernel that searches for the most valuable set of candidates, on rows of bits."""

from __future__ import annotations

import numpy as np

from shapeprog.kernels.bits import ones, uniform
from shapeprog.kernels.compile import helper, kernel

RUIN_LEAST, RUIN_MOST = 0.1, 0.6
"""Range of the share of selected candidates that a round drops, in addition to one that it always drops."""

THRESHOLD = 0.01
"""How much worse than the incumbent a set may be that takes its place; it falls to zero (Dueck and Scheuer 1990)."""

BLINK = 0.05  # probability with which a round overlooks a candidate (Christiaens and Vanden Berghe 2020)


@helper
def gain(data, cover, under, charged, selected, count, candidate):
    """Increase in value of the selected candidates with one more candidate; ``data`` as for ``search``."""
    bits, words, begins, inside, inner, starts, weights, hiders, sample_price, prices, penalty = data
    total = -prices[candidate]
    for index in range(begins[candidate], begins[candidate + 1]):
        word = words[index]
        total += weights[word] * ones(bits[index] & ~cover[word])
    total -= sample_price[candidate] * ones(charged[candidate])
    for index in range(count):  # samples of the others that it hides are no longer charged
        peer = selected[index]
        total += sample_price[peer] * ones(charged[peer] & hiders[peer, candidate])
    for index in range(starts[candidate], starts[candidate + 1]):  # explained points in its interior; and the penalty
        word = inner[index]
        new = inside[index] & ~under[word]
        total -= weights[word] * (ones(new & cover[word]) + penalty * ones(new))
    return total


@kernel(
    "f8(u8[::1], u4[::1], i8[::1], u8[::1], u4[::1], i8[::1], f8[::1], u8[:, ::1], u8[:, ::1], u8[::1], f8[::1],"
    " f8[::1], f8[::1], f8, i8, i8, i8[::1], i8[::1])"
)
def search(
    bits, words, begins, inside, inner, starts, weights, hidden, hiders, exposed, sample_price, prices, gains,
    penalty, rounds, seed, initial_set, best_set,
):  # fmt: skip
    """The value of the best set by ruin and recreate: drop some of the selected, refill greedily, accept what is no
    worse.

    The greedy step is lazy (Minoux 1978): a gain computed earlier in the round bounds the present one, nearly, as gains
    rise only where a selected candidate hides samples or fills free space.

    Parameters
    ----------
    bits, words, begins
        The weighted words of each candidate that hold bits, one candidate after another; their indices; and the first
        of each candidate.
    inside, inner, starts
        The same of each interior.
    hidden, hiders
        The samples of one candidate that another hides (C, C), first indexed by the one that hides, and then by the
        hidden one.
    weights, exposed, sample_price, prices
        See ``CoverageTable``.
    gains
        Upper bounds (C,) of the gain of each candidate: what it explains, less the price of its text.
    penalty
        Price of interior points as a multiple of their weight, whether others explain them or not.
    initial_set, best_set
        Initial candidates (S,), and output: the best (M,), -1 beyond the last.
    """
    data = bits, words, begins, inside, inner, starts, weights, hiders, sample_price, prices, penalty
    most, total = min(len(best_set), len(exposed)), len(exposed)
    cover, under = np.empty(len(weights), np.uint64), np.empty(len(weights), np.uint64)
    incumbent, selected = initial_set.copy(), np.empty(most, np.int64)
    accepted, best_value, draws = 0.0, -np.inf, 0
    for turn in range(rounds + 1):
        share = RUIN_LEAST + (RUIN_MOST - RUIN_LEAST) * uniform(seed, draws)
        dropped = int(uniform(seed, draws + 1) * len(incumbent))
        draws += 2
        count, step, value, bound, charged = 0, 0, 0.0, gains.copy(), exposed.copy()
        cover[:] = np.uint64(0)
        under[:] = np.uint64(0)
        while True:
            best, best_candidate = 0.0, -1
            if step < len(incumbent):  # one of the incumbent that is not dropped
                best_candidate = incumbent[step]
                step += 1
                draws += 1
                if turn > 0 and (step - 1 == dropped or uniform(seed, draws) < share):
                    continue
                best = gain(data, cover, under, charged, selected, count, best_candidate)
            else:
                if value > best_value:
                    best_value = value
                    best_set[:] = -1
                    for k in range(count):  # compiles in half the time of an assignment of slices
                        best_set[k] = selected[k]
                if count == most:
                    break
                first = int(np.argmax(bound))  # the largest bound first: with its gain, most others are no better
                for trial in range(-1, total):
                    candidate = first if trial < 0 else trial
                    if bound[candidate] <= best or (turn > 0 and uniform(seed, draws + candidate) < BLINK):
                        continue
                    bound[candidate] = gain(data, cover, under, charged, selected, count, candidate)
                    if bound[candidate] > best:
                        best, best_candidate = bound[candidate], candidate
                draws += total
                if best_candidate < 0:
                    break
            value += best
            price, samples = sample_price[best_candidate], exposed[best_candidate]
            for candidate in range(total):  # samples of the one that the other hides are charged no longer
                bound[candidate] += price * ones(samples & hiders[best_candidate, candidate])
                charged[candidate] &= ~hidden[best_candidate, candidate]
            for index in range(begins[best_candidate], begins[best_candidate + 1]):
                cover[words[index]] |= bits[index]
            for index in range(starts[best_candidate], starts[best_candidate + 1]):  # no later candidate gains there
                cover[inner[index]] |= inside[index]
                under[inner[index]] |= inside[index]
            selected[count] = best_candidate
            count += 1
        if value >= accepted - THRESHOLD * (1.0 - turn / (rounds + 1.0)):
            accepted, incumbent = value, selected[:count].copy()
    return best_value

"""Kernels that edit whole programs: take blocks out, put better ones in, keep what pays."""

from __future__ import annotations

import numpy as np
from numba import njit

from shapeprog.inference.fold_kernels import search_family
from shapeprog.inference.form_kernels import propose_form
from shapeprog.inference.raster_kernels import (
    ROWS,
    WIDTH,
    draw_all,
    draw_block,
    improve_block,
    iou_rows,
    popcount,
    statements,
)


@njit(cache=True, nogil=True)
def weigh(occupied, covered, waste, low, high):  # type: ignore[no-untyped-def]
    """Weights of the cells in the box [low, high): +1 for occupied, -waste for empty, 0 once covered."""
    out = np.zeros((high[0] - low[0], high[1] - low[1], high[2] - low[2]), np.float32)
    for i in range(low[0], high[0]):
        for j in range(low[1], high[1]):
            full = occupied[i * 32 + j]
            done = covered[i * 32 + j]
            for k in range(low[2], high[2]):
                bit = np.uint32(1) << np.uint32(k)
                if done & bit == 0:
                    out[i - low[0], j - low[1], k - low[2]] = 1.0 if full & bit else -waste
    return out


@njit(cache=True, nogil=True)
def propose(occupied, covered, waste, low, high, table, picks, price):  # type: ignore[no-untyped-def]
    """The repeated box that gains most on what is uncovered, among the families named by ``picks``."""
    weights = weigh(occupied, covered, waste, low, high)
    block = np.zeros(WIDTH)
    block[8] = 1
    block[12] = 1
    best = 0.0
    for s in picks:
        cost = price * (1 + (table[s, 0] >= 0) + (table[s, 4] >= 0))
        value, found = search_family(weights, table[s], best + cost)
        if value > best + cost:
            best = value - cost
            block[:] = 0
            for axis in range(3):
                block[1 + axis] = found[axis] + low[axis] - 16
                block[4 + axis] = found[3 + axis]
            block[8] = max(found[6], 1)
            block[12] = max(found[9], 1)
            if found[6] > 1:
                block[9 + found[7]] = found[8]
            if found[9] > 1:
                block[13 + found[10]] = found[11]
    return best, block


@njit(cache=True, nogil=True)
def value_of(blocks, count, occupied, price):  # type: ignore[no-untyped-def]
    """IoU minus price x statements."""
    total = 0
    for k in range(count):
        total += statements(blocks[k])
    return iou_rows(draw_all(blocks[:count]), occupied) - price * total


@njit(cache=True, nogil=True)
def polish(blocks, count, occupied, price, far, sweeps):  # type: ignore[no-untyped-def]
    """Descend block after block in place until nothing changes; a block that no longer pays is dropped."""
    drawn = np.zeros((count, ROWS), np.uint32)
    for k in range(count):
        draw_block(drawn[k], blocks[k])
    settled = np.zeros(count, np.bool_)
    for _ in range(sweeps):
        changed = False
        for k in range(count):
            if settled[k]:
                continue
            others = np.zeros(ROWS, np.uint32)
            for j in range(count):
                if j != k:
                    others |= drawn[j]
            better, _value = improve_block(blocks[k], occupied, others, price, far)
            settled[k] = True
            if not np.array_equal(better, blocks[k]):
                changed = True
                settled[:] = False
                settled[k] = True
                blocks[k] = better
                drawn[k] = 0
                draw_block(drawn[k], better)
        if not changed:
            break
    k = 0
    while k < count:
        others = np.zeros(ROWS, np.uint32)
        for j in range(count):
            if j != k:
                others |= drawn[j]
        with_it = iou_rows(others | drawn[k], occupied) - price * statements(blocks[k])
        if iou_rows(others, occupied) >= with_it:
            for j in range(k, count - 1):
                blocks[j] = blocks[j + 1]
                drawn[j] = drawn[j + 1]
            count -= 1
        else:
            k += 1
    return count


@njit(cache=True, nogil=True)
def rebuild(blocks, count, most, occupied, low, high, table, price, rounds, subset, seed, heat, forms):  # type: ignore[no-untyped-def]
    """Ruin and recreate: drop some blocks, propose others on what is left uncovered, keep the result if it pays.

    Returns
    -------
    best blocks, their count, their value
    """
    np.random.seed(seed)
    cells = 0
    for i in range(ROWS):
        cells += popcount(occupied[i])
    here = blocks.copy()
    here_count = count
    here_value = value_of(here, here_count, occupied, price)
    best = here.copy()
    best_count = count
    best_value = here_value
    for turn in range(rounds):
        trial = here.copy()
        n = here_count
        drops = 0
        if n > 0:
            drops = min(n, 1 + int(np.random.random() ** 2 * 3.0))
            if n < most and np.random.random() < 0.3:
                drops -= 1
        for _ in range(drops):
            k = np.random.randint(n)
            for j in range(k, n - 1):
                trial[j] = trial[j + 1]
            n -= 1
        waste = np.float32(0.6 + 0.5 * np.random.random())
        more = 1
        if np.random.random() < 0.25:
            waste = np.float32(1.0 + 3.0 * np.random.random())
            more = np.random.randint(1, 4)
        for _ in range(drops + more):
            if n >= most:
                break
            picks = np.random.permutation(len(table))[:subset]
            picks[0] = 0
            covered = draw_all(trial[:n])
            gain, block = propose(occupied, covered, waste, low, high, table, picks, price * cells)
            if np.random.random() < forms:
                form = 1 + np.random.randint(5)
                other_gain, other = propose_form(form, occupied, covered, waste, block, price * cells, price, 30)
                if other_gain > gain or (other_gain > 0 and np.random.random() < 0.3):
                    gain = other_gain
                    block = other
            if gain <= 0:
                break
            trial[n], _ = improve_block(block, occupied, covered, price, 1)
            n += 1
        n = polish(trial, n, occupied, price, 1, 3)
        value = value_of(trial, n, occupied, price)
        cool = heat * (1 - turn / rounds)
        if value > here_value - cool * np.random.random():
            here[:] = trial
            here_count = n
            here_value = value
            if value > best_value + 1e-9:
                best[:] = trial
                best_count = n
                best_value = value
    return best, best_count, best_value

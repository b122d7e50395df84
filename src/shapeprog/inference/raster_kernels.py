"""Kernels on blocks of whole-numbered parameters: draw them as rows of bits and improve them by local search."""

from __future__ import annotations

import numpy as np
from numba import njit

ROWS = 1024
WIDTH = 20
BOX, DISC, BACK, LINE, CROSS = 0, 1, 2, 3, 4
FORM, FIRST = 0, 1
COUNT1, SHIFT1, COUNT2, SHIFT2, ROTATE = 8, 9, 12, 13, 16


@njit(cache=True, nogil=True, inline="always")
def popcount(x):  # type: ignore[no-untyped-def]
    """Number of set bits of a 32-bit word."""
    x = x - ((x >> np.uint32(1)) & np.uint32(0x55555555))
    x = (x & np.uint32(0x33333333)) + ((x >> np.uint32(2)) & np.uint32(0x33333333))
    x = (x + (x >> np.uint32(4))) & np.uint32(0x0F0F0F0F)
    return np.int64(((x * np.uint32(0x01010101)) >> np.uint32(24)) & np.uint32(0xFF))


@njit(cache=True, nogil=True, inline="always")
def span(lo, hi):  # type: ignore[no-untyped-def]
    """Bits lo to hi - 1, clipped to a row."""
    lo = max(lo, 0)
    hi = min(hi, 32)
    if hi <= lo:
        return np.uint32(0)
    return np.uint32(((np.uint64(1) << np.uint64(hi - lo)) - np.uint64(1)) << np.uint64(lo))


@njit(cache=True, nogil=True)
def draw_box(rows, a, b, c, ta, tb, tc):  # type: ignore[no-untyped-def]
    """Set the cells of a box from its low corner and extents."""
    bits = span(c + 16, c + 16 + tc)
    if bits == 0:
        return
    for i in range(max(a + 16, 0), min(a + 16 + ta, 32)):
        for j in range(max(b + 16, 0), min(b + 16 + tb, 32)):
            rows[i * 32 + j] |= bits


@njit(cache=True, nogil=True)
def draw_back(rows, a, b, c, ta, tb, tc, tilt):  # type: ignore[no-untyped-def]
    """Set the cells of a box whose layers are shifted in depth by up to ``tilt``."""
    bits = span(c + 16, c + 16 + tc)
    if bits == 0:
        return
    for i in range(ta):
        up = a + i + 16
        if up < 0 or up >= 32:
            continue
        low = int(np.rint(b + tilt * i / ta)) + 16
        for j in range(max(low, 0), min(low + tb, 32)):
            rows[up * 32 + j] |= bits


@njit(cache=True, nogil=True)
def draw_disc(rows, a, yc, zc, t, r):  # type: ignore[no-untyped-def]
    """Set the cells of an upright cylinder: centres within 1.01 r of its axis."""
    if r <= 0:
        return
    limit = (1.01 * r) ** 2
    for j in range(max(0, yc + 16 - r - 1), min(32, yc + 16 + r + 1)):
        rest = limit - (j - 15.5 - yc) ** 2
        if rest < 0:
            continue
        reach = np.sqrt(rest)
        lo = int(np.ceil(zc + 15.5 - reach))
        hi = int(np.floor(zc + 15.5 + reach)) + 1
        bits = span(lo, hi)
        for i in range(max(a + 16, 0), min(a + 16 + t, 32)):
            rows[i * 32 + j] |= bits


@njit(cache=True, nogil=True)
def draw_line(rows, s0, s1, s2, e0, e1, e2, r):  # type: ignore[no-untyped-def]
    """Cells whose centre lies within 1.01 r of the axis, between the flat caps."""
    d0, d1, d2 = e0 - s0, e1 - s1, e2 - s2
    length = np.sqrt(d0 * d0 + d1 * d1 + d2 * d2)
    if length < 1e-9:
        d0, d1, d2 = 1.0, 0.0, 0.0
    else:
        d0, d1, d2 = d0 / length, d1 / length, d2 / length
    limit = (1.01 * r) ** 2
    m0, m1, m2 = (s0 + e0) / 2 + 0.5, (s1 + e1) / 2 + 0.5, (s2 + e2) / 2 + 0.5
    half = length / 2
    reach0 = half * abs(d0) + 1.01 * r * np.sqrt(max(0.0, 1 - d0 * d0)) + 0.01
    reach1 = half * abs(d1) + 1.01 * r * np.sqrt(max(0.0, 1 - d1 * d1)) + 0.01
    reach2 = half * abs(d2) + 1.01 * r * np.sqrt(max(0.0, 1 - d2 * d2)) + 0.01
    lo0, hi0 = max(0, int(np.ceil(m0 + 15.5 - reach0))), min(31, int(np.floor(m0 + 15.5 + reach0)))
    lo1, hi1 = max(0, int(np.ceil(m1 + 15.5 - reach1))), min(31, int(np.floor(m1 + 15.5 + reach1)))
    lo2, hi2 = max(0, int(np.ceil(m2 + 15.5 - reach2))), min(31, int(np.floor(m2 + 15.5 + reach2)))
    for i in range(lo0, hi0 + 1):
        p0 = i - 15.5 - m0
        for j in range(lo1, hi1 + 1):
            p1 = j - 15.5 - m1
            bits = np.uint32(0)
            for k in range(lo2, hi2 + 1):
                p2 = k - 15.5 - m2
                along = p0 * d0 + p1 * d1 + p2 * d2
                if abs(along) <= half + 1e-3 and p0 * p0 + p1 * p1 + p2 * p2 - along * along <= limit:
                    bits |= np.uint32(1) << np.uint32(k)
            rows[i * 32 + j] |= bits


@njit(cache=True, nogil=True)
def draw_cross(rows, a, yc, zc, t, length, q):  # type: ignore[no-untyped-def]
    """Set the cells of one arm of a cross base, two cells wide."""
    q = q % 4
    if q == 0:
        draw_box(rows, a, yc - 1, zc - length, t, 2, length)
    elif q == 1:
        draw_box(rows, a, yc, zc - 1, t, length, 2)
    elif q == 2:
        draw_box(rows, a, yc - 1, zc, t, 2, length)
    else:
        draw_box(rows, a, yc - length, zc - 1, t, length, 2)


@njit(cache=True, nogil=True)
def draw_block(rows, block):  # type: ignore[no-untyped-def]
    """Set the bits of all copies of a block."""
    form = int(block[0])
    p = block[1:8]
    turns = int(block[16])
    for i1 in range(int(block[8])):
        for i2 in range(int(block[12])):
            s0 = int(i1 * block[9] + i2 * block[13])
            s1 = int(i1 * block[10] + i2 * block[14])
            s2 = int(i1 * block[11] + i2 * block[15])
            if form == 0:
                draw_box(rows, int(p[0]) + s0, int(p[1]) + s1, int(p[2]) + s2, int(p[3]), int(p[4]), int(p[5]))
            elif form == 1:
                draw_disc(rows, int(p[0]) + s0, int(p[1]) + s1, int(p[2]) + s2, int(p[3]), int(p[4]))
            elif form == 2:
                draw_back(
                    rows, int(p[0]) + s0, int(p[1]) + s1, int(p[2]) + s2, int(p[3]), int(p[4]), int(p[5]), int(p[6])
                )
            elif form == 3:
                if turns == 0:
                    draw_line(rows, p[0] + s0, p[1] + s1, p[2] + s2, p[3] + s0, p[4] + s1, p[5] + s2, p[6])
                for t in range(turns):
                    angle = 2 * np.pi * t / turns
                    cos, sin = np.cos(angle), np.sin(angle)
                    y, z = p[4] - p[1], p[5] - p[2]
                    draw_line(rows, p[0], p[1], p[2], p[3], p[1] + y * cos - z * sin, p[2] + y * sin + z * cos, p[6])
            elif turns == 0:
                draw_cross(rows, int(p[0]) + s0, int(p[1]) + s1, int(p[2]) + s2, int(p[3]), int(p[4]), int(p[5]))
            else:
                for t in range(turns):
                    draw_cross(rows, int(p[0]), int(p[1]), int(p[2]), int(p[3]), int(p[4]), int(p[5]) + t)


@njit(cache=True, nogil=True)
def draw_all(blocks):  # type: ignore[no-untyped-def]
    """Rows of the union of blocks."""
    rows = np.zeros(ROWS, np.uint32)
    for k in range(len(blocks)):
        draw_block(rows, blocks[k])
    return rows


@njit(cache=True, nogil=True)
def iou_rows(a, b):  # type: ignore[no-untyped-def]
    """Intersection over union of two sets of rows."""
    inter = 0
    union = 0
    for i in range(ROWS):
        inter += popcount(a[i] & b[i])
        union += popcount(a[i] | b[i])
    return inter / max(union, 1)


@njit(cache=True, nogil=True)
def gains(rows, block, gained, wasted):  # type: ignore[no-untyped-def]
    """Newly covered occupied and empty cells of a block; ``rows`` is scratch."""
    rows[:] = 0
    draw_block(rows, block)
    good = 0
    bad = 0
    for i in range(ROWS):
        good += popcount(rows[i] & gained[i])
        bad += popcount(rows[i] & wasted[i])
    return good, bad


@njit(cache=True, nogil=True)
def moves(block, out, far):  # type: ignore[no-untyped-def]
    """Neighbours of a block: faces, places, ends, spacings and counts moved by up to ``far``."""
    n = 0
    form = int(block[0])
    deltas = (-1, 1, -2, 2, -3, 3)
    use = 2 * far
    for which in range(use):
        delta = deltas[which]
        if form == 0 or form == 2:
            for axis in range(3):
                out[n] = block
                out[n, 1 + axis] += delta
                n += 1
                out[n] = block
                out[n, 4 + axis] += delta
                n += 1
                out[n] = block
                out[n, 1 + axis] += delta
                out[n, 4 + axis] -= delta
                n += 1
                if which < 2:
                    out[n] = block
                    out[n, 1 + axis] -= delta
                    out[n, 4 + axis] += 2 * delta
                    n += 1
            if form == 2:
                out[n] = block
                out[n, 7] += delta
                n += 1
                out[n] = block
                out[n, 7] += delta
                out[n, 2] -= delta
                n += 1
        else:
            last = 5 if form == 1 else (7 if form == 3 else 6)
            for slot in range(1, last + 1):
                out[n] = block
                out[n, slot] += delta
                n += 1
            if form == 3:
                for axis in range(3):
                    out[n] = block
                    out[n, 1 + axis] += delta
                    out[n, 4 + axis] += delta
                    n += 1
            else:
                out[n] = block
                out[n, 1] += delta
                out[n, 4] -= delta
                n += 1
        for level in (8, 12):
            if block[level] > 1:
                for axis in range(3):
                    if block[level + 1 + axis] != 0 or which < 2:
                        out[n] = block
                        out[n, level + 1 + axis] += delta
                        n += 1
                        out[n] = block
                        out[n, level + 1 + axis] += delta
                        out[n, 1 + axis] -= delta
                        if form == 3:
                            out[n, 4 + axis] -= delta
                        n += 1
                        if block[level] > 2:
                            out[n] = block
                            out[n, level + 1 + axis] += delta
                            move = int(np.rint(delta * (block[level] - 1) / 2))
                            out[n, 1 + axis] -= move
                            if form == 3:
                                out[n, 4 + axis] -= move
                            n += 1
                if which < 2:
                    out[n] = block
                    out[n, level] += delta
                    n += 1
                    out[n] = block
                    out[n, level] += delta
                    for axis in range(3):
                        out[n, 1 + axis] -= delta * block[level + 1 + axis]
                        if form == 3:
                            out[n, 4 + axis] -= delta * block[level + 1 + axis]
                    n += 1
        if block[16] > 0 and which < 2:
            out[n] = block
            out[n, 16] += delta
            n += 1
    return n


@njit(cache=True, nogil=True)
def valid(block):  # type: ignore[no-untyped-def]
    """Whether the extents are positive and no two copies of a loop are drawn over each other."""
    form = int(block[0])
    if block[8] < 1 or block[12] < 1 or block[8] * block[12] > 64:
        return False
    for level in (8, 12):
        if block[level] > 1:
            apart = False
            for axis in range(3):
                if form == 0 or form == 2:
                    extent = block[4 + axis]
                elif form == 1:
                    extent = block[4] if axis == 0 else 2 * block[5]
                else:
                    extent = 2.0
                apart = apart or abs(block[level + 1 + axis]) >= extent
            if not apart:
                return False
    if form == 0 or form == 2:
        return block[4] >= 1 and block[5] >= 1 and block[6] >= 1
    if form == 1:
        return block[4] >= 1 and block[5] >= 1
    if form == 3:
        return block[7] >= 1
    return block[4] >= 1 and block[5] >= 1


@njit(cache=True, nogil=True)
def statements(block):  # type: ignore[no-untyped-def]
    """Statements of a block: itself and its loops."""
    return 1 + (block[8] > 1) + (block[12] > 1) + (block[16] > 1)


@njit(cache=True, nogil=True)
def improve_block(block, occupied, others, price, far):  # type: ignore[no-untyped-def]
    """Best-improvement descent of one block on IoU minus price x statements, the others fixed."""
    gained = occupied & ~others
    wasted = ~occupied & ~others
    inter0 = 0
    union0 = 0
    for i in range(ROWS):
        inter0 += popcount(occupied[i] & others[i])
        union0 += popcount(occupied[i] | others[i])
    rows = np.zeros(ROWS, np.uint32)
    around = np.zeros((200, block.shape[0]))
    good, bad = gains(rows, block, gained, wasted)
    best = (inter0 + good) / max(union0 + bad, 1) - price * statements(block)
    current = block.copy()
    for _ in range(60):
        n = moves(current, around, far)
        chosen = -1
        for m in range(n):
            if not valid(around[m]):
                continue
            good, bad = gains(rows, around[m], gained, wasted)
            value = (inter0 + good) / max(union0 + bad, 1) - price * statements(around[m])
            if value > best + 1e-9:
                best = value
                chosen = m
        if chosen < 0:
            break
        current[:] = around[chosen]
    return current, best


@njit(cache=True, nogil=True)
def improve_all(blocks, occupied, price, far, sweeps):  # type: ignore[no-untyped-def]
    """Descend block after block until nothing changes; returns the blocks and their IoU."""
    count = len(blocks)
    blocks = blocks.copy()
    drawn = np.zeros((count, ROWS), np.uint32)
    for k in range(count):
        draw_block(drawn[k], blocks[k])
    for _ in range(sweeps):
        changed = False
        for k in range(count):
            others = np.zeros(ROWS, np.uint32)
            for j in range(count):
                if j != k:
                    others |= drawn[j]
            better, _value = improve_block(blocks[k], occupied, others, price, far)
            if not np.array_equal(better, blocks[k]):
                changed = True
                blocks[k] = better
                drawn[k] = 0
                draw_block(drawn[k], better)
        if not changed:
            break
    return blocks, iou_rows(draw_all(blocks), occupied)

"""Kernels that draw blocks of whole-numbered parameters as rows of bits, one word for the 32 cells of a row."""

from __future__ import annotations

from typing import Any

import numpy as np
from llvmlite import ir  # type: ignore[import-untyped]
from numba import njit, types
from numba.extending import intrinsic

from shapeprog.inference.block_layout import (
    BACK,
    BOX,
    COUNT1,
    COUNT2,
    DISC,
    FIRST,
    FORM,
    LINE,
    ROTATE,
    SHIFT1,
    SHIFT2,
)  # fmt: skip

ROWS = 1024
"""Rows of the grid: row 32 i + j holds the cells at height i and depth j."""

WORDS = 16
"""Words of 64 bits that hold one horizontal layer."""

ARM = 2
"""Cells that an arm of a cross base is wide."""


def _popcount(context, word):  # type: ignore[no-untyped-def]
    """Number of set bits of a word, by the instruction that counts them."""

    def generate(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
        bits = builder.ctpop(arguments[0])
        return bits if bits.type.width == 64 else builder.zext(bits, ir.IntType(64))

    return types.int64(word), generate


popcount: Any = intrinsic(_popcount)
"""Number of set bits of a word of 32 or 64 bits, as a 64-bit number; for use in kernels."""


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
    """Set the cells of one arm of a cross base in the direction of quarter turn q."""
    q = q % 4
    arm = np.int64(ARM)  # a literal would compile the box once more
    if q == 0:
        draw_box(rows, a, yc - 1, zc - length, t, arm, length)
    elif q == 1:
        draw_box(rows, a, yc, zc - 1, t, length, arm)
    elif q == 2:
        draw_box(rows, a, yc - 1, zc, t, arm, length)
    else:
        draw_box(rows, a, yc - length, zc - 1, t, length, arm)


@njit(cache=True, nogil=True)
def draw_block(rows, block):  # type: ignore[no-untyped-def]
    """Set the cells of all copies of a block, clipped to the grid."""
    form = int(block[FORM])
    p = block[FIRST:COUNT1]
    turns = int(block[ROTATE])
    for i1 in range(int(block[COUNT1])):
        for i2 in range(int(block[COUNT2])):
            s0 = int(i1 * block[SHIFT1] + i2 * block[SHIFT2])
            s1 = int(i1 * block[SHIFT1 + 1] + i2 * block[SHIFT2 + 1])
            s2 = int(i1 * block[SHIFT1 + 2] + i2 * block[SHIFT2 + 2])
            a, b, c = int(p[0]) + s0, int(p[1]) + s1, int(p[2]) + s2
            if form == BOX:
                draw_box(rows, a, b, c, int(p[3]), int(p[4]), int(p[5]))
            elif form == DISC:
                draw_disc(rows, a, b, c, int(p[3]), int(p[4]))
            elif form == BACK:
                draw_back(rows, a, b, c, int(p[3]), int(p[4]), int(p[5]), int(p[6]))
            elif form == LINE:
                y, z = p[4] - p[1], p[5] - p[2]
                for turn in range(max(turns, 1)):
                    cos, sin = 1.0, 0.0
                    if turns > 0:
                        angle = 2 * np.pi * turn / turns
                        cos, sin = np.cos(angle), np.sin(angle)
                    end1, end2 = p[1] + y * cos - z * sin, p[2] + y * sin + z * cos
                    draw_line(rows, p[0] + s0, p[1] + s1, p[2] + s2, p[3] + s0, end1 + s1, end2 + s2, p[6])
            else:
                for turn in range(max(turns, 1)):
                    draw_cross(rows, a, b, c, int(p[3]), int(p[4]), int(p[5]) + turn)


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
    one, other = a.view(np.uint64), b.view(np.uint64)
    for i in range(len(one)):
        inter += popcount(one[i] & other[i])
        union += popcount(one[i] | other[i])
    return inter / max(union, 1)

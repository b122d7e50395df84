"""Kernels that fill voxels: a row of cells along left-right is a row of bits.

Positions are in cells from the low corner of the grid, so cell k covers [k, k + 1) and its centre is k + 0.5.
Planes of words (B, W, R, R) hold rows of R cells, 32 to a word, lowest cell in the lowest bit.
"""

from __future__ import annotations

import math

import numpy as np

from shapeprog.geometry.compiling import helper, kernel
from shapeprog.geometry.raster import CAP, REACH, SQUARE

CYLINDER = 1.0


@helper
def _clip(value, high):
    """A position as a cell boundary within the grid."""
    return int(min(max(value, 0.0), float(high)))


@helper
def _word(first, last, word):
    """Bits of one word for the cells [first, last)."""
    low = min(max(first - 32 * word, 0), 32)
    high = min(max(last - 32 * word, 0), 32)
    if low >= high:
        return np.uint32(0)
    return np.uint32(((1 << high) - (1 << low)) & 0xFFFFFFFF)


@helper
def _box(rows, scene, low, high):
    """Fill the cells [low, high) along the three axes."""
    for word in range(low[2] >> 5, (high[2] + 31) >> 5):
        bits = _word(low[2], high[2], word)
        for i in range(low[0], high[0]):
            for j in range(low[1], high[1]):
                rows[scene, word, i, j] |= bits


@helper
def _upright_box(rows, scene, size, centre, rotation, low, high):
    """A cuboid at right angles to the grid covers [rint(low), rint(high)) along each axis."""
    resolution = rows.shape[2]
    for axis in range(3):
        half = 0.0
        for local in range(3):
            half += abs(np.rint(rotation[axis, local])) * size[local]
        low[axis] = _clip(np.rint(centre[axis] - half), resolution)
        high[axis] = _clip(np.rint(centre[axis] + half), resolution)
    _box(rows, scene, low, high)


@helper
def _upright_shear(rows, scene, size, centre, rotation, low, high):
    """A sheared cuboid that stands upright: each layer is moved by a whole number of cells.

    Layer i of t covers [o, o + a) with o = rint(y + lean * i / t) along the axis that it leans to.
    """
    resolution = rows.shape[2]
    along = 1 if abs(rotation[1, 1]) > 0.5 else 2
    across = 3 - along
    lean = size[3] * np.rint(rotation[along, 1]) * np.rint(rotation[0, 0])
    bottom = np.rint(centre[0] - size[0])
    low[across] = _clip(np.rint(centre[across] - size[2]), resolution)
    high[across] = _clip(np.rint(centre[across] + size[2]), resolution)
    start = centre[along] - size[1] - lean / 2
    depth = np.rint(2 * size[1])
    for i in range(_clip(bottom, resolution), _clip(np.rint(centre[0] + size[0]), resolution)):
        low[0], high[0] = i, i + 1
        offset = np.rint(start + lean * (i - bottom) / (2 * size[0]))
        low[along], high[along] = _clip(offset, resolution), _clip(offset + depth, resolution)
        _box(rows, scene, low, high)


@helper
def _upright_cylinder(rows, scene, size, centre):
    """A disc of cells, repeated in every layer whose centres lie between the caps."""
    resolution = rows.shape[2]
    bottom = _clip(np.ceil(centre[0] - size[0] - CAP - 0.5), resolution)
    top = _clip(np.floor(centre[0] + size[0] + CAP + 0.5), resolution)
    reach = REACH * size[1]
    for j in range(_clip(centre[1] - reach - 0.5, resolution), _clip(np.ceil(centre[1] + reach + 0.5), resolution)):
        dy = j + 0.5 - centre[1]
        left = reach * reach - dy * dy
        if left < 0:
            continue
        width = math.sqrt(left)
        first = _clip(np.floor(centre[2] - width - 0.5), resolution)
        last = _clip(np.ceil(centre[2] + width + 0.5), resolution)
        while first < last and (first + 0.5 - centre[2]) ** 2 > left:
            first += 1
        while first < last and (last - 0.5 - centre[2]) ** 2 > left:
            last -= 1
        for word in range(first >> 5, (last + 31) >> 5):
            bits = _word(first, last, word)
            for i in range(bottom, top):
                rows[scene, word, i, j] |= bits


@helper
def _inside(kind, size, rotation, x, y, z):
    """Whether a position relative to the centre is inside a turned solid by the rules for cells."""
    a = rotation[0, 0] * x + rotation[1, 0] * y + rotation[2, 0] * z
    b = rotation[0, 1] * x + rotation[1, 1] * y + rotation[2, 1] * z
    c = rotation[0, 2] * x + rotation[1, 2] * y + rotation[2, 2] * z
    if kind == CYLINDER:
        return abs(a) <= size[0] + CAP and b * b + c * c <= (REACH * size[1]) ** 2
    lean = size[3] / 2 * a / size[0] if size[0] > 0 else 0.0
    return abs(a) <= size[0] and abs(b - lean) <= size[1] and abs(c) <= size[2]


@helper
def _turned(rows, scene, kind, size, centre, rotation, low, high, reach):
    """Any solid in any pose: cells whose centre is inside.

    Solids are convex, so the cells of a row are an interval: it is clipped analytically and its ends are tested.
    """
    resolution = rows.shape[2]
    for axis in range(3):
        if kind == CYLINDER:
            along = rotation[axis, 0]
            reach[axis] = abs(along) * (size[0] + CAP) + REACH * size[1] * math.sqrt(max(1 - along * along, 0.0))
        else:
            depth = size[1] + abs(size[3]) / 2
            reach[axis] = (
                abs(rotation[axis, 0]) * size[0] + abs(rotation[axis, 1]) * depth + abs(rotation[axis, 2]) * size[2]
            )
    for axis in range(3):
        low[axis] = _clip(np.floor(centre[axis] - reach[axis] - 0.5), resolution)
        high[axis] = _clip(np.ceil(centre[axis] + reach[axis] + 0.5), resolution)
    for i in range(low[0], high[0]):
        x = i + 0.5 - centre[0]
        for j in range(low[1], high[1]):
            y = j + 0.5 - centre[1]
            near, far = _interval(kind, size, rotation, x, y, reach[2])
            if near > far:
                continue
            first = max(_clip(np.floor(near + centre[2] - 0.5), resolution), low[2])
            last = min(_clip(np.ceil(far + centre[2] + 0.5), resolution), high[2])
            while first < last and not _inside(kind, size, rotation, x, y, first + 0.5 - centre[2]):
                first += 1
            while first < last and not _inside(kind, size, rotation, x, y, last - 0.5 - centre[2]):
                last -= 1
            for word in range(first >> 5, (last + 31) >> 5):
                rows[scene, word, i, j] |= _word(first, last, word)


@helper
def _slab(near, far, start, slope, half):
    """The part of [near, far] where start + slope * z stays within half of zero."""
    if abs(slope) < 1e-12:
        if abs(start) > half + 1e-9:
            return 1.0, -1.0
        return near, far
    one, two = (-half - start) / slope, (half - start) / slope
    return max(near, min(one, two)), min(far, max(one, two))


@helper
def _interval(kind, size, rotation, x, y, reach):
    """Where along left-right the row through (x, y) can be inside, relative to the centre."""
    a = rotation[0, 0] * x + rotation[1, 0] * y
    b = rotation[0, 1] * x + rotation[1, 1] * y
    c = rotation[0, 2] * x + rotation[1, 2] * y
    da, db, dc = rotation[2, 0], rotation[2, 1], rotation[2, 2]
    near, far = -reach - 1e-6, reach + 1e-6
    if kind == CYLINDER:
        near, far = _slab(near, far, a, da, size[0] + CAP)
        square = db * db + dc * dc
        half = b * db + c * dc
        rest = b * b + c * c - (REACH * size[1]) ** 2
        if square < 1e-12:
            if rest > 1e-9:
                return 1.0, -1.0
            return near, far
        root = half * half - square * rest
        if root < 0:
            return 1.0, -1.0
        width = math.sqrt(root) / square
        return max(near, -half / square - width), min(far, -half / square + width)
    lean = size[3] / 2 / size[0] if size[0] > 0 else 0.0
    near, far = _slab(near, far, a, da, size[0])
    near, far = _slab(near, far, b - lean * a, db - lean * da, size[1])
    return _slab(near, far, c, dc, size[2])


@helper
def _square(rotation):
    """Whether every entry is -1, 0 or 1."""
    for i in range(3):
        for j in range(3):
            if abs(rotation[i, j] - np.rint(rotation[i, j])) > SQUARE:
                return False
    return True


@kernel
def fill(solids, owner, many, rows, begin, end):
    """Fill planes of words with the cells of scenes ``begin`` to ``end``, of ``many`` rows of the table each.

    Each row of the table has its owner: the plane that its cells go to.
    """
    resolution = rows.shape[2]
    scale, origin = resolution / 32, resolution / 2
    size, centre, rotation, reach = np.empty(4), np.empty(3), np.empty((3, 3)), np.empty(3)
    low, high = np.empty(3, np.int64), np.empty(3, np.int64)
    for item in range(begin * many, end * many):
        scene, kind = owner[item], solids[item, 0]
        if kind < 0:
            continue
        total = 0.0
        for i in range(4):
            size[i] = solids[item, 1 + i] * scale
            total += size[i]
        for i in range(3):
            centre[i] = solids[item, 5 + i] * scale + origin
            total += centre[i]
            for j in range(3):
                rotation[i, j] = solids[item, 8 + 3 * i + j]
        if not math.isfinite(total):
            continue
        upright = _square(rotation)
        standing = upright and abs(rotation[0, 0]) > 0.5
        if kind == CYLINDER:
            if size[0] < 0 or size[1] <= 0:
                continue
            if standing:
                _upright_cylinder(rows, scene, size, centre)
                continue
        elif size[0] <= 0 or size[1] <= 0 or size[2] <= 0:
            continue
        elif upright and size[3] == 0:
            _upright_box(rows, scene, size, centre, rotation, low, high)
            continue
        elif standing:
            _upright_shear(rows, scene, size, centre, rotation, low, high)
            continue
        _turned(rows, scene, kind, size, centre, rotation, low, high, reach)


@kernel
def unpack(rows, table, cells, begin, end):
    """Rows of 32 cells as bits (M,) to bytes, given as eights (M, 4); the table spreads 8 bits over 8 bytes."""
    for row in range(begin, end):
        bits = rows[row]
        if bits == 0:
            cells[row, 0] = cells[row, 1] = cells[row, 2] = cells[row, 3] = 0
        else:
            cells[row, 0] = table[bits & np.uint32(255)]
            cells[row, 1] = table[(bits >> np.uint32(8)) & np.uint32(255)]
            cells[row, 2] = table[(bits >> np.uint32(16)) & np.uint32(255)]
            cells[row, 3] = table[bits >> np.uint32(24)]


@kernel
def shared_cells(one, two, counts):
    """Number of cells in both and in either of the packed grids (B, words)."""
    for pair in range(one.shape[0]):
        both, either = np.uint32(0), np.uint32(0)
        for word in range(one.shape[1]):
            both += _ones(one[pair, word] & two[pair, word])
            either += _ones(one[pair, word] | two[pair, word])
        counts[pair, 0], counts[pair, 1] = both, either


@helper
def _ones(word):
    """Number of bits that are set."""
    word = word - ((word >> np.uint32(1)) & np.uint32(0x55555555))
    word = (word & np.uint32(0x33333333)) + ((word >> np.uint32(2)) & np.uint32(0x33333333))
    word = (word + (word >> np.uint32(4))) & np.uint32(0x0F0F0F0F)
    return np.uint32(word * np.uint32(0x01010101)) >> np.uint32(24)

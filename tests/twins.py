"""Slow readable twins: what the fast paths must equal, written as plainly as possible."""

import math

import numpy as np
import torch

from shapeprog.geometry import primitives

SIZE, HALF = 32, 16

# ---------------------------------------------------------------- the published executor, as specified


def _slice(grid, low, high):
    low, high = (np.clip(np.asarray(ends) + HALF, 0, SIZE) for ends in (low, high))
    (a, b, c), (d, e, f) = low, high
    if a < d and b < e and c < f:
        grid[a:d, b:e, c:f] = 1


def _corner_box(grid, h, y, z, t, a, b):
    _slice(grid, (h, y, z), (h + t, y + a, z + b))


def _centre_box(grid, h, yc, zc, t, ry, rz):
    _slice(grid, (h, yc - ry, zc - rz), (h + t, yc + ry, zc + rz))


def _disc(grid, h, yc, zc, t, r):
    for j in range(SIZE):
        for k in range(SIZE):
            if r > 0 and math.hypot(j - 15.5 - yc, k - 15.5 - zc) <= 1.01 * r:
                grid[max(h + HALF, 0) : max(h + t + HALF, 0), j, k] = 1


def _cross(grid, h, yc, zc, t, length, q):
    arms = {
        0: ((yc - 1, zc - length), (yc + 1, zc)),
        1: ((yc, zc - 1), (yc + length, zc + 1)),
        2: ((yc - 1, zc), (yc + 1, zc + length)),
        3: ((yc - length, zc - 1), (yc, zc + 1)),
    }
    low, high = arms[q % 4]
    _slice(grid, (h, *low), (h + t, *high))


def _sideboard(grid, h, y, z, t, ry, b):
    _slice(grid, (h, y - ry, z), (h + t, y + ry, z + b))


def _back(grid, h, y, z, t, a, b, tilt):
    for i in range(t):
        o = int(np.rint(y + tilt * i / t))
        _slice(grid, (h + i, o, z), (h + i + 1, o + a, z + b))


DRAW = {
    **dict.fromkeys((1, 12, 13, 14, 16, 18), (6, _corner_box)),
    **dict.fromkeys((2, 5), (6, _centre_box)),
    **dict.fromkeys((3, 7, 9), (5, lambda grid, h, y, z, t, r: _centre_box(grid, h, y, z, t, r, r))),
    **dict.fromkeys((4, 6, 8), (5, _disc)),
    10: (6, _cross),
    11: (6, _sideboard),
    15: (7, _back),
}
"""Number of parameters and how a statement draws, by id, as in the specification of the language."""


def executed_block(ids, parameters):
    """Cells of one published block [k], [19,k], [19,19,k] or [20,10] with whole-numbered parameters."""
    grid = np.zeros((SIZE, SIZE, SIZE), np.uint8)
    values = [[int(v) for v in row] for row in parameters]
    loops = [step for step, number in enumerate(ids) if number in (19, 20)]
    step = len(loops)
    count, draw = DRAW[ids[step]]
    base = values[step][:count]
    if ids[0] == 20:
        for i in range(max(0, values[0][0])):
            draw(grid, *base[:5], base[5] + i * values[0][1])
        return grid
    shifts = [(0, 0, 0)]
    for loop in loops:
        n, *by = values[loop][:4]
        shifts = [
            tuple(s + i * d for s, d in zip(shift, by, strict=True)) for shift in shifts for i in range(max(0, n))
        ]
    for shift in shifts:
        draw(grid, *[p + s for p, s in zip(base[:3], shift, strict=True)], *base[3:])
    return grid


# ---------------------------------------------------------------- cells of any scene, cell by cell


def cells(scene, resolution=SIZE):
    """Hard cells (R, R, R) of one scene, without upright sheared cuboids: those whose centre a primitive contains."""
    scale = resolution / SIZE
    ticks = np.arange(resolution) + 0.5 - resolution / 2
    centres = np.stack(np.meshgrid(ticks, ticks, ticks, indexing="ij"), -1)
    grid = np.zeros((resolution,) * 3, np.uint8)
    for n in range(scene.mask.shape[-1]):
        if not scene.mask[n]:
            continue
        size = scene.size[n].double().numpy() * scale
        with np.errstate(invalid="ignore", over="ignore"):
            local = (centres - scene.centre[n].double().numpy() * scale) @ scene.rotation[n].double().numpy()
        if primitives[int(scene.kind[n])].name == "cylinder":
            inside = (np.abs(local[..., 0]) <= size[0] + 1e-3) & (
                np.hypot(local[..., 1], local[..., 2]) <= 1.01 * size[1]
            )
        else:
            points, sizes = torch.from_numpy(local), torch.from_numpy(size).expand(*local.shape[:-1], 4)
            inside = (primitives[int(scene.kind[n])].distance(points, sizes) <= 0).numpy() & np.isfinite(size).all()
        grid[inside] = 1
    return grid


# ---------------------------------------------------------------- distances over all pairs


def nearest_squared(queries, points):
    """Squared distance of each query (P, 3) to the nearest point (Q, 3), by all pairs, differentiable."""
    return ((queries[:, None] - points[None]) ** 2).sum(-1).min(1)[0]


def chamfer(points, target):
    """Chamfer distance of two clouds by all pairs, differentiable."""
    return nearest_squared(points, target).mean() + nearest_squared(target, points).mean()

"""Slow readable twins: what the fast paths must equal, written as plainly as possible."""

import dataclasses
import math

import numpy as np
import torch

from shapeprog.geometry.distance import each_distance
from shapeprog.geometry.primitives import primitives
from shapeprog.geometry.surface import PATIENCE, SKIN, Choice
from shapeprog.kernels.bits import FIRST, GOLDEN, SECOND

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


# ---------------------------------------------------------------- points on the surface of any scene


def uniform(seed, count):
    """Numbers of the stream of a seed, uniform in [0, 1): SplitMix64 in whole numbers that wrap around."""
    word = (count + 1) * (GOLDEN - 2**64) + seed
    for shift, factor in ((30, FIRST), (27, SECOND)):
        word = (word ^ ((word >> shift) & ((1 << (64 - shift)) - 1))) * (factor - 2**64)
    word = word ^ ((word >> 31) & ((1 << 33) - 1))
    return ((word >> 11) & ((1 << 53) - 1)).double() * 2.0**-53


def of_slots(scene, slot):
    """Kind, size, centre and rotation of chosen slots (B, n) of elements (B, N), with gradient."""
    element = torch.arange(len(slot))[:, None]
    return (part[element, slot] for part in (scene.kind, scene.size, scene.centre, scene.rotation))


def turned(rotation, vectors):
    return (rotation @ vectors[..., None])[..., 0]


def visible(scene, shares, n, seed):
    """Visible surface points by the declarations: the first candidates that are not hidden."""
    scene = dataclasses.replace(
        scene, **{name: getattr(scene, name).double() for name in ("size", "centre", "rotation")}
    )
    per, order = shares.shape[-1] // scene.mask.shape[-1], torch.arange(scene.mask.shape[-1])
    count = 4 * torch.arange(PATIENCE * n) + (torch.arange(len(shares))[:, None] << 40)
    numbers = torch.stack([uniform(seed, count + turn) for turn in range(4)], -1)
    cell = torch.searchsorted(shares, numbers[..., 0].contiguous(), right=True)
    slot, face = cell // per, cell % per
    kind, size, centre, rotation = of_slots(scene, slot)
    unit, local, normal = (torch.zeros_like(numbers[..., 1:]) for _ in range(3))
    for item in scene.kinds:
        chosen, declared = kind == item, primitives[item]
        unit[chosen] = declared.sample(size[chosen], face[chosen], numbers[chosen][:, 1:])
        local[chosen] = declared.place(size[chosen], unit[chosen])
        normal[chosen] = declared.normal(size[chosen], unit[chosen], face[chosen])
    places = torch.cat([unit, turned(rotation, local) + centre, turned(rotation, normal)], -1)
    over, under = (places[..., 3:6] + side * SKIN * places[..., 6:] for side in (1, -1))
    inside = (each_distance(scene, over) < 0) & (order != slot[..., None])
    flush = (each_distance(scene, under) < 0) & (order < slot[..., None])
    shown = ~(inside | flush).any(-1)
    first = torch.argsort(~shown, dim=-1, stable=True)[:, :n]
    element = torch.arange(len(first))[:, None]
    chosen = torch.stack([slot, face], -1)[element, first].numpy()
    return Choice(chosen, places[element, first].numpy(), shown.sum(-1).clamp(max=n).numpy())


def place(scene, areas, choice):
    """Points (B, n, 3) of a choice and their weights (B, n), with gradient."""
    slot, face = torch.from_numpy(choice.chosen).unbind(-1)
    kind, size, centre, rotation = of_slots(scene, slot)
    unit = torch.from_numpy(choice.places[..., :3]).to(size)
    local = torch.zeros_like(unit)
    for item in scene.kinds:
        chosen = (kind == item).nonzero(as_tuple=True)
        local = local.index_put(chosen, primitives[item].place(size[chosen], unit[chosen]))
    area = areas[torch.arange(len(slot))[:, None], slot, face]
    return turned(rotation, local) + centre, area / area.detach()


# ---------------------------------------------------------------- distances over all pairs


def nearest_squared(queries, points):
    """Squared distance of each query (P, 3) to the nearest point (Q, 3), by all pairs, differentiable."""
    return ((queries[:, None] - points[None]) ** 2).sum(-1).min(1)[0]


def chamfer(points, target):
    """Chamfer distance of two clouds by all pairs, differentiable."""
    return nearest_squared(points, target).mean() + nearest_squared(target, points).mean()

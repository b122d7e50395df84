"""Groups of parts that touch, for many scenes at once.

Boxes along the axes of the grid are compared exactly.  Other solids touch if no plane is found between them: those
along the faces and edges of the boxes around them are tried, then those that Gilbert (1966) finds.  Cushions are
compared as boxes, and bent rods as several straight ones.
"""

from __future__ import annotations

from itertools import product

import numpy as np
from jaxtyping import Bool, Float, Int

from shapeprog.geometry.arrays import array
from shapeprog.geometry.batch import Batch
from shapeprog.geometry.primitives import KINDS, primitives
from shapeprog.geometry.primitives.arc import PIECES
from shapeprog.geometry.primitives.frustum import SEGMENTS
from shapeprog.space import Array, FloatArray

TOUCHING = 0.02
"""Gap in cells up to which parts touch: round solids are looked at as polyhedra inside of them."""

ROUNDS = 24
"""Most planes between two solids that are tried one after another."""

MOST_CORNERS = 64
"""Most corners of a solid that are looked at."""

BENDS = 8
"""Straight rods in place of a bent one."""

AT_ONCE = 4096
"""Pairs of convex solids that are compared together."""

_ALIGNED = 1e-6
_TINY = 1e-12


def contact_groups(scenes: Batch) -> list[int]:
    """The number of groups of touching primitives in each scene of a batch (B, N)."""
    kind, mask = array(scenes.kind), array(scenes.mask)
    fields = scenes.size, scenes.centre, scenes.rotation, scenes.bounds
    size, centre, rotation, bounds = (array(field.double()) for field in fields)
    reach = (np.abs(rotation) @ bounds[..., None])[..., 0]
    low, high = centre - reach, centre + reach + TOUCHING
    near = (low[:, :, None] <= high[:, None]).all(-1) & mask[:, :, None] & mask[:, None]
    near &= np.triu(near.swapaxes(1, 2), 1)
    box = (kind == KINDS["rounded_box"]) | ((kind == KINDS["cuboid"]) & (size[..., 3] == 0))
    box &= (np.abs(rotation - np.rint(rotation)) < _ALIGNED).all((-2, -1))
    touching = near & box[:, :, None] & box[:, None]
    scene, first, second = np.nonzero(near & ~touching)
    rows = np.concatenate([kind[..., None], size, rotation.reshape(*kind.shape, 9), centre], -1)
    pairs = np.stack([rows[scene, first], rows[scene, second]], 1)
    pairs[..., -3:] = (pairs[..., -3:] - pairs[:, :1, -3:]).round(6) + 0.0
    different, number = np.unique(pairs, axis=0, return_inverse=True)  # copies of a pair are looked at once
    touching[scene, first, second] = _touching(different)[number.reshape(-1)]
    return [len(np.unique(numbers[here])) for numbers, here in zip(_connected(touching), mask, strict=True)]


def _connected(touching: Bool[Array, "B N N"]) -> Int[Array, "B N"]:
    """The smallest number of a part that each part is connected with."""
    both = touching | touching.swapaxes(1, 2)
    before, group = None, np.broadcast_to(np.arange(touching.shape[1]), touching.shape[:2])
    while before is None or (group != before).any():
        before, group = group, np.where(both, group[:, None], group[..., None]).min(-1, initial=touching.shape[1])
    return group


def _touching(pairs: Float[Array, "P 2 17"]) -> Bool[Array, " P"]:
    """Whether the parts of pairs touch, each a row of kind, sizes, rotation and centre."""
    known: dict[bytes, FloatArray] = {}
    result = np.zeros(len(pairs), np.bool_)
    hulls = [
        (number, one, other, pair[:, 5:14].reshape(2, 3, 3))
        for number, pair in enumerate(pairs)
        for one, other in product(*(_hulls(part, known) for part in pair))
    ]
    for start in range(0, len(hulls), AT_ONCE):
        number, first, second, axes = (np.stack(column) for column in zip(*hulls[start : start + AT_ONCE], strict=True))
        np.logical_or.at(result, number, _meet(first, second, axes))
    return result


def _meet(
    first: Float[Array, "P V 3"], second: Float[Array, "P V 3"], axes: Float[Array, "P 2 3 3"]
) -> Bool[Array, " P"]:
    """Whether no plane is found between two convex solids, given by their corners and the axes of their boxes."""
    own = axes.swapaxes(-1, -2)
    crossed = np.cross(own[:, 0, :, None], own[:, 1, None]).reshape(-1, 9, 3)
    length = np.linalg.norm(crossed, axis=-1, keepdims=True)
    normals = np.concatenate([own.reshape(-1, 6, 3), crossed / np.maximum(length, _TINY)], 1)
    one, other = (corners @ normals.swapaxes(-1, -2) for corners in (first, second))
    gap = np.maximum(one.min(1) - other.max(1), other.min(1) - one.max(1))
    apart, nearest = (gap > TOUCHING).any(1), first.mean(1) - second.mean(1)
    here = np.arange(len(first))
    for _ in range(ROUNDS):
        ends = [(corners @ nearest[..., None])[..., 0] for corners in (first, second)]
        step = first[here, ends[0].argmin(1)] - second[here, ends[1].argmax(1)]
        apart |= (nearest * step).sum(1) > TOUCHING * np.linalg.norm(nearest, axis=1)
        edge = step - nearest
        share = -(nearest * edge).sum(1) / np.maximum((edge * edge).sum(1), _TINY)
        nearest = nearest + np.clip(share, 0, 1)[:, None] * edge
    return ~apart


def _hulls(part: FloatArray, known: dict[bytes, FloatArray]) -> Float[Array, "K V 3"]:
    """Corners of the convex solids that a part consists of: one, or several along a bent rod."""
    if (key := part[:5].tobytes()) not in known:
        kind, size, names = int(part[0]), part[1:5], KINDS
        if kind == names["rounded_box"]:
            corners = size[:3] * np.array([[*product((-1, 1), repeat=3)]])
        else:
            corners = primitives[kind].mesh(size)[0][None]
        if kind == names["arc"]:
            rings = corners[0, : (PIECES + 1) * SEGMENTS].reshape(-1, SEGMENTS, 3)
            ends = np.linspace(0, PIECES, BENDS + 1).round().astype(int)
            corners = np.stack([rings[ends[:-1]], rings[ends[1:]]], 1).reshape(BENDS, -1, 3)
        corners = corners[:, :: -(-corners.shape[1] // MOST_CORNERS)]
        more = np.repeat(corners[:, :1], MOST_CORNERS - corners.shape[1], 1)
        known[key] = np.concatenate([corners, more], 1)
    placed: Array = known[key] @ part[5:14].reshape(3, 3).T + part[14:]
    return placed

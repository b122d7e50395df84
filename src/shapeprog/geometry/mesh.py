"""Triangle meshes of the parts of a scene and of their union."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from shapeprog.errors import ShapeProgError
from shapeprog.geometry.arrays import array
from shapeprog.geometry.batch import Batch
from shapeprog.geometry.primitive import Mesh as Triangles
from shapeprog.geometry.primitives import primitives
from shapeprog.geometry.primitives.cuboid import CUBOID
from shapeprog.lazy_torch import torch
from shapeprog.space import Array, FloatArray

FLAT = 1e-5
"""A part that is thinner than this, in cells, or fills less than this share of the box around it, has no solid to mesh
and is left out.  It is well above the lengths that primitives take for zero."""

FARTHEST = 1 << 24
"""Coordinates in cells up to which parts are meshed: single precision, in which files of meshes are, resolves no cells
beyond."""

MOST_TRIANGLES = 1 << 21  # most triangles of the parts of a scene together
MOST_TOUCHING = 1 << 14  # most pairs of parts that touch, of which one solid is made: each takes up to a millisecond
AT_ONCE = 64  # solids that are joined together
Single = tuple[npt.NDArray[np.float32], npt.NDArray[np.int64]]  # vertices in single precision and triangles


STEP = 1 / 16384
"""Cells to whose whole multiples vertices are rounded before solids are joined: faces that meet but for the rounding of
numbers meet then."""


class PartMesh(NamedTuple):
    """The watertight mesh of the primitive in one slot of a scene, in the grid frame."""

    slot: int
    vertices: FloatArray
    faces: npt.NDArray[np.int64]


class Solids(NamedTuple):
    """The numbers of the primitives of one scene as arrays, and which of them are solid: not degenerate, nor padding.

    ``half`` are half extents of the box around each in its local frame.
    """

    solid: npt.NDArray[np.bool_]
    size: FloatArray
    centre: FloatArray
    rotation: FloatArray
    half: FloatArray


def solids_of(scene: Batch) -> Solids:
    """The primitives of one scene; a ``ShapeProgError`` if given a batch, or a part lies beyond ``FARTHEST``."""
    if scene.batch_shape:
        message = f"a batch of shape {tuple(scene.batch_shape)} has no single mesh"
        raise ShapeProgError(message, "mesh its scenes one by one")
    solid, reach = array(scene.mask).copy(), np.zeros((len(scene.mask), 3))
    size, centre, rotation = (array(t.double()) for t in (scene.size, scene.centre, scene.rotation))
    for kind in scene.kinds:
        selected, declared = array(scene.kind) == kind, primitives[kind]
        of_kind = torch.tensor(size[selected])
        reach[selected] = array(declared.bound(of_kind))
        filled = array(declared.volume(of_kind)) / (2 * reach[selected].clip(FLAT, FARTHEST)).prod(-1)  # refused beyond
        solid[selected] &= ~((reach[selected] <= FLAT).any(-1) | (filled <= FLAT))
    far = solid & ~((np.abs(centre) + np.linalg.norm(reach, axis=-1, keepdims=True)).max(-1, initial=0) <= FARTHEST)
    if far.any():
        raise ShapeProgError(
            f"{int(far.sum())} of {int(solid.sum())} parts reach farther than {FARTHEST} cells from the centre",
            "lower their positions, sizes or shifts: nearer to it, single precision still tells cells apart",
        )
    return Solids(solid, size, centre, rotation, reach)


def bounds(scene: Batch) -> Iterator[tuple[int, FloatArray, FloatArray]]:
    """The slot of each solid part of one scene, and the low and high corner (3,) of the box around it.

    They are exact for boxes and along the axes of the grid, else those of the mesh; raises what :func:`part_meshes`
    does.
    """
    parts = solids_of(scene)
    turn = np.abs(parts.rotation)
    half = (turn @ parts.half[..., None])[..., 0]
    low, high = parts.centre - half, parts.centre + half
    exact = (turn.max(-1) > 1 - 1e-12).all(-1) | (array(scene.kind) == primitives.index(CUBOID)) & (
        parts.size[:, 3] == 0
    )
    if (parts.solid & ~exact).any():
        for slot, vertices, _ in part_meshes(replace(scene, mask=scene.mask & torch.tensor(~exact))):
            low[slot], high[slot] = vertices.min(0), vertices.max(0)
    return ((slot, low[slot], high[slot]) for slot in np.flatnonzero(parts.solid).tolist())


def part_meshes(scene: Batch) -> list[PartMesh]:
    """A watertight mesh of every primitive of one scene, in the order of the slots; degenerate ones are left out.

    Raises
    ------
    ShapeProgError
        As for :func:`solids_of`, or if there are more triangles than ``MOST_TRIANGLES``.
    """
    results, triangles, cached = [], 0, dict[bytes, Triangles]()
    solid, size, centre, rotation, _ = solids_of(scene)
    for slot, kind in zip(np.flatnonzero(solid).tolist(), array(scene.kind)[solid].tolist(), strict=True):
        key = kind.to_bytes(4, "little") + size[slot].tobytes()  # copies share their sizes
        if key not in cached:
            vertices, faces = primitives[kind].mesh(size[slot])
            cached[key] = vertices, np.asarray(faces, np.int64)
        vertices, faces = cached[key]
        triangles += len(faces)
        if triangles > MOST_TRIANGLES:
            raise ShapeProgError(
                f"the {int(solid.sum())} parts of this program have more than {MOST_TRIANGLES} triangles",
                "lower its counts, or save it as program text, .scad or .py, which keep its loops",
            )
        results.append(PartMesh(slot, vertices @ rotation[slot].T + centre[slot], faces))
    return results


def union_mesh(scene: Batch) -> Triangles:
    """One watertight mesh of the union of all primitives of one scene.

    Only parts that touch are joined; the others are appended unchanged.  A ``ShapeProgError`` if the scene
    holds no solid part, a batch is given, or more than ``MOST_TOUCHING`` pairs of parts touch.
    """
    solids: list[Single] = []
    for group in _touching(scene):
        if len(group) == 1:
            solids += group
        else:
            merged = _joined(group).to_mesh()
            solids.append((merged.vert_properties[:, :3], np.asarray(merged.tri_verts, np.int64)))
    if not any(len(vertices) for vertices, _ in solids):
        raise ShapeProgError("the union of the parts is empty", "a part may be too thin; give it some thickness")
    return joined(solids)


def joined(meshes: Sequence[tuple[Array, Array]]) -> Triangles:
    """Vertices (V, 3) and faces (F, 3) of meshes as those of one, in their order."""
    starts = np.cumsum([0, *(len(vertices) for vertices, _ in meshes)])
    faces = [faces + start for (_, faces), start in zip(meshes, starts, strict=False)]
    return np.concatenate([vertices for vertices, _ in meshes]).astype(np.float64), np.concatenate(faces)


def pieces(vertices: Array, faces: Array) -> int:
    """How many connected solids a watertight mesh, such as a union, is; a cavity within one is no piece."""
    from manifold3d import Manifold, Mesh

    solid = Manifold(Mesh(vertices.astype(np.float32), faces.astype(np.uint32)))
    return sum(piece.volume() > 0 for piece in solid.decompose())


def gaps(scene: Batch, within: float) -> dict[tuple[int, int], float]:
    """The distance between primitives of one scene, for pairs of slots nearer than ``within``; 0 where they overlap."""
    from manifold3d import Manifold, Mesh

    parts = part_meshes(scene)
    solids = [Manifold(Mesh(part.vertices.astype(np.float32), part.faces.astype(np.uint32))) for part in parts]
    low, high = (np.array([corner(part.vertices, 0) for part in parts]) for corner in (np.min, np.max))
    results = {}
    for i, j in combinations(range(len(parts)), 2):
        if (low[i] <= high[j] + within).all() and (low[j] <= high[i] + within).all():
            gap = solids[i].min_gap(solids[j], 2 * within)
            if gap < within:
                results[parts[i].slot, parts[j].slot] = float(gap)
    return results


def _touching(scene: Batch) -> list[list[Single]]:
    """The parts of a scene in single precision, those together whose boxes touch."""
    parts = [((np.round(part.vertices / STEP) * STEP).astype(np.float32), part.faces) for part in part_meshes(scene)]
    if not parts:
        raise ShapeProgError("the scene holds no solid part", "draw something that has a thickness")
    return [[parts[number] for number in group] for group in _groups([vertices for vertices, _ in parts])]


def _joined(parts: list[Single]) -> Any:
    """The union of parts as a manifold: some at once, since the time of all at once grows with the square."""
    from manifold3d import Manifold, Mesh, OpType

    solids = [Manifold(Mesh(vertices, faces.astype(np.uint32))) for vertices, faces in parts]
    while len(solids) > 1:
        solids = [Manifold.batch_boolean(solids[n : n + AT_ONCE], OpType.Add) for n in range(0, len(solids), AT_ONCE)]
        for solid in solids:
            solid.num_tri()  # manifold3d computes lazily
    return solids[0]


def _groups(parts: list[npt.NDArray[np.float32]]) -> list[list[int]]:
    """Numbers of the parts that hang together: their boxes touch.

    Boxes are swept along the axis on which the fewest overlap.
    """
    low, high = (np.array([corner(vertices, 0) for vertices in parts]) for corner in (np.min, np.max))
    sweeps = []
    for axis in range(3):
        order = np.argsort(low[:, axis], kind="stable")
        last = np.searchsorted(low[order, axis], high[order, axis], "right")
        sweeps.append((int(last.sum()), axis, order, last.tolist()))
    _, _, order, last = min(sweeps, key=lambda sweep: sweep[:2])
    groups, pairs = [[number] for number in range(len(parts))], 0
    for place, first in enumerate(order.tolist()):
        later = order[place + 1 : last[place]]
        touching = later[((low[later] <= high[first]) & (low[first] <= high[later])).all(1)].tolist()
        pairs += len(touching)
        if pairs > MOST_TOUCHING:
            raise ShapeProgError(
                f"more than {MOST_TOUCHING} pairs of the {len(parts)} parts touch, too many to join into one solid",
                "lower the counts, or export the parts as they are, as .ply",
            )
        for second in touching:
            small, large = sorted((groups[first], groups[second]), key=len)
            if small is not large:
                large += small
                for number in small:
                    groups[number] = large
    return [sorted(group) for group in {id(group): group for group in groups}.values()]

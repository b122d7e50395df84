"""Triangle meshes of the parts of a scene and of their union."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from shapeprog.errors import ShapeProgError
from shapeprog.geometry.arrays import array
from shapeprog.geometry.batch import Batch
from shapeprog.geometry.primitive import Mesh as Triangles
from shapeprog.geometry.primitives import primitives
from shapeprog.lazy_torch import torch
from shapeprog.space import Array, BoolArray, FloatArray, IntArray

FLAT = 1e-5
"""A part that is thinner than this, in cells, or fills less than this share of the box around it, has no solid to mesh
and is left out.  It is well above the lengths that primitives take for zero."""

FARTHEST = 1 << 24
"""Coordinates in cells up to which parts are meshed: single precision, in which files of meshes are, resolves no cells
beyond."""

MOST_TRIANGLES, MOST_VOXELISED = 1 << 21, 1 << 24  # most triangles of the parts of a scene together
MOST_JOINED = 1 << 13  # most parts of which one solid is made, which takes seconds

STEP = 1 / 16384
"""Cells to whose whole multiples vertices are rounded before solids are joined: faces that meet but for the rounding of
numbers meet then."""


class PartMesh(NamedTuple):
    """The watertight mesh of the primitive in one slot of a scene, in the grid frame."""

    slot: int
    vertices: FloatArray
    faces: IntArray


class SceneNumbers(NamedTuple):
    """The numbers of the primitives of one scene as arrays, and which of them are solid: not degenerate, nor padding.

    ``half`` are half extents of the box around each in its local frame.
    """

    solid: BoolArray
    size: FloatArray
    centre: FloatArray
    rotation: FloatArray
    half: FloatArray


def solids_of(scene: Batch) -> SceneNumbers:
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
    return SceneNumbers(solid, size, centre, rotation, reach)


def part_meshes(scene: Batch, most: float | None = None) -> list[PartMesh]:
    """A watertight mesh of every primitive of one scene, in the order of the slots; degenerate ones are left out.

    Raises
    ------
    ShapeProgError
        As for :func:`solids_of`, or if there are more triangles than ``most``, by default ``MOST_TRIANGLES``.
    """
    most = MOST_TRIANGLES if most is None else most
    results, triangles, cached = [], 0, dict[bytes, Triangles]()
    solid, size, centre, rotation, _ = solids_of(scene)
    for slot, kind in zip(np.flatnonzero(solid).tolist(), array(scene.kind)[solid].tolist(), strict=True):
        key = kind.to_bytes(4, "little") + size[slot].tobytes()  # copies share their sizes
        if key not in cached:
            vertices, faces = primitives[kind].mesh(size[slot])
            cached[key] = vertices, np.asarray(faces, np.int64)
        vertices, faces = cached[key]
        triangles += len(faces)
        if triangles > most:
            raise ShapeProgError(
                f"the {int(solid.sum())} parts of this program have more than {most} triangles",
                "lower its counts, or save it as program text, .scad or .py, which keep its loops",
            )
        results.append(PartMesh(slot, vertices @ rotation[slot].T + centre[slot], faces))
    return results


def bounds(scene: Batch) -> Iterator[tuple[int, FloatArray, FloatArray]]:
    """The slot of each solid part of one scene, and the low and high corner (3,) of the box around it.

    It is exact to .2 % of round parts that are turned, and exact for others; raises what :func:`solids_of` does.
    """
    parts = solids_of(scene)
    half = (np.abs(parts.rotation) @ parts.half[..., None])[..., 0]
    for slot, vertices, _ in part_meshes(scene, np.inf):  # round parts are prisms there
        low, high = parts.centre[slot] - half[slot], parts.centre[slot] + half[slot]
        yield slot, np.maximum(low, vertices.min(0)), np.minimum(high, vertices.max(0))


def union_mesh(scene: Batch) -> Triangles:
    """One watertight mesh of the union of all primitives of one scene.

    A ``ShapeProgError`` if the scene holds no solid part or more than ``MOST_JOINED``, or a batch is given.
    """
    from manifold3d import Manifold, OpType

    union = Manifold.batch_boolean(list(_solids(scene).values()), OpType.Add).to_mesh()
    if not len(union.tri_verts):
        raise ShapeProgError("the union of the parts is empty", "a part may be too thin; give it some thickness")
    return union.vert_properties[:, :3].astype(np.float64), np.asarray(union.tri_verts, np.int64)


def pieces_of_parts(scene: Batch) -> IntArray:
    """The connected solid of the union to which each primitive (N,) of one scene belongs, 0 for that with most surface.

    Two parts are connected if their union is one solid: parts that meet only along an edge or in a point are not.  A
    part without a volume counts as one of the largest solid; so do all parts where :func:`union_mesh` raises an error.
    """
    label = np.zeros(len(scene.mask), np.int64)
    try:
        solids = _solids(scene)
    except ShapeProgError:
        return label
    shapes = list(solids.values())
    box = np.array([shape.bounding_box() for shape in shapes]).reshape(-1, 2, 3)
    overlap = np.minimum(box[:, None, 1], box[:, 1]) - np.maximum(box[:, None, 0], box[:, 0])
    near = np.argwhere(np.triu((overlap >= 0).all(-1), 1))
    piece = np.arange(len(shapes))  # pairs with the most overlap first: most of the others need no union then
    for first, second in near[np.argsort(-overlap[tuple(near.T)].prod(-1), kind="stable")].tolist():
        if piece[first] != piece[second] and _count(shapes[first] + shapes[second]) == 1:
            piece[piece == piece[second]] = piece[first]
    order = np.argsort(-np.bincount(piece, [shape.surface_area() for shape in shapes]), kind="stable")
    label[list(solids)] = np.argsort(order)[piece]
    return label


def _solids(scene: Batch) -> dict[int, Any]:
    """The parts of a scene by slot, as solids whose vertices are rounded to whole multiples of ``STEP``."""
    parts = part_meshes(scene)
    if not parts:
        raise ShapeProgError("the scene holds no solid part", "draw something that has a thickness")
    if len(parts) > MOST_JOINED:
        raise ShapeProgError(
            f"{len(parts)} parts are too many to join into one solid: at most {MOST_JOINED}",
            "lower the counts, or export the parts as they are, as .ply",
        )
    return {p.slot: manifold(np.round(p.vertices / STEP) * STEP, p.faces) for p in parts}


def manifold(vertices: Array, faces: Array) -> Any:
    """A mesh as a solid of manifold3d, in single precision."""
    from manifold3d import Manifold, Mesh

    return Manifold(Mesh(vertices.astype(np.float32), faces.astype(np.uint32)))


def joined(meshes: Sequence[tuple[Array, Array]]) -> Triangles:
    """Vertices (V, 3) and faces (F, 3) of meshes as those of one, in their order."""
    starts = np.cumsum([0, *(len(vertices) for vertices, _ in meshes)])
    faces = [faces + start for (_, faces), start in zip(meshes, starts, strict=False)]
    return np.concatenate([np.empty((0, 3)), *(v for v, _ in meshes)]), np.concatenate([np.empty((0, 3), int), *faces])


def pieces(vertices: Array, faces: Array) -> int:
    """How many connected solids a watertight mesh, such as a union, is; a cavity within one is no piece."""
    return _count(manifold(vertices, faces))


def _count(solid: Any) -> int:
    return sum(piece.volume() > 0 for piece in solid.decompose())


def triangle_normals(vertices: FloatArray, faces: Array) -> tuple[FloatArray, FloatArray]:
    """Normals (F, 3) of triangles, as long as twice their area, and of unit length; 0 for triangles without area."""
    corners = vertices[faces]
    area = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(area, axis=1, keepdims=True)
    return area, area / np.where(length > 0, length, 1)

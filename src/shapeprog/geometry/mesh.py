"""Triangle meshes of the parts of a scene and of their union."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from shapeprog.errors import ShapeProgError
from shapeprog.geometry.arrays import array
from shapeprog.geometry.batch import Batch
from shapeprog.geometry.primitive import Mesh as Triangles
from shapeprog.geometry.primitive import primitives
from shapeprog.space import FloatArray

FLAT = 1e-6
"""A part that is thinner than this, in cells, has no solid to mesh and is left out."""


class PartMesh(NamedTuple):
    """The watertight mesh of the primitive in one slot of a scene, in the grid frame."""

    slot: int
    vertices: FloatArray
    faces: npt.NDArray[np.int64]


def part_meshes(scene: Batch) -> list[PartMesh]:
    """A mesh of every primitive of one scene, in the order of the slots; degenerate ones are left out."""
    if scene.batch_shape:
        said = f"a batch of shape {tuple(scene.batch_shape)} has no single mesh"
        raise ShapeProgError(said, "mesh its scenes one by one")
    found = []
    reach = {kind: array(primitives[kind].bound(scene.size.detach())) for kind in set(scene.kind.tolist())}
    size, centre, rotation = (array(t.double()) for t in (scene.size, scene.centre, scene.rotation))
    for slot, (kind, present) in enumerate(zip(scene.kind.tolist(), scene.mask.tolist(), strict=True)):
        declared = primitives[kind]
        thick = (reach[kind][slot] > FLAT).all() and (size[slot, : declared.extents] > FLAT).all()
        if present and thick and np.isfinite(size[slot]).all():
            vertices, faces = declared.mesh(size[slot])
            found.append(PartMesh(slot, vertices @ rotation[slot].T + centre[slot], np.asarray(faces, np.int64)))
    return found


def union_mesh(scene: Batch) -> Triangles:
    """One watertight mesh of the union of all primitives of one scene; a ``ShapeProgError`` if it holds no solid."""
    merged = _union(scene).to_mesh()
    if not len(merged.tri_verts):
        raise ShapeProgError("the union of the parts is empty", "a part may be too thin; give it some thickness")
    return np.asarray(merged.vert_properties[:, :3], np.float64), np.asarray(merged.tri_verts, np.int64)


def pieces(scene: Batch) -> int:
    """How many connected solids that union is, which must hold one; a cavity within one is no piece."""
    return sum(piece.volume() > 0 for piece in _union(scene).decompose())


def _union(scene: Batch) -> Any:
    from manifold3d import Manifold, Mesh, OpType

    parts = part_meshes(scene)
    if not parts:
        raise ShapeProgError("the scene holds no solid part", "give the program a statement that draws something")
    solids = [Manifold(Mesh(part.vertices.astype(np.float32), part.faces.astype(np.uint32))) for part in parts]
    return Manifold.batch_boolean(solids, OpType.Add)

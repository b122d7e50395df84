"""Primitives and scenes: distance, surface, occupancy, mesh, and the losses between shapes."""

from shapeprog.geometry import cuboid as cuboid
from shapeprog.geometry import cylinder as cylinder
from shapeprog.geometry.distance import each_distance, nearest_slot, signed_distance, union_distance
from shapeprog.geometry.losses import (
    Chamfer,
    chamfer,
    chamfer_directions,
    coverage,
    excess,
    occupancy_cross_entropy,
    parts,
    soft_iou,
    volume,
)  # fmt: skip
from shapeprog.geometry.mesh import PartMesh, part_meshes, union_mesh
from shapeprog.geometry.nearest import squared_distance
from shapeprog.geometry.occupancy import (
    cell_centres,
    pack,
    packed_iou,
    packed_rows,
    soft_logits,
    soft_occupancy,
    voxels,
)  # fmt: skip
from shapeprog.geometry.primitive import Primitive, primitives
from shapeprog.geometry.sampling import SurfaceSample, sample_surface
from shapeprog.geometry.scene import Scene, Solids

__all__ = [
    "Chamfer", "PartMesh", "Primitive", "Scene", "Solids", "SurfaceSample",
    "cell_centres", "chamfer", "chamfer_directions", "coverage", "each_distance", "excess", "nearest_slot",
    "occupancy_cross_entropy", "pack", "packed_iou", "packed_rows", "part_meshes", "parts", "primitives",
    "sample_surface", "signed_distance", "soft_iou", "soft_logits", "soft_occupancy", "squared_distance",
    "union_distance", "union_mesh", "volume", "voxels",
]  # fmt: skip

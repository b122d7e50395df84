"""Primitives and scenes: distance, surface, cells, mesh, and the losses between shapes."""

from shapeprog.geometry.batch import Batch, Solids
from shapeprog.geometry.cells import rasterise, voxels
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
)
from shapeprog.geometry.mesh import PartMesh, part_meshes, union_mesh
from shapeprog.geometry.nearest import squared_distance
from shapeprog.geometry.occupancy import cell_centres, soft_logits, soft_occupancy
from shapeprog.geometry.primitive import Primitive, primitives
from shapeprog.geometry.scene import Scene
from shapeprog.geometry.surface import SurfaceSample, sample_surface

__all__ = [
    "Batch", "Chamfer", "PartMesh", "Primitive", "Scene", "Solids", "SurfaceSample",
    "cell_centres", "chamfer", "chamfer_directions", "coverage", "each_distance", "excess", "nearest_slot",
    "occupancy_cross_entropy", "part_meshes", "parts", "primitives", "rasterise", "sample_surface",
    "signed_distance", "soft_iou", "soft_logits", "soft_occupancy", "squared_distance", "union_distance", "union_mesh",
    "volume", "voxels",
]  # fmt: skip

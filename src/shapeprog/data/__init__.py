"""Shapes from files, into the grid and back."""

from shapeprog.data.loading import load, load_all
from shapeprog.data.packs import Pack, read_pack, write_pack
from shapeprog.data.placement import shape_from_mesh, shape_from_points, shape_from_voxels
from shapeprog.data.preparation import Prepared, prepare
from shapeprog.data.shape import Shape

__all__ = [
    "Pack",
    "Prepared",
    "Shape",
    "load",
    "load_all",
    "prepare",
    "read_pack",
    "shape_from_mesh",
    "shape_from_points",
    "shape_from_voxels",
    "write_pack",
]

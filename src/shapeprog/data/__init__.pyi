from .loading import load, load_all, load_shape, loaded
from .packs import Pack, read_pack, write_pack
from .placement import shape_from_mesh, shape_from_points, shape_from_voxels
from .preparation import Prepared, prepare
from .shape import Shape

__all__ = [
    "Pack", "Prepared", "Shape",
    "load", "load_all", "load_shape", "loaded", "prepare", "read_pack",
    "shape_from_mesh", "shape_from_points", "shape_from_voxels", "write_pack",
]  # fmt: skip

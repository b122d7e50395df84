"""Inference: a program from the surface of a mesh or point cloud, or from the cells of voxels."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

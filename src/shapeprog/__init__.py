"""Furniture as a mesh, point cloud or voxels in; a short program that a person can read, edit and run out.

Names are resolved when they are first used, from the stub beside this file: ``import shapeprog`` loads nothing heavy.
"""

import lazy_loader

__version__ = "0.1.0"

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

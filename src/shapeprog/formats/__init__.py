"""Program files in and out: text, JSON, meshes, CAD, cells, points; the suffix names the format."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

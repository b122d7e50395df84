"""Furniture as a mesh, point cloud or voxels in; a short program that a person can read, edit and run out.

Names are resolved when they are first used, from the stub beside this file: ``import shapeprog`` loads nothing heavy.
"""

__version__ = "0.1.0"


def __getattr__(name: str) -> object:
    """Put what resolves names in the place of this function, and resolve the first; the command needs none."""
    import lazy_loader

    module = globals()
    module["__getattr__"], module["__dir__"], module["__all__"] = lazy_loader.attach_stub(__name__, __file__)
    return module[name] if name in module else module["__getattr__"](name)


def __dir__() -> list[str]:
    __getattr__("__all__")
    return sorted(__all__)

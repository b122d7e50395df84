"""Programs as files: text, meshes, CAD, voxels, chosen by suffix."""

from shapeprog.export.writing import export, suffixes

__all__ = ["export", "suffixes"]

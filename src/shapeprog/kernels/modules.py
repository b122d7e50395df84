"""Which modules hold the kernels of a piece of work: what :func:`shapeprog.kernels.compile.prepare` is given.

They are named, not imported: kernels are the lowest room.
"""

from __future__ import annotations

READING = ("shapeprog.data.voxelise_kernels",)
"""Meshes and points into cells."""

PICTURES = ("shapeprog.view.raster_kernels",)
"""Pictures of shapes and programs."""

SEARCH = (
    "shapeprog.inference.proposal_kernels",
    "shapeprog.inference.raster_kernels",
    "shapeprog.inference.descent_kernels",
    "shapeprog.inference.form_kernels",
    "shapeprog.inference.chance_kernels",
)
"""Structure search."""

GEOMETRY = (
    "shapeprog.geometry.neighbour_kernels",
    "shapeprog.geometry.distance_kernels",
    "shapeprog.geometry.surface_kernels",
    "shapeprog.geometry.cell_kernels",
)
"""Distances, samples, cells and neighbours of scenes; they import torch."""

INFERENCE = (*SEARCH, *GEOMETRY)
"""Search and refinement of a program."""

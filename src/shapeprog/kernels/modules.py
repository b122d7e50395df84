"""Which modules hold the kernels of a piece of work: what :func:`shapeprog.kernels.compile.prepare` is given.

They are named, not imported: kernels are the lowest room.
"""

from __future__ import annotations

READING = ("shapeprog.data.voxelise_kernels",)  # meshes and points into cells
PICTURES = ("shapeprog.view.raster_kernels",)  # of shapes and programs
SEARCH = (  # for a structure
    "shapeprog.inference.proposal_kernels",
    "shapeprog.inference.raster_kernels",
    "shapeprog.inference.descent_kernels",
    "shapeprog.inference.form_kernels",
    "shapeprog.inference.chance_kernels",
)
GEOMETRY = (  # of scenes: distances, samples, cells and neighbours; they import torch
    "shapeprog.geometry.neighbour_kernels",
    "shapeprog.geometry.distance_kernels",
    "shapeprog.geometry.surface_kernels",
    "shapeprog.geometry.cell_kernels",
)
CHOICE = (  # of blocks by the surface of the target
    "shapeprog.inference.evidence_kernels",
    "shapeprog.inference.choice_kernels",
    "shapeprog.inference.coverage_kernels",
    "shapeprog.inference.residual_kernels",
)
PIECES = (  # of the surface of the target
    "shapeprog.inference.cover_kernels",
    "shapeprog.inference.grouping_kernels",
    "shapeprog.inference.oriented_kernels",
    "shapeprog.inference.patch_kernels",
    "shapeprog.inference.repeating_kernels",
    "shapeprog.inference.rod_kernels",
)
INFERENCE = (*SEARCH, *GEOMETRY, *CHOICE, *PIECES)

"""The search on cells in the statements of the paper, for voxels and ``--paper``."""

"""No kernel reads or writes beside its arrays: tests that between them run all kernels, with every index checked.

It is the slowest test of the suite the first time, since all is compiled again; its file comes first so that nothing
waits for it.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]

CHOSEN = [
    "tests/test_inference_blocks.py::test_a_block_covers_the_cells_that_its_program_draws",
    "tests/test_inference_search.py::test_descent_and_polish_never_lower_the_objective",
    "tests/test_inference_choice.py::test_a_planted_table_is_chosen_exactly_among_hundreds",
    "tests/test_inference_boxes.py::test_the_heaviest_box_is_that_of_brute_force",
    "tests/test_data_voxelise.py::test_touched_cells_equal_the_clipping_twin",
    "tests/test_view_pictures.py::test_the_nearest_face_shows_as_in_a_slow_twin",
    "tests/test_geometry_extremes.py::test_every_kernel_takes_every_number",
    "tests/test_many_parts.py::test_points_of_many_parts_are_those_of_all_pairs",
    "tests/test_many_parts.py::test_distances_to_many_parts_are_those_of_all_pairs",
    "tests/test_geometry_cells.py::test_any_pose_and_kind_fills_the_same_cells_by_kernel_and_by_declaration",
    "tests/test_geometry_surface.py::test_gradient_of_placing_is_that_of_the_declarations",
]
"""Tests that between them run kernels of every room."""


def test_kernels_stay_within_the_bounds_of_their_arrays(pytestconfig: pytest.Config):
    """Once with every index checked; the cache is its own, since the code is another, and kept for the next run."""
    assert pytestconfig.cache is not None
    kept = str(pytestconfig.cache.mkdir("bounds"))
    environment = {**os.environ, "NUMBA_BOUNDSCHECK": "1", "NUMBA_OPT": "1", "NUMBA_CACHE_DIR": kept}
    command = [sys.executable, "-m", "pytest", "-q", "-x", "-p", "no:cacheprovider", *CHOSEN]
    done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout[-4000:]

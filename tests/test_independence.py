"""Rows that are independent of each other, and what is left of one beside others."""

from __future__ import annotations

import numpy as np
import pytest

from shapeprog.library.independence import beside, independent


@pytest.mark.parametrize("seed", range(5))
def test_as_many_rows_are_kept_as_there_are_dimensions(seed: int) -> None:
    random = np.random.default_rng(seed)
    rows = random.integers(-1, 2, (30, 4)) @ random.integers(-1, 2, (4, 9)).astype(float)
    kept = independent(rows)
    assert np.linalg.matrix_rank(rows[kept]) == len(kept) == np.linalg.matrix_rank(rows)


def test_the_first_in_the_order_is_kept_and_what_follows_from_it_is_not() -> None:
    rows = np.array([[0.0, 0, 0], [1, 1, 0], [2, 2, 0], [1, 0, 0], [0, 1, 0]])
    assert independent(rows) == [1, 3]
    assert independent(rows, [4, 2, 1, 3]) == [4, 2]


def test_what_is_left_of_a_row_is_one_long_and_at_right_angles_to_the_others() -> None:
    axes = np.eye(4)[:2]
    left = beside(np.array([3.0, -2.0, 0.6, 0.8]), axes)
    assert left is not None
    np.testing.assert_allclose(left, [0, 0, 0.6, 0.8], atol=1e-15)
    assert beside(np.array([3.0, -2.0, 1e-9, 0.0]), axes) is None

"""Gaps between oriented boxes: known answers, and the same in batches."""

from __future__ import annotations

import numpy as np
import pytest

from shapeprog.geometry import separation
from shapeprog.geometry.separation import OrientedBoxes, gaps, touching

TURN = np.array([[1, 0, 0], [0, np.sqrt(0.5), np.sqrt(0.5)], [0, -np.sqrt(0.5), np.sqrt(0.5)]])


def boxes(*centres: tuple[float, float, float]) -> OrientedBoxes:
    """Cubes of side 2."""
    return OrientedBoxes(np.array(centres, float), np.tile(np.eye(3), (len(centres), 1, 1)))


def test_gaps_of_cubes_are_as_known() -> None:
    cubes = boxes((0, 0, 0), (0, 0, 5), (0, 0.5, 1.5))
    pairs = np.array([0, 0]), np.array([1, 2])
    assert gaps(cubes, *pairs) == pytest.approx([3, -0.5])
    turned = cubes._replace(edges=np.stack([np.eye(3), TURN, np.eye(3)]))
    assert gaps(turned, *pairs)[0] == pytest.approx(5 - 1 - np.sqrt(2))
    assert [each.tolist() for each in touching(cubes, 0.1)] == [[0], [2]]


@pytest.mark.parametrize("count", [0, 1, 40])
def test_gaps_do_not_depend_on_batches(monkeypatch: pytest.MonkeyPatch, count: int) -> None:
    random = np.random.default_rng(0)
    scenes = OrientedBoxes(random.normal(size=(4, 9, 3)) * 3, random.normal(size=(4, 9, 3, 3)))
    first, second = random.integers(0, 9, (2, count))
    together = gaps(scenes, first, second)
    assert together.shape == (4, count)
    monkeypatch.setattr(separation, "MOST_PAIRS", 12)
    assert np.array_equal(gaps(scenes, first, second), together)
    for scene, expected in zip(zip(*scenes, strict=True), together, strict=True):
        assert gaps(OrientedBoxes(*scene), first, second) == pytest.approx(expected)

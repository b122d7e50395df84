"""Labels of parts against labelled points, on programs whose answer is counted by hand."""

from __future__ import annotations

import numpy as np
import pytest

import shapeprog as sp
from shapeprog.errors import ShapeProgError
from shapeprog.evaluation.labels import label_scores, labels_at

STOOL = """
seat(box(at=(0, -6, -6), size=(2, 12, 12)))
for i in mirror(side):
    leg(at=(-12, -1, 4), size=(12, 2, 2))
rod(start=(-8, 0, -4), end=(-8, 0, 4), radius=0.2)
"""

POINTS = np.array(
    [[2, 0, 0], [2, 5, 5], [1, 6, 0], [-12, 0, 5], [-12, 0, -5], [-6, 0, -6], [-8, 0.2, 0], [-8, -0.2, 0]]
)


def test_a_point_has_the_label_of_the_role_of_the_nearest_primitive_and_none_where_that_has_no_role() -> None:
    assert labels_at(sp.parse(STOOL), POINTS).tolist() == ["seat"] * 3 + ["leg"] * 3 + [""] * 2


def test_accuracy_counts_points_and_iou_is_the_mean_over_the_labels_there_are() -> None:
    scores = label_scores(sp.parse(STOOL), POINTS, ["seat", "seat", "back", "leg", "leg", "leg", "leg", "leg"])
    assert scores.label_accuracy == 5 / 8
    assert scores.label_iou == pytest.approx((0 / 1 + 2 / 3 + 3 / 5) / 3)


def test_a_program_that_draws_nothing_has_no_label_right() -> None:
    assert label_scores(sp.parse(""), POINTS, ["seat"] * 8) == (0, 0)


def test_points_and_labels_must_pair_up() -> None:
    with pytest.raises(ShapeProgError, match="8 points"):
        label_scores(sp.parse(STOOL), POINTS, ["seat"])
    with pytest.raises(ShapeProgError, match="0 points"):
        label_scores(sp.parse(STOOL), POINTS[:0], [])

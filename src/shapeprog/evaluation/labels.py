"""Do the words of a program say what each place of an object is?  Against labelled points of its surface."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import torch

from shapeprog.errors import ShapeProgError
from shapeprog.geometry.distance import nearest_primitive
from shapeprog.language.program import Draw, Program
from shapeprog.language.statement import Role, language
from shapeprog.language.unroll import unroll
from shapeprog.space import Array


class LabelScores(NamedTuple):
    """Share of the points whose part is called right, and the IoU of points by label, its mean over those there are."""

    label_accuracy: float
    label_iou: float


def label_scores(program: Program, points: Array, labels: Sequence[str] | Array) -> LabelScores:
    """How well the labels of a program's roles agree with labelled points, by the nearest primitive of each.

    Parameters
    ----------
    program
        What it calls its parts has a label, see :class:`shapeprog.language.statement.Role`; other words are wrong.
    points
        Points (P, 3) of the surface, in cells.
    labels
        What each of them is (P,), in the words of the labels of roles.

    Raises
    ------
    ShapeProgError
        If there are no points, or not one label for each.
    """
    said = np.asarray(labels)
    if not len(points) or said.shape != (len(points),):
        raise ShapeProgError(
            f"{len(points)} points and labels of shape {said.shape} do not pair up", "give one label for each point"
        )
    predicted = labels_at(program, points)
    right = predicted == said
    overlaps = [(right & (said == label)).sum() / ((predicted == label) | (said == label)).sum() for label in set(said)]
    return LabelScores(float(right.mean()), float(np.mean(overlaps)))


def labels_at(program: Program, points: Array) -> Array:
    """The label (P,) of the nearest primitive of each point; empty where it has none."""
    scene = unroll(program)
    if not scene.mask.any():
        return np.full(len(points), "")
    called = [language().called(node.word) for node in program.walk() if isinstance(node, Draw)]
    of_block = np.array([each.label if isinstance(each, Role) else "" for each in called])
    slot, _ = nearest_primitive(scene, torch.from_numpy(np.asarray(points, np.float32)))
    return of_block[scene.block[slot].numpy()]

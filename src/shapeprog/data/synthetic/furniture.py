"""The prior ``furniture``: sketches in every statement that there is, with roles, mirrors and real numbers.

It plants programs that inference should recover.  Generators cannot learn from it: they are not taught all statements.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from shapeprog.data.synthetic import sketched_cases as cases
from shapeprog.data.synthetic import sketched_seating as seating
from shapeprog.data.synthetic.sketch import Sketch, tidy
from shapeprog.geometry.mesh import part_meshes
from shapeprog.language.ast import changed_lines
from shapeprog.language.parameters import to_float32
from shapeprog.language.program import Loop, Node, Program
from shapeprog.language.statement import language
from shapeprog.language.unroll import unroll
from shapeprog.space import SPAN, UP, FloatArray

FURNITURE = "furniture"
"""What commands call it."""

SKETCHES: tuple[tuple[Callable[[Sketch], None], float], ...] = (
    (seating.chair, 0.28),
    (seating.stool, 0.1),
    (seating.bench, 0.12),
    (seating.sofa, 0.08),
    (cases.table, 0.18),
    (cases.desk, 0.07),
    (cases.cabinet, 0.08),
    (cases.bookshelf, 0.05),
    (cases.bed, 0.04),
)
"""The sketches of the mixture with their weights."""


def furniture(number: int, seed: int = 0, measures: int | None = None) -> Program:
    """A piece of furniture in the grid, as large as real ones are scaled; it depends on its number and seed alone.

    It is sketched twice: before the second time it is known how large it is.

    Parameters
    ----------
    measures
        The number of a variant that is designed alike and has other measures; where something depends on a measure,
        such as whether there is room for two pillows, it may have other parts too.
    """
    weights = np.array([weight for _, weight in SKETCHES])

    def sketched(scale: float, measures: int | None = None) -> Program:
        random = np.random.default_rng((seed, number))
        sketch = Sketch(random, scale, None if measures is None else np.random.default_rng((seed, number, measures)))
        SKETCHES[int(random.choice(len(weights), p=weights / weights.sum()))][0](sketch)
        return sketch.program

    low, high = _bounds(sketched(1.0))
    program = sketched(SPAN / float((high - low).max()), measures)
    low, high = _bounds(program)
    shift = -(low + high) / 2
    if any(isinstance(node, Loop) and node.name == "rotate" for node in program.walk()):
        shift[UP + 1 :] = 0  # rotated copies stay centred on the axis of the grid
    moved = partial(_moved, shift=[tidy(value) for value in shift.tolist()])
    return Program(changed_lines(program.body, moved))


def _bounds(program: Program) -> tuple[FloatArray, FloatArray]:
    corners = np.concatenate([part.vertices for part in part_meshes(unroll(program))])
    return corners.min(0), corners.max(0)


def _moved(node: Node, shift: list[float]) -> Node:
    """The node with its own places moved, the planes of mirrors too."""
    quantities = language()[node.name].quantities
    axes = [int(value) for value, quantity in zip(node.values, quantities, strict=True) if quantity.kind == "axis"]
    along = itertools.cycle([shift[axis] for axis in axes] or shift)
    values = tuple(
        to_float32(tidy(value + next(along))) if quantity.kind == "position" else value
        for value, quantity in zip(node.values, quantities, strict=True)
    )
    return replace(node, values=values)

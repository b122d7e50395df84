"""Whether a program holds together when it is edited: each free number made a fifth larger, and a fifth smaller.

Contacts
    Share of the pairs of primitives that touch which still do.
Symmetry
    Whether a program that is its own mirror image, left for right, still is.
One piece
    Whether a program that is one connected solid still is.

All are means over the edits; symmetry and one piece are not a number where the program did not have them to begin with.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import count
from typing import NamedTuple

import numpy as np
import torch

from shapeprog.errors import ShapeProgError
from shapeprog.geometry.distance import signed_distance
from shapeprog.geometry.mesh import gaps, pieces, union_mesh
from shapeprog.geometry.scene import Scene
from shapeprog.geometry.surface import sample_surface
from shapeprog.language.evaluation import evaluated
from shapeprog.language.expression import Expression, Value
from shapeprog.language.parameters import to_float32
from shapeprog.language.program import Program
from shapeprog.language.source import Assignment, Call, Function, Line, Source, WrittenDraw, WrittenLoop
from shapeprog.language.statement import language
from shapeprog.language.text import source_of
from shapeprog.language.unroll import unroll
from shapeprog.space import SIDE

FACTORS = (1.2, 0.8)
"""What free numbers are multiplied by."""

TOUCHING = 0.1
"""Cells between two primitives that touch, at most."""

SYMMETRIC = 0.1
"""How far the mirror image of a point of the surface may be from the surface, in cells."""

LOOKED = 1_000
"""Points of the surface that are mirrored."""


class EditScores(NamedTuple):
    """What edits keep, each between 0 and 1; and the number of free numbers."""

    contacts: float
    symmetry: float
    one_piece: float
    free: int


def edit_scores(program: Program) -> EditScores:
    """What is kept of a program when its free numbers are changed, one at a time; see the module."""
    before = unroll(program)
    touching = _contacts(before)
    symmetric, whole = _symmetric(before), _one_piece(before)
    kept: list[tuple[float, float, float]] = []
    for edited in edits(program):
        after = unroll(edited)
        kept.append((
            len(touching & _contacts(after)) / len(touching) if touching else np.nan,
            float(_symmetric(after)) if symmetric else np.nan,
            float(_one_piece(after)) if whole else np.nan,
        ))  # fmt: skip
    scores = np.array(kept).reshape(-1, 3)
    known = [float(np.nanmean(column)) if np.isfinite(column).any() else float("nan") for column in scores.T]
    return EditScores(*known, free=len(kept) // len(FACTORS))


def free_numbers(program: Program) -> int:
    """How many numbers of a program may be set, zeros aside: those named by a plain number, and all others written."""
    return sum(1 for _ in _places(source_of(program).lines))


def edits(program: Program) -> Iterator[Program]:
    """The program with each free number a fifth larger and a fifth smaller; edits that are no program are left out."""
    source = source_of(program)
    for place in range(free_numbers(program)):
        for factor in FACTORS:
            counter = count()
            lines = tuple(_changed(line, counter, place, factor) for line in source.lines)
            try:
                yield evaluated(Source(lines))
            except ShapeProgError:
                continue


def _places(lines: tuple[Line, ...]) -> Iterator[Value]:
    for line in lines:
        yield from (value for value, free in _numbers(line) if free)
        if isinstance(line, WrittenLoop | Function):
            yield from _places(line.body)


def _numbers(line: Line) -> Iterator[tuple[Value, bool]]:
    """The numbers on a line, and whether each is free: plain, continuous and not zero."""
    if isinstance(line, WrittenDraw | WrittenLoop):
        declared = language()[line.name]
        for value, quantity in zip(line.values, declared.quantities, strict=True):
            yield value, _plain(value) and not quantity.discrete
    elif isinstance(line, Assignment):
        yield from ((value, _plain(value)) for _, value in line.numbers)
    elif isinstance(line, Call):
        yield from ((value, _plain(value)) for _, value in line.arguments)


def _plain(value: Value) -> bool:
    return not isinstance(value, Expression) and value != 0


def _changed(line: Line, counter: Iterator[int], place: int, factor: float) -> Line:
    """The line with one free number of the program multiplied."""
    values = [
        to_float32(value * factor) if free and next(counter) == place else value  # type: ignore[operator]
        for value, free in _numbers(line)
    ]
    if isinstance(line, WrittenDraw):
        return replace(line, values=tuple(values))
    if isinstance(line, WrittenLoop):
        body = tuple(_changed(inner, counter, place, factor) for inner in line.body)
        return replace(line, values=tuple(values), body=body)
    if isinstance(line, Assignment):
        return replace(line, numbers=tuple((name, value) for (name, _), value in zip(line.numbers, values, strict=True)))
    if isinstance(line, Call):
        given = zip(line.arguments, values, strict=True)
        return replace(line, arguments=tuple((name, value) for (name, _), value in given))
    if isinstance(line, Function):
        return replace(line, body=tuple(_changed(inner, counter, place, factor) for inner in line.body))
    return line


def _contacts(scene: Scene) -> set[tuple[int, int]]:
    """Pairs of slots whose primitives touch."""
    try:
        return set(gaps(scene, TOUCHING))
    except ShapeProgError:  # a part lies too far away to be measured
        return set()


def _symmetric(scene: Scene) -> bool:
    try:
        points = sample_surface(scene, LOOKED, torch.Generator().manual_seed(0)).points.detach()
    except ShapeProgError:  # nothing is drawn
        return False
    image = points.clone()
    image[:, SIDE] *= -1
    return bool((signed_distance(scene, image).abs() <= SYMMETRIC).double().mean() >= 0.99)


def _one_piece(scene: Scene) -> bool:
    try:
        return pieces(*union_mesh(scene)) == 1
    except ShapeProgError:  # nothing has a volume
        return False

"""Programs in cells with their parts placed from the sides of the whole.

Positions are linear forms of the names of a program, measured from the middle of the whole: every side, size and offset
is then another linear form, and the way of writing that needs the fewest operators is found by trying all of them.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace

import numpy as np

from shapeprog.errors import ShapeProgError
from shapeprog.geometry.arrays import array
from shapeprog.language.ast import (
    Assignment,
    Call,
    Comment,
    Draw,
    Function,
    Line,
    Loop,
    Scale,
    Source,
    assignments,
    used_names,
)
from shapeprog.language.convert.loops import Loops, with_joined_mirrors
from shapeprog.language.evaluate import evaluated
from shapeprog.language.expression import Expression, Linear
from shapeprog.language.merging import merged_lines
from shapeprog.language.parameters import shortest, to_float32
from shapeprog.language.placement import BOX_IN_CELLS, SIZES
from shapeprog.language.program import Program
from shapeprog.language.unit import Unit
from shapeprog.language.unroll import exact_scene
from shapeprog.space import DEPTH, SIDE, UP, FloatArray

EMPTY = 0.1
"""Share of the height that may be empty below the parts, as the feet that no part stands for."""

NEAR, SLIGHT = 0.3, 0.05
"""Cells by which parts may end inside and outside of a side of the shape: a misfit, and no part that is missing."""


def placed(
    program: Program,
    *,
    merge: bool = True,
    rows: bool = True,
    floor: float | None = None,
    whole: Source | None = None,
    box: tuple[FloatArray, FloatArray] | None = None,
) -> Program:
    """The same shape with its parts placed from the sides of its bounding box about the middle of the grid.

    Parameters
    ----------
    program
        The program, in either notation.
    merge
        Whether loops that repeat in the same way become one; otherwise lines keep their order.
    rows
        Whether loops with equal steps may be written as rows, where that is shorter.
    floor
        Height of the floor in the grid, in cells.  If it is given, the box ends where the parts end in height, and in
        depth unless they have an axis in the middle of the grid; it stands on the floor if at most a tenth of it is
        empty below the parts.  Read without its frame, the text is placed about the middle of that box.
    whole
        A placed source whose box is that of the result, instead of the box around the parts.
    box
        The low and high corner (3,) of the shape in the grid: where the parts end near a side of it, so does the box.

    Raises
    ------
    ShapeProgError
        If a statement or loop has no placed form, as those that users declare, or a part has no thickness.
    """
    if program.scale is not None:
        return program
    low, high = _bounds(program)
    middle = np.zeros(3)
    if whole is not None and whole.scale is not None:
        numbers, scale = whole.evaluated_numbers(), whole.scale
        extents = np.array([numbers[size] for size in ("height", "depth", "width")]) * scale.cells_per_unit
        middle[:] = scale.floor + extents[UP] / 2, scale.middle, 0.0
        low, high = middle - extents / 2, middle + extents / 2
    if box is not None:
        inside = np.stack([low - box[0], box[1] - high])
        low, high = np.where((inside >= -SLIGHT) & (inside <= NEAR), box, (low, high))
    if floor is not None:
        if 0 < low[UP] - floor <= EMPTY * (high[UP] - floor):
            low[UP] = floor
        axes = [UP] if _has_axis(program) else [UP, DEPTH]
        middle[axes] = (low + high)[axes] / 2
    reach = np.maximum(high - middle, middle - low)
    sizes = [to_float32(float(f"{2 * reach[axis]:.7g}")) or 1.0 for axis in (SIDE, DEPTH, UP)]
    converter = Loops(tuple(Linear(float(shortest(size))) for size in sizes), {}, {})
    converter.rows = rows
    converter.shift = Linear(), Linear(-float(middle[DEPTH])), Linear(-float(middle[UP]))
    body = with_joined_mirrors(converter.lines(program.body).lines)
    header = Assignment(tuple(zip(SIZES, sizes, strict=True)))
    return _in_own_cells((header, *(merged_lines(body) if merge else body)), float(middle[UP]), float(middle[DEPTH]))


def placed_again(cells: Source, functions: Iterable[Function] = ()) -> Program:
    """The placed program of statements in cells whose values are expressions of names.

    Parameters
    ----------
    cells
        As :func:`~shapeprog.language.convert.named_cells` gives them; they may have calls with a box among them.
    functions
        The placed functions that these call.

    Raises
    ------
    ShapeProgError
        As for :func:`placed`.
    """
    numbers = cells.evaluated_numbers()
    names = {name: Linear.of(name) for name, value in cells.numbers.items() if not isinstance(value, Expression)}
    forms = cells.evaluated_numbers(names)
    converter = Loops((forms["width"], forms["depth"], forms["height"]), forms, numbers)
    body = merged_lines(with_joined_mirrors(converter.lines(_drawing(cells.lines)).lines))
    header = assignments(cells.lines, used_names(Source(body).walk()) | {*SIZES})
    called = [line for function in functions for line in (Comment(), function, Comment())]
    return _in_own_cells((*header, *called, *body))


def placed_if_possible(program: Program, floor: float | None = None) -> Program:
    """The placed program, or the same one if something in it has no placed form."""
    try:
        return placed(program, floor=floor)
    except ShapeProgError:
        return program


def placed_function(function: Function, numbers: Mapping[str, float]) -> Function:
    """A function in cells, whose first parameters are its box, with its parts placed from the sides of that box.

    Parameters
    ----------
    function
        The function.
    numbers
        Typical values of its parameters, which decide what lies above or beside what.

    Raises
    ------
    ShapeProgError
        If a statement or loop has no placed form.
    """
    sizes = Linear.of("width"), Linear.of("depth"), Linear.of("height")
    low = dict(zip(BOX_IN_CELLS[:3], reversed(sizes), strict=True))
    names = {name: Linear.of(name) for name in numbers} | {name: size / -2.0 for name, size in low.items()}
    converter = Loops(sizes, names, numbers)
    body = with_joined_mirrors(converter.lines(_drawing(function.body)).lines)
    return replace(function, parameters=function.parameters[len(BOX_IN_CELLS) :], body=body)


def _drawing(lines: Iterable[Line]) -> Iterable[Draw | Loop | Call]:
    return (line for line in lines if isinstance(line, Draw | Loop | Call))


def _in_own_cells(lines: tuple[Line, ...], up: float = 0.0, depth: float = 0.0) -> Program:
    """The program of placed lines with lengths in cells, whose middle is at this height and depth in the grid."""
    source = Source(lines, Unit("", 1.0))
    return evaluated(replace(source, scale=Scale(1.0, up - source.evaluated_numbers()["height"] / 2, depth)))


def _bounds(program: Program) -> tuple[FloatArray, FloatArray]:
    """The low and high corner (3,) in cells of the box around the parts of a program; zeros if it has none."""
    with exact_scene(program) as scene:
        mask, centre, reach = array(scene.mask), array(scene.centre), array(scene.reach)
    if not mask.any():
        return np.zeros(3), np.zeros(3)
    return (centre - reach)[mask].min(0), (centre + reach)[mask].max(0)


def _has_axis(program: Program) -> bool:
    """Whether parts are mirrored in depth, or turned, about the middle of the grid."""
    loops = [(node.name, node.values) for node in program.walk() if isinstance(node, Loop)]
    return any(
        name == "rotate" or (name, *values[1:]) == ("mirror", DEPTH, 0) or (name == "rotate_about" and values[2] == 0)
        for name, values in loops
    )

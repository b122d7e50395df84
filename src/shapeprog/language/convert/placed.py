"""Programs in cells with their parts placed from the sides of the whole.

Positions are linear forms of the names of a program, measured from the middle of the whole: every side, size and offset
is then another linear form, and the way of writing that needs the fewest operators is found by trying all of them.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace

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
from shapeprog.language.tensors import encode
from shapeprog.language.unit import Unit
from shapeprog.language.unroll import on_numpy_if_shipped, unroll
from shapeprog.lazy_torch import torch
from shapeprog.space import DEPTH, SIDE, UP


def placed(program: Program, *, merge: bool = True, rows: bool = True) -> Program:
    """The same shape with its parts placed from the sides of its bounding box about the middle of the grid.

    Parameters
    ----------
    program
        The program, in either notation.
    merge
        Whether loops that repeat in the same way become one; otherwise lines keep their order.
    rows
        Whether loops with equal steps may be written as rows, where that is shorter.

    Raises
    ------
    ShapeProgError
        If a statement or loop has no placed form, as those that users declare, or a part has no thickness.
    """
    if program.scale is not None:
        return program
    sizes = [to_float32(float(f"{extent:.7g}")) or 1.0 for extent in _extents(program)]
    forms = [Linear(float(shortest(size))) for size in sizes]
    converter = Loops((forms[0], forms[1], forms[2]), {}, {})
    converter.rows = rows
    body = with_joined_mirrors(converter.lines(program.body).lines)
    header = Assignment(tuple(zip(SIZES, sizes, strict=True)))
    return _in_own_cells((header, *(merged_lines(body) if merge else body)))


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


def placed_if_possible(program: Program) -> Program:
    """The placed program, or the same one if something in it has no placed form."""
    try:
        return placed(program)
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


def _in_own_cells(lines: tuple[Line, ...]) -> Program:
    """The program of placed lines with lengths in cells."""
    source = Source(lines, Unit("", 1.0))
    return evaluated(replace(source, scale=Scale(1.0, source.evaluated_numbers()["height"] / -2)))


def _extents(program: Program) -> list[float]:
    """Width, depth and height in cells of the smallest box about the middle of the grid that holds a program."""
    with on_numpy_if_shipped(program):
        scene = unroll(encode(program, dtype=torch.float64))
        reach = array(scene.reach + scene.centre.abs())[array(scene.mask)].max(0, initial=0.0)
    return [float(2 * reach[axis]) for axis in (SIDE, DEPTH, UP)]

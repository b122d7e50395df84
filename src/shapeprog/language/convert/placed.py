"""Programs in cells with their parts placed from the sides of the whole.

Positions are linear forms of the names of a program, measured from the middle of the whole: every side, size and offset
is then another linear form, and the way of writing that needs the fewest operators is found by trying all of them.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from types import MappingProxyType

import numpy as np

from shapeprog.errors import ShapeProgError
from shapeprog.geometry.arrays import array
from shapeprog.geometry.primitive import primitives
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
from shapeprog.language.convert.forms import NOTHING, Triple
from shapeprog.language.convert.loops import Loops, with_joined_mirrors
from shapeprog.language.evaluate import evaluated
from shapeprog.language.expression import Linear
from shapeprog.language.merging import merged_lines
from shapeprog.language.parameters import shortest, to_float32
from shapeprog.language.placement import BOX_IN_CELLS, SIZES
from shapeprog.language.printer import source_of
from shapeprog.language.program import Program
from shapeprog.language.tensors import encode
from shapeprog.language.unit import Unit
from shapeprog.language.unroll import on_numpy_if_shipped, unroll
from shapeprog.lazy_torch import torch
from shapeprog.space import DEPTH, SIDE, UP


def placed(
    program: Program, functions: Mapping[str, Function] = MappingProxyType({}), *, merge: bool = True
) -> Program:
    """The same shape with its parts placed from the sides of the whole.

    The whole is the box that the names ``width``, ``depth`` and ``height`` give, or else the bounding box.

    Parameters
    ----------
    program
        The program, in either notation; its names stand for plain numbers.
    functions
        The placed functions that it calls, by name.
    merge
        Whether loops that repeat in the same way become one; otherwise lines keep their order.

    Raises
    ------
    ShapeProgError
        If a statement or loop has no placed form, as those that users declare, or a part has no thickness.
    """
    source = source_of(program)
    if source.placed:
        return program
    numbers = source.evaluated_numbers()
    sizes = _sizes(program, numbers)
    converter = Loops(sizes, numbers)
    body = with_joined_mirrors(converter.lines(_drawing(source.lines)).lines)
    body = merged_lines(body) if merge else body
    header = _header(source.lines, sizes, used_names(Source(body).walk()))
    height = converter.number(sizes[2])
    called = [line for function in functions.values() for line in (Comment(), function, Comment())]
    return evaluated(Source((*header, *called, *body), Unit("", 1.0), Scale(1.0, -height / 2)))


def placed_if_possible(program: Program, functions: Mapping[str, Function] = MappingProxyType({})) -> Program:
    """The placed program, or the same one if something in it has no placed form."""
    try:
        return placed(program, functions)
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
    scope = dict(numbers) | {name: numbers[size] / -2 for name, size in zip(low, BOX_IN_CELLS[3:], strict=True)}
    converter = Loops(sizes, scope, {name: size / -2.0 for name, size in low.items()})
    body = with_joined_mirrors(converter.lines(_drawing(function.body)).lines)
    return replace(function, parameters=function.parameters[len(BOX_IN_CELLS) :], body=body)


def _drawing(lines: Iterable[Line]) -> Iterable[Draw | Loop | Call]:
    return (line for line in lines if isinstance(line, Draw | Loop | Call))


def _sizes(program: Program, numbers: Mapping[str, float]) -> Triple:
    """Width, depth and height of the whole, as names where the program has them."""
    extents = _extents(program) if any(numbers.get(word, 0) <= NOTHING for word in SIZES) else [0.0] * 3
    plain = [float(shortest(to_float32(float(f"{extent:.7g}")) or 1.0)) for extent in extents]
    forms = [
        Linear.of(word) if numbers.get(word, 0) > NOTHING else Linear(v) for word, v in zip(SIZES, plain, strict=True)
    ]
    return forms[0], forms[1], forms[2]


def _header(lines: Iterable[Line], sizes: Triple, used: set[str]) -> Iterable[Assignment]:
    """One line with the sizes of the whole, and the other names that are used."""
    numbers = Source(tuple(lines)).numbers
    whole = [
        (word, numbers[word] if size.factors else to_float32(size.constant))
        for word, size in zip(SIZES, sizes, strict=True)
    ]
    yield Assignment(tuple(whole))
    yield from assignments(lines, used - {*SIZES})


def _extents(program: Program) -> list[float]:
    """Width, depth and height in cells of the smallest box about the middle of the grid that holds a program."""
    reach = np.zeros(3)
    with on_numpy_if_shipped(program):
        scene = unroll(encode(program, dtype=torch.float64))
        for kind in scene.kinds:
            selected = scene.mask & (scene.kind == kind)
            half = primitives[kind].bound(scene.size[selected])
            corners = (scene.rotation[selected].abs() @ half[..., None])[..., 0] + scene.centre[selected].abs()
            reach = np.maximum(reach, array(corners).max(0))
    return [float(2 * reach[axis]) for axis in (SIDE, DEPTH, UP)]

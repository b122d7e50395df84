"""Placed programs as statements in cells."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from shapeprog.language.ast import (
    Assignment,
    Call,
    Draw,
    Function,
    Line,
    Loop,
    Scale,
    Source,
    assignments,
    used_names,
    values,
    with_values,
)
from shapeprog.language.convert.forms import Forms
from shapeprog.language.dimensions import counted_names, in_unit
from shapeprog.language.evaluate import evaluated, expanded, symbolic
from shapeprog.language.expression import Expression, Linear, Name, combined
from shapeprog.language.placement import BOX_IN_CELLS, SIZES
from shapeprog.language.printer import source_of
from shapeprog.language.program import Node, Program

EVEN = 1e-4
"""Degrees by which the copies of a rotation may miss a full circle."""


def in_cells(program: Program, *, named: bool = True) -> Program:
    """A placed program as statements in cells; functions and groups are written out.

    Parameters
    ----------
    named
        Whether it has the names of plain numbers; otherwise it is plain.

    Raises
    ------
    ShapeProgError
        If its numbers are not linear in these names, or a name is a length in one place only.
    """
    if program.scale is None:
        return program
    if not named:
        return Program(tuple(_published(node, node) for node in program.body))
    source = source_of(in_unit(program, None))
    names = {name: Linear.of(name) for name, v in source.numbers.items() if not isinstance(v, Expression)}
    nodes = symbolic(source, names, source.evaluated_numbers(names)["height"] / -2.0)
    lines = tuple(_published(_written(node), plain) for node, plain in zip(nodes, program.body, strict=True))
    return evaluated(Source((*assignments(source.lines, used_names(Source(lines).walk())), *lines)))


def function_in_cells(source: Source, name: str, example: Mapping[str, Any]) -> Function:
    """A function of a placed program as one in cells, whose first parameters are its box.

    Parameters
    ----------
    source
        The program.
    name
        The function.
    example
        Numbers for the parameters in cells of which it draws something; others have the usual ones.

    Raises
    ------
    ShapeProgError
        If its shape is not linear in its box and its lengths.
    """
    function = source.functions[name]
    counted = counted_names(source)
    words = [word for word, _ in function.parameters]
    box = {f"box {word}": Name(word) for word in BOX_IN_CELLS}
    up, depth, side, *sizes = (Name(word) for word in box)
    placement = {"bottom": up, "y": depth + sizes[1] / 2.0, "x": -(side + sizes[2] / 2.0)}
    keywords = (
        placement | dict(zip(BOX_IN_CELLS[3:], sizes, strict=True)) | {word: Name(f"own {word}") for word in words}
    )
    usual = dict.fromkeys(BOX_IN_CELLS, 12.0) | {word: 3.0 if f"{name}.{word}" in counted else 1.0 for word in words}
    usual |= {word: value for word, value in function.parameters if isinstance(value, float)} | dict(example)
    numbers = [(f"box {word}", usual[word]) for word in BOX_IN_CELLS] + [(f"own {word}", usual[word]) for word in words]
    header = Assignment((*((size, 1.0) for size in SIZES), *numbers))
    lines: tuple[Line, ...] = (header, *source.functions.values(), Call(name, tuple(keywords.items())))
    placed = Source(lines, scale=Scale(1.0, 0.0))
    nodes = symbolic(placed, box | {f"own {word}": Name(word) for word in words})
    nothing = Linear()
    forms = Forms((nothing, nothing, nothing), {})

    def clean(line: Any) -> Any:
        line = with_values(line, [forms.written(forms.form(value), exact=True) for value in values(line)])
        return replace(line, body=tuple(map(clean, line.body))) if isinstance(line, Loop) else line

    body = tuple(_published(clean(node), plain) for node, plain in zip(nodes, expanded(placed), strict=True))
    sides = tuple((word, None) for word in BOX_IN_CELLS)
    return replace(function, parameters=(*sides, *function.parameters), body=body)


def _written(node: Node) -> Node:
    """A statement or loop with expressions for its linear forms."""
    new = []
    for value in node.values:
        if isinstance(value, Linear):
            terms = sorted(((Name(name), factor) for name, factor in value.factors), key=lambda term: term[1] < 0)
            value = combined(value.constant, terms)
        new.append(value if isinstance(value, Expression) else value + 0.0)
    node = replace(node, values=tuple(new))
    return replace(node, body=tuple(map(_written, node.body))) if isinstance(node, Loop) else node


def _published(node: Node, plain: Node) -> Node:
    """A statement or loop by the name that text in cells has for it, where it has one."""
    values = plain.values
    if isinstance(node, Loop) and isinstance(plain, Loop):
        body = tuple(_published(inner, written) for inner, written in zip(node.body, plain.body, strict=True))
        even = node.name == "rotate_about" and not any(values[2:]) and abs(values[1] * values[0] - 360) < EVEN
        return Loop("rotate", (node.values[0], 1.0), body) if even else replace(node, body=body)
    assert isinstance(node, Draw)
    if node.name == "beam" and int(np.abs(np.subtract(values[3:6], values[:3])).argmax()) == values[8]:
        return Draw("bar", (*node.values[:8], node.values[9]), node.role)
    return Draw("back", node.values, node.role) if (node.name, node.role) == ("leaning_box", "back") else node

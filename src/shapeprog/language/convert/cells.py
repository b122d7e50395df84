"""Placed programs and functions as statements in cells, whose numbers are linear in names."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from shapeprog.language.ast import Assignment, Call, Draw, Loop, Scale, Source, assignments, used_names
from shapeprog.language.convert.forms import EVEN
from shapeprog.language.dimensions import ALL_DIGITS, counted_names, in_unit
from shapeprog.language.evaluate import symbolic
from shapeprog.language.expression import Expression, Linear, Name
from shapeprog.language.placement import BOX_IN_CELLS, SIZES
from shapeprog.language.printer import source_of
from shapeprog.language.program import Node, Program


def in_cells(program: Program) -> Program:
    """A placed program as plain statements of published names, where they have one; functions are written out."""
    return Program(tuple(_published(node, {}) for node in program.body))


def named_cells(program: Program) -> Source:
    """A placed program as its names, and statements and loops in cells whose values are expressions of them.

    Raises
    ------
    ShapeProgError
        If its numbers are not linear in the names of plain numbers, or a name is a length in one place only.
    """
    source = source_of(in_unit(program, None, digits=ALL_DIGITS))
    numbers = source.evaluated_numbers()
    names = {name: Linear.of(name) for name, value in source.numbers.items() if not isinstance(value, Expression)}
    nodes = symbolic(source, names, (source.evaluated_numbers(names)["height"] / -2.0, 0.0))
    lines = tuple(_written(_published(node, numbers)) for node in nodes)
    return Source((*assignments(source.lines, used_names(Source(lines).walk()) | {*SIZES}), *lines))


def call_in_cells(source: Source, name: str, numbers: Mapping[str, float]) -> tuple[Node, ...]:
    """What a function of a placed program draws, as statements and loops in cells with linear forms of its
    parameters other than counts.

    Parameters
    ----------
    source
        The program.
    name
        The function.
    numbers
        Its parameters, those of its box first: typical values, which decide what lies above or beside what, and counts.

    Raises
    ------
    ShapeProgError
        If it cannot be drawn so, or is not linear in its box and its other parameters.
    """
    inner = {word: f"own {word}" for word in numbers}  # which the program does not use itself
    up, depth, side, *sizes = (Name(inner[word]) for word in BOX_IN_CELLS)
    corner = {"bottom": up, "y": depth + sizes[1] / 2.0, "x": -(side + sizes[2] / 2.0)}
    keywords = {word: Name(inner[word]) for word in numbers if word not in BOX_IN_CELLS[:3]} | corner
    header = Assignment((*((size, 1.0) for size in SIZES), *((inner[word], numbers[word]) for word in numbers)))
    call = Call(name, tuple(keywords.items()))
    placed = Source((header, *source.functions.values(), call), scale=Scale(1.0, 0.0))
    counted = counted_names(source)
    measures = {inner[word]: Linear.of(word) for word in numbers if f"{name}.{word}" not in counted}
    nodes = symbolic(placed, {inner[word]: numbers[word] for word in numbers} | measures)
    return tuple(_published(node, numbers) for node in nodes)


def _written(node: Node) -> Node:
    """A statement or loop with expressions for its linear forms."""
    new = []
    for value in node.values:
        if isinstance(value, Linear):
            value = value.written()
        new.append(value if isinstance(value, Expression) else value + 0.0)
    node = replace(node, values=tuple(new))
    return replace(node, body=tuple(map(_written, node.body))) if isinstance(node, Loop) else node


def _published(node: Node, numbers: Mapping[str, float]) -> Node:
    """A statement or loop by the name that text in cells has for it, where it has one."""
    values: list[Any] = [value.at(numbers) if isinstance(value, Linear) else value for value in node.values]
    if isinstance(node, Loop):
        body = tuple(_published(inner, numbers) for inner in node.body)
        even = node.name == "rotate_about" and not any(values[2:]) and abs(values[1] * values[0] - 360) < EVEN
        return Loop("rotate", (node.values[0], 1.0), body) if even else replace(node, body=body)
    if node.name == "beam" and int(np.abs(np.subtract(values[3:6], values[:3])).argmax()) == values[8]:
        return Draw("bar", (*node.values[:8], node.values[9]), node.role)
    return Draw("back", node.values, node.role) if (node.name, node.role) == ("leaning_box", "back") else node

"""Loops that repeat in the same way written once, ``for _ in mirror(x=0):`` above all that has an image."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace

from shapeprog.language.ast import Assignment, Comment, Function, Group, Line, Loop
from shapeprog.language.evaluate import evaluated
from shapeprog.language.printer import source_of
from shapeprog.language.program import Program


def merged(program: Program) -> Program:
    """The same shape, each loop together with those behind it that are written alike, at the place of the first.

    Nothing moves past a named number, a function or a line that is a comment; lines with a comment behind them stay.
    """
    source = source_of(program)
    lines = merged_lines(source.lines)
    return program if lines == source.lines else evaluated(replace(source, lines=lines))


def merged_lines(lines: Iterable[Line]) -> tuple[Line, ...]:
    """The same for lines; a row, whose step follows from the first element in it, and a group do not change."""
    result: list[Line] = []
    indices: dict[Line, int] = {}
    for line in lines:
        if isinstance(line, Comment | Assignment | Function):
            indices.clear()
        elif isinstance(line, Loop | Group) and _merges(line):
            index = indices.setdefault(replace(line, body=()), len(result))
            if index < len(result):
                before = result[index]
                assert isinstance(before, Loop | Group)
                result[index] = replace(before, body=(*before.body, *line.body))
                continue
        result.append(line)
    return tuple(
        replace(line, body=merged_lines(line.body)) if isinstance(line, Loop | Group) else line for line in result
    )


def separate_loops(lines: Iterable[Line]) -> Iterator[Line]:
    """The lines with each loop in cells around several statements as that loop around each."""
    for line in lines:
        if isinstance(line, Loop):
            yield from (replace(line, body=(inner,)) for inner in separate_loops(line.body))
        else:
            yield line


def _merges(line: Loop | Group) -> bool:
    return isinstance(line, Loop) or (line.kind in ("mirror", "translate", "rotate") and not line.note)

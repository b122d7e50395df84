"""Loops that repeat in the same way written once, ``for i in mirror(side):`` above all that has an image; and back."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

from shapeprog.language.evaluation import evaluated
from shapeprog.language.expression import Value
from shapeprog.language.program import Program
from shapeprog.language.source import Assignment, Comment, Function, Line, WrittenLoop
from shapeprog.language.text import source_of


def merged(program: Program) -> Program:
    """The same shape, each loop together with those behind it that are written alike, at the place of the first.

    Nothing moves past a named number, a function or a line that is a comment, and what has a comment behind it stays.
    """
    source = source_of(program)
    lines = _merged(source.lines)
    return program if lines == source.lines else evaluated(replace(source, lines=lines))


def apart(lines: Sequence[Line]) -> Iterator[Line]:
    """The lines with each loop around several statements as that loop around each; those with comments stay."""
    for line in lines:
        if not isinstance(line, WrittenLoop) or any(isinstance(inner, Comment) for inner in line.body):
            yield line
            continue
        for place, inner in enumerate(apart(line.body)):
            yield replace(line, body=(inner,), note="" if place else line.note)


def _merged(lines: Sequence[Line]) -> tuple[Line, ...]:
    found: list[Line] = []
    places: dict[tuple[str, tuple[Value, ...]], int] = {}
    for line in lines:
        if isinstance(line, Comment | Assignment | Function):
            places.clear()
        elif isinstance(line, WrittenLoop) and not line.note:
            place = places.setdefault((line.name, line.values), len(found))
            if place < len(found):
                before = found[place]
                assert isinstance(before, WrittenLoop)
                found[place] = replace(before, body=(*before.body, *line.body))
                continue
        found.append(line)
    return tuple(replace(each, body=_merged(each.body)) if isinstance(each, WrittenLoop) else each for each in found)

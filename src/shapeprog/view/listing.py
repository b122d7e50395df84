"""A program as coloured lines: what is beside a picture, on a page and in a terminal."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from shapeprog.language.program import Draw, Loop, Node, Program
from shapeprog.language.statement import language
from shapeprog.language.text import format_program

DIGITS = 2
"""Decimals that are shown; files keep all of them."""


@dataclass(frozen=True)
class Line:
    """One line of program text.

    Parameters
    ----------
    text
        As printed.
    word
        The role, statement or loop on it.
    statement
        The id of that role or statement if it draws, else None.
    blocks
        The drawing statements, counted from 0 in the order of the text, that it draws or repeats.
    """

    text: str
    word: str
    statement: int | None
    blocks: tuple[int, ...]


def listing(program: Program, digits: int | None = DIGITS) -> list[Line]:
    """The lines of a program, with numbers rounded for reading unless ``digits`` is None."""
    shown = program if digits is None else Program(tuple(_rounded(node, digits) for node in program.body))
    texts = format_program(shown).splitlines()
    found: list[Line] = []
    places = iter(texts)
    _collect(shown.body, places, found, 0)
    return found


def _collect(body: tuple[Node, ...], texts: Iterator[str], found: list[Line], first: int) -> int:
    for node in body:
        text = next(texts)
        if isinstance(node, Draw):
            found.append(Line(text, node.word, language().called(node.word).id, (first,)))
            first += 1
            continue
        place = len(found)
        start = first
        if not node.body:
            next(texts)
            found.append(Line(f"{text} pass", node.name, None, ()))
            continue
        first = _collect(node.body, texts, found, first)
        found.insert(place, Line(text, node.name, None, tuple(range(start, first))))
    return first


def _rounded(node: Node, digits: int) -> Node:
    values = tuple(round(value, digits) + 0.0 for value in node.values)
    if isinstance(node, Draw):
        return Draw(node.name, values, node.role)
    return Loop(node.name, values, tuple(_rounded(inner, digits) for inner in node.body))


def parted(line: Line) -> tuple[str, str, str]:
    """What stands before the word, the word, and what follows it."""
    indent = line.text[: len(line.text) - len(line.text.lstrip(" "))]
    start = line.text.index(line.word, len(indent) + (4 if line.statement is None else 0))
    return line.text[:start], line.word, line.text[start + len(line.word) :]

"""A program as coloured lines, for pictures, pages and terminals."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, replace

from shapeprog.language.expression import Value, with_numbers
from shapeprog.language.program import Program
from shapeprog.language.source import (
    Assignment,
    Call,
    Comment,
    Function,
    Line,
    Source,
    WrittenDraw,
    WrittenLoop,
    values,
    with_values,
)
from shapeprog.language.statement import language
from shapeprog.language.text import format_source, source_of
from shapeprog.language.unit import Unit

DIGITS = 2
"""Decimals shown of numbers in cells; files have all of them."""


@dataclass(frozen=True)
class Shown:
    """One line of program text.

    Parameters
    ----------
    text
        As printed.
    word
        The role, statement, loop or function on it; empty if there is none.
    statement
        The id of that role or statement if it draws, else None.
    blocks
        Indices, from 0, of the drawing statements of the expanded program that it draws or repeats.
    """

    text: str
    word: str
    statement: int | None
    blocks: tuple[int, ...]


def listing(program: Program, digits: int | None = DIGITS) -> list[Shown]:
    """The lines of a program, with numbers rounded for reading unless ``digits`` is None."""
    source = source_of(program)
    if digits is not None:
        kept = digits_in(source.unit, digits)
        source = replace(source, lines=tuple(_rounded(line, kept) for line in source.lines))
    drawn = _Drawn(source)
    texts = iter(format_source(source).splitlines())
    head = [] if source.unit is None else [Shown(next(texts), "", None, ())]
    return [*head, *_shown(source.lines, texts, drawn.blocks)]


def digits_in(unit: Unit | None, digits: int = DIGITS) -> int:
    """Decimals in a unit with the precision of ``digits`` in cells."""
    return digits if unit is None else max(0, digits - math.floor(math.log10(unit.per_cell)))


def parted(line: Shown) -> tuple[str, str, str]:
    """The text before the word, the word, and the text after it."""
    if not line.word:
        return (line.text, "", "") if line.text.lstrip().startswith("#") else ("", "", line.text)
    bare = line.text.lstrip(" ")
    start = len(line.text) - len(bare) + (4 if bare.startswith(("for ", "def ")) else 0)
    start = line.text.index(line.word, start)
    return line.text[:start], line.word, line.text[start + len(line.word) :]


def wrapped(line: Shown, most: int) -> list[Shown]:
    """A line as several of at most so many letters, broken behind commas, else between words; those that follow have no
    word and stand farther in.  What has no place to break is cut."""
    indent = " " * (len(line.text) - len(line.text.lstrip(" ")) + 4)
    found, rest, word = [], line.text, line.word
    while len(rest) > most:
        limit = max(most, len(indent) + 2)
        cuts = (rest.rfind(end, len(indent), limit) + len(end) for end in ("), ", ", ", " "))
        cut = next((cut for cut in cuts if cut > len(indent) + 2), 0)
        if not cut:
            rest = rest[: limit - 1] + "…"
            break
        found.append(replace(line, text=rest[:cut].rstrip(), word=word))
        rest, word = indent + rest[cut:], ""
    return [*found, replace(line, text=rest, word=word)]


class _Drawn:
    """Drawing statements of the expanded program by the ``id`` of the line that makes them."""

    def __init__(self, source: Source) -> None:
        self.blocks: dict[int, list[int]] = defaultdict(list)
        self.functions = source.functions
        self._next = 0
        self._draw(source.lines)

    def _draw(self, lines: tuple[Line, ...]) -> None:
        for line in lines:
            start = self._next
            match line:
                case WrittenDraw():
                    self._next += 1
                case WrittenLoop():
                    self._draw(line.body)
                case Call():
                    self._draw(self.functions[line.name].body)
                    self.blocks[id(self.functions[line.name])] += range(start, self._next)
            self.blocks[id(line)] += range(start, self._next)


def _shown(lines: tuple[Line, ...], texts: Iterator[str], blocks: dict[int, list[int]]) -> Iterator[Shown]:
    for line in lines:
        word, statement = "" if isinstance(line, Comment | Assignment) else line.name, None
        if isinstance(line, WrittenDraw) or (isinstance(line, Call) and line.role):
            word = line.role or line.name
            statement = language().called(word).id
        text, body = next(texts), line.body if isinstance(line, WrittenLoop | Function) else None
        if body == ():
            text += f" {next(texts).strip()}"
        yield Shown(text, word, statement, tuple(blocks[id(line)]))
        if body:
            yield from _shown(body, texts, blocks)
            if all(isinstance(inner, Comment) for inner in body):
                yield Shown(next(texts), "", None, ())


def _rounded(line: Line, digits: int) -> Line:
    def short(value: Value) -> Value:
        return with_numbers(value, lambda number: round(number, digits) + 0.0)

    found = with_values(line, map(short, values(line)))
    if isinstance(found, WrittenLoop | Function):
        return replace(found, body=tuple(_rounded(inner, digits) for inner in found.body))
    return found

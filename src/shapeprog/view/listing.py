"""A program as coloured lines, for pictures, pages and terminals."""

from __future__ import annotations

import math
import textwrap
from dataclasses import dataclass, replace
from functools import partial

from shapeprog.language.ast import (
    Assignment,
    Call,
    Comment,
    Draw,
    Group,
    Line,
    Part,
    changed_lines,
    changed_values,
)
from shapeprog.language.evaluate import provenance
from shapeprog.language.expression import rounded, text_of
from shapeprog.language.printer import printed, source_of
from shapeprog.language.program import Program
from shapeprog.language.unit import Unit

DIGITS = 2  # decimals shown of numbers in cells; files have all of them


@dataclass(frozen=True)
class Row:
    """One row of program text.

    Parameters
    ----------
    text
        As printed.
    word
        The role, statement, loop, group or function on it; empty if there is none.
    role
        The role or statement in whose colour it is shown, if it draws, else empty.
    blocks
        Indices, from 0, of the drawing statements of the expanded program that it draws or repeats.
    numbers
        The names that it assigns, each with its value as printed, in this order.
    """

    text: str
    word: str = ""
    role: str = ""
    blocks: tuple[int, ...] = ()
    numbers: tuple[tuple[str, str], ...] = ()


def listing(program: Program, digits: int | None = DIGITS) -> list[Row]:
    """The rows of the text of a program, with numbers rounded for reading unless ``digits`` is None."""
    source, shown = source_of(program), source_of(program)
    if digits is not None:
        decimals = digits_in(source.unit, digits)
        round_values = partial(changed_values, change=lambda value: rounded(value, decimals))
        shown = replace(source, lines=changed_lines(source.lines, round_values))
    blocks, words = provenance(source), [draw.word for draw in program.draws]
    rows = []
    for (text, _), (_, line) in zip(printed(shown), printed(source), strict=True):
        if line is None or isinstance(line, Comment | Assignment):
            numbers = line.numbers if isinstance(line, Assignment) else ()
            rows.append(Row(text, numbers=tuple((name, text_of(value)) for name, value in numbers)))
            continue
        block_numbers = tuple(blocks.get(id(line), ()))
        word, role = _word(line), ""
        if isinstance(line, Draw | Part):
            role = words[block_numbers[0]] if block_numbers else word
        elif isinstance(line, Call):
            role = line.role
        rows.append(Row(text, word, role, block_numbers))
    return rows


def digits_in(unit: Unit | None, digits: int = DIGITS) -> int:
    """Decimals in a unit with the precision of ``digits`` in cells."""
    return digits if unit is None else max(0, digits - math.floor(math.log10(unit.per_cell)))


def parted(line: Row) -> tuple[str, str, str]:
    """The text before the word, the word, and the text after it."""
    if not line.word:
        return (line.text, "", "") if line.text.lstrip().startswith("#") else ("", "", line.text)
    bare = line.text.lstrip(" ")
    start = len(line.text) - len(bare) + (4 if bare.startswith(("for ", "def ")) else 0)
    start = line.text.index(line.word, start)
    return line.text[:start], line.word, line.text[start + len(line.word) :]


def wrapped(line: Row, length: int) -> list[Row]:
    """A line as several of at most ``length`` letters, broken between words, or within one that is longer; later lines
    have no word and are indented, nor does the first where it was broken within its word."""
    indent = " " * (len(line.text) - len(line.text.lstrip(" ")) + 4)
    width = max(length, len(indent) + 2)
    first, *others = textwrap.wrap(line.text, width, subsequent_indent=indent, break_on_hyphens=False) or [""]
    word = line.word if line.word in first else ""
    return [replace(line, text=first, word=word), *(replace(line, text=text, word="") for text in others)]


def _word(line: Line) -> str:
    if isinstance(line, Draw | Part | Call) and line.role:
        return line.role
    return line.kind if isinstance(line, Part | Group) else line.name  # type: ignore[union-attr]

"""The comments and empty lines of a program text, handed out in order while the lines around them are read."""

from __future__ import annotations

import io
import tokenize
from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

from shapeprog.language.source import Comment


class _Remark(NamedTuple):
    """A comment at its row and column, which count from 1; an empty line if there is nothing in it."""

    row: int
    column: int
    text: str


class Comments:
    """Those of a text, as its lines, that have not been handed out yet."""

    def __init__(self, lines: Sequence[str] = ()) -> None:
        self._rest = list(_remarks(lines))

    def before(self, row: int) -> tuple[Comment, ...]:
        """Those above a row."""
        return tuple(Comment(each.text) for each in self._while(lambda each: each.row < row))

    def note(self, row: int) -> str:
        """Those down to a row as one: they stand behind what was read last, or within it."""
        return "  ".join(each.text for each in self._while(lambda each: each.row <= row) if each.text)

    def ending(self, column: int, row: float) -> tuple[Comment, ...]:
        """Those above a row that end a block at a column: they are indented like it, or more."""
        found = self._while(lambda each: each.row < row and (not each.text or each.column >= column))
        while found and not found[-1].text:  # empty lines below a block are not in it
            self._rest.insert(0, found.pop())
        return tuple(Comment(each.text) for each in found)

    def _while(self, wanted: Callable[[_Remark], bool]) -> list[_Remark]:
        count = next((place for place, each in enumerate(self._rest) if not wanted(each)), len(self._rest))
        found, self._rest = self._rest[:count], self._rest[count:]
        return found


def _remarks(lines: Sequence[str]) -> Iterator[_Remark]:
    for token in tokenize.generate_tokens(io.StringIO("\n".join(lines)).readline):
        row, column = token.start
        if token.type == tokenize.COMMENT:
            shown = "".join(letter if letter.isprintable() else " " for letter in token.string[1:])
            yield _Remark(row, column + 1, shown.strip())
        elif token.type == tokenize.NL and not token.line.strip():
            yield _Remark(row, column + 1, "")

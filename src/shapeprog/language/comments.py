"""The comments and empty lines of a program text, handed out in order while the lines around them are read."""

from __future__ import annotations

import io
import tokenize
from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

from shapeprog.language.ast import Comment


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
        return tuple(Comment(remark.text) for remark in self._while(lambda remark: remark.row < row))

    def note(self, row: int) -> str:
        """Those down to a row as one: they are behind or within the last line that was read."""
        return "  ".join(remark.text for remark in self._while(lambda remark: remark.row <= row) if remark.text)

    def ending(self, column: int, row: float) -> tuple[Comment, ...]:
        """Those above a row that end a block at a column: they are indented like it, or more."""
        result = self._while(lambda remark: remark.row < row and (not remark.text or remark.column >= column))
        while result and not result[-1].text:  # empty lines below a block are not in it
            self._rest.insert(0, result.pop())
        return tuple(Comment(remark.text) for remark in result)

    def _while(self, accepted: Callable[[_Remark], bool]) -> list[_Remark]:
        count = next((index for index, remark in enumerate(self._rest) if not accepted(remark)), len(self._rest))
        result, self._rest = self._rest[:count], self._rest[count:]
        return result


def _remarks(lines: Sequence[str]) -> Iterator[_Remark]:
    if not any("#" in line for line in lines):  # empty lines alone: tokens take long
        yield from (_Remark(row, 1, "") for row, line in enumerate(lines, 1) if not line.strip() and row < len(lines))
        return
    for token in tokenize.generate_tokens(io.StringIO("\n".join(lines)).readline):
        row, column = token.start
        if token.type == tokenize.COMMENT:
            shown = "".join(letter if letter.isprintable() else " " for letter in token.string[1:])
            yield _Remark(row, column + 1, shown.strip())
        elif token.type == tokenize.NL and not token.line.strip():
            yield _Remark(row, column + 1, "")

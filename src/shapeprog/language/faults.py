"""Mistakes on a line of a syntax tree; a reader of text knows where the line stands."""

from __future__ import annotations

from shapeprog.errors import ShapeProgError
from shapeprog.language.ast import Line
from shapeprog.language.expression import Expression


class Fault(ShapeProgError):
    """A mistake on a line of a program.

    Parameters
    ----------
    line
        The line.
    message, hint
        What is wrong, and what to do.
    key
        Where on the line: the slot of a number, or the name of a keyword, number, argument or parameter.
    expression
        The part of an expression that is wrong.
    """

    def __init__(
        self, line: Line, message: str, hint: str, key: int | str = "", expression: Expression | None = None
    ) -> None:
        super().__init__(message, hint)
        self.line, self.key, self.expression = line, key, expression

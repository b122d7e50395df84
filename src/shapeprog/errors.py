"""What can go wrong, in words: every error a user can cause names the cause and the cure."""

from __future__ import annotations


class ShapeProgError(Exception):
    """A mistake that the user can mend.

    Parameters
    ----------
    message
        What is wrong, with the values found.
    hint
        What to do about it; printed on a line of its own.
    """

    def __init__(self, message: str, hint: str = "") -> None:
        super().__init__(message)
        self.message = message
        self.hint = hint

    def __str__(self) -> str:
        return f"{self.message}\n  hint: {self.hint}" if self.hint else self.message


class DeclarationError(ShapeProgError):
    """A statement, loop or primitive was declared in a way that the language cannot use."""


class InputError(ShapeProgError):
    """A file or an array that cannot be read as a shape."""


class OutputError(ShapeProgError):
    """A result that cannot be written."""


class ProgramError(ShapeProgError):
    """A program text that is not in the language; points at the place.

    Parameters
    ----------
    line, column
        Place of the mistake, both counted from 1.
    source
        The line of text it is on.
    name
        What the text is called, a path for instance.
    """

    def __init__(
        self, message: str, *, line: int = 1, column: int = 1, source: str = "", hint: str = "", name: str = "<program>"
    ) -> None:
        super().__init__(message, hint)
        self.line = line
        self.column = column
        self.source = source
        self.name = name

    def __str__(self) -> str:
        place = f"{self.name}, line {self.line}, column {self.column}: {self.message}"
        shown = f"\n  {self.source}\n  {' ' * (self.column - 1)}^" if self.source else ""
        return f"{place}{shown}" + (f"\n  hint: {self.hint}" if self.hint else "")

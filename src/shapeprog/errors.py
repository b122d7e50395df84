"""What can go wrong, in words: every error a user can cause names the cause and the cure."""

from __future__ import annotations

import difflib
from collections.abc import Iterable


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


def did_you_mean(word: str, known: Iterable[str], otherwise: str = "", *, quoted: bool = False) -> str:
    """A hint that proposes the known word nearest to ``word``, whatever its case.

    Parameters
    ----------
    otherwise
        The hint where no word is near; by default it lists all that are known.
    quoted
        Whether the word stands in quotation marks.
    """
    words = {each.lower(): each for each in known}
    near = difflib.get_close_matches(word.lower(), words, 1)
    if near:
        return f"did you mean {words[near[0]]!r}?" if quoted else f"did you mean {words[near[0]]}?"
    return otherwise or (f"known are {', '.join(words.values())}" if words else "nothing is declared")

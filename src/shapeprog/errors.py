"""The errors: every error that a user can cause names its cause and the remedy."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable

_WIDEST = 200  # letters of a line that are shown
_LONGEST = 200  # letters of a word that are compared with the known words; the time grows with the letters
_MOST = 800  # letters of a message

_UNPRINTABLE = re.compile("[\0-\t\x0b-\x1f\x7f-\x9f\u2028-\u202e\u2066-\u2069\ud800-\udfff]")
"""Control characters of terminals, marks of text direction, and half characters; not the line feed."""


class ShapeProgError(Exception):
    """A mistake that the user can correct: ``message`` names the problem, ``hint`` the remedy, on a separate line.

    Both may quote a file. Unprintable characters are replaced by escapes such as ``\\x1b``; long texts lose their
    middle.
    """

    def __init__(self, message: str, hint: str = "") -> None:
        self.message, self.hint = _shown(message), _shown(hint)
        super().__init__(self.message)

    def __str__(self) -> str:
        return f"{self.message}\n  hint: {self.hint}" if self.hint else self.message


class DeclarationError(ShapeProgError):
    """A statement, loop or primitive was declared in a way that the language cannot use."""


class InputError(ShapeProgError):
    """A file or an array that cannot be read as a shape."""


class OutputError(ShapeProgError):
    """A result that cannot be written."""


class ProgramError(ShapeProgError):
    """A program text that is not in the language; points at the position.

    ``line`` and ``column`` count from 1; ``source`` is the line of text, shortened for display; ``name`` is the name of
    the text.
    """

    def __init__(
        self, message: str, *, line: int = 1, column: int = 1, source: str = "", hint: str = "", name: str = "<program>"
    ) -> None:
        super().__init__(message, hint)
        self.line, self.column, self.name = line, column, _shown(name)
        self.source = _UNPRINTABLE.sub(" ", source[:_WIDEST]) if column <= _WIDEST else ""

    def __str__(self) -> str:
        shown = f"\n  {self.source}\n  {' ' * (self.column - 1)}^" if self.source else ""
        hint = f"\n  hint: {self.hint}" if self.hint else ""
        return f"{self.name}, line {self.line}, column {self.column}: {self.message}{shown}{hint}"


def _shown(text: str) -> str:
    if len(text) > _MOST:
        text = f"{text[: _MOST // 2]} ... {text[-_MOST // 2 :]}"
    return _UNPRINTABLE.sub(lambda match: match[0].encode("unicode_escape").decode(), text)


def did_you_mean(word: str, known: Iterable[str], otherwise: str = "", *, quoted: bool = False) -> str:
    """A hint that proposes the known word nearest to ``word``, ignoring case, in quotation marks if ``quoted``.

    If none is near, the hint is ``otherwise``; by default a list of all known words.
    """
    words = {word.lower(): word for word in known}
    near = difflib.get_close_matches(word[:_LONGEST].lower(), words, 1)
    if near:
        return f"did you mean {repr(words[near[0]]) if quoted else words[near[0]]}?"
    return otherwise or (f"known: {', '.join(words.values())}" if words else "none is declared")

"""Program text as Python sees it, where every mistake has its line and column; nothing of it is ever executed."""

from __future__ import annotations

import ast
import re
import warnings
from typing import TypeAlias

from shapeprog.errors import ProgramError

LONGEST = 500_000
"""Letters of the longest text: a syntax tree takes a thousand times the memory of its text."""

Node: TypeAlias = ast.stmt | ast.expr | ast.keyword | ast.arg

_FORBIDDEN = (
    (r"^[^\S\t]*\t(?=.*\S)", "this line is indented with a tab", "indent with four spaces"),
    (r"\0", "there is a null byte in this line", "is this a text file?"),
)
_WORDS_OF_PYTHON = {"positional argument": "a number without a name", "keyword argument": "one with a name"}
_SHOWN = 60


def proper_text(text: str, name: str) -> str:
    """The text without its byte order mark; a ``ProgramError`` if it holds half characters, which no file can show."""
    half = re.search("[\ud800-\udfff]", text)
    if half:
        line, hint = text.count("\n", 0, half.start()) + 1, "is this a text file in UTF-8?"
        raise ProgramError("this line holds half a character", line=line, hint=hint, name=name)
    return text.removeprefix("\ufeff")


class Text:
    """The text of a program, what it is called in errors, and its lines."""

    def __init__(self, text: str, name: str) -> None:
        self.text = proper_text(text, name)
        self.name = name
        self.lines = re.split(r"\r\n|\r|\n", self.text)

    def tree(self) -> ast.Module:
        """The syntax tree; a ``ProgramError`` if the text is not Python."""
        if len(self.text) > LONGEST:
            raise self.at(1, 1, f"this text has more than {LONGEST:,} letters", "keep such a program as .json")
        for number, line in enumerate(self.lines, 1):
            for pattern, message, hint in _FORBIDDEN:
                found = re.search(pattern, line)
                if found:
                    raise self.at(number, found.end(), message, hint)
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                return ast.parse(self.text)
        except SyntaxError as error:
            row = min(max(error.lineno or 1, 1), len(self.lines))
            column = min(max(error.offset or 1, 1), len(self.lines[row - 1]) + 1)
            said = (error.msg or "invalid syntax").split(";")[0]
            for word, ours in _WORDS_OF_PYTHON.items():
                said = said.replace(word, ours)
            hint = "a line is name(parameter=number, ...), name = number, or a for loop"
            raise self.at(row, column, f"this cannot be read: {said}", hint) from None
        except (RecursionError, MemoryError):
            raise self.at(1, 1, "this is nested too deeply to be a program", "write plain numbers") from None

    def shown(self, node: Node) -> str:
        """The source of a piece of syntax, on one line and cut where it is long."""
        raw = self.lines[node.lineno - 1].encode()
        end = node.end_col_offset if node.end_lineno == node.lineno else None
        text = raw[node.col_offset : end].decode(errors="replace").strip()
        return text if len(text) <= _SHOWN else text[:_SHOWN] + "..."

    def error(self, node: Node, message: str, hint: str) -> ProgramError:
        """What is wrong at a piece of syntax."""
        before = self.lines[node.lineno - 1].encode()[: node.col_offset]  # ast counts columns in bytes of UTF-8
        return self.at(node.lineno, len(before.decode(errors="replace")) + 1, message, hint)

    def at(self, line: int, column: int, message: str, hint: str) -> ProgramError:
        """What is wrong at a line and column, which count from 1."""
        return ProgramError(message, line=line, column=column, source=self.lines[line - 1], hint=hint, name=self.name)

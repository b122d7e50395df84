"""Program text as Python sees it, where every mistake has its line and column; nothing of it is ever executed."""

from __future__ import annotations

import ast
import re
import warnings
from typing import TypeAlias

from shapeprog.errors import ProgramError, ShapeProgError
from shapeprog.language.parameters import to_float32

LONGEST = 500_000  # letters of the longest text: a syntax tree takes a thousand times the memory of its text

Node: TypeAlias = ast.stmt | ast.expr | ast.keyword | ast.arg

_FORBIDDEN = (
    (r"^[^\S\t]*\t(?=.*\S)", "this line is indented with a tab", "indent with four spaces"),
    (r"\0", "there is a null byte in this line", "is this a text file?"),
)
_WORDS_OF_PYTHON = {
    "positional argument": "a number without a name", "keyword argument": "one with a name",
    "Perhaps you forgot a comma?": "a word too many",
}  # fmt: skip
_SYNTAX_HINTS = {
    "positional argument follows": "write each number with its keyword, and with a decimal point: left=2.5",
    "decimal literal": "write the unit once, at the top: # unit: cm",
    "forgot a comma": "write numbers without a unit, and one part on a line",
    "expected ':'": "a loop, a group and a function end in a colon",
    "indented block": "indent the lines in a loop, group or function by four spaces",
    "unindent": "begin a line in the column of its loop, group or function, or of the lines in it",
    "unexpected indent": "only lines in a loop, group or function are indented",
}
_SYNTAX_HINT = "a line is a part, name = number, for _ in ...:, with inside(...):, or def name(...):"
_MIXED = re.compile(r"(?<![\w.])(\d+)[ \t]+(\d+)[ \t]*/[ \t]*0*([1-9]\d*)")  # 5 1/2
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
            raise self.at(1, 1, f"this text has more than {LONGEST:,} letters", "write loops")
        for number, line in enumerate(self.lines, 1):
            for pattern, message, hint in _FORBIDDEN:
                match = re.search(pattern, line)
                if match:
                    raise self.at(number, match.end(), message, hint)
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                return ast.parse(self.text)
        except SyntaxError as error:
            row = min(max(error.lineno or 1, 1), len(self.lines))
            column = min(max(error.offset or 1, 1), len(self.lines[row - 1]) + 1)
            if (error.msg or "").startswith(("unindent", "unexpected indent")):
                column = len(self.lines[row - 1]) - len(self.lines[row - 1].lstrip()) + 1
            message = (error.msg or "").split(";")[0].removeprefix("invalid syntax").strip(". ") or "unexpected word"
            hint = next((hint for words, hint in _SYNTAX_HINTS.items() if words in message), _SYNTAX_HINT)
            if mixed := _MIXED.search(self.lines[row - 1].partition("#")[0]):
                whole, part, parts = (float(digits) for digits in mixed.groups())
                hint = f"write {whole + part / parts:.6g} for {mixed[0]}"
            for word, ours in _WORDS_OF_PYTHON.items():
                message = message.replace(word, ours)
            raise self.at(row, column, f"invalid syntax: {message}", hint) from None
        except (RecursionError, MemoryError):
            raise self.at(1, 1, "this is nested too deeply to be a program", "write plain numbers") from None

    def shown(self, node: Node) -> str:
        """The source of a piece of syntax, on one line and cut where it is long."""
        raw = self.lines[node.lineno - 1].encode()
        end = node.end_col_offset if node.end_lineno == node.lineno else None
        text = raw[node.col_offset : end].decode(errors="replace").strip()
        return text if len(text) <= _SHOWN else text[:_SHOWN] + "..."

    def literal(self, word: str, node: ast.Constant) -> float | None:
        """The number that a constant is, ``None`` for other constants; ``word`` is what holds it, in errors."""
        if isinstance(node.value, bool) or not isinstance(node.value, float | int):
            return None
        try:
            to_float32(float(node.value))
        except (OverflowError, ShapeProgError):
            message = f"{word} holds {self.shown(node)}, which is too large"
            raise self.error(node, message, "numbers end at 3.4028235e+38") from None
        return float(node.value)

    def error(self, node: Node, message: str, hint: str) -> ProgramError:
        """What is wrong at a piece of syntax."""
        before = self.lines[node.lineno - 1].encode()[: node.col_offset]  # ast counts columns in bytes of UTF-8
        return self.at(node.lineno, len(before.decode(errors="replace")) + 1, message, hint)

    def at(self, line: int, column: int, message: str, hint: str) -> ProgramError:
        """What is wrong at a line and column, which count from 1."""
        return ProgramError(message, line=line, column=column, source=self.lines[line - 1], hint=hint, name=self.name)

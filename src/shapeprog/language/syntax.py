"""From program text to programs: a strict subset of Python, read through ``ast``; nothing is ever executed."""

from __future__ import annotations

import ast
import re
import warnings

from shapeprog.errors import ProgramError, ShapeProgError, did_you_mean
from shapeprog.language.parameters import Parameter, to_float32
from shapeprog.language.program import Draw, Loop, Node, Program
from shapeprog.language.statement import Statement, language
from shapeprog.space import AXES

DEEPEST = 64  # levels of loops in text; Python itself ends at 100 levels of indentation

LONGEST = 500_000
"""Letters of the longest text: a syntax tree takes a thousand times the memory of its text."""

_FORBIDDEN = (
    (r"^[^\S\t]*\t(?=.*\S)", "this line is indented with a tab", "indent with four spaces"),
    (r"\0", "there is a null byte in this line", "is this a text file?"),
)
_WORDS_OF_PYTHON = {"positional argument": "a number without a name", "keyword argument": "one with a name"}
_SHOWN = 60


def parse(text: str, name: str = "<program>") -> Program:
    """The program of a text: calls of drawing statements with literal numbers, and ``for`` loops over calls of loops.

    Comments are allowed and forgotten; numbers are rounded to float32.  A ``ProgramError`` says where in ``name``, such
    as a path, the first mistake is, and the nearest name or the legal range.
    """
    text = proper_text(text, name)
    reader = _Reader(re.split(r"\r\n|\r|\n", text), name)
    return Program(reader.body(reader.tree(text).body, 0))


def proper_text(text: str, name: str) -> str:
    """The text without its byte order mark; a ``ProgramError`` if it holds half characters, which no file can show."""
    half = re.search("[\ud800-\udfff]", text)
    if half:
        line, hint = text.count("\n", 0, half.start()) + 1, "is this a text file in UTF-8?"
        raise ProgramError("this line holds half a character", line=line, hint=hint, name=name)
    return text.removeprefix("\ufeff")


class _Reader:
    """Turns syntax into nodes and knows the place of every mistake."""

    def __init__(self, lines: list[str], name: str) -> None:
        self.lines = lines
        self.name = name

    def tree(self, text: str) -> ast.Module:
        if len(text) > LONGEST:
            raise self._at(1, 1, f"this text has more than {LONGEST:,} letters", "keep such a program as .json")
        for number, line in enumerate(self.lines, 1):
            for pattern, message, hint in _FORBIDDEN:
                found = re.search(pattern, line)
                if found:
                    raise self._at(number, found.end(), message, hint)
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                return ast.parse(text)
        except SyntaxError as error:
            row = min(max(error.lineno or 1, 1), len(self.lines))
            column = min(max(error.offset or 1, 1), len(self.lines[row - 1]) + 1)
            said = (error.msg or "invalid syntax").split(";")[0]
            for word, ours in _WORDS_OF_PYTHON.items():
                said = said.replace(word, ours)
            hint = "a line is name(parameter=number, ...) or a for loop"
            raise self._at(row, column, f"this cannot be read: {said}", hint) from None
        except (RecursionError, MemoryError):
            raise self._at(1, 1, "this is nested too deeply to be a program", "write plain numbers") from None

    def body(self, statements: list[ast.stmt], depth: int) -> tuple[Node, ...]:
        if depth and len(statements) == 1 and isinstance(statements[0], ast.Pass):
            return ()
        return tuple(self._node(statement, depth) for statement in statements)

    def _node(self, statement: ast.stmt, depth: int) -> Node:
        if isinstance(statement, ast.For):
            return self._loop(statement, depth)
        if not isinstance(statement, ast.Expr):
            hint = "write name(parameter=number, ...) or for i in loop(count, ...):"
            raise self._error(statement, "a program holds only drawing statements and for loops", hint)
        role, solid = self._role(statement.value)
        declared, call = self._call(solid, "statement")
        if declared.is_loop:
            raise self._misused(call, f"{declared.name} is a loop and draws nothing itself", declared)
        if declared.name == role:
            raise self._error(call, f"{role} is a {role} without being called one", f"write {declared.signature}")
        return Draw(declared.name, self._values(declared, call), role)

    def _role(self, node: ast.expr) -> tuple[str, ast.expr]:
        """The role that is put around a call, and what it is put around; no role and the same if there is none."""
        roles = language().roles
        if not isinstance(node, ast.Call) or not isinstance(node.func, ast.Name) or node.func.id not in roles:
            return "", node
        role = node.func.id
        if len(node.args) == 1 and isinstance(node.args[0], ast.Call) and not node.keywords:
            return role, node.args[0]
        if role in language() and not any(isinstance(each, ast.Call) for each in node.args):
            return "", node
        said = f"{role} is what a part is for, and stands around one solid"
        raise self._error(node, said, f"write {role}(box(at=(_, _, _), size=(_, _, _))), or another solid")

    def _loop(self, statement: ast.For, depth: int) -> Loop:
        if depth >= DEEPEST:
            raise self._error(statement, f"loops are nested more than {DEEPEST} deep", "put some of them side by side")
        if not isinstance(statement.target, ast.Name):
            raise self._error(statement.target, "a loop has one variable", "write for i in loop(count, ...):")
        if statement.orelse:
            raise self._error(statement.orelse[0], "a loop of the language has no else", "leave it out")
        declared, call = self._call(statement.iter, "loop")
        if not declared.is_loop:
            raise self._misused(call, f"{declared.name} draws and repeats nothing", declared)
        return Loop(declared.name, self._values(declared, call), self.body(statement.body, depth + 1))

    def _call(self, node: ast.expr, wanted: str) -> tuple[Statement, ast.Call]:
        """The declaration that a call names; ``wanted`` is the kind of word that fits the place."""
        known = language()
        function = node.func if isinstance(node, ast.Call) else node
        if not isinstance(function, ast.Name):
            hint = f"write the name of a {wanted} and its parameters"
            raise self._error(node, f"{self._shown(node)} is no {wanted}", hint)
        if function.id not in known:
            fitting = [declared.name for declared in known if declared.is_loop == (wanted == "loop")]
            fitting += [] if wanted == "loop" else known.roles
            raise self._error(function, f"no {wanted} is called {function.id!r}", did_you_mean(function.id, fitting))
        declared = known[function.id]
        if not isinstance(node, ast.Call):
            raise self._misused(node, f"{declared.name} lacks its parameters", declared)
        return declared, node

    def _values(self, declared: Statement, call: ast.Call) -> tuple[float, ...]:
        parameters = {parameter.name: parameter for parameter in declared.parameters}
        found: dict[str, list[float]] = {}
        for argument in call.args:
            if not declared.is_loop or found or isinstance(argument, ast.Starred):
                allowed = f"only its {declared.first.name}" if declared.is_loop else "nothing"
                raise self._misused(argument, f"{declared.name} takes {allowed} without a name", declared)
            found[declared.first.name] = self._numbers(declared, declared.first, argument)
        for word in call.keywords:
            if word.arg is None or word.arg not in parameters:
                what = f"parameter {word.arg!r}" if word.arg else "parameter **"
                raise self._error(word, f"{declared.name} has no {what}", did_you_mean(word.arg or "", parameters))
            if word.arg in found:
                raise self._error(word, f"{word.arg} of {declared.name} is given twice", "leave one of them out")
            found[word.arg] = self._numbers(declared, parameters[word.arg], word.value)
        for name, parameter in parameters.items():
            if name not in found and (silent := parameter.unsaid) is not None:
                found[name] = [silent]
            if name not in found:
                raise self._misused(call, f"{declared.name} lacks {name}", declared)
        return tuple(number for name in parameters for number in found[name])

    def _numbers(self, declared: Statement, parameter: Parameter, node: ast.expr) -> list[float]:
        place = f"{parameter.name} of {declared.name}"
        if isinstance(node, ast.Tuple) and parameter.quantity.width == 1:
            raise self._error(node, f"{place} takes 1 number, not a group", f"write {parameter.blank}")
        if parameter.quantity.kind == "axis":
            numbers = [self._axis(place, node, parameter)]
        else:
            numbers = [self._number(place, each) for each in (node.elts if isinstance(node, ast.Tuple) else [node])]
        try:
            return parameter.checked(declared.name, numbers)
        except ShapeProgError as mistake:
            raise self._error(node, mistake.message, mistake.hint) from None

    def _axis(self, place: str, node: ast.expr, parameter: Parameter) -> float:
        if isinstance(node, ast.Name) and node.id in AXES:
            return float(AXES.index(node.id))
        said = f"{place} holds {self._shown(node)}, which is no axis"
        hint = did_you_mean(node.id, AXES) if isinstance(node, ast.Name) else ""
        raise self._error(node, said, hint or f"it is {parameter.quantity.range_text}")

    def _number(self, place: str, node: ast.expr) -> float:
        sign, bare = 1.0, node
        if isinstance(node, ast.UnaryOp) and isinstance(node.op, (ast.USub, ast.UAdd)):
            sign, bare = (-1.0 if isinstance(node.op, ast.USub) else 1.0), node.operand
        if not isinstance(bare, ast.Constant) or type(bare.value) not in (int, float):
            said = f"{place} holds {self._shown(node)}, which is not a number"
            raise self._error(node, said, "write plain numbers such as 4 or -2.5")
        try:
            number = sign * float(bare.value)  # type: ignore[arg-type]
            to_float32(number)
        except (OverflowError, ShapeProgError):
            said = f"{place} holds {self._shown(node)}, which is too large"
            raise self._error(node, said, "numbers end at 3.4028235e+38") from None
        return number

    def _shown(self, node: ast.expr) -> str:
        """The source of an expression, on one line and cut where it is long."""
        raw = self.lines[node.lineno - 1].encode()
        end = node.end_col_offset if node.end_lineno == node.lineno else None
        text = raw[node.col_offset : end].decode(errors="replace").strip()
        return text if len(text) <= _SHOWN else text[:_SHOWN] + "..."

    def _misused(self, node: ast.expr, message: str, declared: Statement) -> ProgramError:
        return self._error(node, message, f"write {declared.signature}")

    def _error(self, node: ast.stmt | ast.expr | ast.keyword, message: str, hint: str) -> ProgramError:
        before = self.lines[node.lineno - 1].encode()[: node.col_offset]  # ast counts columns in bytes of UTF-8
        return self._at(node.lineno, len(before.decode(errors="replace")) + 1, message, hint)

    def _at(self, line: int, column: int, message: str, hint: str) -> ProgramError:
        return ProgramError(message, line=line, column=column, source=self.lines[line - 1], hint=hint, name=self.name)

"""Statements in cells: ``leg(at=(0, 0, 0), size=(4, 1, 1))``, with plain numbers alone."""

from __future__ import annotations

import ast
from collections.abc import Sequence

from shapeprog.errors import ProgramError, ShapeProgError, did_you_mean
from shapeprog.language.parameters import Parameter
from shapeprog.language.program import DEEPEST, Draw, Loop, Node, Program
from shapeprog.language.statement import Statement, language
from shapeprog.language.text import Text
from shapeprog.language.unit import HEAD
from shapeprog.space import AXES

_PLACED = "names, functions and units are for parts placed by keywords, such as leg(left=0, width=2)"
_LOOP = "write for i in loop(count, ...):"


def parse_cells(text: Text, tree: ast.Module) -> Program:
    """The program of a text with statements in cells, without its comments.

    A ``ProgramError`` has the line and column of a mistake.
    """
    for row, line in enumerate(text.lines, 1):
        if line.replace(" ", "").startswith(f"#{HEAD}"):
            raise text.at(row, 1, "statements in cells have no unit", _PLACED)
    return Program(_Reader(text).body(tree.body))


class _Reader:
    """Reads statements and loops in cells."""

    def __init__(self, text: Text) -> None:
        self.text = text

    def body(self, statements: Sequence[ast.stmt], depth: int = 0) -> tuple[Node, ...]:
        """The statements and loops of a block inside of ``depth`` loops."""
        return tuple(self._node(node, depth) for node in statements if not isinstance(node, ast.Pass))

    def _node(self, node: ast.stmt, depth: int) -> Node:
        if isinstance(node, ast.For):
            return self._loop(node, depth)
        if not isinstance(node, ast.Expr):
            raise self.text.error(node, "this is no statement of a program in cells", _PLACED)
        role, inner = self._role(node.value)
        declared, call = self._declared(inner, "statement")
        if declared.is_loop:
            raise self._misused(call, f"{declared.name} is a loop, not a drawing statement", declared)
        if declared.name == role:
            message = f"redundant role: {role}(...) already has the role {role!r}"
            raise self._misused(call, message, declared)
        return Draw(declared.name, self._values(declared, call), role)

    def _role(self, node: ast.expr) -> tuple[str, ast.expr]:
        """The role that is put around a call, and what it is put around; no role and the same if there is none."""
        roles = language().roles
        if not isinstance(node, ast.Call) or not isinstance(node.func, ast.Name) or node.func.id not in roles:
            return "", node
        role = node.func.id
        if len(node.args) == 1 and isinstance(node.args[0], ast.Call) and not node.keywords:
            return role, node.args[0]
        if role in language() and not any(isinstance(argument, ast.Call) for argument in node.args):
            return "", node
        hint = f"write {role}(box(at=(_, _, _), size=(_, _, _))), or another solid"
        raise self.text.error(node, f"{role} is a role: it takes one solid", hint)

    def _loop(self, node: ast.For, depth: int) -> Loop:
        if depth >= DEEPEST:
            message = f"loops are nested more than {DEEPEST} deep"
            raise self.text.error(node, message, "put some of them side by side")
        if not isinstance(node.target, ast.Name):
            raise self.text.error(node.target, "a loop has one variable", _LOOP)
        if node.orelse:
            raise self.text.error(node.orelse[0], "loops have no else", "leave it out")
        declared, call = self._declared(node.iter, "loop")
        if not declared.is_loop:
            raise self._misused(call, f"{declared.name} is a drawing statement, not a loop", declared)
        return Loop(declared.name, self._values(declared, call), self.body(node.body, depth + 1))

    def _declared(self, node: ast.expr, kind: str) -> tuple[Statement, ast.Call]:
        """The declaration that a call names; ``kind`` is ``statement`` or ``loop``."""
        registry = language()
        function = node.func if isinstance(node, ast.Call) else node
        if not isinstance(function, ast.Name):
            hint = f"write the name of a {kind} and its parameters"
            raise self.text.error(node, f"{self.text.shown(node)} is not a {kind}", hint)
        if function.id not in registry:
            fitting = [declared.name for declared in registry if declared.is_loop == (kind == "loop")]
            fitting += [] if kind == "loop" else registry.roles
            hint = did_you_mean(function.id, fitting)
            if kind == "statement":
                own = "A statement of your own needs --with, in Python sp.load_statements."
                hint = f"{hint} {own}" if hint.endswith("?") else f"{hint}. {own}"
            raise self.text.error(function, f"unknown {kind} {function.id!r}", hint)
        declared = registry[function.id]
        if not isinstance(node, ast.Call):
            raise self._misused(node, f"{declared.name} needs parameters", declared)
        return declared, node

    def _values(self, declared: Statement, call: ast.Call) -> tuple[float, ...]:
        """The values of a statement or loop in slot order."""
        parameters = {parameter.name: parameter for parameter in declared.parameters}
        numbers: dict[str, list[float]] = {}
        for argument in call.args:
            if not declared.is_loop or numbers or isinstance(argument, ast.Starred):
                allowed = f"only its {declared.first.name}" if declared.is_loop else "nothing"
                raise self._misused(argument, f"{declared.name} takes {allowed} without a name", declared)
            numbers[declared.first.name] = self._numbers(declared, declared.first, argument)
        for keyword in call.keywords:
            word = keyword.arg or ""
            if word not in parameters:
                what = f"parameter {word!r}" if word else "parameter **"
                raise self.text.error(keyword, f"{declared.name} has no {what}", did_you_mean(word, parameters))
            if word in numbers:
                raise self.text.error(keyword, f"{word} of {declared.name} is given twice", "leave one of them out")
            numbers[word] = self._numbers(declared, parameters[word], keyword.value)
        for name, parameter in parameters.items():
            if name not in numbers and (default := parameter.unsaid) is not None:
                numbers[name] = [default]
            if name not in numbers:
                raise self._misused(call, f"{declared.name} needs {name}", declared)
        return tuple(value for name in parameters for value in numbers[name])

    def _numbers(self, declared: Statement, parameter: Parameter, node: ast.expr) -> list[float]:
        """The numbers of one parameter, checked and rounded to float32."""
        word = f"{parameter.name} of {declared.name}"
        if isinstance(node, ast.Tuple) and parameter.quantity.width == 1:
            raise self.text.error(node, f"{word} takes 1 number, not a group", f"write {parameter.blank}")
        if parameter.quantity.kind == "axis":
            axis = node.id if isinstance(node, ast.Name) else ""
            if axis not in AXES:
                message = f"{word} holds {self.text.shown(node)}, which is not an axis"
                hint = (axis and did_you_mean(axis, AXES)) or f"it is {parameter.quantity.range_text}"
                raise self.text.error(node, message, hint)
            return [float(AXES.index(axis))]
        values = [self._number(word, item) for item in (node.elts if isinstance(node, ast.Tuple) else [node])]
        try:
            return parameter.checked(declared.name, values)
        except ShapeProgError as mistake:
            raise self.text.error(node, mistake.message, mistake.hint) from None

    def _number(self, word: str, node: ast.expr) -> float:
        sign, unsigned = 1.0, node
        while isinstance(unsigned, ast.UnaryOp) and isinstance(unsigned.op, ast.UAdd | ast.USub):
            sign, unsigned = (-sign if isinstance(unsigned.op, ast.USub) else sign), unsigned.operand
        if not isinstance(unsigned, ast.Constant) or (number := self.text.literal(word, unsigned)) is None:
            hint = "write numbers such as 4 or -2.5: names and expressions are for parts placed by keywords"
            raise self.text.error(node, f"{word} holds {self.text.shown(node)}, which is not a number", hint)
        return sign * number

    def _misused(self, node: ast.expr, message: str, declared: Statement) -> ProgramError:
        """A mistake in the call of a statement or loop, with how it is written."""
        return self.text.error(node, message, f"write {declared.signature}")

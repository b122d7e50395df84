"""The numbers in a program text: literals, and expressions of names with + - * /."""

from __future__ import annotations

import ast
from collections.abc import Sequence

from shapeprog.errors import ProgramError, ShapeProgError, did_you_mean
from shapeprog.language.expression import Binary, Expression, Name, Negative, Operator, Value
from shapeprog.language.parameters import Parameter, to_float32
from shapeprog.language.place import Node, Text
from shapeprog.language.program import DEEPEST
from shapeprog.language.statement import Statement
from shapeprog.space import AXES

_OPERATORS: dict[type[ast.operator], Operator] = {ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/"}
_PLAIN = "write numbers such as 4 or -2.5, or names of numbers, with + - * / between them"


def checked_values(parameter: Parameter, owner: str, values: Sequence[Value]) -> list[Value]:
    """The numbers of a parameter in a call of ``owner``, of which the plain ones are checked and rounded to float32."""
    plain = [0.0 if isinstance(value, Expression) else value for value in values]
    checked = parameter.checked(owner, plain)
    return [old if isinstance(old, Expression) else new for old, new in zip(values, checked, strict=True)]


def parse_number(text: str, name: str = "<number>") -> Value:
    """A number or expression from its text; a ``ProgramError`` if it is none."""
    whole = Text(text, name)
    match whole.tree().body:
        case [ast.Expr(value)]:
            return Numbers(whole).one("this", value)
    raise whole.at(1, 1, "this is not a number", _PLAIN)


class Numbers:
    """Reads the numbers of a text; ``places`` says where each expression stands, by its ``id``."""

    def __init__(self, text: Text) -> None:
        self.text = text
        self.places: dict[int, Node] = {}

    def of_call(self, declared: Statement, call: ast.Call) -> tuple[tuple[Value, ...], dict[int, Node]]:
        """The numbers in the call of a statement or loop in slot order, and where they stand by slot."""
        parameters = {parameter.name: parameter for parameter in declared.parameters}
        found: dict[str, list[Value]] = {}
        places: dict[int, Node] = {}

        def take(parameter: Parameter, node: ast.expr) -> None:
            found[parameter.name] = self._group(declared, parameter, node)
            each = node.elts if isinstance(node, ast.Tuple) else [node]
            places.update(enumerate(each, parameter.start))

        for argument in call.args:
            if not declared.is_loop or found or isinstance(argument, ast.Starred):
                allowed = f"only its {declared.first.name}" if declared.is_loop else "nothing"
                raise self.misused(argument, f"{declared.name} takes {allowed} without a name", declared)
            take(declared.first, argument)
        for word in call.keywords:
            if word.arg is None or word.arg not in parameters:
                what = f"parameter {word.arg!r}" if word.arg else "parameter **"
                hint = did_you_mean(word.arg or "", parameters)
                raise self.text.error(word, f"{declared.name} has no {what}", hint)
            if word.arg in found:
                raise self.text.error(word, f"{word.arg} of {declared.name} is given twice", "leave one of them out")
            take(parameters[word.arg], word.value)
        for name, parameter in parameters.items():
            if name not in found and (silent := parameter.unsaid) is not None:
                found[name] = [silent]
            if name not in found:
                raise self.misused(call, f"{declared.name} needs {name}", declared)
        return tuple(number for name in parameters for number in found[name]), places

    def misused(self, node: ast.expr, message: str, declared: Statement) -> ProgramError:
        """A mistake in the call of a statement or loop, with how it is written."""
        return self.text.error(node, message, f"write {declared.signature}")

    def _group(self, declared: Statement, parameter: Parameter, node: ast.expr) -> list[Value]:
        """The numbers of one parameter; what is a plain number is checked already."""
        place = f"{parameter.name} of {declared.name}"
        if isinstance(node, ast.Tuple) and parameter.quantity.width == 1:
            raise self.text.error(node, f"{place} takes 1 number, not a group", f"write {parameter.blank}")
        values: list[Value]
        if parameter.quantity.kind == "axis":
            values = [self._axis(place, node, parameter)]
        else:
            values = [self._read(place, each, 0) for each in (node.elts if isinstance(node, ast.Tuple) else [node])]
        try:
            return checked_values(parameter, declared.name, values)
        except ShapeProgError as mistake:
            raise self.text.error(node, mistake.message, mistake.hint) from None

    def _axis(self, place: str, node: ast.expr, parameter: Parameter) -> float:
        if isinstance(node, ast.Name) and node.id in AXES:
            return float(AXES.index(node.id))
        said = f"{place} holds {self.text.shown(node)}, which is not an axis"
        hint = did_you_mean(node.id, AXES) if isinstance(node, ast.Name) else ""
        raise self.text.error(node, said, hint or f"it is {parameter.quantity.range_text}")

    def one(self, place: str, node: ast.expr) -> Value:
        """A number by itself, exact in float32, or an expression; ``place`` is what holds it, in errors."""
        value = self._read(place, node, 0)
        return value if isinstance(value, Expression) else to_float32(value)

    def _read(self, place: str, node: ast.expr, depth: int) -> Value:
        if depth > DEEPEST:
            cure = "give a part of it a name of its own"
            raise self.text.error(node, f"{place} holds an expression of more than {DEEPEST} levels", cure)
        match node:
            case ast.Constant(float() | int() as number) if not isinstance(number, bool):
                return self._literal(place, node, number)
            case ast.Name(word):
                return self._placed(Name(word), node)
            case ast.UnaryOp(ast.UAdd(), inner):
                return self._read(place, inner, depth + 1)
            case ast.UnaryOp(ast.USub(), inner):
                value = self._read(place, inner, depth + 1)
                return self._placed(Negative(value), node) if isinstance(value, Expression) else -value
            case ast.BinOp(left, operator, right) if type(operator) in _OPERATORS:
                sides = self._read(place, left, depth + 1), self._read(place, right, depth + 1)
                return self._placed(Binary(_OPERATORS[type(operator)], *sides), node)
        raise self.text.error(node, f"{place} holds {self.text.shown(node)}, which is not a number", _PLAIN)

    def _literal(self, place: str, node: ast.expr, number: float) -> float:
        try:
            to_float32(float(number))
        except (OverflowError, ShapeProgError):
            said = f"{place} holds {self.text.shown(node)}, which is too large"
            raise self.text.error(node, said, "numbers end at 3.4028235e+38") from None
        return float(number)

    def _placed(self, expression: Expression, node: ast.expr) -> Expression:
        self.places[id(expression)] = node
        return expression

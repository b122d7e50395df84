"""Statements in cells: ``leg(at=(0, 0, 0), size=(4, 1, 1))``, with names, expressions and functions if wanted."""

from __future__ import annotations

import ast
import math

from shapeprog.errors import ProgramError, ShapeProgError, did_you_mean
from shapeprog.language.ast import Call, Draw, Fault, Line, Loop, Source
from shapeprog.language.evaluate import evaluated
from shapeprog.language.expression import Expression, Value
from shapeprog.language.parameters import Parameter
from shapeprog.language.program import DEEPEST, Program
from shapeprog.language.reader import Block, Comments, Names, Reader
from shapeprog.language.statement import Statement, language
from shapeprog.language.text import Node, Text
from shapeprog.language.unit import read_unit
from shapeprog.space import AXES


def parse_cells(text: Text, tree: ast.Module) -> Program:
    """The program of a text with statements in cells.

    Comments are kept where there are names, expressions, functions or a unit; any other program is its statements
    alone.  A ``ProgramError`` has the line and column of a mistake.
    """
    unit, lines = read_unit(text, tree.body[0].lineno if tree.body else math.inf)
    named = unit is not None or any(isinstance(node, ast.Assign | ast.FunctionDef) for node in tree.body)
    reader = _Reader(text, tree, Comments(lines if named else ()))
    source = Source(reader.lines(), unit, warnings=reader.warnings())
    if not named and not source.plain:  # comments take time, and are read where they are kept
        reader = _Reader(text, tree, Comments(lines))
        source = Source(reader.lines(), unit, warnings=reader.warnings())
    try:
        return evaluated(source)
    except Fault as fault:
        raise reader.located(fault) from None


class _Reader(Reader):
    """Reads statements in cells."""

    def __init__(self, text: Text, tree: ast.Module, comments: Comments) -> None:
        super().__init__(text, tree, comments)
        calls = (node.func for node in ast.walk(tree) if isinstance(node, ast.Call))
        self.called = {function.id for function in calls if isinstance(function, ast.Name)}

    def reserved(self, word: str, kind: str) -> str:
        """Statements, loops and roles are no functions, nor names where the text uses them."""
        known = word in language() or word in language().roles
        if known and (kind == "function" or word in self.called):
            return f"{word!r} is a word of the language"
        return ""

    def element(self, call: ast.Call, scope: Names) -> Line:
        """A statement, or a call of a function, with a role around it or without."""
        role, inner = self._role(call)
        name = inner.func.id if isinstance(inner, ast.Call) and isinstance(inner.func, ast.Name) else ""
        if isinstance(inner, ast.Call) and name not in language() and name in self.later:
            return self._function_call(inner, name, role, scope)
        declared, solid = self._statement(inner, "statement")
        if declared.is_loop:
            raise self.misused(solid, f"{declared.name} is a loop, not a drawing statement", declared)
        if declared.name == role:
            message = f"redundant role: {role}(...) already has the role {role!r}"
            raise self.error(solid, message, f"write {declared.signature}")
        values, places = self._values(declared, solid, scope)
        return self.recorded(Draw(declared.name, values, role, self.note(call)), call, places)

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
        message = f"{role} is a role: it takes one solid or one call of a function"
        raise self.error(node, message, f"write {role}(box(at=(_, _, _), size=(_, _, _))), or another solid")

    def loop(self, node: ast.For | ast.With, block: Block) -> Line:
        """A loop."""
        hint = "write for i in loop(count, ...):"
        self.require(isinstance(node, ast.For), node, "this is no statement of a program in cells", hint)
        assert isinstance(node, ast.For)
        if block.depth >= DEEPEST:
            message = f"loops are nested more than {DEEPEST} deep"
            raise self.error(node, message, "put some of them side by side")
        if not isinstance(node.target, ast.Name):
            raise self.error(node.target, "a loop has one variable", hint)
        if node.orelse:
            raise self.error(node.orelse[0], "loops have no else", "leave it out")
        word = node.target.id
        if word in block.scope or word in self.later:
            message = f"the variable {word} of this loop has the name of a number or function"
            raise self.error(node.target, message, "give the variable another name, such as i")
        self.variables[word] = node.target
        declared, call = self._statement(node.iter, "loop")
        if not declared.is_loop:
            raise self.misused(call, f"{declared.name} is a drawing statement, not a loop", declared)
        values, places = self._values(declared, call, block.scope)
        note = self.note(node.iter)
        body = self.body(node.body, block._replace(depth=block.depth + 1))
        return self.recorded(Loop(declared.name, values, body, note), node, places)

    def _values(self, declared: Statement, call: ast.Call, scope: Names) -> tuple[tuple[Value, ...], dict[str, Node]]:
        """The values of a statement or loop in slot order, and where they stand by slot."""
        parameters = {parameter.name: parameter for parameter in declared.parameters}
        numbers: dict[str, list[Value]] = {}
        places: dict[str, Node] = {}

        def take(parameter: Parameter, node: ast.expr) -> None:
            numbers[parameter.name] = self._group(declared, parameter, node)
            nodes = node.elts if isinstance(node, ast.Tuple) else [node]
            places.update({str(slot): each for slot, each in enumerate(nodes, parameter.start)})

        for argument in call.args:
            if not declared.is_loop or numbers or isinstance(argument, ast.Starred):
                allowed = f"only its {declared.first.name}" if declared.is_loop else "nothing"
                raise self.misused(argument, f"{declared.name} takes {allowed} without a name", declared)
            take(declared.first, argument)
        for keyword in call.keywords:
            word = keyword.arg or ""
            if word not in parameters:
                what = f"parameter {word!r}" if word else "parameter **"
                raise self.error(keyword, f"{declared.name} has no {what}", did_you_mean(word, parameters))
            if word in numbers:
                raise self.error(keyword, f"{word} of {declared.name} is given twice", "leave one of them out")
            take(parameters[word], keyword.value)
        for name, parameter in parameters.items():
            if name not in numbers and (default := parameter.unsaid) is not None:
                numbers[name] = [default]
            if name not in numbers:
                raise self.misused(call, f"{declared.name} needs {name}", declared)
        values = tuple(value for name in parameters for value in numbers[name])
        for value in values:
            self.use(value, scope)
        return values, places

    def _group(self, declared: Statement, parameter: Parameter, node: ast.expr) -> list[Value]:
        """The numbers of one parameter, of which the plain ones are checked and rounded to float32."""
        word = f"{parameter.name} of {declared.name}"
        if isinstance(node, ast.Tuple) and parameter.quantity.width == 1:
            raise self.error(node, f"{word} takes 1 number, not a group", f"write {parameter.blank}")
        values: list[Value]
        if parameter.quantity.kind == "axis":
            axis = node.id if isinstance(node, ast.Name) else ""
            if axis not in AXES:
                message = f"{word} holds {self.text.shown(node)}, which is not an axis"
                hint = (axis and did_you_mean(axis, AXES)) or f"it is {parameter.quantity.range_text}"
                raise self.error(node, message, hint)
            values = [float(AXES.index(axis))]
        else:
            values = [self.number(word, each) for each in (node.elts if isinstance(node, ast.Tuple) else [node])]
        try:
            plain = [0.0 if isinstance(value, Expression) else value for value in values]
            checked = parameter.checked(declared.name, plain)
        except ShapeProgError as mistake:
            raise self.error(node, mistake.message, mistake.hint) from None
        return [old if isinstance(old, Expression) else new for old, new in zip(values, checked, strict=True)]

    def misused(self, node: ast.expr, message: str, declared: Statement) -> ProgramError:
        """A mistake in the call of a statement or loop, with how it is written."""
        return self.error(node, message, f"write {declared.signature}")

    def _statement(self, node: ast.expr, wanted: str) -> tuple[Statement, ast.Call]:
        """The declaration that a call names; ``wanted`` is the kind of word that fits the place."""
        known = language()
        function = node.func if isinstance(node, ast.Call) else node
        if not isinstance(function, ast.Name):
            hint = f"write the name of a {wanted} and its parameters"
            raise self.error(node, f"{self.text.shown(node)} is not a {wanted}", hint)
        if function.id not in known:
            fitting = [declared.name for declared in known if declared.is_loop == (wanted == "loop")]
            fitting += [] if wanted == "loop" else [*known.roles, *self.later]
            hint = did_you_mean(function.id, fitting)
            raise self.error(function, f"unknown {wanted} {function.id!r}", hint)
        declared = known[function.id]
        if not isinstance(node, ast.Call):
            raise self.misused(node, f"{declared.name} needs parameters", declared)
        return declared, node

    def _function_call(self, call: ast.Call, name: str, role: str, scope: Names) -> Line:
        """A call of a function, whose first arguments may stand without their names."""
        if name not in self.functions:
            inside = name in self.function_names
            message = f"{name} calls itself" if inside else f"the function {name} is defined further down"
            hint = "use a loop: functions call only those above them" if inside else "move it above this line"
            raise self.error(call, message, hint)
        self.function_names[name].used = True
        parameters = dict(self.functions[name].parameters)
        words, arguments, places = [*parameters], dict[str, Value](), dict[str, Node]()
        signature = f"{name}({', '.join(f'{word}=_' for word in words)})"
        if len(call.args) > len(words):
            message = f"{name} takes {len(words)} numbers, not {len(call.args)}"
            raise self.error(call.args[len(words)], message, "leave the others out")
        for word, argument in zip(words, call.args, strict=False):
            arguments[word], places[word] = self.value(f"{word} of {name}", argument, scope), argument
        for keyword in call.keywords:
            word = keyword.arg or "**"
            if word not in parameters:
                hint = did_you_mean(word, parameters, f"write {signature}")
                raise self.error(keyword, f"{name} has no parameter {word!r}", hint)
            if word in arguments:
                raise self.error(keyword, f"{word} of {name} is given twice", "leave one of them out")
            arguments[word], places[word] = self.value(f"{word} of {name}", keyword.value, scope), keyword
        for word, default in parameters.items():
            if default is None and word not in arguments:
                raise self.error(call, f"{name} needs {word}", f"write {signature}")
        ordered = tuple((word, arguments[word]) for word in words if word in arguments)
        return self.recorded(Call(name, ordered, self.note(call), role), call, places)

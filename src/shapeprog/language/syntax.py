"""From program text to programs: a strict subset of Python, read through ``ast``; nothing is ever executed."""

from __future__ import annotations

import ast
import math
from collections.abc import Mapping

from shapeprog.errors import ProgramError, did_you_mean
from shapeprog.language.checking import Fault, misnamed
from shapeprog.language.comments import Comments
from shapeprog.language.evaluation import evaluated
from shapeprog.language.expression import Name, Value
from shapeprog.language.numbers import Numbers
from shapeprog.language.place import Node, Text
from shapeprog.language.program import DEEPEST, Program
from shapeprog.language.source import (
    Assignment,
    Call,
    Comment,
    Function,
    Line,
    Source,
    WrittenDraw,
    WrittenLoop,
    names_of,
    tidy,
)
from shapeprog.language.statement import Statement, language
from shapeprog.language.unit import read_unit

_CALL = "name(parameter=number, ...)"


def parse(text: str, name: str = "<program>") -> Program:
    """The program of a text: drawing statements, ``for`` loops over calls of loops, named numbers and functions.

    Wherever a number may stand, an expression of numbers and names with + - * / may.  Numbers are rounded to float32.
    Comments are kept where there are names, expressions, functions or a unit; any other program is its statements
    alone.  A ``ProgramError`` says where in ``name``, such as a path, a mistake is, and the nearest name or the legal
    range.
    """
    whole = Text(text, name)
    tree = whole.tree()
    unit, lines = read_unit(whole, tree.body[0].lineno if tree.body else math.inf)
    reader = _Reader(whole, tree, Comments())
    source = Source(reader.body(tree.body), unit)
    if not source.plain or unit is not None:  # comments take time, and are looked for where they are kept
        reader = _Reader(whole, tree, Comments(lines))
        source = Source(reader.body(tree.body), unit)
    try:
        reader.check_variables(source)
        return evaluated(source)
    except Fault as fault:
        raise reader.placed(fault) from None


class _Reader:
    """Turns syntax into lines and knows the place of every mistake."""

    def __init__(self, text: Text, tree: ast.Module, comments: Comments) -> None:
        self.text = text
        self.comments = comments
        self.numbers = Numbers(text)
        self.functions = {node.name: node for node in tree.body if isinstance(node, ast.FunctionDef)}
        self.variables: dict[str, ast.expr] = {}
        self.places: dict[tuple[int, int | str], Node] = {}

    def placed(self, fault: Fault) -> ProgramError:
        """A fault in the lines that were read, at its place in the text."""
        key = (id(fault.line), fault.key)
        node = self.numbers.places.get(id(fault.expression)) or self.places.get(key) or self.places[key[0], ""]
        if isinstance(fault.expression, Name) and fault.expression.name in self.variables:
            said = f"{fault.expression.name} is the variable of a loop, not a number"
            return self.text.error(node, said, "the parameters of the loop define how it moves its copies")
        return self.text.error(node, fault.message, fault.hint)

    def check_variables(self, source: Source) -> None:
        """Refuse variables of loops that are called like a number or function."""
        for name in [*names_of(source), *source.functions]:
            if name in self.variables:
                said = f"the variable {name} of this loop has the name of a number or function"
                raise self.text.error(self.variables[name], said, "give the variable another name, such as i")

    def body(self, statements: list[ast.stmt], depth: int = 0, end: float = math.inf) -> tuple[Line, ...]:
        """The lines of a block that ends above the row ``end``; ``depth`` is how many loops and functions it is in."""
        found: list[Line] = []
        ends = [*(each.lineno for each in statements), end][1:]
        for statement, following in zip(statements, ends, strict=True):
            found += self.comments.before(statement.lineno)
            if depth and len(statements) == 1 and isinstance(statement, ast.Pass):
                found += [Comment(note)] if (note := self.comments.note(statement.lineno)) else []
            else:
                found.append(self._line(statement, depth, following))
        column = statements[0].col_offset + 1 if depth else 1
        return tidy((*found, *self.comments.ending(column, end)))

    def _line(self, statement: ast.stmt, depth: int, end: float) -> Line:
        match statement:
            case ast.For():
                return self._loop(statement, depth, end)
            case ast.FunctionDef():
                return self._function(statement, depth, end)
            case ast.Assign():
                return self._assignment(statement)
            case ast.Expr(value):
                role, inner = self._role(value)
                match inner:
                    case ast.Call(ast.Name(name)) if name in self.functions and name not in language():
                        return self._function_call(statement, inner, name, role)
                return self._draw(statement, role, inner)
        said = "a program holds only drawing statements, named numbers, for loops and functions"
        raise self.text.error(statement, said, f"write {_CALL} or for i in loop(count, ...):")

    def _draw(self, statement: ast.stmt, role: str, solid: ast.expr) -> Line:
        declared, call = self._call(solid, "statement")
        if declared.is_loop:
            raise self.numbers.misused(call, f"{declared.name} is a loop, not a drawing statement", declared)
        if declared.name == role:
            said = f"redundant role: {role}(...) already has the role {role!r}"
            raise self.text.error(call, said, f"write {declared.signature}")
        values, places = self.numbers.of_call(declared, call)
        return self._kept(WrittenDraw(declared.name, values, role, self._note(statement)), statement, places)

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
        said = f"{role} is a role: it takes one solid or one call of a function"
        raise self.text.error(node, said, f"write {role}(box(at=(_, _, _), size=(_, _, _))), or another solid")

    def _loop(self, statement: ast.For, depth: int, end: float) -> Line:
        if depth >= DEEPEST:
            said = f"loops are nested more than {DEEPEST} deep"
            raise self.text.error(statement, said, "put some of them side by side")
        if not isinstance(statement.target, ast.Name):
            raise self.text.error(statement.target, "a loop has one variable", "write for i in loop(count, ...):")
        if statement.orelse:
            raise self.text.error(statement.orelse[0], "loops have no else", "leave it out")
        self.variables[statement.target.id] = statement.target
        declared, call = self._call(statement.iter, "loop")
        if not declared.is_loop:
            raise self.numbers.misused(call, f"{declared.name} is a drawing statement, not a loop", declared)
        values, places = self.numbers.of_call(declared, call)
        note = self._note(statement.iter)
        body = self.body(statement.body, depth + 1, end)
        return self._kept(WrittenLoop(declared.name, values, body, note), statement, places)

    def _call(self, node: ast.expr, wanted: str) -> tuple[Statement, ast.Call]:
        """The declaration that a call names; ``wanted`` is the kind of word that fits the place."""
        known = language()
        function = node.func if isinstance(node, ast.Call) else node
        if not isinstance(function, ast.Name):
            hint = f"write the name of a {wanted} and its parameters"
            raise self.text.error(node, f"{self.text.shown(node)} is not a {wanted}", hint)
        if function.id not in known:
            fitting = [declared.name for declared in known if declared.is_loop == (wanted == "loop")]
            fitting += [] if wanted == "loop" else [*known.roles, *self.functions]
            hint = did_you_mean(function.id, fitting)
            raise self.text.error(function, f"unknown {wanted} {function.id!r}", hint)
        declared = known[function.id]
        if not isinstance(node, ast.Call):
            raise self.numbers.misused(node, f"{declared.name} needs parameters", declared)
        return declared, node

    def _assignment(self, statement: ast.Assign) -> Line:
        target, value = statement.targets[0], statement.value
        targets = target.elts if isinstance(target, ast.Tuple) else [target]
        values = value.elts if isinstance(value, ast.Tuple) else [value]
        if len(statement.targets) > 1:
            raise self.text.error(
                statement.targets[1], "there are two = on this line", "name one number, then the other"
            )
        for each in targets:
            if not isinstance(each, ast.Name):
                said = f"{self.text.shown(each)} is not a name"
                raise self.text.error(each, said, "write name = number")
        if len(targets) != len(values):
            said = f"{_counted(len(targets), 'name')} for {_counted(len(values), 'number')}"
            raise self.text.error(value, said, "write as many of the one as of the other")
        words = {each.id: each for each in targets if isinstance(each, ast.Name)}
        names = [each.id for each in targets if isinstance(each, ast.Name)]
        pairs = [(name, self.numbers.one(name, each)) for name, each in zip(names, values, strict=True)]
        return self._kept(Assignment(tuple(pairs), self._note(statement)), statement, words)

    def _function(self, statement: ast.FunctionDef, depth: int, end: float) -> Line:
        given, name = statement.args, statement.name
        if wrong := misnamed(name):  # before its calls are taken for those of a statement
            raise self.text.error(statement, *wrong)
        others = (given.vararg, given.kwarg, *given.posonlyargs, *given.kwonlyargs)
        marks = [statement.returns, *statement.decorator_list, *(each.annotation for each in given.args)]
        marks += getattr(statement, "type_params", [])  # from Python 3.12
        for odd in [*others, *marks]:
            if odd is not None:
                said = f"{name} has {self.text.shown(odd)}, which functions of this language cannot have"
                raise self.text.error(odd, said, f"write def {name}(parameter, parameter=number):")
        words = [each.arg for each in given.args]
        values: list[Value | None] = [None] * (len(words) - len(given.defaults))
        for word, default in zip(words[len(values) :], given.defaults, strict=True):
            values.append(self.numbers.one(f"{word} of {name}", default))
        heads: list[Node] = [*given.args, *given.defaults]
        note = self.comments.note(max([statement.lineno, *(each.end_lineno or 0 for each in heads)]))
        body = self.body(statement.body, depth + 1, end)
        line = Function(name, tuple(zip(words, values, strict=True)), body, note)
        return self._kept(line, statement, {each.arg: each for each in given.args})

    def _function_call(self, statement: ast.stmt, call: ast.Call, name: str, role: str) -> Line:
        words = [each.arg for each in self.functions[name].args.args]
        places: dict[str, Node] = {}
        pairs: list[tuple[str, Value]] = []
        if len(call.args) > len(words):
            said = f"{name} takes {_counted(len(words), 'number')}, not {len(call.args)}"
            raise self.text.error(call.args[len(words)], said, "leave the others out")
        for word, argument in zip(words, call.args, strict=False):
            pairs.append((word, self.numbers.one(f"{word} of {name}", argument)))
        for keyword in call.keywords:
            if keyword.arg is None:
                raise self.text.error(keyword, f"{name} has no parameter **", f"its parameters are {', '.join(words)}")
            pairs.append((keyword.arg, self.numbers.one(f"{keyword.arg} of {name}", keyword.value)))
            places[keyword.arg] = keyword
        order = {word: place for place, word in enumerate(words)}
        pairs.sort(key=lambda pair: order.get(pair[0], len(words)))
        return self._kept(Call(name, tuple(pairs), self._note(statement), role), statement, places)

    def _note(self, node: Node) -> str:
        return self.comments.note(node.end_lineno or node.lineno)

    def _kept(self, line: Line, node: Node, places: Mapping[str, Node] | Mapping[int, Node]) -> Line:
        """The line, with the places of its numbers and names."""
        self.places |= {(id(line), key): place for key, place in places.items()}
        self.places[id(line), ""] = node
        return line


def _counted(count: int, what: str) -> str:
    return f"{count} {what}" if count == 1 else f"{count} {what}s"

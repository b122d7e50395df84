"""Names and their scopes, functions and comments of placed text, and the places of mistakes."""

from __future__ import annotations

import ast
import io
import math
import tokenize
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple, TypeAlias

from shapeprog.errors import ProgramError, did_you_mean
from shapeprog.language.ast import Assignment, Comment, Fault, Function, Line, without_double_blanks
from shapeprog.language.expression import Binary, Expression, Name, Operator, Value
from shapeprog.language.parameters import to_float32
from shapeprog.language.placement import ATTRIBUTES, RESERVED, SIZES
from shapeprog.language.program import DEEPEST
from shapeprog.language.statement import language
from shapeprog.language.text import Node, Text

BEGIN = "begin with width, depth, height = ..."
_OPERATORS: dict[type[ast.operator], Operator] = {ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/"}


@dataclass
class Declared:
    """A declared name, parameter or function, and whether anything uses it."""

    node: Node
    used: bool = False


Names: TypeAlias = dict[str, Declared]


class Block(NamedTuple):
    """Where lines stand: the names that they see, whether in a function, how many loops deep, and the last row."""

    scope: Names
    local: bool = False
    depth: int = 0
    end: float = math.inf


class Reader(ABC):
    """Turns syntax into lines, checks what needs no number, and knows the place of every line and number.

    Parameters
    ----------
    text, tree
        The text and its syntax tree.
    comments
        Comments that become lines or notes.
    """

    def __init__(self, text: Text, tree: ast.Module, comments: Comments) -> None:
        self.text, self.tree, self.comments = text, tree, comments
        self.expressions: dict[int, Node] = {}
        self.places: dict[tuple[int, str], Node] = {}
        self.functions: dict[str, Function] = {}
        self.names: Names = {}
        self.function_names: Names = {}
        self.declared: list[tuple[str, Declared]] = []
        self.has_whole = self.declares_whole = False

    @abstractmethod
    def element(self, call: ast.Call, scope: Names) -> Line:
        """A line that draws: a solid, or a call of a function."""

    @abstractmethod
    def loop(self, node: ast.For | ast.With, block: Block) -> Line:
        """A loop or a group."""

    # ---- lines --------------------------------------------------------------------------------------------------

    def lines(self) -> tuple[Line, ...]:
        """The lines of the whole text."""
        return self.body(self.tree.body, Block(self.names))

    def warnings(self) -> tuple[str, ...]:
        """What is legal and probably a mistake."""
        unused = [(word, name.node.lineno) for word, name in self.declared if not name.used]
        return tuple(f"line {row}: unused name {word!r}" for word, row in unused)

    def located(self, fault: Fault) -> ProgramError:
        """A fault in the lines that were read, with its place in the text."""
        key = (id(fault.line), str(fault.key))
        node = self.expressions.get(id(fault.expression)) or self.places.get(key) or self.places[key[0], ""]
        return self.error(node, fault.message, fault.hint)

    def error(self, node: Node, message: str, hint: str) -> ProgramError:
        """A mistake at a piece of syntax."""
        return self.text.error(node, message, hint)

    def require(self, condition: object, node: Node, message: str, hint: str) -> None:
        """Raise an error at a piece of syntax unless a condition holds."""
        if not condition:
            raise self.error(node, message, hint)

    def body(self, statements: list[ast.stmt], block: Block) -> tuple[Line, ...]:
        """The lines of a block."""
        lines: list[Line] = []
        ends = [*(statement.lineno for statement in statements), block.end][1:]
        for statement, following in zip(statements, ends, strict=True):
            lines += self.comments.before(statement.lineno)
            if isinstance(statement, ast.Pass):
                lines += [Comment(note)] if (note := self.comments.note(statement.lineno)) else []
            else:
                lines.append(self._line(statement, block._replace(end=following)))
        column = statements[0].col_offset + 1 if block.depth or block.local else 1
        return without_double_blanks((*lines, *self.comments.ending(column, block.end)))

    def _line(self, node: ast.stmt, block: Block) -> Line:
        if isinstance(node, ast.Assign):
            self.require(
                not block.depth, node, "a name is declared inside a loop or a group", "move this line above it"
            )
            return self._assignment(node, block.scope, block.local)
        is_legal = isinstance(node, ast.For | ast.With | ast.FunctionDef)
        is_legal = is_legal or (isinstance(node, ast.Expr) and isinstance(node.value, ast.Call))
        hint = "use a part, a loop, with inside(...), a function or name = number"
        self.require(is_legal, node, "this is no statement of a program", hint)
        self.require(self.has_whole, node, "the size is not declared yet", BEGIN)
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Call):
            return self.element(node.value, block.scope)
        if isinstance(node, ast.For | ast.With):
            return self.loop(node, block)
        assert isinstance(node, ast.FunctionDef)
        outermost = not block.depth and not block.local
        self.require(outermost, node, "a function is defined inside another block", "move it to the top")
        return self._function(node, block.end)

    def _assignment(self, node: ast.Assign, scope: Names, local: bool) -> Line:
        """Names with their values."""
        message = "there are two = on this line"
        self.require(len(node.targets) == 1, node.targets[-1], message, "declare one name, then the other")
        target, value = node.targets[0], node.value
        targets = target.elts if isinstance(target, ast.Tuple) else [target]
        values = value.elts if isinstance(value, ast.Tuple) and isinstance(target, ast.Tuple) else [value]
        held = (len(targets), "name"), (len(values), "number")
        message = " for ".join(f"{count} {word}{'s' * (count != 1)}" for count, word in held)
        self.require(len(targets) == len(values), node, message, "write as many numbers as names")
        words = [getattr(name, "id", "") for name in targets]
        for name, word in zip(targets, words, strict=True):
            self.require(word, name, f"{self.text.shown(name)} is not a name", "write name = number, without brackets")
        pairs = [(word, self.value(word, number, scope)) for word, number in zip(words, values, strict=True)]
        self.declares_whole = not local and not self.has_whole and set(SIZES) <= set(words)
        self.has_whole = self.has_whole or self.declares_whole
        for name, word in zip(targets, words, strict=True):
            self.declare(word, name, scope)
        places: dict[str, Node] = dict(zip(words, targets, strict=True))
        return self.recorded(Assignment(tuple(pairs), self.note(node)), node, places)

    def declare(self, word: str, node: Node, scope: Names, parameter: bool = False) -> None:
        """Add a name to a scope; a parameter may hide a name of the program."""
        is_taken = not parameter and (word in scope or word in self.functions)
        self.require(not is_taken, node, f"{word!r} is declared twice", "use another name")
        is_free = not is_reserved(word) or (self.declares_whole and word in SIZES and not parameter)
        is_free = is_free and not (parameter and word == "tilt")  # a call takes tilt itself
        hint = "width, depth, height = ... is one line" if word in SIZES else f"use another name, such as {word}_size"
        self.require(is_free, node, f"{word!r} is a word of the language", hint)
        scope[word] = Declared(node, used=word in SIZES)  # the sizes of the whole always count as used
        self.declared.append((word, scope[word]))

    def _function(self, node: ast.FunctionDef, end: float) -> Line:
        """A function, which is known below its definition only, so that there is no recursion."""
        head, name = node.args, node.name
        is_taken = is_reserved(name) or name in ATTRIBUTES or name in self.functions or name in self.names
        self.require(not is_taken, node, f"{name!r} has a meaning already", "use another name")
        extra = [head.posonlyargs, head.vararg, head.kwonlyargs, head.kwarg, node.decorator_list, node.returns]
        extra += [*(argument.annotation for argument in head.args), getattr(node, "type_params", None)]
        self.require(not any(extra), node, "parameters are name or name=number", "remove the rest")
        outer = {word: entry for word, entry in self.names.items() if word not in SIZES}
        defaults: list[ast.expr | None] = [*[None] * (len(head.args) - len(head.defaults)), *head.defaults]
        scope, parameters = dict(self.names), dict[str, Value | None]()
        self.function_names[name] = Declared(node)
        self.declared.append((name, self.function_names[name]))
        for parameter, default in zip(head.args, defaults, strict=True):
            word = parameter.arg
            self.require(word not in parameters, parameter, f"{word!r} is declared twice", "use another name")
            parameters[word] = None if default is None else self.value(word, default, outer)
            self.declare(word, parameter, scope, parameter=True)
        heads = [node.lineno, *(a.end_lineno or 0 for a in head.args), *(d.end_lineno or 0 for d in head.defaults)]
        note = self.comments.note(max(heads))
        body = self.body(node.body, Block(scope, True, 0, end))
        function = Function(name, tuple(parameters.items()), body, note)
        self.functions[name] = function
        return self.recorded(function, node, {argument.arg: argument for argument in head.args})

    # ---- numbers ------------------------------------------------------------------------------------------------

    def value(self, word: str, node: ast.expr, scope: Mapping[str, Declared]) -> Value:
        """A number or an expression of names in a scope; ``word`` is what holds it, in errors."""
        value = self.number(word, node)
        self.use(value, scope)
        return value if isinstance(value, Expression) else to_float32(value)

    def number(self, word: str, node: ast.expr, depth: int = 0) -> Value:
        """A number or an expression, whose names are not checked yet."""
        if depth > DEEPEST:
            message = f"{word} holds an expression of more than {DEEPEST} levels"
            raise self.error(node, message, "give a part of it a name of its own")
        result: Value
        match node:
            case ast.Constant() if (literal := self.text.literal(word, node)) is not None:
                return literal
            case ast.Name(name):
                result = Name(name)
            case ast.UnaryOp(ast.UAdd(), inner):
                return self.number(word, inner, depth + 1)
            case ast.UnaryOp(ast.USub(), inner):
                result = -self.number(word, inner, depth + 1)
            case ast.BinOp(left, operator, right) if type(operator) in _OPERATORS:
                sides = self.number(word, left, depth + 1), self.number(word, right, depth + 1)
                result = Binary(_OPERATORS[type(operator)], *sides)
            case _:
                hint = "write numbers such as 4 or -2.5, or names of numbers, with + - * / between them"
                raise self.error(node, f"{word} holds {self.text.shown(node)}, which is not a number", hint)
        self.expressions[id(result)] = node
        return result

    def use(self, value: Value, scope: Mapping[str, Declared]) -> None:
        """Refuse names that are not in a scope, and take note of those that are."""
        for name in value.names() if isinstance(value, Expression) else ():
            if name.name not in scope:
                otherwise = f"declare it above: {name.name} = ..."
                suggestion = did_you_mean(name.name, scope, " ").strip()
                hint = f"{suggestion} or {otherwise}" if suggestion else otherwise
                if is_reserved(name.name):
                    hint = f"{name.name} is a word of the language, not a number"
                if name.name in SIZES:
                    hint = f"{name.name} is known below its line, but not to defaults of parameters"
                raise self.error(self.expressions[id(name)], f"unknown name {name.name!r}", hint)
            scope[name.name].used = True

    def note(self, node: ast.expr | ast.stmt) -> str:
        """The comment behind a line."""
        return self.comments.note(node.end_lineno or node.lineno)

    def recorded(self, line: Line, node: Node, places: Mapping[str, Node]) -> Line:
        """The line, with the places of its keywords and names."""
        self.places |= {(id(line), key): place for key, place in places.items()}
        self.places[id(line), ""] = node
        return line


def is_reserved(word: str) -> bool:
    """Whether a word of the language cannot be declared as a name."""
    return word in RESERVED or word in language().roles


class _Remark(NamedTuple):
    """A comment at its row and column, which count from 1; an empty line if there is nothing in it."""

    row: int
    column: int
    text: str


class Comments:
    """Those of a text, as its lines, that have not been handed out yet."""

    def __init__(self, lines: Sequence[str]) -> None:
        self._rest = list(_remarks(lines))

    def before(self, row: int) -> tuple[Comment, ...]:
        """Those above a row."""
        return tuple(Comment(remark.text) for remark in self._while(lambda remark: remark.row < row))

    def note(self, row: int) -> str:
        """Those down to a row as one: they are behind or within the last line that was read."""
        return "  ".join(remark.text for remark in self._while(lambda remark: remark.row <= row) if remark.text)

    def ending(self, column: int, row: float) -> tuple[Comment, ...]:
        """Those above a row that end a block at a column: they are indented like it, or more."""
        result = self._while(lambda remark: remark.row < row and (not remark.text or remark.column >= column))
        while result and not result[-1].text:  # empty lines below a block are not in it
            self._rest.insert(0, result.pop())
        return tuple(Comment(remark.text) for remark in result)

    def _while(self, accepted: Callable[[_Remark], bool]) -> list[_Remark]:
        count = next((index for index, remark in enumerate(self._rest) if not accepted(remark)), len(self._rest))
        result, self._rest = self._rest[:count], self._rest[count:]
        return result


def _remarks(lines: Sequence[str]) -> Iterator[_Remark]:
    if not any("#" in line for line in lines):  # empty lines alone: tokens take long
        yield from (_Remark(row, 1, "") for row, line in enumerate(lines, 1) if not line.strip() and row < len(lines))
        return
    for token in tokenize.generate_tokens(io.StringIO("\n".join(lines)).readline):
        row, column = token.start
        if token.type == tokenize.COMMENT:
            shown = "".join(letter if letter.isprintable() else " " for letter in token.string[1:])
            yield _Remark(row, column + 1, shown.strip())
        elif token.type == tokenize.NL and not token.line.strip():
            yield _Remark(row, column + 1, "")

"""What can be wrong with written programs whatever their numbers are: names, functions and arguments."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import NoReturn

from shapeprog.errors import ShapeProgError, did_you_mean
from shapeprog.language.expression import Expression, Name, Value, text_of
from shapeprog.language.source import (
    Assignment,
    Call,
    Comment,
    Function,
    Line,
    Source,
    WrittenDraw,
    WrittenLoop,
    values,
)
from shapeprog.language.statement import WORDS, is_word, language


class Fault(ShapeProgError):
    """What is wrong with a line of a program, and where on it.

    ``key`` is the place of a number among those of a statement, or the name of a number, argument or parameter;
    ``expression`` what is wrong in the number there.
    """

    def __init__(
        self, line: Line, message: str, hint: str, key: int | str = "", expression: Expression | None = None
    ) -> None:
        super().__init__(message, hint)
        self.line, self.key, self.expression = line, key, expression


@dataclass
class _Scope:
    """The names that lines of a program or function may use: their own, and those around a function."""

    function: str = ""
    outer: frozenset[str] = frozenset()
    own: dict[str, Line] = field(default_factory=dict)
    borrowed: set[str] = field(default_factory=set)
    used: set[str] = field(default_factory=set)


def check(source: Source) -> None:
    """Check every name, function and argument of a program; the first error is raised as a :class:`Fault`."""
    checker = _Checker(source)
    checker.block(source.lines, checker.outermost, 0)
    checker.end(checker.outermost)


def signature(function: Function) -> str:
    """How a function is called, with a blank for each number that must be given: ``legs(height=_, thick=2)``."""
    blanks = (f"{name}={'_' if default is None else text_of(default)}" for name, default in function.parameters)
    return f"{function.name}({', '.join(blanks)})"


def misnamed(name: str) -> tuple[str, str] | None:
    """Why no function may have this name, and the cure; ``None`` if one may."""
    known = language()
    if not is_word(name):
        return f"invalid function name {name!r}", WORDS
    if name in known or name in known.roles:
        what = "role" if name not in known else "loop" if known[name].is_loop else "statement"
        return f"{name} is already a {what} of the language", "give the function another name"
    return None


class _Checker:
    """Goes through the lines in order and knows the names and functions so far."""

    def __init__(self, source: Source) -> None:
        self.source = source
        self.called = {word: line for line in source.walk() for word in _words(line)}
        self.functions: dict[str, Function] = {}
        self.outermost = _Scope()

    def block(self, lines: tuple[Line, ...], scope: _Scope, loops: int) -> None:
        """Check the lines of a program, function or loop."""
        for line in lines:
            if isinstance(line, Function):
                self._function(line, scope, loops)
                continue
            for value in values(line):
                self._use(value, line, scope)
            match line:
                case Assignment():
                    self._assignment(line, scope, loops)
                case Call():
                    self._call(line, scope)
                case WrittenDraw() | WrittenLoop():
                    _check_declared(line)
            if isinstance(line, WrittenLoop):
                self.block(line.body, scope, loops + 1)

    def end(self, scope: _Scope) -> None:
        """Refuse names of a scope that nothing uses."""
        for name, line in scope.own.items():
            if name not in scope.used:
                raise Fault(line, f"unused name {name!r}", "leave it out, or write it in place of a number", name)

    def _use(self, value: Value, line: Line, scope: _Scope) -> None:
        for name in value.names() if isinstance(value, Expression) else ():
            if name.name not in scope.own and name.name not in scope.outer:
                raise Fault(line, f"undefined name {name.name!r}", self._cure(name, line, scope), "", name)
            if name.name in scope.own:
                scope.used.add(name.name)
            else:
                scope.borrowed.add(name.name)
                self.outermost.used.add(name.name)

    def _cure(self, name: Name, line: Line, scope: _Scope) -> str:
        if name.name in self.source.numbers and not (isinstance(line, Assignment) and name.name in dict(line.numbers)):
            return f"{name.name} is defined further down: move that line up"
        return did_you_mean(name.name, [*scope.own, *scope.outer], f"write {name.name} = ... above this line")

    def _define(self, name: str, line: Line, scope: _Scope) -> None:
        if not is_word(name):
            raise Fault(line, f"invalid name {name!r}", WORDS, name)
        if name in scope.own:
            raise Fault(line, f"{name} is defined twice", "give one of them another name", name)
        if name in scope.borrowed:
            said = f"{name} is a number of the program above this line and a new one below"
            raise Fault(line, said, "give one of them another name", name)
        if name in self.called:
            what = "function" if isinstance(self.called[name], Call | Function) else "statement, role or loop"
            raise Fault(line, f"{name} is already a {what} of this program", "give the number another name", name)
        scope.own[name] = line

    def _assignment(self, line: Assignment, scope: _Scope, loops: int) -> None:
        if loops:
            raise Fault(line, "numbers cannot be named inside a loop", "move this line above the loop")
        if not line.numbers:
            raise Fault(line, "this line defines no name", "leave it out")
        for name, _ in line.numbers:
            self._define(name, line, scope)

    def _function(self, line: Function, scope: _Scope, loops: int) -> None:
        if loops or scope.function:
            cure = "move it to the top of the program"
            raise Fault(line, "functions cannot be defined inside loops or functions", cure)
        name = line.name
        if wrong := misnamed(name):
            raise Fault(line, *wrong)
        if name in self.functions:
            raise Fault(line, f"the function {name} is defined twice", "give one of them another name")
        for value in values(line):
            self._use(value, line, scope)
        inner = _Scope(name, frozenset(scope.own))
        for parameter, _ in line.parameters:
            self._define(parameter, line, inner)
        defaults = [default is not None for _, default in line.parameters]
        if defaults != sorted(defaults):
            raise Fault(line, f"a parameter of {name} without a default follows one with a default", "put it first")
        self.block(line.body, inner, 0)
        self.end(inner)
        self.functions[name] = line

    def _call(self, line: Call, scope: _Scope) -> None:
        if line.role and line.role not in language().roles:
            raise Fault(line, f"unknown role {line.role!r}", did_you_mean(line.role, language().roles))
        if line.name == scope.function:
            cure = "use a loop: functions call only those defined above them"
            raise Fault(line, f"{line.name} calls itself", cure)
        if line.name not in self.functions:
            if line.name in self.source.functions:
                cure = "move the function above this line"
                raise Fault(line, f"the function {line.name} is defined further down", cure)
            cure = did_you_mean(line.name, self.functions)
            raise Fault(line, f"undefined function {line.name!r}", cure)
        function = self.functions[line.name]
        parameters = dict(function.parameters)
        given: set[str] = set()
        for name, _ in line.arguments:
            if name not in parameters:
                cure = did_you_mean(name, parameters, f"write {signature(function)}")
                raise Fault(line, f"{line.name} has no parameter {name!r}", cure, name)
            if name in given:
                raise Fault(line, f"{name} of {line.name} is given twice", "leave one of them out", name)
            given.add(name)
        for name, default in parameters.items():
            if default is None and name not in given:
                raise Fault(line, f"{line.name} needs {name}", f"write {signature(function)}")


def _words(line: Line) -> Iterator[str]:
    """What is called on a line, or may be."""
    if not isinstance(line, Comment | Assignment):
        yield line.name
    if isinstance(line, WrittenDraw | Call) and line.role:
        yield line.role


def _check_declared(line: WrittenDraw | WrittenLoop) -> None:
    def refuse(message: str, hint: str) -> NoReturn:
        raise Fault(line, message, hint)

    known = language()
    if line.name not in known:
        refuse(f"unknown statement {line.name!r}", "load the module that declares it")
    declared = known[line.name]
    if declared.is_loop != isinstance(line, WrittenLoop):
        refuse(f"{line.name} is {'a' if declared.is_loop else 'no'} loop", f"write {declared.signature}")
    if len(line.values) != declared.size:
        refuse(f"{line.name} has {len(line.values)} numbers instead of {declared.size}", "correct the program")

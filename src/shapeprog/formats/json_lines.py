"""The lines of a program as entries of JSON, and back.

{"statement": "leg", "parameters": {"at": ["floor", 0, "depth / 2 - thick"], "size": [12, 2, 2]}, "role": "post"}
{"statement": "translate", "parameters": {"count": 2, "by": [0, 0, 18]}, "body": [...]}
{"numbers": {"width": 10.25, "floor": "-height / 2"}}
{"function": "legs", "parameters": {"long": null, "thick": 2}, "body": [...]}
{"call": "posts", "arguments": {"long": "seat_height"}, "role": "leg"}
{"comment": "four of them"}

A number is a plain one, or an expression as its text.  All but comments may have a "note", the comment behind them.
"""

from __future__ import annotations

import json
from reprlib import repr as shortened
from typing import Any

from shapeprog.errors import InputError, ShapeProgError, did_you_mean
from shapeprog.language.checking import Fault
from shapeprog.language.evaluation import evaluated
from shapeprog.language.expression import Expression, Value
from shapeprog.language.numbers import checked_values, parse_number
from shapeprog.language.parameters import Parameter, shortest, to_float32
from shapeprog.language.program import DEEPEST, Program
from shapeprog.language.source import Assignment, Call, Comment, Function, Line, Source, WrittenDraw, WrittenLoop
from shapeprog.language.statement import Statement, language
from shapeprog.language.text import checked_role, declared_of, number_text, source_of
from shapeprog.language.unit import Unit
from shapeprog.space import AXES

_WORDS = {
    "statement": ("statement", "parameters", "role", "body", "note"),
    "numbers": ("numbers", "note"),
    "function": ("function", "parameters", "body", "note"),
    "call": ("call", "arguments", "role", "note"),
    "comment": ("comment",),
}
"""Keys that an entry may have, by the key of its kind."""


def entries_of(program: Program) -> list[dict[str, Any]]:
    """The entries of a program; numbers have the fewest digits that read back exactly."""
    return [_entry(line, 0) for line in source_of(program).lines]


def program_from_entries(entries: Any, name: str, place: str, unit: Unit | None = None) -> Program:
    """The program of entries at the path ``place`` of the file ``name``, with lengths in a unit or in cells.

    Raises
    ------
    InputError
        If one is not valid, naming the entry.
    """
    reader = _Reader(name)
    source = Source(reader.body(entries, place, 0), unit)
    try:
        return evaluated(source)
    except Fault as fault:
        raise InputError(f"{name}: {reader.places[id(fault.line)]}: {fault.message}", fault.hint) from None


def _entry(line: Line, depth: int) -> dict[str, Any]:
    if depth > DEEPEST:
        raise ShapeProgError(f"loops are nested more than {DEEPEST} deep", "put some of them side by side")
    found: dict[str, Any]
    match line:
        case Comment(text):
            return {"comment": text}
        case Assignment(pairs):
            found = {"numbers": {name: _plain(value) for name, value in pairs}}
        case Call(name, pairs):
            found = {"call": name, "arguments": {word: _plain(value) for word, value in pairs}}
        case Function(name, parameters):
            given = {word: None if value is None else _plain(value) for word, value in parameters}
            found = {"function": name, "parameters": given}
        case _:
            found = {"statement": line.name, "parameters": _parameters(line)}
    if isinstance(line, WrittenDraw | Call) and line.role:
        found["role"] = line.role if isinstance(line, Call) else checked_role(line)
    if isinstance(line, WrittenLoop | Function):
        found["body"] = [_entry(inner, depth + 1) for inner in line.body]
    return found | ({"note": line.note} if line.note else {})


def _parameters(line: WrittenDraw | WrittenLoop) -> dict[str, Any]:
    found = {}
    for parameter in declared_of(line).parameters:
        if parameter.quantity.written_out:
            numbers = [_slot(parameter, value) for value in line.values[parameter.slots]]
            found[parameter.name] = numbers if parameter.quantity.width > 1 else numbers[0]
    return found


def _slot(parameter: Parameter, value: Value) -> Any:
    text = number_text(parameter.quantity, value)
    return text if isinstance(value, Expression) or parameter.quantity.kind == "axis" else json.loads(text)


def _plain(value: Value) -> Any:
    return str(value) if isinstance(value, Expression) else json.loads(shortest(value))


class _Reader:
    """Turns entries into lines; ``places`` maps the ``id`` of a line to the path of its entry."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.places: dict[int, str] = {}

    def body(self, entries: Any, place: str, depth: int) -> tuple[Line, ...]:
        """The lines of a list of entries."""
        if not isinstance(entries, list):
            raise self._error(f"{place} is not a list of statements", "write [ ... ], or [] for an empty list")
        if depth > DEEPEST:
            raise self._error(f"loops are nested more than {DEEPEST} deep", "put some of them side by side")
        return tuple(self._line(entry, f"{place}[{number}]", depth) for number, entry in enumerate(entries))

    def _line(self, entry: Any, place: str, depth: int) -> Line:
        kind = next((kind for kind in _WORDS if isinstance(entry, dict) and kind in entry), "")
        if not kind or not isinstance(entry[kind], dict if kind == "numbers" else str):
            raise self._error(f"{place} is not a statement", 'write {"statement": name, "parameters": {...}}')
        allowed = set(_WORDS[kind])
        if kind == "statement":
            declared = self._declared(entry[kind], place)
            allowed.remove("role" if declared.is_loop else "body")
        if extra := sorted(entry.keys() - allowed):
            word = entry[kind] if isinstance(entry[kind], str) else kind
            said = f"{place}: {shortened(word)} has no entry {shortened(extra[0])}"
            raise self._error(said, f"it has {', '.join(sorted(allowed))}")
        note = entry.get("note", "")
        if not isinstance(note, str):
            raise self._error(f"{place}: the note is not a string", "write it in quotation marks")
        line: Line
        match kind:
            case "comment":
                line = Comment(entry[kind])
            case "numbers":
                line = Assignment(self._pairs(entry[kind], place), note)
            case "call":
                role = self._role(entry, "", place)
                line = Call(entry[kind], self._pairs(entry.get("arguments"), place), note, role)
            case "function":
                given = entry.get("parameters")
                blank = {name for name, value in given.items() if value is None} if isinstance(given, dict) else set()
                some = {name: value for name, value in given.items() if name not in blank} if blank else given
                defaults = dict(self._pairs(some, place))
                parameters = tuple((name, defaults.get(name)) for name in given or ())
                line = Function(entry[kind], parameters, self.body(entry.get("body"), f"{place}.body", depth + 1), note)
            case _:
                values = self._values(declared, entry.get("parameters"), place)
                if declared.is_loop:
                    body = self.body(entry.get("body"), f"{place}.body", depth + 1)
                    line = WrittenLoop(declared.name, values, body, note)
                else:
                    line = WrittenDraw(declared.name, values, self._role(entry, declared.name, place), note)
        self.places[id(line)] = place
        return line

    def _declared(self, word: str, place: str) -> Statement:
        known = language()
        if word not in known:
            hint = did_you_mean(word, known.names)
            raise self._error(f"{place}: unknown statement {shortened(word)}", hint)
        return known[word]

    def _role(self, entry: dict[str, Any], word: str, place: str) -> str:
        role, roles = entry.get("role", ""), language().roles
        if not isinstance(role, str) or (role and role not in roles):
            hint = did_you_mean(str(role), roles)
            raise self._error(f"{place}: unknown role {shortened(role)}", hint)
        if role and role == word:
            raise self._error(
                f"{place}: redundant role: {word}(...) already has the role {word!r}", "leave the role out"
            )
        return role

    def _pairs(self, given: Any, place: str) -> tuple[tuple[str, Value], ...]:
        """Named numbers."""
        if not isinstance(given, dict):
            raise self._error(f"{place}: expected numbers by name", 'write {"name": number, ...}')
        found = ((name, self._number(value, shortened(name), place)) for name, value in given.items())
        try:
            return tuple((name, v if isinstance(v, Expression) else to_float32(v)) for name, v in found)
        except InputError:
            raise
        except ShapeProgError as mistake:
            raise self._error(f"{place}: {mistake.message}", mistake.hint) from None

    def _number(self, given: Any, what: str, place: str) -> Value:
        """A plain number, or an expression parsed from its text."""
        if type(given) not in (int, float, str):
            said = f"{place}: {what} holds something that is not a number"
            raise self._error(said, "write plain numbers such as 4 or -2.5, or expressions in quotation marks")
        if not isinstance(given, str):
            return given
        try:
            value = parse_number(given, self.name)
        except ShapeProgError as mistake:
            raise self._error(f"{place}: {what}: {mistake.message}", mistake.hint) from None
        if isinstance(value, Expression):
            return value
        said = f"{place}: {what} holds {shortened(given)}, which is a number in quotation marks"
        raise self._error(said, "write it without quotation marks")

    def _values(self, declared: Statement, given: Any, place: str) -> tuple[Value, ...]:
        words = [parameter.name for parameter in declared.parameters]
        if not isinstance(given, dict):
            raise self._error(f"{place}: {declared.name} needs parameters", f"they are {', '.join(words)}")
        for word in given:
            if word not in words:
                hint = did_you_mean(word, words)
                raise self._error(f"{place}: {declared.name} has no parameter {shortened(word)}", hint)
        values: list[Value] = []
        for parameter in declared.parameters:
            if parameter.name not in given and parameter.unsaid is not None:
                values.append(parameter.unsaid)
                continue
            if parameter.name not in given:
                raise self._error(f"{place}: {declared.name} needs {parameter.name}", f"it has {', '.join(words)}")
            values += self._group(declared, parameter, given[parameter.name], place)
        return tuple(values)

    def _group(self, declared: Statement, parameter: Parameter, given: Any, place: str) -> list[Value]:
        numbers = given if isinstance(given, list) else [given]
        what = f"{parameter.name} of {declared.name}"
        if parameter.quantity.kind == "axis":
            numbers = [float(AXES.index(each)) if each in AXES else each for each in numbers]
            if any(type(each) not in (int, float) for each in numbers):
                raise self._error(f"{place}: {what} is not an axis", f"it is {parameter.quantity.range_text}")
        values = [self._number(each, what, place) for each in numbers]
        try:
            return checked_values(parameter, declared.name, values)
        except ShapeProgError as mistake:
            raise self._error(f"{place}: {mistake.message}", mistake.hint) from None

    def _error(self, message: str, hint: str) -> InputError:
        return InputError(f"{self.name}: {message}", hint)

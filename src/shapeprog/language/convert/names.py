"""Names of programs that are converted: words of the language are changed, and unused names are left out."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace

from shapeprog.language.ast import Assignment, Call, Function, Group, Line, Loop, Source, names_of, values, with_values
from shapeprog.language.expression import Name, Value, names_in, replaced
from shapeprog.language.placement import ATTRIBUTES, BOX, BOX_IN_CELLS, RESERVED, SIZES
from shapeprog.language.statement import language

NOTHING = 2e-6
"""Cells; a length up to this is none."""


def without_unused(lines: tuple[Line, ...]) -> tuple[Line, ...]:
    """The lines without names and parameters that nothing uses, but for the sizes of the whole."""
    while True:
        outer, inner = {*SIZES}, dict[str, set[str]]()
        for line in lines:
            names = used_names(Source((line,)).walk())
            if isinstance(line, Function):
                inner[line.name] = used_names(Source(line.body).walk())
                names = inner[line.name] - line.names | used_names([replace(line, body=())])
            outer |= names
        new = tuple(pruned(lines, outer, inner))
        if new == lines:
            return lines
        lines = new


def used_names(lines: Iterable[Line]) -> set[str]:
    """The names in the numbers of lines, not in those inside of them."""
    return {name for line in lines for value in values(line) for name in names_in(value)}


def pruned(lines: Iterable[Line], used: set[str], inner: Mapping[str, set[str]]) -> Iterator[Line]:
    """Lines with the names that are used alone; ``inner`` has those that are used in each function."""
    for line in lines:
        match line:
            case Assignment(pairs):
                used_pairs = tuple(pair for pair in pairs if pair[0] in used)
                if used_pairs:
                    yield replace(line, numbers=used_pairs)
            case Call(name, arguments):
                yield replace(line, arguments=tuple(pair for pair in arguments if pair[0] in {*inner[name], *BOX}))
            case Function(name, parameters, body):
                kept_parameters = tuple(pair for pair in parameters if pair[0] in inner[name])
                kept_body = tuple(pruned(body, inner[name], inner))
                yield replace(line, parameters=kept_parameters, body=kept_body)
            case Group(body=body):
                yield replace(line, body=tuple(pruned(body, used, inner)))
            case _:
                yield line


def with_legal_names(source: Source) -> Source:
    """The program with other names for numbers and functions that are words of the language."""
    roles = language().roles
    top = source.numbers
    names = names_of(source) | {*source.functions}

    def legal(name: str, *more: str) -> str:
        if name not in RESERVED and name not in roles and name not in more:
            return name
        base = f"part_{name}" if name in BOX else f"{name}_size"
        new, number = base, 2
        while new in names:
            new, number = f"{base}_{number}", number + 1
        names.add(new)
        return new

    evaluated = source.evaluated_numbers()
    outer = {name: name if name in SIZES and evaluated[name] > NOTHING else legal(name) for name in top}
    functions = {name: legal(name, *ATTRIBUTES) for name in source.functions}
    parameters = {
        function.name: {
            name: name if function.box and name in BOX_IN_CELLS else legal(name, "tilt")
            for name, _ in function.parameters
        }
        for function in source.functions.values()
    }

    def renamed(lines: Iterable[Line], scope: Mapping[str, str]) -> Iterator[Line]:
        for line in lines:
            names = {old: Name(new) for old, new in (outer if isinstance(line, Function) else scope).items()}
            line = with_values(line, [with_names(value, names) for value in values(line)])
            match line:
                case Assignment(pairs):
                    yield replace(line, numbers=tuple((scope[name], value) for name, value in pairs))
                case Call(name, pairs):
                    arguments = tuple((parameters[name][word], value) for word, value in pairs)
                    yield replace(line, name=functions[name], arguments=arguments)
                case Loop(body=body):
                    yield replace(line, body=tuple(renamed(body, scope)))
                case Function(name, pairs, body):
                    inside = {**outer, **parameters[name]}
                    inside |= {word: legal(word) for word in line.names - parameters[name].keys()}
                    own_parameters = tuple((parameters[name][word], value) for word, value in pairs)
                    yield replace(
                        line, name=functions[name], parameters=own_parameters, body=tuple(renamed(body, inside))
                    )
                case _:
                    yield line

    return replace(source, lines=tuple(renamed(source.lines, outer)))


def with_names(value: Value, names: Mapping[str, Value]) -> Value:
    """A number with other numbers for some names."""
    return replaced(value, lambda leaf: names.get(leaf.name, leaf) if isinstance(leaf, Name) else leaf)

"""Names that say how often something is repeated: they are whole numbers, which no gradient reaches."""

from __future__ import annotations

from shapeprog.language.expression import Name, Value
from shapeprog.language.source import Call, Function, Line, Source, WrittenLoop
from shapeprog.language.statement import language


class Counts:
    """Names and parameters that are written for a count, turn or axis of a loop, or passed on to one.

    Attributes
    ----------
    of
        The parameters of each function, and names in it, by the name of the function.
    outside
        The names of the program itself.
    """

    def __init__(self, source: Source) -> None:
        self.of: dict[str, set[str]] = {}
        for function in source.functions.values():  # each calls those above it
            self.of[function.name] = self._within(function.body)
        self.outside = self._within(tuple(line for line in source.lines if not isinstance(line, Function)))
        for function in source.functions.values():
            local = {name for name, _ in function.parameters}
            self.outside |= self.of[function.name] - local

    def _within(self, lines: tuple[Line, ...]) -> set[str]:
        found: set[str] = set()
        for line in Source(lines).walk():
            counted: list[Value] = []
            if isinstance(line, WrittenLoop):
                quantities = language()[line.name].quantities
                counted = [value for value, each in zip(line.values, quantities, strict=True) if each.discrete]
            elif isinstance(line, Call):
                counted = [value for name, value in line.arguments if name in self.of.get(line.name, ())]
            found |= {value.name for value in counted if isinstance(value, Name)}
        return found

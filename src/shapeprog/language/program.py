"""A program: drawing statements and loops, nested freely, as plain immutable values."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

from shapeprog.language.source import Source
from shapeprog.language.unit import Unit

PUBLISHED_DEPTH = 3
"""Steps of one block in the published generator."""

DEEPEST = 64
"""Levels of loops, calls and parentheses in text; Python itself ends at 100 levels of indentation."""


@dataclass(frozen=True)
class Draw:
    """A drawing statement with its parameters in slot order, and the role it plays, if another than its own name.

    Every number is exact in float32.
    """

    name: str
    values: tuple[float, ...]
    role: str = ""

    @property
    def word(self) -> str:
        """The name of the part, its role or else its statement."""
        return self.role or self.name


@dataclass(frozen=True)
class Loop:
    """A loop with its parameters in slot order and what it repeats."""

    name: str
    values: tuple[float, ...]
    body: tuple[Node, ...]

    @property
    def count(self) -> int:
        """Number of copies; none when the count is not positive."""
        return max(0, round(self.values[0]))


Node = Draw | Loop
Chain = tuple[Node, ...]
"""Loops from the outermost inwards, without bodies, and the drawing statement they repeat: one block."""


@dataclass(frozen=True)
class Program:
    """A shape as a list of drawing statements and loops, in the order they are written.

    Where its text has named numbers, expressions or functions, ``source`` is that text and ``body`` what it comes to:
    see :func:`shapeprog.language.evaluation.evaluated`, which makes such programs.  What works on shapes looks at the
    body alone; a program made from another body is plain.
    """

    body: tuple[Node, ...] = ()
    source: Source | None = None

    @property
    def unit(self) -> Unit | None:
        """The unit of the lengths in its text; ``None`` for cells, which those of ``body`` are in always."""
        return None if self.source is None else self.source.unit

    @property
    def chains(self) -> list[Chain]:
        """The blocks, each as the loops around a drawing statement, outermost first, then the statement.

        A loop around several statements is the union of that loop around each, so nothing is lost.
        """
        return [chain for node in self.body for chain in _chains(node)]

    @property
    def statements(self) -> int:
        """Number of statements as written; loops count one each."""
        return sum(1 for _ in self.walk())

    @property
    def blocks(self) -> int:
        """Number of drawing statements, each with the loops around it."""
        return len(self.chains)

    @property
    def size(self) -> int:
        """Number of drawn copies after unrolling."""
        return sum(math.prod(node.count for node in chain if isinstance(node, Loop)) for chain in self.chains)

    def walk(self) -> Iterator[Node]:
        """Every node in the order of the text."""
        stack = [*reversed(self.body)]
        while stack:
            yield (node := stack.pop())
            stack += reversed(node.body) if isinstance(node, Loop) else ()

    def flat(self) -> Program:
        """The same shape with one drawing statement in each loop nest."""
        return Program(tuple(nest(chain) for chain in self.chains))

    def snap(self) -> Program:
        """The program with every number rounded half to even to a whole one, as published executors do."""
        return Program(tuple(_snap(node) for node in self.body))


def nest(chain: Chain) -> Node:
    """The node that a chain of loops and a drawing statement stands for."""
    *loops, node = chain
    for outer in reversed(loops):
        assert isinstance(outer, Loop)
        node = Loop(outer.name, outer.values, (node,))
    return node


def _chains(node: Node, *loops: Loop) -> Iterator[Chain]:
    if isinstance(node, Draw):
        yield (*loops, node)
    else:
        for inner in node.body:
            yield from _chains(inner, *loops, Loop(node.name, node.values, ()))


def _snap(node: Node) -> Node:
    values = tuple(float(round(value)) for value in node.values)
    if isinstance(node, Draw):
        return Draw(node.name, values, node.role)
    return Loop(node.name, values, tuple(_snap(inner) for inner in node.body))

"""A program: drawing statements and loops, nested freely, as plain immutable values."""

from __future__ import annotations

import importlib
import math
import reprlib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import Any

from shapeprog.errors import ShapeProgError
from shapeprog.language.ast import Draw as Draw
from shapeprog.language.ast import Loop as Loop
from shapeprog.language.ast import Scale, Source, changed_lines, changed_values
from shapeprog.language.unit import Unit
from shapeprog.space import Frame

PUBLISHED_DEPTH = 3  # steps of one block in the published generator
DEEPEST = 64  # levels of loops, calls and parentheses in text; Python itself ends at 100 levels of indentation


Node = Draw | Loop
Chain = tuple[Node, ...]
"""Loops from the outermost inwards, without bodies, and the drawing statement they repeat: one block."""


@dataclass(frozen=True, repr=False)
class Program:
    """A shape as a list of drawing statements and loops, in the order they are written.

    If its parts are placed, ``source`` is its text and ``body`` the value of that: see
    :func:`shapeprog.language.evaluate.evaluated`, which makes such programs.  Functions of shapes use the body alone; a
    program of statements in cells has no source.  ``frame`` leads from its grid to the coordinates of its input, where
    that is known: in results of :func:`shapeprog.infer`, and in files with a frame.
    """

    body: tuple[Node, ...] = ()
    source: Source | None = None
    frame: Frame | None = field(default=None, compare=False)

    def __repr__(self) -> str:
        """Its size in one line."""
        return f"<Program: {self.blocks} blocks, {self.statements} statements, {self.size} solids>"

    def __str__(self) -> str:
        """Its text, without the last line break."""
        text: str = importlib.import_module("shapeprog.language.printer").format_program(self)  # which imports this
        return text.rstrip("\n")

    def _repr_png_(self) -> bytes:
        """A picture, which notebooks show."""
        return importlib.import_module("shapeprog.view.page").png(self)  # drawn above this level

    @property
    def unit(self) -> Unit | None:
        """The unit of the lengths in its text; ``None`` for cells, which those of ``body`` are in always."""
        return None if self.source is None else self.source.unit

    @property
    def scale(self) -> Scale | None:
        """How its text lies in the grid, if its parts are placed."""
        return None if self.source is None else self.source.scale

    @property
    def draws(self) -> list[Draw]:
        """The drawing statements, in the order of the text."""
        return [node for node in self.walk() if isinstance(node, Draw)]

    @cached_property
    def chains(self) -> list[Chain]:
        """The blocks, each as the loops around a drawing statement, outermost first, then the statement.

        A loop around several statements is the union of that loop around each, so the shape is the same.
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
        return Program(changed_lines(self.body, partial(changed_values, change=lambda value: float(round(value)))))


def programs_of(value: Any) -> list[Program]:
    """One program, or several, as a list; a ``ShapeProgError`` if anything else is among them."""
    return [*map(program_of, value if isinstance(value, Iterable) and not isinstance(value, str) else [value])]


def program_of(value: Any, frame: Frame | None = None) -> Program:
    """A program, or that of a result, in the frame that a caller gives; a ``ShapeProgError`` if either is none."""
    program = getattr(value, "program", value)
    if not isinstance(program, Program):
        cure = "sp.parse reads text, sp.load a file; sp.decode returns several"
        raise ShapeProgError(f"{reprlib.repr(value)} is no program", cure)
    if not isinstance(frame, Frame | None):
        raise ShapeProgError(f"frame is {reprlib.repr(frame)}", "give the frame of a shape or of a program, or nothing")
    return program if frame is None else replace(program, frame=frame)


def nest(chain: Chain) -> Node:
    """The node of a chain of loops and a drawing statement."""
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

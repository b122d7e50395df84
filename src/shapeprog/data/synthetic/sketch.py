"""A sketch: one piece of furniture, part by part, in centimetres that become cells.

Heights count from the floor, depth from the middle to the rear, left-right from the middle.  Lengths in
cells are rounded at once, and those of parts when they are added, so parts that share a plane share its number.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from shapeprog.language.parameters import to_float32
from shapeprog.language.program import Draw, Loop, Node, Program
from shapeprog.language.statement import language
from shapeprog.space import AXES

Point = tuple[float, float, float]
"""Up, depth and left-right."""

Span = tuple[float, float]
"""From and to, along one axis."""

DIGITS = 2
"""Decimals of lengths in cells."""


def tidy(length: float) -> float:
    """A length in cells with as many decimals as text should show."""
    return round(length, DIGITS) + 0.0


class Sketch:
    """The parts of one piece of furniture, in the order in which they are added.

    Parameters
    ----------
    random
        Where its choices come from.
    scale
        Cells in a centimetre.
    measures
        Where measures come from, if not from ``random``, so that all else is chosen as it would be without.
    """

    def __init__(self, random: np.random.Generator, scale: float, measures: np.random.Generator | None = None) -> None:
        self._random, self._scale, self._measures = random, scale, measures
        self._body: list[Node] = []

    @property
    def program(self) -> Program:
        """The program of all added parts."""
        return Program(tuple(self._body))

    def cm(self, low: float, high: float | None = None) -> float:
        """A length in cells: of so many centimetres, or of any number between two."""
        return tidy(self._scale * self.any(low, low if high is None else high))

    def any(self, low: float, high: float) -> float:
        """A number between two."""
        value = self._random.uniform(low, high)
        return float(value if self._measures is None else self._measures.uniform(low, high))

    def whole(self, low: int, high: int) -> int:
        """A whole number between two, both included."""
        return int(self._random.integers(low, high + 1))

    def chance(self, share: float) -> bool:
        """Whether something of that probability happens."""
        return bool(self._random.random() < share)

    def pick(self, *options: str) -> str:
        """One of several words."""
        return options[self.whole(0, len(options) - 1)]

    def add(self, role: str, solid: str, *numbers: float | Sequence[float], mirror: str = "", **repeat: float) -> None:
        """A part: its role, its statement and the numbers of that.

        Parameters
        ----------
        mirror
            Axes about whose middle planes it is mirrored, such as ``side depth``.
        repeat
            ``count`` of copies and the step between them, ``up_step``, ``depth_step``, ``side_step``; or ``turns``,
            copies around the vertical axis.
        """
        flat = [number for item in numbers for number in (item if isinstance(item, Sequence) else [item])]
        defaults = [item.default for item in language()[solid].parameters if item.start >= len(flat)]
        values = tuple(to_float32(tidy(number or 0.0)) for number in [*flat, *defaults])
        if (role, solid) == ("leg", "box"):
            solid = "leg"
        node: Node = Draw(solid, values, "" if role == solid else role)
        if repeat.get("count", 1) > 1:
            step = [to_float32(tidy(repeat.get(f"{axis}_step", 0.0))) for axis in AXES]
            node = Loop("translate", (float(repeat["count"]), *step), (node,))
        if "turns" in repeat:
            node = Loop("rotate", (float(repeat["turns"]), 1.0), (node,))
        for axis in reversed(mirror.split()):
            node = Loop("mirror", (2.0, float(AXES.index(axis)), 0.0), (node,))
        self._body.append(node)

    def box(
        self, role: str, up: Span, depth: Span, side: Span, *, solid: str = "box", more: Sequence[float] = (),
        mirror: str = "", **repeat: float,
    ) -> None:  # fmt: skip
        """A part from where to where it reaches along each axis; ``more`` are the other numbers of its statement."""
        at, end = ([*map(tidy, corner)] for corner in zip(up, depth, side, strict=True))
        size = [b - a for a, b in zip(at, end, strict=True)]
        self.add(role, solid, at, size, *more, mirror=mirror, **repeat)

    def stick(
        self, role: str, solid: str, foot: Point, head: Point, *numbers: float | Sequence[float], thick: float = 0.0,
        mirror: str = "", **repeat: float,
    ) -> None:  # fmt: skip
        """A part between two points; ``thick`` raises it by the lowest edge of its foot."""
        start, end = ([*map(tidy, point)] for point in (foot, head))
        along = np.subtract(end, start)
        lean = math.hypot(along[1], along[2]) / max(float(np.linalg.norm(along)), 1e-9)
        start[0] += thick / 2 * lean
        self.add(role, solid, start, end, *numbers, mirror=mirror, **repeat)


def between(foot: Point, head: Point, height: float) -> Point:
    """The point of a line at a height."""
    share = (height - foot[0]) / (head[0] - foot[0])
    up, depth, side = (tidy(a + share * (b - a)) for a, b in zip(foot, head, strict=True))
    return up, depth, side

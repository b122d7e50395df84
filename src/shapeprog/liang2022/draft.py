"""Programs of synthetic furniture, written block by block in whole numbers."""

from __future__ import annotations

import random
from collections.abc import Callable, Sequence
from typing import Any, TypeVar

from shapeprog.language.program import Draw, Loop, Node, nest
from shapeprog.space import UP

T = TypeVar("T")
Triple = tuple[int, ...]  # three numbers along up, depth and left-right
Repeats = Sequence[tuple[int, Triple]]  # translations, outermost first: number of copies, shift from one to the next
ODD = {"top_rectangle": "locker", "layer": "horizontal_bar", "sideboard": "vertical_board"}  # where extents are odd


class Rng(random.Random):
    """Random whole numbers and choices."""

    def whole(self, low: int, high: int) -> int:
        """A whole number from ``low`` to ``high``, both included; ``low`` where the range is empty."""
        return low + int(self.random() * (max(high - low, 0) + 1))

    def chance(self, probability: float) -> bool:
        """Whether an event of that probability happens."""
        return self.random() < probability

    def pick(self, weights: dict[T, float]) -> T:
        """One of the keys, by their weights."""
        return self.choices(list(weights), list(weights.values()))[0]


class Draft:
    """The blocks of one program, moved by ``shift``; ``boxes`` holds the low corners and extents of its boxes."""

    def __init__(self, shift: Triple = (0, 0, 0)) -> None:
        self.nodes: list[Node] = []
        self.boxes: list[tuple[Triple, Triple]] = []
        self._shift = shift

    def add(self, name: str, *numbers: int | Triple, repeat: Repeats = (), turns: tuple[int, ...] = ()) -> None:
        """Write a statement, its positions given as triples, within translations or a rotation."""
        loops = [Loop("translate", (count, *by), ()) for count, by in repeat if count > 1 and any(by)]
        loops += [Loop("rotate", turns, ())] if turns else []
        values: list[int] = []
        for number in numbers:
            values += [number] if isinstance(number, int) else map(sum, zip(number, self._shift, strict=True))
        self.nodes.append(nest((*loops, Draw(name, tuple(values)))))

    def box(
        self, name: str, low: Triple, size: Triple, *, repeat: Repeats = (), sides: bool = False,
        rear: int | None = None, tilt: int = 0,
    ) -> None:  # fmt: skip
        """Write a box by a statement, or by its substitute in ``ODD``; nothing if an extent is zero.

        ``sides`` adds a copy on the other side, ``rear`` one that ends at that depth; ``tilt`` shifts the top of a
        back to the rear.
        """
        up, depth, side = size
        if min(size) < 1:
            return
        if sides:
            repeat = [*repeat, (2, (0, 0, -2 * low[2] - side))]
        if rear is not None:
            repeat = [*repeat, (2, (0, rear - low[1] - depth, 0))]
        self.boxes.append((low, size))
        if name == "sideboard" and depth % 2 == 0:
            self.add(name, (low[0], low[1] + depth // 2, low[2]), up, depth // 2, side, repeat=repeat)
        elif name in ("top_rectangle", "layer") and depth % 2 == side % 2 == 0:
            middle = (low[0], low[1] + depth // 2, low[2] + side // 2)
            self.add(name, middle, up, depth // 2, side // 2, repeat=repeat)
        else:
            self.add(ODD.get(name, name), low, *size, *((tilt,) if name == "back" else ()), repeat=repeat)

    def spread(self, name: str, low: Triple, size: Triple, axis: int, count: int, thick: int = 0, **more: Any) -> None:
        """Write boxes evenly from end to end of a box along an axis, ``count`` of them as far as there is room.

        They are a cell apart if no thickness is given.  Spare cells stay at the bottom, or at both ends.
        """
        count = max(min(count, (size[axis] + 1) // (max(thick, 1) + 1)), 1)
        thick = thick or (size[axis] + 1) // count - 1
        pitch, spare = divmod(size[axis] - thick, max(count - 1, 1))
        start = low[axis] + (spare if axis == UP else spare // 2)
        repeat = [(count, _along(axis, pitch, (0, 0, 0)))]
        self.box(name, _along(axis, start, low), _along(axis, thick, size), repeat=repeat, **more)


def _along(axis: int, value: int, others: Triple) -> Triple:
    return (*others[:axis], value, *others[axis + 1 :])


Template = Callable[[Rng, Draft], None]  # a kind of furniture: it adds the blocks of one program to a draft

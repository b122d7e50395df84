"""Programs of synthetic furniture, written block by block in whole numbers."""

from __future__ import annotations

import random
from collections.abc import Callable, Sequence
from typing import TypeVar

from shapeprog.language import standard
from shapeprog.language.program import PUBLISHED_DEPTH
from shapeprog.language.statement import SLOTS

T = TypeVar("T")
Triple = tuple[int, int, int]
"""Numbers along up, depth and left-right."""
Repeat = tuple[int, Triple]
"""A translation: number of copies, and the shift from one to the next."""

IDS = {declared.name: declared.id for declared in standard}
ROLES = {
    "top": ("top_square", "top_rectangle", "horizontal_bar", "locker"),
    "shelf": ("layer", "horizontal_bar", "locker"),
    "side": ("sideboard", "vertical_board"),
}
"""Statements for boxes of one role, of which the first that fits the extents is used."""


class Rng(random.Random):
    """Random whole numbers and choices."""

    def whole(self, low: int, high: int) -> int:
        """A whole number from ``low`` to ``high``, both included; ``low`` where the range is empty."""
        return low + int(self.random() * (max(high - low, 0) + 1))

    def even(self, low: int, high: int) -> int:
        """An even number between two even ones, both included."""
        return 2 * self.whole(low // 2, high // 2)

    def chance(self, probability: float) -> bool:
        """Whether something of that probability happens."""
        return self.random() < probability

    def pick(self, weights: dict[T, float]) -> T:
        """One of the keys, by their weights."""
        rest = self.random() * sum(weights.values())
        for value, weight in weights.items():
            rest -= weight
            if rest < 0:
                return value
        return next(reversed(weights))


class Draft:
    """The blocks of one program, moved by ``shift``.

    ``rows`` holds the ids of the steps of a block and then their parameters; ``boxes`` the low corner and the extents
    of the first and the last copy of a part.
    """

    def __init__(self, shift: Triple = (0, 0, 0)) -> None:
        self.rows: list[list[int]] = []
        self.boxes: list[tuple[Triple, Triple]] = []
        self._shift = shift

    def add(self, name: str, *numbers: int | Triple, repeat: Sequence[Repeat] = (), turns: Sequence[int] = ()) -> None:
        """Write a statement, its positions given as triples, within translations or a rotation."""
        steps = [[IDS["rotate"], *turns]] if turns else []
        steps += [[IDS["translate"], count, *shift] for count, shift in repeat if count > 1 and any(shift)]
        last = [IDS[name]]
        for number in numbers:
            last += [number] if isinstance(number, int) else [a + b for a, b in zip(number, self._shift, strict=True)]
        line = [0] * (PUBLISHED_DEPTH * (1 + SLOTS))
        for step, (number, *values) in enumerate([*steps, last]):
            line[step] = number
            start = PUBLISHED_DEPTH + step * SLOTS
            line[start : start + len(values)] = values
        self.rows.append(line)

    def box(
        self, role: str, low: Triple, size: Triple, *, repeat: Sequence[Repeat] = (), sides: bool = False,
        rear: int | None = None, tilt: int = 0,
    ) -> None:  # fmt: skip
        """Write a box by one of ``ROLES`` or by a statement, unless an extent is zero.

        ``repeat`` holds translations, outermost first; ``sides`` adds a copy on the other side, ``rear`` one that ends
        at that depth; ``tilt`` shifts the top of a back to the rear.
        """
        up, depth, side = size
        if min(size) < 1:
            return
        if sides:
            repeat = [*repeat, (2, (0, 0, -2 * low[2] - side))]
        if rear is not None:
            repeat = [*repeat, (2, (0, rear - low[1] - depth, 0))]
        self._bound(low, size, repeat)
        name = next(name for name in ROLES.get(role, (role,)) if name == role or _fits(name, size))
        if name in ("top_square", "top_rectangle", "layer"):
            half = (depth // 2,) if name == "top_square" else (depth // 2, side // 2)
            self.add(name, (low[0], low[1] + depth // 2, low[2] + side // 2), up, *half, repeat=repeat)
        elif name == "sideboard":
            self.add(name, (low[0], low[1] + depth // 2, low[2]), up, depth // 2, side, repeat=repeat)
        else:
            self.add(name, low, up, depth, side, *((tilt,) if name == "back" else ()), repeat=repeat)

    def centred(self, name: str, at: Triple, height: int, reach: int, repeat: Sequence[Repeat] = ()) -> None:
        """Write a circle, square or support around the centre of its bottom face."""
        self._bound((at[0], at[1] - reach, at[2] - reach), (height, 2 * reach, 2 * reach), repeat)
        self.add(name, at, height, reach, repeat=repeat)

    def star(self, at: Triple, height: int, reach: int, count: int) -> None:
        """Write lines from a height above ``at`` down and outwards."""
        self.add("line", (at[0] + height, *at[1:]), (at[0], at[1] + 1 - reach, at[2]), 1, turns=(count, 0))

    def _bound(self, low: Triple, size: Triple, repeat: Sequence[Repeat]) -> None:
        up, depth, side = (low[axis] + sum((count - 1) * by[axis] for count, by in repeat) for axis in range(3))
        self.boxes += [(low, size), ((up, depth, side), size)]


def _fits(name: str, size: Triple) -> bool:
    """Whether a statement describes a box of these extents in whole numbers, and bars are no thicker than 2."""
    up, depth, side = size
    if name in ("top_rectangle", "layer"):
        return not depth % 2 and not side % 2
    if name in ("top_square", "sideboard"):
        return not depth % 2 and (depth == side or name == "sideboard")
    return name != "horizontal_bar" or up <= 2


Template = Callable[[Rng, Draft], None]
"""A kind of furniture: it adds the blocks of one program to a draft."""

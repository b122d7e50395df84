"""Names for numbers that several parts share."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence

import numpy as np

from shapeprog.inference.ties.layout import Layout, Slot
from shapeprog.language.ast import Part
from shapeprog.language.placement import RESERVED, SIZES
from shapeprog.language.statement import language

THIN = 0.6
"""A side of a part is its thickness if it is at most this share of the next longer one."""

FLAT = ("seat", "top", "shelf", "mattress", "cushion", "pillow")
"""Parts whose height is called thickness: the height of a seat is that of its top above the floor."""

APART = 1.0
"""Cells by which the middles of parts must differ for names by position."""

WHERE = (("left", "right"), ("front", "rear"), ("lower", "upper"))
"""Words for parts at different positions along each axis."""

STATEMENTS = {"leaning_box": "box", "beam": "bar"}


class Namer:
    """Names for the numbers of one program.

    Parameters
    ----------
    layout
        The program.
    slots
        Its numbers.
    """

    def __init__(self, layout: Layout, slots: Sequence[Slot]) -> None:
        self.layout, self.slots = layout, slots
        self.holders: dict[str, int] = {}
        words = language()
        roles = {line.role or line.kind for line in layout.lines if isinstance(line, Part)}
        self.used = {*SIZES, "diameter", *RESERVED, *words.names, *words.roles, *roles} - {"gap", "edge", "radius"}

    def name(self, members: Sequence[int]) -> str:
        """A new name for a number that these slots share."""
        offered = [*self._offered(members)]
        line = self._part(members)
        for base in offered:
            if base not in self.used:
                return self._take(base, line)
        for base in offered:
            for word in self._distinctions(self.holders.get(base, line), line):
                if (name := f"{word}_{base}") not in self.used:
                    return self._take(name, line)
        number = 2
        while f"{offered[0]}_{number}" in self.used:
            number += 1
        return self._take(f"{offered[0]}_{number}", line)

    def _take(self, name: str, line: int) -> str:
        self.used.add(name)
        self.holders[name] = line
        return name

    def _offered(self, members: Sequence[int]) -> Iterator[str]:
        """Candidate names of a number, the best first."""
        sizes = [k for k in members if self.slots[k].kind in ("size", "radius", "edge", "angle", "length")]
        selected = sizes or list(members)
        kinds = Counter(self._kind(self.slots[k]) for k in selected)
        roles = Counter(self._role(self.slots[k].line) for k in selected)
        kind = max(kinds, key=lambda word: (kinds[word], -[*kinds].index(word)))
        if len(roles) > 1 and kind in ("thickness", "radius", "inset", "setback", "edge", "tilt"):
            yield kind
        elif len(roles) > 1 and kind in SIZES:  # a number that no single part owns
            uses = Counter(self.slots[k].line for k in selected).most_common(1)[0]
            yield f"{self._role(uses[0])}_width" if uses[1] > 1 else "board_width"  # that of a square section
        for role, _ in roles.most_common():
            role_kinds = Counter(self._kind(self.slots[k]) for k in selected if self._role(self.slots[k].line) == role)
            yield f"{role}_{role_kinds.most_common(1)[0][0]}"
        for k in selected:
            slot = self.slots[k]
            if slot.axis >= 0 and slot.kind == "size":
                yield f"{self._role(slot.line)}_{SIZES[slot.axis]}"
            elif slot.axis >= 0:
                yield f"{self._role(slot.line)}_{slot.word.rpartition('.')[2]}"

    def _part(self, members: Sequence[int]) -> int:
        return self._first_part(self.slots[min(members, key=lambda k: self.slots[k].line)].line)

    def _first_part(self, line: int) -> int:
        """The line itself if it is a part, else the first part in it."""
        return self.layout.first(line)[0] if line >= 0 else 0

    def _role(self, line: int) -> str:
        part = self.layout.lines[self._first_part(line)]
        assert isinstance(part, Part)
        return part.role or STATEMENTS.get(part.kind, part.kind)

    def _kind(self, slot: Slot) -> str:
        """The measured quantity of a number, as the end of a name."""
        word = slot.word.rpartition(".")[2]
        if slot.kind == "size":
            return self._size(slot)
        if slot.kind == "clearance":
            return "inset" if slot.axis == 0 else "setback" if slot.axis == 1 else "drop" if word == "top" else word
        if slot.kind == "offset":
            return "offset"
        return slot.kind if slot.kind in ("radius", "edge") else slot.word.partition(".")[0]

    def _size(self, slot: Slot) -> str:
        sizes = sorted(
            [candidate.value for candidate in self.slots if candidate.line == slot.line and candidate.kind == "size"]
            + [self._full(slot.line, axis) for axis in range(3) if not self._is_sized(slot.line, axis)]
        )
        flat = slot.axis == 2 and self._role(slot.line) in FLAT
        if flat or (slot.value <= sizes[0] and (len(sizes) < 2 or sizes[0] <= THIN * sizes[1])):
            return "thickness"
        return SIZES[slot.axis]

    def _is_sized(self, line: int, axis: int) -> bool:
        return any(slot.line == line and slot.kind == "size" and slot.axis == axis for slot in self.slots)

    def _full(self, line: int, axis: int) -> float:
        element = self.layout.elements.get((line, "", axis))
        return element.high - element.low if element else float("inf")

    def _distinctions(self, first: int, second: int) -> Iterator[str]:
        """Words that distinguish the second of two parts from the first, the best first."""
        middles = [self._middle(line) for line in (first, second)]
        away = middles[1] - middles[0]
        for axis in np.argsort(-np.abs(away), kind="stable"):
            if abs(away[axis]) >= APART:
                if axis == 0:
                    extent = self.layout.extents[0] / 2
                    yield ("inner", "outer")[int(abs(middles[1][0] - extent) > abs(middles[0][0] - extent))]
                else:
                    yield WHERE[axis][int(away[axis] > 0)]

    def _middle(self, line: int) -> np.ndarray:
        of_part = [element for (number, *_), element in self.layout.elements.items() if number == line]
        return np.array([np.mean([e.middle for e in of_part if e.axis == axis] or [0.0]) for axis in range(3)])

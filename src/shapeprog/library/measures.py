"""What can be measured of some blocks together, the relations between it, and words for it."""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from typing import Literal, NamedTuple

import numpy as np

from shapeprog.library.blocks import Kind, Slot
from shapeprog.space import DEPTH, SIDE, UP, FloatArray

EXTENTS = ("height", "depth", "width")
LOW = ("bottom", "front", "left")
AXIS = ("up", "depth", "side")

THIN = 0.6
"""A solid is thin along an axis where it measures less than this share of the next longer."""

CHOSEN = 2.5
"""Price up to which a place is a side of a whole block; dearer ones are of single copies, or ends of rods."""

SIDES_OF = (("bottom", "top"), ("front", "rear"), ("right", "left"))
"""The low and the high side of a box along each axis of the grid."""

LEAST_EXTENT = 0.1
"""Cells that the box of a group measures along each axis, at least."""

Sort = Literal["length", "place", "middle", "angle"]


class Group(NamedTuple):
    """Blocks that may be a function: their kinds and the slots of each, one block after another."""

    kinds: tuple[Kind, ...]
    slots: tuple[tuple[Slot, ...], ...]

    @property
    def size(self) -> int:
        """How many numbers they have."""
        return sum(map(len, self.slots))

    @property
    def counts(self) -> int:
        """How many of their repetitions have a count that is open."""
        return sum(way == "row" for kind in self.kinds for _, way in kind.repeats)


class Measure(NamedTuple):
    """A measure of a group: its block, its row of factors, and its price as an argument of a call.

    An ``opening`` is zero in most programs: a part centred in the whole, or an upright angle.
    """

    block: int
    word: str
    sort: Sort
    axis: int
    row: FloatArray
    price: float

    @property
    def opening(self) -> bool:
        """Whether it may be an optional argument."""
        return self.sort == "angle" or (self.sort == "middle" and self.axis != UP)


def measures(group: Group, typical: FloatArray) -> Iterator[Measure]:
    """All measures of a group; ``typical`` are its numbers (M,) in one program, by which thin parts are recognised."""
    start = 0
    unit = np.eye(group.size)
    for block, (kind, slots) in enumerate(zip(group.kinds, group.slots, strict=True)):
        own, values = unit[start : start + len(slots)], typical[start : start + len(slots)]
        start += len(slots)
        for word, sort, axis, row, price in (
            _boxed(kind, slots, own, values) if kind.boxed else _pointed(kind, slots, own, values)
        ):
            yield Measure(block, word, sort, axis, row, price)


def boxes_of(group: Group, typical: FloatArray) -> Iterator[FloatArray]:
    """The boxes of a group as rows (6, M): their low corner, then their extents, if these are more than nothing.

    Which sides of which blocks are the sides of a box follows from ``typical`` (M,), the numbers in one program.  Parts
    between points count by these points along their direction and where they are mirrored; elsewhere by their thickness
    at the start, so that they may lean either way, or by their points as well.
    """
    unique = {box.tobytes(): box for leaning in (True, False) if (box := _box(group, typical, leaning)) is not None}
    yield from unique.values()


def _box(group: Group, typical: FloatArray, leaning: bool) -> FloatArray | None:
    lows: list[list[FloatArray]] = [[], [], []]
    highs: list[list[FloatArray]] = [[], [], []]
    start, unit = 0, np.eye(group.size)
    for kind, slots in zip(group.kinds, group.slots, strict=True):
        own, first = unit[start : start + len(slots)], len(slots) - kind.spans
        start += len(slots)
        spans = {axis: own[place] for place, (axis, _) in enumerate(kind.repeats, first)}
        mirrored = {axis for axis, way in kind.repeats if way == "mirror"}
        across = _across(kind, slots, own, own @ typical) if leaning else {}
        for row, slot in zip(own[:first], slots[:first], strict=True):
            if slot.kind != "position":
                continue
            axis = slot.axis
            if axis in across and axis not in mirrored and axis not in spans:
                ends = [row - across[axis] / 2, row + across[axis] / 2] if slot.word == "start" else []
                lows[axis] += ends
                highs[axis] += ends
                continue
            sizes = [size for size, other in zip(own, slots, strict=True) if other == ("size", "length", axis)]
            ends = [row, *(row + size for size in sizes)]
            if axis in mirrored:
                ends += [2 * spans[axis] - end for end in ends]
            elif axis in spans:
                ends = [row, row + spans[axis]]
            lows[axis] += ends
            highs[axis] += ends
    low = [min(rows, key=lambda row: row @ typical) for rows in lows]
    high = [max(rows, key=lambda row: row @ typical) for rows in highs]
    box = np.array([*low, *(b - a for a, b in zip(low, high, strict=True))])
    return box if min(box[3:] @ typical) >= LEAST_EXTENT and np.linalg.matrix_rank(box) == 6 else None


def _across(kind: Kind, slots: Sequence[Slot], own: FloatArray, values: FloatArray) -> dict[int, FloatArray]:
    """The thickness of a part between two points along the axes across its direction."""
    across = sorted({UP, *_leaning(slots, values)} if _leaning(slots, values) != {DEPTH, SIDE} else {DEPTH, SIDE})
    thick = [row for slot, row in zip(slots, own, strict=True) if slot.word in ("section", "radius")]
    if not thick or not _leaning(slots, values):
        return {}
    return {axis: thick[place] if kind.shape == "bar" else 2 * thick[0] for place, axis in enumerate(across)}


def _leaning(slots: Sequence[Slot], values: FloatArray) -> set[int]:
    """The horizontal axes across the direction of a part between two points; none of other parts."""
    ends = {(slot.word, slot.axis): value for slot, value in zip(slots, values, strict=False)}
    if ("end", UP) not in ends or ("through", UP) in ends:
        return set()
    along = max(range(3), key=lambda axis: abs(ends["end", axis] - ends["start", axis]))
    return {DEPTH, SIDE} - {along}


def within_box(known: Iterable[Measure], box: FloatArray) -> Iterator[Measure]:
    """Measures with places told from the low and the high side of a box (6, M)."""
    for each in known:
        if each.sort not in ("place", "middle"):
            yield each
            continue
        low, size = box[each.axis], box[3 + each.axis]
        end = f"{each.word.partition('_at_')[0]}_" if "_at_" in each.word else ""
        near, far = SIDES_OF[each.axis]
        yield each._replace(word=f"{end}{near}", row=each.row - low)
        yield each._replace(word=f"{end}{far}", row=low + size - each.row, price=each.price + 0.1)


def moved(group: Group) -> FloatArray:
    """How the numbers of a group change where it moves by one cell along each axis: (3, M)."""
    slots = [slot for each in group.slots for slot in each]
    return np.array(
        [
            [slot.axis == axis and (slot.kind == "position" or slot.word == "plane") for slot in slots]
            for axis in range(3)
        ],
        np.float64,
    )


def relations(known: Sequence[Measure]) -> list[FloatArray]:
    """Relations that may hold: equal lengths, faces flush or in contact, what lies in the middle, what is straight."""
    found = [each.row for each in known if each.opening]
    for one, two in itertools.combinations(known, 2):
        if one.sort == two.sort == "length":
            found.append(one.row - two.row)
        if one.axis != two.axis or not {one.sort, two.sort} <= {"place", "middle"}:
            continue
        ends = one.sort == two.sort == "place" and one.price >= CHOSEN
        if one.block != two.block or ends:
            found.append(one.row - two.row)
        if one.block == two.block and ends and one.axis != UP:
            found.append(one.row + two.row)
    unique: dict[bytes, FloatArray] = {}
    for row in found:
        if row.any():
            sign = np.sign(row[np.flatnonzero(row)[0]])
            unique.setdefault((np.round(row * sign, 6) + 0.0).tobytes(), row)
    return list(unique.values())


Found = tuple[str, Sort, int, FloatArray, float]


def _boxed(kind: Kind, slots: Sequence[Slot], own: FloatArray, values: FloatArray) -> Iterator[Found]:
    """Measures of solids that are told by low corner, extents and what else shapes them."""
    first = len(slots) - kind.spans
    repeats = {axis: place for place, (axis, _) in enumerate(kind.repeats, first)}
    sizes = values[3:6]
    thin = int(np.argmin(sizes))
    flat = bool(sizes[thin] < THIN * np.sort(sizes)[1])
    for axis in range(3):
        low, size, word = own[axis], own[3 + axis], EXTENTS[axis]
        span = own[repeats[axis]] if axis in repeats else size
        if axis in repeats:
            yield word, "length", axis, span, 0.0
            word = f"each_{word}"
        if kind.shape == "cylinder" and axis != UP:
            word = "diameter"
        elif flat and axis == thin:
            word = "thickness"
        yield word, "length", axis, size, 1.0 + 0.1 * axis
        yield LOW[axis], "place", axis, low, 2.0
        yield f"middle_{AXIS[axis]}", "middle", axis, low + span / 2, 4.0
        yield f"{LOW[axis]}_end", "place", axis, low + span, 5.0
        if axis in repeats:
            yield f"inner_{LOW[axis]}", "place", axis, low + size, 6.0
            yield f"outer_{LOW[axis]}", "place", axis, low + span - size, 6.0
    for place in range(6, first):
        yield slots[place].word, "length", -1, own[place], 1.3


def _pointed(kind: Kind, slots: Sequence[Slot], own: FloatArray, values: FloatArray) -> Iterator[Found]:
    """Measures of solids that are told by points, such as the two ends of a rod."""
    first = len(slots) - kind.spans
    planes = {axis: own[place] for place, (axis, way) in enumerate(kind.repeats, first) if way == "mirror"}
    rising = _rises(slots, values)
    heights: dict[str, FloatArray] = {}
    numbered: Counter[str] = Counter()
    for row, slot in zip(own, slots[:first], strict=False):
        end = {"start": "bottom", "end": "upper"}.get(slot.word, slot.word) if rising else slot.word
        if slot.kind == "position":
            if slot.axis in planes:
                yield f"{end}_{EXTENTS[slot.axis]}", "length", slot.axis, 2 * (row - planes[slot.axis]), 0.2
            if slot.axis == UP:
                heights[slot.word] = row
                yield "bottom" if slot.word in ("start", "at") else f"{slot.word}_up", "place", UP, row, 2.0
            else:
                yield f"{end}_at_{AXIS[slot.axis]}", "place", slot.axis, row, 3.0
        elif slot.kind == "length":
            numbered[slot.word] += 1
            word = {"size": EXTENTS[slot.axis]}.get(slot.word, slot.word)
            if slot.word == "section":
                word = "thickness" if numbered[slot.word] == 1 else "breadth"
            elif sum(each.word == slot.word for each in slots) == 2:
                word = f"{'bottom' if numbered[slot.word] == 1 else 'upper'}_{slot.word}"
            yield word, "length", slot.axis, row, 1.0
        else:
            yield slot.word, "angle", -1, row, 1.0
    ends = {(slot.word, slot.axis): row for slot, row in zip(slots, own, strict=False)}
    for axis in _leaning(slots, values) - planes.keys():
        yield "lean" if axis == DEPTH else "shift", "angle", axis, ends["end", axis] - ends["start", axis], 1.2
    if heights.keys() >= {"start", "end"}:
        yield "height" if rising else "rise", "length", UP, heights["end"] - heights["start"], 1.5
    for place, (axis, way) in enumerate(kind.repeats, first):
        if way == "mirror":
            yield f"middle_{AXIS[axis]}", "middle", axis, own[place], 4.0
        else:
            yield EXTENTS[axis], "length", axis, own[place], 0.5


def _rises(slots: Sequence[Slot], values: FloatArray) -> bool:
    """Whether what runs from a start to an end runs upwards more than along the floor."""
    ends = {(slot.word, slot.axis): value for slot, value in zip(slots, values, strict=False)}
    if ("start", UP) not in ends or ("end", UP) not in ends:
        return False
    along = [ends["end", axis] - ends["start", axis] for axis in range(3)]
    return bool(along[UP] > max(abs(along[DEPTH]), abs(along[SIDE])))

"""Measures of groups of blocks, the relations between them, and their names."""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from typing import Literal, NamedTuple

import numpy as np

from shapeprog.language.placement import BOX_IN_CELLS
from shapeprog.library.blocks import Kind, Slot
from shapeprog.space import AXES, DEPTH, SIDE, UP, FloatArray

LOW, EXTENTS = BOX_IN_CELLS[:3], BOX_IN_CELLS[3:]

THIN = 0.6
"""A solid is thin along an axis where it measures less than this share of the next longer."""

SIDE_PRICE = 2.5
"""Largest price of a side of a complete block; higher prices are sides of single copies, or ends of rods."""

SIDES_OF = (("bottom", "top"), ("front", "rear"), ("right", "left"))
"""The low and the high side of a box along each axis of the grid."""

LEAST_EXTENT = 0.1
"""Least extent of the box of a group along an axis, in cells."""

Sort = Literal["length", "place", "middle", "angle"]


class Group(NamedTuple):
    """Blocks that a function may draw: the kind and the slots of each block."""

    kinds: tuple[Kind, ...]
    slots: tuple[tuple[Slot, ...], ...]

    @property
    def size(self) -> int:
        """How many numbers they have."""
        return sum(map(len, self.slots))

    @property
    def counts(self) -> int:
        """How many of their repetitions have a variable count."""
        return sum(way == "row" for kind in self.kinds for _, way in kind.repeats)


class Measure(NamedTuple):
    """A measure of a group: its block, its row of factors, and its price as an argument of a call.

    An ``opening`` is zero in most programs: a part centred in the object, or an upright angle.
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
    """All measures of a group; ``typical`` are its numbers (M,) in one program, which show thin parts."""
    start = 0
    unit = np.eye(group.size)
    for block, (kind, slots) in enumerate(zip(group.kinds, group.slots, strict=True)):
        factors, values = unit[start : start + len(slots)], typical[start : start + len(slots)]
        start += len(slots)
        for word, sort, axis, row, price in (
            _boxed(kind, slots, factors, values) if kind.boxed else _pointed(kind, slots, factors, values)
        ):
            yield Measure(block, word, sort, axis, row, price)


def boxes_of(group: Group, typical: FloatArray) -> Iterator[FloatArray]:
    """The boxes of a group as rows (6, M): their low corner, then their extents, which are positive.

    The blocks whose sides bound a box follow from ``typical`` (M,), the numbers in one program.  The points of a part
    between points bound it along its direction and along mirrored axes.  Along the other axes its thickness at the
    start does in one box, so that it may lean either way, and its points do in the other.
    """
    unique = {box.tobytes(): box for leaning in (True, False) if (box := _box(group, typical, leaning)) is not None}
    yield from unique.values()


def _box(group: Group, typical: FloatArray, leaning: bool) -> FloatArray | None:
    lows: list[list[FloatArray]] = [[], [], []]
    highs: list[list[FloatArray]] = [[], [], []]
    start, unit = 0, np.eye(group.size)
    for kind, slots in zip(group.kinds, group.slots, strict=True):
        factors, first = unit[start : start + len(slots)], len(slots) - kind.spans
        start += len(slots)
        spans = {axis: factors[index] for index, (axis, _) in enumerate(kind.repeats, first)}
        mirrored = {axis for axis, way in kind.repeats if way == "mirror"}
        across = _across(kind, slots, factors, factors @ typical) if leaning else {}
        for row, slot in zip(factors[:first], slots[:first], strict=True):
            if slot.kind != "position":
                continue
            axis = slot.axis
            if axis in across and axis not in mirrored and axis not in spans:
                ends = [row - across[axis] / 2, row + across[axis] / 2] if slot.word == "start" else []
                lows[axis] += ends
                highs[axis] += ends
                continue
            sizes = [size for size, item in zip(factors, slots, strict=True) if item == ("size", "length", axis)]
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


def _across(kind: Kind, slots: Sequence[Slot], factors: FloatArray, values: FloatArray) -> dict[int, FloatArray]:
    """The thickness of a part between two points along the axes across its direction."""
    leaning = _leaning(slots, values)
    thick = [row for slot, row in zip(slots, factors, strict=True) if slot.word in ("section", "radius")]
    if not thick or not leaning:
        return {}
    across = sorted(leaning if leaning == {DEPTH, SIDE} else {UP, *leaning})
    return {axis: thick[index] if kind.shape == "bar" else 2 * thick[0] for index, axis in enumerate(across)}


def _leaning(slots: Sequence[Slot], values: FloatArray) -> set[int]:
    """The horizontal axes across the direction of a part between two points; empty for other parts."""
    ends = {(slot.word, slot.axis): value for slot, value in zip(slots, values, strict=False)}
    if ("end", UP) not in ends or ("through", UP) in ends:
        return set()
    along = max(range(3), key=lambda axis: abs(ends["end", axis] - ends["start", axis]))
    return {DEPTH, SIDE} - {along}


def within_box(all_measures: Iterable[Measure], box: FloatArray) -> Iterator[Measure]:
    """Measures with positions relative to the low and the high side of a box (6, M)."""
    for measure in all_measures:
        if measure.sort not in ("place", "middle"):
            yield measure
            continue
        low, size = box[measure.axis], box[3 + measure.axis]
        end = f"{measure.word.partition('_at_')[0]}_" if "_at_" in measure.word else ""
        low_side, high_side = SIDES_OF[measure.axis]
        yield measure._replace(word=f"{end}{low_side}", row=measure.row - low)
        yield measure._replace(word=f"{end}{high_side}", row=low + size - measure.row, price=measure.price + 0.1)


def moved(group: Group) -> FloatArray:
    """The change of the numbers of a group when it moves by one cell along each axis: (3, M)."""
    slots = [slot for block_slots in group.slots for slot in block_slots]
    return np.array(
        [
            [slot.axis == axis and (slot.kind == "position" or slot.word == "plane") for slot in slots]
            for axis in range(3)
        ],
        np.float64,
    )


def relations(all_measures: Sequence[Measure]) -> list[FloatArray]:
    """Relations that may hold: equal lengths, faces flush or in contact, centred parts, zero angles."""
    rows = [measure.row for measure in all_measures if measure.opening]
    for first, second in itertools.combinations(all_measures, 2):
        if first.sort == second.sort == "length":
            rows.append(first.row - second.row)
        if first.axis != second.axis or not {first.sort, second.sort} <= {"place", "middle"}:
            continue
        ends = first.sort == second.sort == "place" and first.price >= SIDE_PRICE
        if first.block != second.block or ends:
            rows.append(first.row - second.row)
        if first.block == second.block and ends and first.axis != UP:
            rows.append(first.row + second.row)
    unique: dict[bytes, FloatArray] = {}
    for row in rows:
        if row.any():
            sign = np.sign(row[np.flatnonzero(row)[0]])
            unique.setdefault((np.round(row * sign, 6) + 0.0).tobytes(), row)
    return list(unique.values())


Fields = tuple[str, Sort, int, FloatArray, float]


def _boxed(kind: Kind, slots: Sequence[Slot], factors: FloatArray, values: FloatArray) -> Iterator[Fields]:
    """Measures of solids described by low corner, extents and further sizes."""
    first = len(slots) - kind.spans
    repeats = {axis: index for index, (axis, _) in enumerate(kind.repeats, first)}
    sizes = values[3:6]
    thin = int(np.argmin(sizes))
    flat = bool(sizes[thin] < THIN * np.sort(sizes)[1])
    for axis in range(3):
        low, size, word = factors[axis], factors[3 + axis], EXTENTS[axis]
        span = factors[repeats[axis]] if axis in repeats else size
        if axis in repeats:
            yield word, "length", axis, span, 0.0
            word = f"each_{word}"
        if kind.shape == "cylinder" and axis != UP:
            word = "diameter"
        elif flat and axis == thin:
            word = "thickness"
        yield word, "length", axis, size, 1.0 + 0.1 * axis
        yield LOW[axis], "place", axis, low, 2.0
        yield f"middle_{AXES[axis]}", "middle", axis, low + span / 2, 4.0
        yield f"{LOW[axis]}_end", "place", axis, low + span, 5.0
        if axis in repeats:
            yield f"inner_{LOW[axis]}", "place", axis, low + size, 6.0
            yield f"outer_{LOW[axis]}", "place", axis, low + span - size, 6.0
    for index in range(6, first):
        yield slots[index].word, "length", -1, factors[index], 1.3


def _pointed(kind: Kind, slots: Sequence[Slot], factors: FloatArray, values: FloatArray) -> Iterator[Fields]:
    """Measures of solids described by points, such as the two ends of a rod."""
    first = len(slots) - kind.spans
    planes = {axis: factors[index] for index, (axis, way) in enumerate(kind.repeats, first) if way == "mirror"}
    rising = _rises(slots, values)
    heights: dict[str, FloatArray] = {}
    numbered: Counter[str] = Counter()
    for row, slot in zip(factors, slots[:first], strict=False):
        end = {"start": "bottom", "end": "upper"}.get(slot.word, slot.word) if rising else slot.word
        if slot.kind == "position":
            if slot.axis in planes:
                yield f"{end}_{EXTENTS[slot.axis]}", "length", slot.axis, 2 * (row - planes[slot.axis]), 0.2
            if slot.axis == UP:
                heights[slot.word] = row
                yield "bottom" if slot.word in ("start", "at") else f"{slot.word}_up", "place", UP, row, 2.0
            else:
                yield f"{end}_at_{AXES[slot.axis]}", "place", slot.axis, row, 3.0
        elif slot.kind == "length":
            numbered[slot.word] += 1
            word = {"size": EXTENTS[slot.axis]}.get(slot.word, slot.word)
            if slot.word == "section":
                word = "thickness" if numbered[slot.word] == 1 else "breadth"
            elif sum(candidate.word == slot.word for candidate in slots) == 2:
                word = f"{'bottom' if numbered[slot.word] == 1 else 'upper'}_{slot.word}"
            yield word, "length", slot.axis, row, 1.0
        else:
            yield slot.word, "angle", -1, row, 1.0
    ends = {(slot.word, slot.axis): row for slot, row in zip(slots, factors, strict=False)}
    for axis in _leaning(slots, values) - planes.keys():
        yield "lean" if axis == DEPTH else "shift", "angle", axis, ends["end", axis] - ends["start", axis], 1.2
    if heights.keys() >= {"start", "end"}:
        yield "height" if rising else "rise", "length", UP, heights["end"] - heights["start"], 1.5
    for index, (axis, way) in enumerate(kind.repeats, first):
        if way == "mirror":
            yield f"middle_{AXES[axis]}", "middle", axis, factors[index], 4.0
        else:
            yield EXTENTS[axis], "length", axis, factors[index], 0.5


def _rises(slots: Sequence[Slot], values: FloatArray) -> bool:
    """Whether a part from a start to an end rises more than it runs along the floor."""
    ends = {(slot.word, slot.axis): value for slot, value in zip(slots, values, strict=False)}
    if ("start", UP) not in ends or ("end", UP) not in ends:
        return False
    along = [ends["end", axis] - ends["start", axis] for axis in range(3)]
    return bool(along[UP] > max(abs(along[DEPTH]), abs(along[SIDE])))

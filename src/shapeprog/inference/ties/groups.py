"""Lines of a tied program written shorter: rows of two as mirrors, neighbours that fill a box as its division, and
parts with equal clearances inside of a new box."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import combinations

from shapeprog.inference.ties.naming import interval
from shapeprog.language.ast import Argument, Group, Keywords, Line, Part, Point, Source, changed_lines, values
from shapeprog.language.convert.loops import with_joined_mirrors
from shapeprog.language.convert.parts import ordered
from shapeprog.language.expression import Binary, Expression, Name, Value, names_in, value_at
from shapeprog.language.merging import merged_lines
from shapeprog.language.parameters import to_float32
from shapeprog.language.placement import AXES, BOX, SIZES, axis_of

BOXES = ("box", "cushion")
GAP, LEAST = 0.25, 2.0
"""Neighbours divide a box if the gap between them is at most this share of their size, which is this many cells."""

CENTRED = 0.1
"""Cells by which the clearances of a part in the middle differ at most."""

Side = tuple[str, str]
"""A keyword of a side, and the text of its value."""


def grouped(lines: Sequence[Line], numbers: dict[str, float]) -> tuple[Line, ...]:
    """The lines of a placed program in fewer words.

    Parameters
    ----------
    lines
        Lines that draw; no groups but loops.
    numbers
        The values of all names.
    """

    def shorter(line: Line) -> Line:
        return _divided(_mirrored(_straight(line)), numbers) if isinstance(line, Group) else line

    changed = changed_lines(lines, shorter)
    return _in_boxes(with_joined_mirrors(merged_lines(changed_lines(changed, _nested))))


# ---- rows ---------------------------------------------------------------------------------------------------------


def _straight(row: Group) -> Group:
    """A row without the axes along which its last copy is where the first is."""
    first = next(_solids(row), None)
    if row.kind != "row" or first is None:
        return row
    (_, last), *_ = row.keywords
    assert isinstance(last, Point)
    arguments = dict(first.keywords)
    start = arguments.get("start")
    if isinstance(start, Point):
        arguments = dict(start.keywords)

    def same(word: str, value: Value) -> bool:
        words = next(words for words in AXES if word in words)
        full = word != words.offset and not {words.size, "radius"} & arguments.keys() and start is None
        default = (
            0.0
            if full or word == "bottom" or (word == words.offset and not set(words[:2]) & arguments.keys())
            else None
        )
        return arguments.get(word, default) == value

    pairs = tuple((word, value) for word, value in last.keywords if not same(word, value))
    return replace(row, keywords=(("last", Point(pairs or last.keywords)),))


def _nested(line: Line) -> Line:
    """A mirror about several planes as one for each, so that loops about one of them can be merged."""
    if not isinstance(line, Group) or line.kind != "mirror" or len(line.keywords) < 2:
        return line
    return replace(line, keywords=line.keywords[:1], body=(replace(line, keywords=line.keywords[1:], note=""),))


def _mirrored(row: Group) -> Group:
    """A row of two parts with equal clearances as a mirror about the middle."""
    (_, last), *further = row.keywords or [("", 0.0)]
    if row.kind != "row" or further or row.count != 2 or not isinstance(last, Point) or len(last.keywords) != 1:
        return row
    (word, value), *_ = last.keywords
    axis = axis_of(word)
    words, first = AXES[axis], _only_part(row)
    if axis == 2 or first is None or word == words.offset or {"tilt", "lean", "turn"} & dict(first.keywords).keys():
        return row
    opposite = words.high if word == words.low else words.low
    keywords = dict(first.keywords)
    start = keywords.get("start")
    if isinstance(start, Point):
        ends = (keywords["end"], keywords.get("through"))
        crooked = any(set(words) & dict(end.keywords).keys() for end in ends if isinstance(end, Point))
        same = dict(start.keywords).get(opposite) == value and not crooked
    else:
        same = keywords.get(opposite) == value and word not in keywords
    return Group("mirror", ((words.offset, 0.0),), row.body, note=row.note) if same else row


def _divided(loop: Group, numbers: dict[str, float]) -> Group:
    """A row, or a mirror, of equal neighbours as the division of a box; further parts of a row are placed in each."""
    part, *others = loop.body
    if not all(isinstance(line, Part) and _is_upright(line) for line in loop.body):
        return loop
    assert isinstance(part, Part)
    keywords = dict(part.keywords)
    if loop.kind == "mirror" and len(loop.keywords) == 1 and not others:
        (word, plane), *_ = loop.keywords
        axis = axis_of(word)
        words, middle = AXES[axis], Binary("/", Name(SIZES[axis]), 2.0)
        if word != words.offset or plane != 0 or words.size in keywords:
            return loop
        clearance, inner = keywords.get(words.low, 0.0), keywords.get(words.high, 0.0)
        if inner == middle:
            gap = 0.0
        elif isinstance(inner, Binary) and inner.left == middle and isinstance(inner.right, float):
            gap = to_float32(2 * inner.right if inner.operator == "+" else -2 * inner.right)
        else:
            return loop
        return _division(part, axis, 2.0, (clearance, clearance), gap) if gap >= 0 else loop
    if loop.kind != "row" or len(loop.keywords) != 1 or not isinstance(loop.count, float | int):
        return loop
    (_, last), *_ = loop.keywords
    if not isinstance(last, Point) or len(last.keywords) != 1:
        return loop
    (word, value), *_ = last.keywords
    axis = axis_of(word)
    words = AXES[axis]
    size = keywords.get(words.size)
    first_word = words.high if word == words.low else words.low if word == words.high else ""
    if (
        not isinstance(size, float)
        or (size < LEAST and not others)
        or (others and any(SIZES[axis] in names_in(value) for line in loop.body for value in values(line)))
        or any(words.size not in dict(other.keywords) for other in others if isinstance(other, Part))
        or (first_word not in keywords and not (axis == 2 and first_word == "bottom"))
    ):
        return loop
    clearances = {word: value, first_word: keywords.get(first_word, 0.0)}
    occupied = sum(value_at(clearance, numbers) for clearance in clearances.values())  # type: ignore[arg-type]
    gap = (numbers[SIZES[axis]] - occupied - loop.count * size) / (loop.count - 1)
    if not 0 <= round(gap, 2) <= GAP * size:
        return loop
    further = tuple(_in_division(other, part, axis, numbers) for other in others if isinstance(other, Part))
    return _division(part, axis, loop.count, (clearances[words.low], clearances[words.high]), round(gap, 2), further)


def _division(
    part: Part,
    axis: int,
    count: float,
    clearances: tuple[Argument, Argument],
    gap: float,
    others: tuple[Part, ...] = (),
) -> Group:
    """The division of a box; it has the sides of its only part."""
    words = AXES[axis]
    mine = [(word, value) for word, value in zip(words[:2], clearances, strict=True) if value != 0]
    sides = [(word, value) for word, value in part.keywords if word in BOX and word not in words and not others]
    remaining = tuple(
        (word, value) for word, value in part.keywords if word not in words and (word, value) not in sides
    )
    keywords: Keywords = (*([("gap", to_float32(gap))] if gap else []), *ordered((*mine, *sides)))
    return Group("divide", keywords, (replace(part, keywords=remaining), *others), float(count), "xyz"[axis])


def _in_division(part: Part, first: Part, axis: int, numbers: dict[str, float]) -> Part:
    """A part of a row in the box of the first one, in the middle of it if it nearly is."""
    words = AXES[axis]
    (low, size), (start, whole) = (interval(each, axis, numbers) for each in (part, first))
    remaining = [(word, value) for word, value in part.keywords if word not in words or word == words.size]
    centred = abs(2 * (low - start) + size - whole) < CENTRED
    place = (words.offset, 0.0) if centred else (words.low, to_float32(round(low - start, 2)))
    return replace(part, keywords=ordered((place, *remaining)))


def _is_upright(part: Part) -> bool:
    return part.kind in BOXES and not {"tilt", "lean"} & dict(part.keywords).keys()


def _solids(line: Line) -> Iterator[Part]:
    return (inner for inner in Source((line,)).walk() if isinstance(inner, Part))


def _only_part(line: Line) -> Part | None:
    """The only part inside of loops that mirror; none if there are several lines in them."""
    while isinstance(line, Group):
        if len(line.body) != 1 or line.kind not in ("row", "mirror"):
            return None
        line = line.body[0]
    return line if isinstance(line, Part) else None


# ---- boxes --------------------------------------------------------------------------------------------------------


def _in_boxes(lines: tuple[Line, ...]) -> tuple[Line, ...]:
    """Parts and loops with equal clearances moved into boxes, while that saves words."""
    while True:
        drawing = [k for k, line in enumerate(lines) if isinstance(line, Part | Group) and not _is_box(line)]
        sides = {k: _sides(lines[k]) for k in drawing}
        frames = {frozenset(sides[a].items()) & frozenset(sides[b].items()) for a, b in combinations(drawing, 2)}
        best: tuple[int, tuple[Side, ...], list[int]] | None = None
        for frame in sorted(tuple(sorted(frame)) for frame in frames if frame):
            members = [k for k in drawing if _fits(lines[k], dict(frame))]
            saved = sum(_saved(lines[k], dict(frame)) for k in members) - 2 - _length(frame)
            if len(members) > 1 and (best is None or saved > best[0]):
                best = (saved, frame, members)
        if best is None or best[0] <= 0:
            return lines
        _, frame, members = best
        sizes = {word: value for k in members for word, value in _values(lines[k], dict(frame))}
        body = tuple(_inside(lines[k], dict(frame)) for k in members)
        order = [word for words in AXES for word in words if word in dict(frame)]
        box = Group("inside", tuple((word, sizes[word]) for word in order), body)
        lines = tuple(
            box if k == members[0] else line for k, line in enumerate(lines) if k not in members or k == members[0]
        )


def _is_box(line: Line) -> bool:
    return isinstance(line, Group) and line.kind == "inside"


def _outer(line: Line) -> Iterator[Line]:
    """A line and those in it, without what is placed in the boxes of a division."""
    yield line
    if isinstance(line, Group) and line.kind != "divide":
        for inner in line.body:
            yield from _outer(inner)


def _parts(line: Line) -> Iterator[Part | Group]:
    """The parts in a line, and the divisions, which have a box as well."""
    return (
        inner for inner in _outer(line)
        if isinstance(inner, Part) or (isinstance(inner, Group) and inner.kind == "divide")
    )  # fmt: skip


def _sides(line: Line) -> dict[str, str]:
    """The clearances that all parts of a line have, by keyword."""
    common: dict[str, str] | None = None
    for part in _parts(line):
        clearances = {
            word: str(value) for word, value in part.keywords
            if any(word in words[:2] for words in AXES) and value != 0 and isinstance(value, Expression)
        }  # fmt: skip
        common = clearances if common is None else dict(common.items() & clearances.items())
    return common or {}


def _values(line: Line, frame: dict[str, str]) -> Iterator[tuple[str, Argument]]:
    return ((word, value) for part in _parts(line) for word, value in part.keywords if str(value) == frame.get(word))


def _fits(line: Line, frame: dict[str, str]) -> bool:
    """Whether a line draws the same in a box with these clearances."""
    for axis, words in enumerate(AXES):
        if not {words.low, words.high} & frame.keys():
            continue
        even = frame.get(words.low) == frame.get(words.high)
        if any(SIZES[axis] in names_in(value) for inner in Source((line,)).walk() for value in values(inner)):
            return False
        for inner in _outer(line):
            if isinstance(inner, Group) and inner.kind not in ("divide", "mirror"):
                return False
            arguments = dict(inner.keywords) if isinstance(inner, Part | Group) else {}
            if isinstance(inner, Group) and inner.kind == "mirror":
                used = [word for word in words if word in arguments]
                if used and not (used == [words.offset] and even):
                    return False
                continue
            if "start" in arguments or ("radius" in arguments and axis < 2):
                return False
            for word in (words.low, words.high):
                if word in frame and str(arguments.get(word)) != frame[word] and not _from_other(word, arguments, axis):
                    return False
            centred = words.offset in arguments or (
                words.size in arguments and not {words.low, words.high} & arguments.keys()
            )
            if centred and (not even or (axis == 2 and words.offset not in arguments)):
                return False
    return True


def _from_other(word: str, arguments: dict[str, Argument], axis: int) -> bool:
    """Whether a part is measured from the side opposite to this, or from the middle, and keeps its size."""
    words = AXES[axis]
    opposite = words.high if word == words.low else words.low
    return words.size in arguments and word not in arguments and (opposite in arguments or axis < 2)


def _saved(line: Line, frame: dict[str, str]) -> int:
    """How many words less it has."""
    total = 0
    for part in _parts(line):
        arguments = dict(part.keywords)
        for word, text in frame.items():
            if str(arguments.get(word)) == text:
                axis = axis_of(word)
                sized = AXES[axis].size in arguments and not (axis == 2 and word == "bottom")
                total += len(text.split()) - 1 if sized else 1 + len(text.split())
    return total


def _length(frame: tuple[Side, ...]) -> int:
    return sum(1 + len(text.split()) for _, text in frame)


def _inside(line: Line, frame: dict[str, str]) -> Line:
    """The line in a box with these clearances."""
    if isinstance(line, Group) and line.kind != "divide":
        return replace(line, body=tuple(_inside(inner, frame) for inner in line.body))
    assert isinstance(line, Part | Group)
    arguments, keywords = dict(line.keywords), list[tuple[str, Argument]]()
    for word, value in line.keywords:
        if str(value) != frame.get(word):
            keywords.append((word, value))
            continue
        axis = axis_of(word)
        if AXES[axis].size in arguments and word != "bottom":
            keywords.append((word, 0.0))
    return replace(line, keywords=tuple(keywords))

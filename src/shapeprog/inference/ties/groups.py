"""Lines of a tied program written shorter: rows of two as mirrors, neighbours that fill a box as its division, and
parts with equal clearances inside of a new box."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import combinations

from shapeprog.inference.ties.layout import interval
from shapeprog.inference.ties.settings import TIES
from shapeprog.language.ast import Argument, Group, Keywords, Line, Part, Point, Source, changed_lines, values
from shapeprog.language.convert.loops import with_joined_mirrors
from shapeprog.language.convert.parts import ordered
from shapeprog.language.expression import Expression, Value, names_in, value_at
from shapeprog.language.merging import merged_lines
from shapeprog.language.parameters import to_float32
from shapeprog.language.placement import AXES, BOX, SIZES, axis_of

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
        return _divided(_mirrored(_straight(line, numbers)), numbers) if isinstance(line, Group) else line

    single = (
        replace(line, body=(inner,)) if isinstance(line, Group) and line.kind == "mirror" else line
        for line in lines
        for inner in (line.body if isinstance(line, Group) and line.kind == "mirror" else (line,))
    )
    changed = changed_lines(single, shorter)
    return _in_boxes(with_joined_mirrors(merged_lines(changed_lines(changed, _nested))))


# ---- rows ---------------------------------------------------------------------------------------------------------


def _straight(row: Group, numbers: dict[str, float]) -> Group:
    """A row without the axes along which its last copy is where the first is."""
    first = next(_solids(row), None)
    if row.kind != "row" or first is None:
        return row
    (_, last), *_ = row.keywords
    assert isinstance(last, Point)

    def moves(word: str, value: Value) -> bool:
        axis = axis_of(word)
        (low, high), whole = interval(first, axis, numbers), numbers[SIZES[axis]]
        place = dict(zip(AXES[axis], (low, whole - high, high - low, (low + high - whole) / 2), strict=True))[word]
        return abs(place - value_at(value, numbers)) > 1e-6

    pairs = tuple((word, value) for word, value in last.keywords if moves(word, value))
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
    parts = [line for line in loop.body if isinstance(line, Part) and _is_upright(line)]
    if len(parts) < len(loop.body) or len(loop.keywords) != 1 or loop.kind not in ("row", "mirror"):
        return loop
    (part, *others), ((word, place),) = parts, loop.keywords
    if isinstance(place, Point):
        if len(place.keywords) != 1:
            return loop
        ((word, place),) = place.keywords
    axis = axis_of(word)
    words, whole, keywords = AXES[axis], numbers[SIZES[axis]], dict(part.keywords)
    size = keywords.get(words.size, "")
    if loop.kind == "row":
        first, count = words.high if word == words.low else words.low, loop.count
        if word == words.offset or not (first in keywords or first == "bottom") or not isinstance(size, float):
            return loop
        clearances = {word: place, first: keywords.get(first, 0.0)}
    else:  # the inner side is in the middle, or the size is a number
        sides = [side for side in words[:2] if side in keywords]
        sides.sort(key=lambda side: value_at(keywords[side], numbers))  # type: ignore[arg-type]
        if others or axis == 2 or place != 0 or word != words.offset or not sides:
            return loop
        count, clearances = 2.0, dict.fromkeys(words[:2], keywords[sides[0]])
        if not isinstance(size, float) and [*names_in(keywords[sides[-1]])] != [SIZES[axis]]:  # type: ignore[arg-type]
            return loop
    low, high = interval(part, axis, numbers)
    length, sized = high - low, (words.size in dict(other.keywords) for other in others)
    follows = any(SIZES[axis] in names_in(value) for line in parts for value in values(line))
    if (
        not isinstance(count, float | int)
        or (length < TIES.divided and not others)
        or (others and (follows or not all(sized)))
    ):
        return loop
    occupied = sum(value_at(clearance, numbers) for clearance in clearances.values())  # type: ignore[arg-type]
    gap = to_float32(round((whole - occupied - count * length) / (count - 1), 2))
    if not 0 <= gap <= TIES.gap * length:
        return loop
    mine = [(side, clearances[side]) for side in words[:2] if clearances[side] != 0]
    shared = [pair for pair in part.keywords if pair[0] in BOX and pair[0] not in words and not others]
    remaining = tuple(pair for pair in part.keywords if pair[0] not in words and pair not in shared)
    box: Keywords = (*([("gap", gap)] if gap else []), *ordered((*mine, *shared)))
    inner = (_in_division(other, part, axis, numbers) for other in others)
    return Group("divide", box, (replace(part, keywords=remaining), *inner), float(count), "xyz"[axis])


def _in_division(part: Part, first: Part, axis: int, numbers: dict[str, float]) -> Part:
    """A part of a row in the box of the first one, in the middle of it if it nearly is."""
    words = AXES[axis]
    (low, high), (start, end) = (interval(each, axis, numbers) for each in (part, first))
    remaining = [(word, value) for word, value in part.keywords if word not in words or word == words.size]
    centred = abs(low + high - start - end) < TIES.uneven
    place = (words.offset, 0.0) if centred else (words.low, to_float32(round(low - start, 2)))
    return replace(part, keywords=ordered((place, *remaining)))


def _is_upright(part: Part) -> bool:
    return part.kind in ("box", "cushion") and not {"tilt", "lean"} & dict(part.keywords).keys()


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
            saved = sum(_words(lines[k]) - _words(_inside(lines[k], dict(frame))) for k in members) - 2
            saved -= sum(1 + len(text.split()) for _, text in frame)
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


def _words(line: Line) -> int:
    """How many words its keywords and their values have."""
    return sum(1 + len(str(value).split()) for part in _parts(line) for _, value in part.keywords)


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

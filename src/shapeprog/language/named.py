"""The named numbers of a program: their values, programs with other values, and how far each can be changed."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache

from shapeprog.arguments import number_of
from shapeprog.errors import ShapeProgError, did_you_mean
from shapeprog.geometry.arrays import array
from shapeprog.geometry.contacts import contact_groups
from shapeprog.geometry.mesh import pieces_of_parts
from shapeprog.language.ast import Assignment, Fault, Line, Source
from shapeprog.language.dimensions import counted_names
from shapeprog.language.evaluate import evaluated
from shapeprog.language.expression import names_in, text_of
from shapeprog.language.parameters import LARGEST, to_float32
from shapeprog.language.printer import printed
from shapeprog.language.program import Program, program_of
from shapeprog.language.unroll import exact_scene, on_numpy_if_shipped, unroll

FARTHEST = 3.0  # multiple of a number up to which it is tried
LEAST = 1.0  # magnitude assumed for smaller numbers, in cells
STEPS, HALVINGS = 4, 4  # values tried on either side of a number, and bisections between the last good and first bad
LISTED = 10  # names that are listed where there are many
MOST = 256  # most primitives of a program whose contacts are examined


@dataclass(frozen=True)
class Named:
    """A named number of a program.

    Parameters
    ----------
    name, value
        Its name, and its value; lengths are in the unit of the text.
    text
        How it is written: a number, or an expression of others.
    free
        Whether it depends on no other name, so that it can be set.
    whole
        Whether it is a number of copies or of quarter turns.
    ranges
        Finds the ranges of all free names.
    """

    name: str
    value: float
    text: str
    free: bool
    whole: bool
    ranges: Callable[[], Mapping[str, tuple[float, float]]] = field(default=dict, compare=False, repr=False)

    @property
    def range(self) -> tuple[float, float] | None:
        """About the lowest and the highest value, up to three times the present one, with which the parts stay
        connected and none vanishes, while all other names are as they are; ``None`` unless it is free.  Some values
        between and slightly beyond are tried, not all.  Takes a moment."""
        return self.ranges().get(self.name)


def inline(program: Program) -> Program:
    """The program written out: statements and loops in cells with plain numbers."""
    return replace(program_of(program), source=None)


def names(program: Program) -> list[Named]:
    """The named numbers of a program in the order of its text; none if it is plain.

    Names inside of functions are not among them: their value differs from call to call.
    """
    program = program_of(program)
    if program.source is None:
        return []
    numbers = program.source.evaluated_numbers()
    counted = counted_names(program.source)
    result: list[Named] = []

    @cache
    def ranges() -> dict[str, tuple[float, float]]:
        return _ranges(program, [named for named in result if named.free])

    for name, value in program.source.numbers.items():
        result.append(Named(name, numbers[name], text_of(value), not names_in(value), name in counted, ranges))
    return result


def set(program: Program, changes: Mapping[str, float] | None = None, /, **numbers: float) -> Program:
    """The program with other numbers for some of its names, in the unit of its text: ``set(program, seat=11)``.

    A number replaces an expression too; a number of copies is whole.  The cells that a unit has stay the same.

    Raises
    ------
    ShapeProgError
        If it has no such name, or the program cannot be drawn with such numbers.
    """
    program = program_of(program)
    replacements = {**(changes or {}), **numbers}
    if not replacements:
        return program
    source = program.source or Source()
    declared, counted = source.numbers, counted_names(source)
    for name in replacements:
        if name not in declared:
            more = f" and {len(declared) - LISTED} more in its text" if len(declared) > LISTED else ""
            known = f"its names are {', '.join([*declared][:LISTED])}{more}"
            hint = f"{did_you_mean(name, declared, ' ')} {known}".strip()
            hint = hint if declared else "it has no names: write name = number at its top"
            raise ShapeProgError(f"this program has no name {name!r}", hint)
        value, number = replacements[name], number_of(replacements[name])
        if not abs(number) <= LARGEST:  # true of NaN, too
            message = f"{name} = {value!r} is no number, not finite, or too large for single precision"
            raise ShapeProgError(message, "write one such as 12.5")
        if name in counted and (number < 0 or number % 1):
            raise ShapeProgError(f"{name} = {number:g} is no number of copies", "give a whole number of 0 or more")
    try:
        edited = evaluated(replace(source, lines=tuple(_set(line, replacements) for line in source.lines)))
        return replace(edited, frame=program.frame)
    except Fault as fault:
        (text, _), *_ = printed(Source((fault.line,), scale=source.scale))
        raise ShapeProgError(f"{fault.message}, in {text}", fault.hint) from None


def _set(line: Line, replacements: Mapping[str, float]) -> Line:
    if not isinstance(line, Assignment):
        return line
    pairs = ((name, to_float32(replacements[name]) if name in replacements else value) for name, value in line.numbers)
    return replace(line, numbers=tuple(pairs))


def loosened(program: Program, edited: Program, changed: Collection[str]) -> dict[str, tuple[float, float]] | None:
    """The ranges of changed names, as far as they are free, if parts of the edited program come apart or vanish.

    ``None`` if it holds together as the program did, or has too many parts to tell.
    """
    with on_numpy_if_shipped(program):
        check = _Check(program)
        whole = any(number.whole for number in names(program) if number.name in changed)
        if edited.size > check.most or all(check.fits([edited], [whole])):
            return None
    return ranges_of(program, changed)


def loose_parts(program: Program, edited: Program) -> list[str]:
    """The words of parts that are not one solid with the largest part any more, if the program was one solid.

    None where there are too many parts to tell.
    """
    if max(program.size, edited.size) > MOST:
        return []
    with exact_scene(program) as before, exact_scene(edited) as after:
        loose = pieces_of_parts(after) > 0
        if not loose.any() or pieces_of_parts(before).any():
            return []
        return [edited.draws[block].word for block in array(after.block)[loose]]


def ranges_of(program: Program, changed: Collection[str]) -> dict[str, tuple[float, float]]:
    """The :attr:`Named.range` of some names, as far as they are free."""
    return _ranges(program, [named for named in names(program) if named.name in changed and named.free])


# ---- ranges ---------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Search:
    """A number that is changed in one direction: the last good value, and the next that is bad or the last to try."""

    number: Named
    good: float
    bad: float

    def between(self, share: float) -> float:
        """A value between both."""
        value = self.good + (self.bad - self.good) * share
        return float(round(value)) if self.number.whole else value


def _ranges(program: Program, numbers: Sequence[Named]) -> dict[str, tuple[float, float]]:
    """The values of numbers within which no size is negative, no part vanishes and the parts hang together.

    Each number is changed alone, from nothing to three times its value.  The ends are values that were tried, within a
    few percent of the last good one.  A program whose parts form several groups that touch may keep as many.
    """
    smallest = LEAST * (1.0 if program.unit is None else program.unit.per_cell)
    searches = []
    for number in numbers:
        size = max(abs(number.value), 1.0 if number.whole else smallest)
        low = min(1.0, number.value) if number.whole else number.value - size
        ends = low, number.value + (FARTHEST - 1) * size
        searches += [_Search(number, number.value, end) for end in ends]
    with on_numpy_if_shipped(program):
        check = _Check(program)
        values = [[search.between(step / STEPS) for step in range(STEPS + 1)] for search in searches]
        tried = [(search.number, at) for search, row in zip(searches, values, strict=True) for at in row[1:]]
        good = iter(check(tried))
        for index, row in enumerate(values):
            results = [next(good) for _ in row[1:]]
            reached = results.index(False) if False in results else STEPS
            searches[index] = replace(searches[index], good=row[reached], bad=row[min(reached + 1, STEPS)])
        for _ in range(HALVINGS):
            pending = [index for index, search in enumerate(searches) if search.good != search.bad]
            tried = [(searches[index].number, searches[index].between(0.5)) for index in pending]
            for index, (_, at), fits in zip(pending, tried, check(tried), strict=True):
                search = searches[index]
                searches[index] = replace(search, good=at) if fits else replace(search, bad=at)
    return {low.number.name: (low.good, high.good) for low, high in zip(searches[::2], searches[1::2], strict=True)}


class _Check:
    """Whether a program holds together with other values of its numbers."""

    def __init__(self, program: Program) -> None:
        self.program, self.most = program, max(MOST, program.size)
        scene = unroll([program])
        self.parts = int(scene.mask.sum())
        self.groups = contact_groups(scene)[0] if program.size <= MOST else None

    def __call__(self, changes: Sequence[tuple[Named, float]]) -> list[bool]:
        programs: dict[int, Program] = {}
        for index, (number, value) in enumerate(changes):
            try:
                edited = set(self.program, {number.name: value})
            except ShapeProgError:
                continue
            if edited.size <= self.most:
                programs[index] = edited
        results = [False] * len(changes)
        fits = self.fits([*programs.values()], [changes[index][0].whole for index in programs]) if programs else ()
        for index, good in zip(programs, fits, strict=True):
            results[index] = good
        return results

    def fits(self, programs: Sequence[Program], fewer: Sequence[bool]) -> list[bool]:
        """Whether these programs hold together and have as many parts, or ``fewer`` where that may be."""
        scenes = unroll(list(programs))
        groups = [None] * len(programs) if self.groups is None else contact_groups(scenes)
        return [
            (parts >= self.parts or less) and (count is None or self.groups is None or count <= self.groups)
            for parts, less, count in zip(scenes.mask.sum(-1).tolist(), fewer, groups, strict=True)
        ]

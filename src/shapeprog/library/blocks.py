"""Canonical forms of blocks: different texts that draw the same shape have the same form.

A solid that is symmetric along the axes is its low corner and extents, whatever statement draws it.  Two copies side by
side are a pair, whether a mirror or a shift makes them.  Copies along an axis are described by the span of all of them.
For fixed counts every number of the form is linear in those of the text, so expressions of names carry over.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Literal, NamedTuple

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from shapeprog.geometry.batch import Solids
from shapeprog.geometry.primitives import primitives
from shapeprog.language.program import Chain, Draw, Loop, Program
from shapeprog.language.statement import Statement, language, remembered
from shapeprog.language.unroll import unroll
from shapeprog.library.independence import independent
from shapeprog.space import DEPTH, HALF, SIDE, SPAN, UP, FloatArray

ZERO = 1e-6
"""Shifts in cells below this are zero."""

ROWS: tuple[tuple[int, ...], ...] = ((), (UP, DEPTH, SIDE), (DEPTH,), (SIDE,))
"""Axes along which mirror images may be read as rows."""

PAIR = 2.0
"""Default number of copies in a row."""

STRAIGHT = 0.02
"""Largest distance in cells between a part defined by points and its own mirror image."""

Way = Literal["pair", "row", "mirror"]
"""How copies lie along an axis: two, any number at equal steps, or one and its mirror image."""


class Slot(NamedTuple):
    """The meaning of a number of a block: the word of its parameter, its quantity, and its axis of the grid, or -1."""

    word: str
    kind: str
    axis: int


STEPS = tuple(Slot("step", "length", axis) for axis in range(3))
"""The numbers of steps."""


class Solid(NamedTuple):
    """The map from the numbers of a statement to those of a block: (M, S + 1) factors of its S slots and a constant.

    A ``boxed`` solid is its own mirror image along every axis of the grid.  Its numbers are its low corner, its extents
    and further sizes.  Those of any other solid are the numbers of its statement.
    """

    shape: str
    slots: tuple[Slot, ...]
    rows: FloatArray
    boxed: bool


@dataclass(frozen=True)
class Kind:
    """The discrete properties that equal blocks share.

    Parameters
    ----------
    word
        The role of the part, or the empty string.
    shape, boxed
        Its solid, and whether low corner and extents describe that.
    repeats
        The axes along which it is repeated, and how.
    steps
        Whether the result is repeated again, shifted along several axes at once or along one of these.
    loops
        Loops without such a form: turns, steps in steps.
    """

    word: str
    shape: str
    boxed: bool
    repeats: tuple[tuple[int, Way], ...] = ()
    steps: bool = False
    loops: tuple[str, ...] = ()

    @property
    def spans(self) -> int:
        """How many of its numbers describe the repetition; they come last."""
        return len(self.repeats) + 3 * self.steps


class Block(NamedTuple):
    """A block in its form: its numbers (M,), their slots, their factors (M, V + 1) by the V of the text, its counts.

    After the numbers of the solid come, for each axis along which it is repeated, the span of all copies or the
    position of the mirror; then the three shifts of its steps.  The count of steps is the last count.
    """

    kind: Kind
    slots: tuple[Slot, ...]
    values: FloatArray
    rows: FloatArray
    counts: tuple[int, ...]


def blocks_of(chain: Chain, rows: Sequence[int] = ()) -> Iterator[Block]:
    """The forms of a block: first the narrowest, then those that read a pair as a row of two.

    Parts that run straight along a mirror, such as a rail on either side, are also rows of two along the axes ``rows``.
    """
    *outer, draw = chain
    assert isinstance(draw, Draw)
    loops = [node for node in outer if isinstance(node, Loop)]
    word = draw.role or language().own_role(draw.name)
    solid = solid_of(draw.name)
    numbers = np.array([*(value for node in chain for value in node.values), 1.0])
    first = len(numbers) - 1 - len(draw.values)
    base = np.zeros((len(solid.rows), len(numbers)))
    base[:, first:] = solid.rows
    repeated = _repeated(loops, base, solid, numbers, draw, rows)
    if repeated is None:
        names = tuple(node.name for node in loops)
        more = [slot for node in loops for slot in _slots(language()[node.name])]
        every = np.vstack([base, np.eye(len(numbers))[:first]])
        kind = Kind(word, solid.shape, solid.boxed, loops=names)
        yield Block(kind, (*solid.slots, *more), every @ numbers, every, tuple(node.count for node in loops))
        return
    spans = [Slot("plane" if way == "mirror" else "span", "length", axis) for axis, way in repeated.ways]
    slots = (*solid.slots, *spans, *(STEPS if repeated.steps else ()))
    pairs = [index for index, (_, way) in enumerate(repeated.ways) if way == "pair"]
    for subset in (subset for size in range(len(pairs) + 1) for subset in itertools.combinations(pairs, size)):
        repeats = tuple((axis, "row" if index in subset else way) for index, (axis, way) in enumerate(repeated.ways))
        kind = Kind(word, solid.shape, solid.boxed, repeats, repeated.steps)
        yield Block(kind, slots, repeated.rows @ numbers, repeated.rows, repeated.counts)


def readings(chain: Chain) -> list[Block]:
    """The narrowest forms of a block: with its mirrors, then with mirror images as rows of two along some axes."""
    unique: dict[Kind, Block] = {}
    for rows in ROWS:
        block = next(blocks_of(chain, rows))
        unique.setdefault(block.kind, block)
    return list(unique.values())


def forms_of(chain: Chain) -> list[Block]:
    """All forms of a block: those with its mirrors, then those with mirror images as rows of two."""
    return [*blocks_of(chain), *readings(chain)[1:]]


class _Repeated(NamedTuple):
    """How a block is repeated along each axis, whether in steps, the factors of its numbers, and its counts."""

    ways: tuple[tuple[int, Way], ...]
    steps: bool
    rows: FloatArray
    counts: tuple[int, ...]


def _repeated(
    loops: Sequence[Loop], base: FloatArray, solid: Solid, numbers: FloatArray, draw: Draw, straight: Sequence[int]
) -> _Repeated | None:
    """How a block is repeated, from its innermost loop outwards; ``None`` unless along axes and in steps alone.

    A solid that is not boxed is a row of two in a mirror across one of the axes ``straight`` where it is its own image.
    """
    rows = base.copy()
    positions = [
        [k for k, slot in enumerate(solid.slots) if (slot.axis, slot.kind) == (axis, "position")] for axis in range(3)
    ]
    ways: dict[int, tuple[Way, FloatArray, int]] = {}
    steps: tuple[FloatArray, int] | None = None
    starts = np.cumsum([0, *(len(loop.values) for loop in loops)])
    for loop, start in reversed([*zip(loops, starts, strict=False)]):
        slots = np.eye(len(numbers))[start : start + len(loop.values)]
        if loop.name == "translate" and loop.count == 1:  # a single copy, not shifted
            continue
        if loop.name == "translate":
            shift = slots[1:4]
            along = [axis for axis in range(3) if abs(shift[axis] @ numbers) > ZERO]
            if len(along) == 1 and along[0] not in ways:
                ways[along[0]] = "row", (loop.count - 1) * shift[along[0]], loop.count
            elif along and steps is None and not any(ways[axis][0] == "mirror" for axis in along if axis in ways):
                steps = shift, loop.count
            else:
                return None
            continue
        if loop.name != "mirror":
            return None
        axis, plane = int(loop.values[1]), slots[2]
        symmetric = solid.boxed or (axis in straight and _is_symmetric_part(draw, axis))
        if symmetric and steps is not None and abs(steps[0][axis] @ numbers) > ZERO:
            return None  # the images would step in the opposite direction
        if not symmetric:
            if axis in ways and (ways[axis][0] == "mirror" or steps is not None):
                return None
            if axis in ways:
                _, reach, count = ways.pop(axis)
                steps = np.eye(3)[:, [axis]] * (reach / (count - 1)), count
            ways[axis] = "mirror", plane, 2
            continue
        low = rows[positions[axis][0]]
        reach = 2 * plane - 2 * low - (rows[3 + axis] if solid.boxed else 0)
        if axis not in ways:
            ways[axis] = "row", reach, 2
        elif ways[axis][0] == "row" and steps is None:
            steps = np.eye(3)[:, [axis]] * (reach - ways[axis][1]), 2
        else:
            return None
    spans: dict[int, FloatArray] = {}
    for axis, (way, reach, _) in ways.items():
        back = way == "row" and reach @ numbers < 0
        spans[axis] = (-reach if back else reach) + (rows[3 + axis] if solid.boxed else 0)
        rows[positions[axis]] += reach if back else 0  # the first copy becomes the lowest
    if steps is not None:
        shift, count = steps
        if next((step for step in shift @ numbers if abs(step) > ZERO), 0) < 0:
            for axis in range(3):
                rows[positions[axis]] += (count - 1) * shift[axis]
            shift = -shift
        spans |= dict(enumerate(shift, 3))
    order = sorted(ways)
    pairs = [axis for axis, (way, _, count) in ways.items() if solid.boxed and way == "row" and count == 2]
    repeats = tuple((axis, "pair" if axis in pairs else ways[axis][0]) for axis in order)
    counts = tuple(ways[axis][2] for axis in order)
    stacked = np.vstack([rows, *(spans[key] for key in sorted(spans))])
    return _Repeated(repeats, steps is not None, stacked, (*counts, *(steps[1:] if steps else ())))


@remembered(1024)
def _is_symmetric_part(draw: Draw, axis: int) -> bool:
    """Whether a part defined by points is its own mirror image across the plane through all of them."""
    indices = [k for k, slot in enumerate(_slots(language()[draw.name])) if slot == (slot.word, "position", axis)]
    coordinates = [draw.values[k] for k in indices]
    if not coordinates or np.ptp(coordinates) > STRAIGHT:
        return False
    points = torch.rand(64, 3, dtype=torch.float64, generator=torch.Generator().manual_seed(0)) * SPAN - HALF
    mirrored = points.clone()
    mirrored[:, axis] = 2 * float(np.mean(coordinates)) - points[:, axis]
    scene = unroll(Program((draw,)))
    return bool((scene.distance(points) - scene.distance(mirrored)).abs().max() <= STRAIGHT)


def solid_of(name: str) -> Solid:
    """The map from the numbers of a drawing statement to those of a block."""
    return _solid(language()[name])


def _slots(declared: Statement) -> Iterator[Slot]:
    for parameter in declared.parameters:
        words = parameter.quantity.each.split(", ")
        for index in range(parameter.quantity.width):
            axis = {"up": 0, "depth": 1, "left-right": 2}.get(words[index] if index < len(words) else "", -1)
            yield Slot(parameter.name, parameter.quantity.kind, axis)


@cache
def _solid(declared: Statement) -> Solid:
    width = declared.size
    plain = Solid(declared.name, tuple(_slots(declared)), np.hstack([np.eye(width), np.zeros((width, 1))]), False)
    start, check = 1 + torch.rand(2, width, dtype=torch.float64, generator=torch.Generator().manual_seed(0))
    solids = declared.solids(start)
    if len(solids) != 1 or not _symmetric(solids[0]):
        return plain

    def form(values: Float[Tensor, " S"]) -> Float[Tensor, " M"]:
        (solid,) = declared.solids(values)
        half = primitives[solid.kind].bound(solid.size)
        return torch.cat([solid.centre - half, 2 * half, solid.size])

    slope = torch.autograd.functional.jacobian(form, start)
    constant = form(start) - slope @ start
    if not torch.allclose(form(check), slope @ check + constant):
        return plain
    rows = np.round(np.hstack([slope.numpy(), constant[:, None].numpy()]), 9) + 0.0
    selected = [*range(6), *(index for index in independent(rows) if index >= 6)]
    if len(independent(rows[selected, :-1])) < width:
        return plain
    corner = [Slot("at", "position", axis) for axis in range(3)] + [Slot("size", "length", axis) for axis in range(3)]
    extra = [Slot(primitives[solids[0].kind].sizes[index - 6], "length", -1) for index in selected[6:]]
    return Solid(primitives[solids[0].kind].name, (*corner, *extra), rows[selected], True)


def _symmetric(solid: Solids) -> bool:
    """Whether a solid lies along the axes of the grid, and is its own mirror image along each of them."""
    if solid.rotation is not None:
        return False
    points = torch.rand(64, 3, dtype=solid.size.dtype, generator=torch.Generator().manual_seed(0)) * 4 - 2
    away, size = primitives[solid.kind].distance, solid.size.expand(64, -1)
    signs = 1 - 2 * torch.eye(3, dtype=points.dtype)
    return all(torch.allclose(away(points, size), away(points * sign, size)) for sign in signs)

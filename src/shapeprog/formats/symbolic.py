"""The solids of a statement as linear expressions in its named parameters.

This works for any statement.  A declaration is evaluated in float64 at its parameters and at points around them; a
number that is linear in them becomes an expression such as ``leg_1_at[1] + leg_1_size[1] / 2``.  A parameter with a
nonlinear effect is *fixed*: it enters as a plain number, and exports mark it.

Values are in cells; expressions are in the unit of the program, in which a cell has the size ``cell``.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from shapeprog.geometry.batch import Solids
from shapeprog.geometry.primitive import primitives
from shapeprog.language.parameters import shortest
from shapeprog.language.statement import Motion, Statement
from shapeprog.lazy_torch import Tensor, torch
from shapeprog.space import FloatArray

Measure = Callable[[Tensor], "list[_Measured]"]

Slot: TypeAlias = str | float
"""A number of a statement: a name or expression, in parentheses if needed, or a plain number."""

STEP = 0.5
"""Cells by which parameters are moved to find their effect."""

TOLERANCE = 1e-7
"""In cells: far below anything visible, far above rounding in float64."""


@dataclass(frozen=True)
class Affine:
    """A number that is linear in named slots: ``constant + sum of coefficient * slot``."""

    constant: float
    terms: tuple[tuple[int, float], ...] = ()

    def text(self, slots: Sequence[Slot]) -> str:
        """The expression, valid in Python and OpenSCAD alike; slots that are numbers count as constants."""
        words, constant, plain = [], self.constant, False
        for slot, coefficient in self.terms:
            word = slots[slot]
            if isinstance(word, str):
                words += ["-" if coefficient < 0 else "+", _scaled(word, abs(coefficient))]
            else:
                constant, plain = constant + coefficient * word, True
        if constant or not words:
            size = abs(constant)
            words += ["-" if constant < 0 else "+", shortest(size) if plain else number(size)]
        if words[0] == "+" and len(words) == 2:
            return words[1].removeprefix("(").removesuffix(")") if _enclosed(words[1]) else words[1]
        lead = "-" if words[0] == "-" else ""
        return lead + " ".join(words[1:])


@dataclass(frozen=True)
class Piece:
    """One solid that a statement draws.

    Parameters
    ----------
    kind
        The function of a script that draws it: that of its :class:`~shapeprog.geometry.batch.Form`, or else ``cuboid``,
        ``cylinder_between`` or, for every other primitive, ``shell``.
    groups
        The vectors and numbers that place and shape it: the arguments of its form; for a cuboid its low corner, its
        extents and its lean; for a cylinder both ends and its radius, for a frustum both radii; for a shell its centre
        and the half extents of its local box.
    axes
        Its local axes as columns (3, 3), if they differ from those of the grid and do not follow from the groups.  A
        cuboid with axes has its centre instead of the corner.
    vertices, faces
        Of a shell: its mesh with the local box scaled to [-1, 1]^3.
    """

    kind: str
    groups: tuple[tuple[Affine, ...], ...]
    axes: FloatArray | None = None
    vertices: FloatArray | None = None
    faces: npt.NDArray[np.int64] | None = None


def number(value: float | np.number[Any]) -> str:
    """A number with at most 12 digits and no trailing point."""
    return f"{value + 0.0:.12g}"


def pieces(declared: Statement, values: Sequence[float], cell: float = 1.0) -> tuple[list[Piece], frozenset[int]]:
    """The solids of a drawing statement as expressions in its slots, and the slots that are fixed."""
    probe = _Probe(
        declared, values, lambda rows: [_measured(s) for s in declared.solids(rows)], _continuous(declared), STEP
    )
    found = []
    start = 0
    for part in probe.base:
        groups = []
        for number, width in enumerate(part.widths, 1):
            power = 0 if number > len(part.widths) - part.angles else 1
            groups.append(tuple(probe.affine(start + place, cell, power) for place in range(width)))
            start += width
        found.append(Piece(part.kind, tuple(groups), part.axes, part.vertices, part.faces))
    return found, probe.fixed


def point(
    declared: Statement, values: Sequence[float], cell: float = 1.0
) -> tuple[tuple[Affine, ...] | None, frozenset[int]]:
    """The pivot of a statement as expressions in its slots, or None for the axis of the grid."""
    pivot = declared.pivot
    if pivot is None:
        return None, frozenset()

    def measure(rows: Tensor) -> list[_Measured]:
        place = pivot(**declared.split(rows)).numpy()
        return [_Measured("point", (3,), place, np.zeros((len(place), 0)))]

    probe = _Probe(declared, values, measure, _continuous(declared), STEP)
    return tuple(probe.affine(axis, cell) for axis in range(3)), probe.fixed


@dataclass(frozen=True)
class Repeat:
    """How a loop moves copy i: by a turn of ``i * turn`` degrees, or evenly over the circle, and by ``i * shift``.

    Otherwise ``table`` holds the degrees and shift of every copy.  For a loop that reflects, which is applied first,
    ``signs`` has -1 or 1 for each axis of every copy.
    """

    turn: Affine | None = None
    even: bool = False
    shift: tuple[Affine, ...] | None = None
    table: FloatArray | None = None
    signs: FloatArray | None = None

    @property
    def turns(self) -> bool:
        """Whether copies are turned at all."""
        return self.even or self.turn is not None or (self.table is not None and bool(self.table[:, 0].any()))


def repeat(
    declared: Statement, values: Sequence[float], quarter: bool, cell: float = 1.0
) -> tuple[Repeat, frozenset[int]]:
    """The motion of a loop as expressions in its slots, and the slots that are fixed (the count is never)."""

    def motion_of(rows: Tensor, copy: Tensor) -> Motion:
        assert declared.move is not None
        return declared.move(copy, torch.full((len(rows),), quarter), **declared.split(rows))

    def moved(rows: Tensor, copy: Tensor) -> FloatArray:
        motion = motion_of(rows, copy)
        turn = torch.zeros_like(rows[:, 0]) if motion.turn is None else motion.turn
        shift = rows.new_zeros(len(rows), 3) if motion.shift is None else motion.shift
        return np.concatenate([360 * turn.numpy()[:, None], shift.numpy()], 1)

    def measure(columns: slice) -> Measure:
        def around(rows: Tensor) -> list[_Measured]:
            once, *others = (moved(rows, torch.full((len(rows),), float(c)).double())[:, columns] for c in (1, 2, 5))
            still = np.concatenate([other - c * once for other, c in zip(others, (2, 5), strict=True)], 1)
            return [_Measured("motion", (once.shape[1],), once, still)]

        return around

    slots = [slot for slot, quantity in enumerate(declared.quantities) if quantity.kind != "axis"]
    own = torch.tensor([values], dtype=torch.float64)

    def each_copy() -> tuple[Tensor, Tensor]:
        count = max(0, round(values[0]))
        return own.expand(count, len(values)), torch.arange(count, dtype=torch.float64)

    reflects = motion_of(own, torch.zeros_like(own[:, 0])).signs is not None
    signs = motion_of(*each_copy()).signs if reflects else None  # a regular loop may have millions of copies
    reflected = None if signs is None or bool((signs == 1).all()) else signs.numpy()
    here = torch.cat([own] * 8)
    here[:, 0] = torch.arange(1, 9)
    copies = torch.tensor([0, 1, 1, 3, 4, 5, 2, 7], dtype=torch.float64)
    even = bool(np.abs(moved(here, copies)[:, 0] - 360 * (copies / here[:, 0]).numpy()).max() < TOLERANCE)
    turn = _Probe(declared, values, measure(slice(0, 0 if even else 1)), slots, 1.0)
    shift = _Probe(declared, values, measure(slice(1, 4)), slots, 1.0)
    if max(np.abs(probe.base[0].still[0]).max(initial=0) for probe in (turn, shift)) > TOLERANCE:
        table = moved(*each_copy()) * [1, cell, cell, cell]
        return Repeat(table=table, signs=reflected), frozenset(slots) - {0}
    angle = None if even else _unless_zero((turn.affine(0, cell, 0),))
    by = _unless_zero(tuple(shift.affine(axis, cell) for axis in range(3)))
    found = Repeat(None if angle is None else angle[0], even, by, signs=reflected)
    return found, (turn.fixed & shift.fixed) - {0}


def _unless_zero(each: tuple[Affine, ...]) -> tuple[Affine, ...] | None:
    return each if any(one.terms or one.constant for one in each) else None


@dataclass(frozen=True)
class _Measured:
    """A solid at every row of parameters: ``linear`` (B, m) may follow them, ``still`` (B, c) must not move.

    The last ``angles`` of its groups are in degrees.
    """

    kind: str
    widths: tuple[int, ...]
    linear: FloatArray
    still: FloatArray
    axes: FloatArray | None = None
    vertices: FloatArray | None = None
    faces: npt.NDArray[np.int64] | None = None
    angles: int = 0


def _measured(solids: Solids) -> _Measured:
    size, centre = solids.size.numpy(), solids.centre.numpy()
    rows = len(size)
    if solids.form is not None:
        form = solids.form
        groups = [argument.numpy().reshape(rows, -1) for argument in (*form.arguments, *form.angles)]
        widths, linear = tuple(group.shape[1] for group in groups), np.concatenate(groups, 1)
        return _Measured(form.name, widths, linear, np.zeros((rows, 0)), angles=len(form.angles))
    rotation = np.tile(np.eye(3), (rows, 1, 1)) if solids.rotation is None else solids.rotation.numpy()
    turned = bool(np.abs(rotation - np.eye(3)).max() > 0)
    name = primitives[solids.kind].name
    if name in ("cylinder", "frustum"):
        reach, radii = rotation[..., 0] * size[:, :1], size[:, 1 : 2 if name == "cylinder" else 3]
        linear = np.concatenate([centre - reach, centre + reach, radii], 1)
        return _Measured("cylinder_between", (3, 3, *[1] * radii.shape[1]), linear, np.zeros((rows, 0)))
    axes, still = (rotation[0], rotation.reshape(rows, 9)) if turned else (None, np.zeros((rows, 0)))
    if name == "cuboid":
        low = centre - size[:, :3]
        low[:, 1] -= size[:, 3] / 2
        linear = np.concatenate([centre if turned else low, 2 * size[:, :3], size[:, 3:4]], 1)
        return _Measured(name, (3, 3, 1), linear, still, axes)
    declared = primitives[solids.kind]
    bound = declared.bound(solids.size).numpy()
    meshes = [declared.mesh(row.astype(np.float64)) for row in size]
    units = [vertices / np.where(half > 0, half, 1) for (vertices, _), half in zip(meshes, bound, strict=True)]
    same = all(unit.shape == units[0].shape for unit in units)
    unit = np.stack(units) if same else np.arange(rows, dtype=np.float64)[:, None]
    shape = np.concatenate([still, unit.reshape(rows, -1)], 1)
    return _Measured("shell", (3, 3), np.concatenate([centre, bound], 1), shape, axes, units[0], meshes[0][1])


class _Probe:
    """A function of parameters, evaluated around them: which slots it is linear in, and with which coefficients."""

    def __init__(
        self, declared: Statement, values: Sequence[float], measure: Measure, slots: Sequence[int], step: float
    ) -> None:
        here = np.asarray(values, np.float64)
        along = [far * np.eye(len(here))[slot] for slot in slots for far in (step, 2 * step)]
        self.base, linear, still = _evaluate(measure, np.stack([here, *(here + move for move in along)]))
        one, two = linear[1::2] - linear[0], linear[2::2] - linear[0]
        bent = np.abs(two - 2 * one).max(1, initial=0) > TOLERANCE
        moved = np.abs(still[1:] - still[0]).max(1, initial=0).reshape(-1, 2).max(1, initial=0) > TOLERANCE
        live = [slot for slot, bad in zip(slots, bent | moved, strict=True) if not bad]
        slope = np.zeros((len(here), linear.shape[1]))
        slope[list(slots)] = one / step
        # Linear in each slot alone is not linear in all: move the live ones together, and give up where that differs.
        mixed = np.zeros((2, len(here)))
        mixed[:, live] = step * np.outer([1, 3], 1 + np.arange(len(live)) % 3)
        _, together, pose = _evaluate(measure, np.concatenate([here[None], here + mixed]))
        gap = np.abs(together[1:] - linear[0] - mixed @ slope).max(initial=0)
        if max(gap, np.abs(pose[1:] - pose[0]).max(initial=0)) > TOLERANCE:
            live = []
        used = {slot for slot in live if np.abs(slope[slot]).max(initial=0) > TOLERANCE}
        self.fixed = frozenset(range(declared.size)) - used
        self._here, self._value, self._slope, self._live = here, linear[0], slope, live
        self._quantities = declared.quantities

    def affine(self, column: int, cell: float = 1.0, power: int = 1) -> Affine:
        """One number as an expression; a length where ``power`` is 1, an angle where it is 0."""
        terms, constant = [], float(self._value[column])
        for slot in self._live:
            coefficient = round(float(self._slope[slot][column]), 9)
            if coefficient:
                terms.append((slot, coefficient * cell ** (power - self._quantities[slot].spatial)))
                constant -= coefficient * self._here[slot]
        constant = round(constant, 9) if terms else constant
        return Affine(constant * cell**power if abs(constant) > 1e-9 else 0.0, tuple(terms))


def _evaluate(measure: Measure, rows: FloatArray) -> tuple[list[_Measured], FloatArray, FloatArray]:
    with torch.no_grad():
        parts = measure(torch.from_numpy(rows))
    linear = np.concatenate([part.linear for part in parts], 1)
    return parts, linear, np.concatenate([part.still for part in parts], 1)


def _continuous(declared: Statement) -> list[int]:
    return [slot for slot, quantity in enumerate(declared.quantities) if not quantity.discrete]


def _enclosed(text: str) -> bool:
    """Whether one pair of parentheses encloses a whole text."""
    depth = 0
    for place, letter in enumerate(text):
        depth += {"(": 1, ")": -1}.get(letter, 0)
        if not depth:
            return text[0] == "(" and place == len(text) - 1
    return False


def _scaled(name: str, coefficient: float) -> str:
    if coefficient == 1:
        return name
    if coefficient < 1 and abs(1 / coefficient - round(1 / coefficient)) < 1e-9:
        return f"{name} / {round(1 / coefficient)}"
    return f"{number(coefficient)} * {name}"

"""Cut lists: count, role and size of each distinct part, as CSV and as a table."""

from __future__ import annotations

import csv
import io
import math
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

from shapeprog.files import write_text
from shapeprog.geometry.mesh import solids_of
from shapeprog.geometry.primitives import primitives
from shapeprog.language.program import Program
from shapeprog.language.tensors import encode
from shapeprog.language.unit import METRES
from shapeprog.language.unroll import on_numpy_if_shipped, unroll
from shapeprog.lazy_torch import torch
from shapeprog.space import FloatArray, Frame

FINEST = 1e-4  # metres to which sizes are rounded
DIGITS = 3  # significant digits of sizes whose unit is not known, and of areas
BOARD = "board"  # the shape of a box whose thickness is at most half its width
SAME = 1e-3  # cells within which two copies coincide
FLAT = 1e-5  # share of its size by which a part leans, or is bent, at least


@dataclass(frozen=True, order=True)
class Cut:
    """A distinct part of a cut list.

    Parameters
    ----------
    role
        Its role or statement.
    shape
        ``board``, ``bar`` or ``block``, ``round``, or the dimensions needed to make it, such as ``rounded edges 3``.
    length, width, thickness
        Its sizes in the unit of the list; a round part has its length and a diameter instead of both others.
    round
        Whether it is round.
    """

    role: str
    shape: str
    length: float
    width: float
    thickness: float
    round: bool = False

    @property
    def size(self) -> str:
        """Its sizes as text."""
        if self.round:
            return f"⌀ {self.width:g} x {self.length:g}"
        return f"{self.length:g} x {self.width:g} x {self.thickness:g}"


@dataclass(frozen=True)
class CutList:
    """The distinct parts of a program with their counts, largest first, in a unit.

    ``coinciding`` copies lie where another one lies, and are not counted.
    """

    cuts: tuple[tuple[Cut, int], ...]
    unit: str
    coinciding: int

    @property
    def area(self) -> str:
        """Total length x width of all boards."""
        total = sum(count * cut.length * cut.width for cut, count in self.cuts if cut.shape == BOARD)
        if self.unit:
            return f"{_digits(total * METRES[self.unit] ** 2):g} m²"
        return f"{_digits(total):g} square units"

    @property
    def table(self) -> str:
        """The list as a table of plain text, with the total area of its boards and a warning of coinciding copies."""
        rows = [(f"{count}", cut.role, cut.size, cut.shape) for cut, count in self.cuts]
        rows.insert(0, ("count", "role", f"size{f' ({self.unit})' if self.unit else ''}", "shape"))
        widths = [max(len(row[column]) for row in rows) for column in range(3)]
        lines = [
            f"{row[0]:>{widths[0]}}  {row[1]:<{widths[1]}}  {row[2]:<{widths[2]}}  {row[3]}".rstrip() for row in rows
        ]
        lines.append(f"Area of boards, length x width: {self.area}")
        if self.coinciding:
            lines.append(f"Warning: {self.coinciding} copies lie where others lie (a mirror through the part?).")
        return "\n".join(lines)


@lru_cache(maxsize=1)  # the command writes and prints the same list
def cut_list(program: Program, frame: Frame, unit: str = "") -> CutList:
    """The distinct parts of a program; ``frame.scale`` is the size of a cell in ``unit``, which is empty if unknown."""
    with on_numpy_if_shipped(program):
        cuts = list(_cuts(program, frame.scale, unit))
    counts: Counter[Cut] = Counter()
    for cut, _ in set(cuts):
        counts[cut] += 1
    rows = sorted(counts.items(), key=lambda row: (row[0].round, -row[0].thickness, -row[0].length, row[0]))
    return CutList(tuple(rows), unit, len(cuts) - len(set(cuts)))


def write_cuts(program: Program, path: Path, frame: Frame, unit: str = "") -> None:
    """Write the cut list as CSV, see :func:`cut_list`."""
    text = io.StringIO()
    rows = csv.writer(text, lineterminator="\n")
    behind = f" ({unit})" if unit else ""
    rows.writerow(
        ["count", "role", *(f"{word}{behind}" for word in ("length", "width", "thickness", "diameter")), "shape"]
    )
    for cut, count in cut_list(program, frame, unit).cuts:
        sizes = [cut.length, "", "", cut.width] if cut.round else [cut.length, cut.width, cut.thickness, ""]
        rows.writerow([count, cut.role, *(value if value == "" else f"{value:g}" for value in sizes), cut.shape])
    write_text(path, text.getvalue())


def _cuts(program: Program, scale: float, unit: str) -> Iterator[tuple[Cut, tuple[float, ...]]]:
    """The entry of every part that has a volume, and where it lies: its centre and extents, rounded."""
    scene = unroll(encode(program, dtype=torch.float64))
    words, blocks, kinds = [draw.word for draw in program.draws], scene.block.tolist(), scene.kind.tolist()
    solid, sizes, centre, rotation, halves = solids_of(scene)
    for slot in np.flatnonzero(solid).tolist():
        half = halves[slot]
        cut = _cut(words[blocks[slot]], primitives[kinds[slot]].name, sizes[slot], half, scale, unit)
        if cut is not None:
            spread = rotation[slot] @ np.diag(half**2) @ rotation[slot].T
            pose = np.concatenate([centre[slot], np.sign(spread).ravel() * np.sqrt(np.abs(spread)).ravel()])
            yield cut, tuple(np.rint(pose / SAME).tolist())


def _cut(role: str, name: str, size: FloatArray, half: FloatArray, scale: float, unit: str) -> Cut | None:
    """The entry of a part by the name and the sizes of its primitive and its half extents, in cells; none if it has no
    volume."""
    if name == "cylinder":
        return _round_cut(role, "round", 2 * size[0] * scale, 2 * size[1] * scale, unit)
    if name == "frustum":
        ends = " to ".join(f"{_rounded(2 * scale * float(radius), unit):g}" for radius in size[1:3])
        return _round_cut(role, f"tapered from {ends}", 2 * size[0] * scale, 2 * max(size[1:3]) * scale, unit)
    if name == "arc":
        chord, rise = float(size[0]), float(size[2])
        along = 2 * chord if rise < FLAT * chord else (chord**2 + rise**2) / rise * 2 * math.atan2(rise, chord)
        return _round_cut(role, "bent", along * scale, 2 * size[1] * scale, unit)
    shape = name
    if name == "cuboid":
        half, lean = size[:3], _rounded(abs(float(size[3])) * scale, unit)
        shape = f"leaning by {lean:g}" if lean > 0 and abs(size[3]) > FLAT * min(half) else BOARD
    elif name == "rounded_box":
        edge = _rounded(min(float(size[3]), *map(float, size[:3])) * scale, unit)
        shape = f"rounded edges {edge:g}" if edge > 0 else BOARD
    thickness, width, length = (_rounded(2 * float(side) * scale, unit) for side in sorted(half))
    if shape == BOARD and 2 * thickness > width:
        shape = "bar" if length > 3 * width else "block"
    return Cut(role, shape, length, width, thickness) if thickness > 0 else None


def _round_cut(role: str, shape: str, length: float, diameter: float, unit: str) -> Cut | None:
    length, diameter = _rounded(float(length), unit), _rounded(float(diameter), unit)
    return Cut(role, shape, length, diameter, diameter, round=True) if min(length, diameter) > 0 else None


def _rounded(value: float, unit: str) -> float:
    """A length in multiples of ``FINEST``, or with one more than ``DIGITS`` digits if its unit is not known."""
    if unit:
        return round(value, -math.floor(math.log10(FINEST / METRES[unit]) + 1e-9)) + 0.0
    return round(value, DIGITS - math.floor(math.log10(max(abs(value), 1e-30)))) + 0.0


def _digits(value: float) -> float:
    return float(f"{value:.{DIGITS}g}")

"""Cut lists: count, role and size of each distinct part, as CSV and as a table."""

from __future__ import annotations

import csv
import io
import math
from collections import Counter
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from shapeprog.formats.format import format_of
from shapeprog.formats.frames import placement
from shapeprog.geometry.mesh import solids_of
from shapeprog.geometry.primitives import primitives
from shapeprog.language.program import Program
from shapeprog.language.statement import remembered
from shapeprog.language.unit import METRES
from shapeprog.language.unroll import exact_scene
from shapeprog.space import FloatArray, Frame

FINEST = 1e-4  # metres to which sizes are rounded
FOOT = 0.3048  # metres
DIGITS = 3  # significant digits of areas; sizes whose unit is not known have one more
BOARD = "board"  # the shape of a box whose thickness is at most half its width
SAME = 1e-3  # cells within which two copies coincide
FLAT = 1e-5  # share of its size by which a part leans, or is bent, at least


class Cut(NamedTuple):
    """A distinct part of a cut list; lengths are in the unit of the list, and 0 where they do not apply.

    Parameters
    ----------
    role
        Its role or statement.
    shape
        ``board``, ``round``, the dimensions needed to make it, such as ``rounded edges 3`` or ``board, leaning by 5``,
        or empty for other boxes.
    length
        Its longest edge, or the length of a round part.
    width, thickness
        The other edges of a part that is not round.
    diameter
        That of a round part.
    """

    role: str
    shape: str
    length: float
    width: float = 0.0
    thickness: float = 0.0
    diameter: float = 0.0


class CutList(NamedTuple):
    """The distinct parts of a program with their counts, largest first, in a unit.

    ``coinciding`` copies lie where another one lies, and ``dropped`` parts have a side that rounds to 0; neither are
    counted.
    """

    cuts: tuple[tuple[Cut, int], ...]
    unit: str
    coinciding: int
    dropped: int

    @property
    def area(self) -> str:
        """Total length x width of all boards."""
        total = sum(count * cut.length * cut.width for cut, count in self.cuts if cut.shape.startswith(BOARD))
        size, unit = (FOOT, "ft²") if self.unit == "in" else (1.0, "m²" if self.unit else "square units")
        total *= (METRES.get(self.unit, 1.0) / size) ** 2
        return f"{float(f'{total:.{DIGITS}g}'):g} {unit}"

    @property
    def rows(self) -> list[list[str]]:
        """The list as text, with a row of headings."""
        unit = f" ({self.unit})" if self.unit else ""
        sizes = (f"{size}{unit}" for size in ("length", "width", "thickness", "diameter"))
        result = [["count", "role", *sizes, "shape"]]
        for (role, shape, *lengths), count in self.cuts:
            result.append([f"{count}", role, *(f"{length:g}" if length else "" for length in lengths), shape])
        return result

    @property
    def table(self) -> str:
        """The list as a table of plain text, with the total area of its boards."""
        widths = [max(map(len, column)) for column in zip(*self.rows, strict=True)]
        lines = ["  ".join(f"{text:<{n}}" for text, n in zip(row, widths, strict=True)).rstrip() for row in self.rows]
        return "\n".join([*lines, f"Area of boards, length x width: {self.area}"])

    @property
    def warnings(self) -> list[str]:
        """What is not counted, and why."""
        same = f"copies that lie where another one lies are left out (a mirror through the part?): {self.coinciding}"
        least = "0.0005 in" if self.unit == "in" else "0.05 mm"
        thin = f"parts thinner than {least} are left out (wrong unit?): {self.dropped}"
        return [same] * (self.coinciding > 0) + [thin] * (self.dropped > 0)


@remembered(1)  # the command writes and prints the same list
def cut_list(program: Program, frame: Frame, unit: str = "") -> CutList:
    """The distinct parts of a program; ``frame.scale`` is the size of a cell in ``unit``, which is empty if unknown."""
    with exact_scene(program) as scene:
        solids = list(_copies(scene, program, frame.scale, unit))
    copies = [(cut, key) for cut, key in solids if min(cut.length, cut.thickness + cut.diameter) > 0]
    distinct = set(copies)
    counts = Counter(cut for cut, _ in distinct)
    rows = sorted(counts.items(), key=_order)
    return CutList(tuple(rows), unit, len(copies) - len(distinct), len(solids) - len(copies))


def _order(row: tuple[Cut, int]) -> tuple[bool, float, float, Cut]:
    """Round parts last, thick and long ones first."""
    cut, _ = row
    return cut.diameter > 0, -cut.thickness - cut.diameter, -cut.length, cut


def cuts_csv(program: Program, frame: Frame, unit: str = "") -> str:
    """The cut list as CSV, see :func:`cut_list`."""
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(cut_list(program, frame, unit).rows)
    return text.getvalue()


def listed_cuts(program: Program, **asked: Any) -> CutList:
    """The cut list that :func:`shapeprog.export` writes with the same arguments."""
    chosen = format_of("a.csv")
    assert chosen is not None
    lies = placement(chosen, program, **asked)
    assert lies.frame is not None
    return cut_list(program, lies.frame, lies.unit)


def _copies(scene: Any, program: Program, scale: float, unit: str) -> Iterator[tuple[Cut, tuple[float, ...]]]:
    """The entry of every part that has a volume, and where it lies: the moments of its corners."""
    words, blocks, kinds = [draw.word for draw in program.draws], scene.block.tolist(), scene.kind.tolist()
    solid, sizes, centre, rotation, halves = solids_of(scene)
    rounded = partial(_rounded, scale=scale, unit=unit)
    for slot in np.flatnonzero(solid).tolist():
        cut = _cut(words[blocks[slot]], primitives[kinds[slot]].name, sizes[slot], halves[slot], rounded)
        vertices = primitives[kinds[slot]].mesh(sizes[slot])[0] @ rotation[slot].T
        offsets = vertices - vertices.mean(0)
        square = (offsets**2).sum(1, keepdims=True)  # the third moment is the direction of a taper
        spread = (offsets.T @ offsets).ravel() / len(offsets), (offsets * square).sum(0) / square.sum()
        key = np.concatenate([centre[slot] + vertices.mean(0), *spread])
        yield cut, tuple(np.rint(key / SAME).tolist())


def _cut(role: str, name: str, size: FloatArray, half: FloatArray, rounded: Callable[[float], float]) -> Cut:
    """The entry of a part by the name and the sizes of its primitive and its half extents, in cells."""
    if name == "cylinder":
        return Cut(role, "round", rounded(2 * size[0]), diameter=rounded(2 * size[1]))
    if name == "frustum":
        first, last = (rounded(2 * radius) for radius in size[1:3])
        return Cut(role, f"tapered from {first:g} to {last:g}", rounded(2 * size[0]), diameter=max(first, last))
    if name == "arc":
        chord, rise = float(size[0]), float(size[2])
        along = 2 * chord if rise < FLAT * chord else (chord**2 + rise**2) / rise * 2 * math.atan2(rise, chord)
        return Cut(role, "bent", rounded(along), diameter=rounded(2 * size[1]))
    shape = ""
    if name == "cuboid":
        half, lean = np.array([math.hypot(size[0], size[3] / 2), *size[1:3]]), rounded(abs(size[3]))
        shape = f"leaning by {lean:g}" if lean > 0 and abs(size[3]) > FLAT * min(half) else ""
    elif name == "rounded_box":
        edge = rounded(min(size[3], *size[:3]))
        shape = f"rounded edges {edge:g}" if edge > 0 else ""
    thickness, width, length = (rounded(2 * side) for side in sorted(half))
    board = BOARD if 2 * thickness <= width and not shape.startswith("rounded") else ""
    return Cut(role, ", ".join(filter(None, (board, shape))), length, width, thickness)


def _rounded(cells: float, scale: float, unit: str) -> float:
    """A length in multiples of ``FINEST``, or with one more than ``DIGITS`` digits if its unit is not known.

    Parameters
    ----------
    cells
        The length in cells.
    scale, unit
        Size of a cell in the unit, and the name of that.
    """
    length = float(cells) * scale
    finest = FINEST / METRES[unit] if unit else max(abs(length), 1e-30) / 10**DIGITS
    return round(length, -math.floor(math.log10(finest) + 1e-9)) + 0.0

"""Cut lists: count, role and size of each distinct part, as CSV."""

from __future__ import annotations

import csv
import io
import math
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from shapeprog.files import write_text
from shapeprog.geometry.mesh import solids_of
from shapeprog.geometry.primitive import primitives
from shapeprog.language.program import Program
from shapeprog.language.tensors import encode
from shapeprog.language.unit import METRES
from shapeprog.language.unroll import on_numpy_if_shipped, unroll
from shapeprog.lazy_torch import torch
from shapeprog.space import FloatArray, Frame

FINEST = 1e-4  # metres to which sizes are rounded
DIGITS = 3  # significant digits of sizes whose unit is not known, but for one more
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


def cut_list(program: Program, frame: Frame, unit: str = "") -> list[tuple[Cut, int]]:
    """The distinct parts of a program with their counts, largest first.

    Copies that lie where another one lies are counted once.

    Parameters
    ----------
    program
        What to list.
    frame
        Its scale is the size of a cell in ``unit``.
    unit
        Unit of the sizes; empty if it is not known.
    """
    with on_numpy_if_shipped(program):
        counts = Counter(cut for cut, _ in set(_cuts(program, frame.scale, unit)))
    return sorted(counts.items(), key=lambda row: (row[0].round, -row[0].thickness, -row[0].length, row[0]))


def write_cuts(program: Program, path: Path, frame: Frame, unit: str = "") -> None:
    """Write the cut list as CSV, see :func:`cut_list`."""
    text = io.StringIO()
    rows = csv.writer(text, lineterminator="\n")
    behind = f" ({unit})" if unit else ""
    sizes = [f"{word}{behind}" for word in ("length", "width", "thickness", "diameter")]
    rows.writerow(["count", "role", *sizes, "shape"])
    for cut, count in cut_list(program, frame, unit):
        length, width, thickness = (f"{size:g}" for size in (cut.length, cut.width, cut.thickness))
        sizes = [length, "", "", width] if cut.round else [length, width, thickness, ""]
        rows.writerow([count, cut.role, *sizes, cut.shape])
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

"""An interactive view as one self-contained HTML file: turn the shape, relate lines to parts, and drag the
numbers of a program.

The page cannot draw statements, which may be a user's own.  It has the meshes for the smallest and the largest value of
each number and interpolates linearly between them and the written one, which is exact wherever corners depend linearly
on a number.
"""

from __future__ import annotations

import base64
import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from shapeprog.data.shape import Shape
from shapeprog.errors import OutputError, ShapeProgError
from shapeprog.files import write_text
from shapeprog.formats.colours import colour
from shapeprog.formats.files import written_format
from shapeprog.formats.frames import cell_size, frame_comment
from shapeprog.formats.parts import Part, crease_edges, part_normals, parts
from shapeprog.language.dimensions import lengths
from shapeprog.language.named import Named, names, set
from shapeprog.language.program import Program
from shapeprog.language.unit import Unit
from shapeprog.space import Array, Frame
from shapeprog.view.listing import Row, digits_in, listing, parted
from shapeprog.view.model import FINE, of_cells, of_shape
from shapeprog.view.page import readable, scores_text

PAGE = Frame(axes=((0.0, 0.0, -1.0), (1.0, 0.0, 0.0), (0.0, -1.0, 0.0)))
"""From grid axes (up, depth, left-right) to page axes (right, up, towards the viewer)."""

REACH = 0.5  # farthest from a number that its slider goes, as a share of it, within the range of the name
LEAST = 1.0  # magnitude assumed for smaller numbers, so that a zero can be dragged; for lengths in cells
STILL = 1e-4  # movement in cells below which a part counts as fixed
MOST = 400_000  # most triangle corners of all meshes of a page; with more it has no sliders


@dataclass(frozen=True)
class Slider:
    """A number to drag.

    Parameters
    ----------
    name, value
        Its name and value.
    unit
        Unit of a length that is not in cells, else empty.
    ends
        For its smallest and its largest value the corners (F, 3, 6) of the triangles of each part, positions and
        normals; ``None`` for parts that do not move.
    """

    name: str
    value: float
    unit: str
    ends: dict[float, list[Array | None]]


def viewer(
    program: Program,
    path: str | os.PathLike[str],
    *,
    shape: Shape | None = None,
    title: str = "",
    scores: Mapping[str, float] | None = None,
) -> Path:
    """Write the page: the program next to its parts, and the input if there is one.

    Parameters
    ----------
    program
        The program to draw; text that is copied from the page keeps its frame.
    path
        The page, which ends in .html.
    shape
        The input.
    title
        Stands above the program; by default the name of the input or of the page.
    scores
        Scores by name, as ``picture`` takes them.

    Raises
    ------
    OutputError
        If the file cannot be written, or the program has more than ``FINE`` triangles.
    """
    drawn = parts(program, PAGE)
    if (triangles := sum(len(part.faces) for part in drawn)) > FINE:
        raise OutputError(
            f"the {len(drawn)} parts of this program have {triangles} triangles: a page holds at most {FINE}",
            "lower the counts, or draw a picture",
        )
    given = None if shape is None else _input(shape)
    target = Path(path)
    content = {
        "frame": frame_comment(program),
        "title": title or (shape.name if shape is not None else target.stem),
        "facts": " · ".join(scores_text(scores, program)),
        "lines": [_line(row) for row in listing(program, None)],
        "parts": [
            {"name": part.name, "block": part.block, "colour": [channel / 255 for channel in colour(part.word)]}
            | _buffers(part.vertices, part.faces, normals)
            for part, normals in zip(drawn, part_normals(drawn), strict=True)
        ],
        "sliders": [_slider_content(slider) for slider in sliders(program, drawn)],
        "digits": digits_in(program.unit),
        "scale": cell_size(written_format(Path("a.stl")), program)[0],
        "input": None if given is None else _buffers(*given),
    }
    text = json.dumps(content, separators=(",", ":")).replace("<", "\\u003c")
    write_text(target, Path(__file__).with_suffix(".html").read_text(encoding="utf-8").replace("@DATA@", text))
    return target


def sliders(program: Program, drawn: Sequence[Part]) -> list[Slider]:
    """The free numbers of a program, except for those that change how many parts there are or how they are divided.

    Parameters
    ----------
    drawn
        The parts of the unchanged program on the page.
    """
    free = [named for named in names(program) if named.free]
    if len(free) * 2 * sum(3 * len(part.faces) for part in drawn) > MOST:
        return []
    unit, measured, start = program.unit, lengths(program), corners_of(drawn)
    result = []
    for named in free:
        own_unit = unit if named.name in measured else None
        tried = {end: _moved(program, start, {named.name: end}) for end in _range(named, own_unit)}
        ends = {end: corners for end, corners in tried.items() if corners is not None}
        if any(part is not None for corners in ends.values() for part in corners):
            result.append(Slider(named.name, named.value, own_unit.name if own_unit else "", ends))
    return result


def corners_of(drawn: Sequence[Part]) -> list[Array]:
    """The corners of the triangles of parts (F, 3, 6): positions and normals."""
    return [
        np.concatenate([part.vertices[part.faces], normals], -1)
        for part, normals in zip(drawn, part_normals(drawn), strict=True)
    ]


def _range(named: Named, unit: Unit | None) -> list[float]:
    """The ends of the slider of a number that differ from it."""
    size = REACH * max(abs(named.value), LEAST if unit is None else LEAST * unit.per_cell)
    low, high = named.range or (named.value, named.value)
    ends = max(low, named.value - size), min(high, named.value + size)
    return [end for end in ends if end != named.value]


def _moved(program: Program, start: Sequence[Array], changes: Mapping[str, float]) -> list[Array | None] | None:
    """The corners of moving parts of a changed program; none at all if it has other parts."""
    try:
        corners = corners_of(parts(set(program, changes), PAGE))
    except ShapeProgError:
        return None
    if [part.shape for part in corners] != [part.shape for part in start]:
        return None
    pairs = zip(start, corners, strict=True)
    return [None if np.abs(after - before).max(initial=0) < STILL else after for before, after in pairs]


def _input(shape: Shape) -> tuple[Array, Array, Array]:
    """The vertices, faces and normals of an input on the page."""
    # No browser opens a page of hundreds of megabytes, so such a mesh is shown as cells.
    large = shape.faces is not None and len(shape.faces) > FINE
    model = of_cells(shape.voxels) if large else of_shape(shape)
    return PAGE.to_world(model.vertices), model.faces, PAGE.to_world(model.normals)


def _line(row: Row) -> dict[str, Any]:
    before, word, after = parted(row)
    record = {"before": before, "word": word, "after": after, "blocks": row.blocks, "numbers": row.numbers}
    shades = {"colour": colour(row.role), "ink": readable(row.role)} if row.role else {}
    return record | {key: "rgb({}, {}, {})".format(*shade) for key, shade in shades.items()}


def _slider_content(slider: Slider) -> dict[str, Any]:
    places = [
        {"at": at, "parts": [None if part is None else _packed(part) for part in corners]}
        for at, corners in slider.ends.items()
    ]
    values = [slider.value, *slider.ends]
    ends = {"low": min(values), "high": max(values), "unit": slider.unit}
    return {"name": slider.name, "value": slider.value, **ends, "places": places}


def _buffers(vertices: Array, faces: Array, normals: Array) -> dict[str, str]:
    """Triangles as positions and normals of corners, and creases as pairs of corners."""
    corners = np.concatenate([vertices[faces], normals], -1)
    return {"triangles": _packed(corners), "creases": _packed(crease_edges(faces, normals), "<u4")}


def _packed(values: Array, kind: str = "<f4") -> str:
    return base64.b64encode(np.ascontiguousarray(values, kind).tobytes()).decode()

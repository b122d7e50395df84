"""An interactive view as one self-contained HTML file: turn the shape, relate lines to parts, and drag the
numbers of a program."""

from __future__ import annotations

import base64
import json
import os
from pathlib import Path
from typing import Any

import numpy as np

from shapeprog.data.shape import Shape
from shapeprog.errors import OutputError
from shapeprog.files import write_text
from shapeprog.formats.colours import colour
from shapeprog.formats.frames import frame_comment
from shapeprog.formats.parts import parts
from shapeprog.language.program import Program
from shapeprog.space import Array, Frame
from shapeprog.view.listing import digits_in, listing, parted
from shapeprog.view.model import FINE, of_cells, of_shape
from shapeprog.view.page import readable, scores_text
from shapeprog.view.sliders import Slider, corners_of, pieces, sliders

_TO_PAGE = np.array([[0.0, 0.0, -1.0], [1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
"""From grid axes (up, depth, left-right) to page axes (right, up, towards the viewer)."""


def viewer(
    program: Program,
    path: str | os.PathLike[str],
    *,
    shape: Shape | None = None,
    title: str = "",
    scores: Any = None,
    frame: Frame | None = None,
) -> Path:
    """Write the page: the program next to its parts, and the input if there is one.

    Parameters
    ----------
    program
        The program to draw.
    path
        The page, which ends in .html.
    shape
        The input.
    title
        Stands above the program; by default the name of the input or of the page.
    scores
        Scores by name, as ``picture`` takes them.
    frame
        The way to the world of the input, which is kept in the text that is copied from the page.

    Raises
    ------
    OutputError
        If the file cannot be written, or the program has more than ``FINE`` triangles.
    """
    shown_parts = parts(program)
    if (triangles := sum(len(part.faces) for part in shown_parts)) > FINE:
        raise OutputError(
            f"the {len(shown_parts)} parts of this program have {triangles} triangles: a page holds at most {FINE}",
            "lower the counts, or draw a picture",
        )
    # No browser opens a page of hundreds of megabytes, so such a mesh is shown as cells.
    large = shape is not None and shape.faces is not None and len(shape.faces) > FINE
    model = None if shape is None else of_cells(shape.voxels) if large else of_shape(shape)
    vertices = [part.vertices for part in shown_parts] + ([] if model is None else [model.vertices])
    points = np.concatenate([*vertices, np.zeros((0, 3))])
    points = points if len(points) else np.zeros((1, 3))
    low, high = points.min(0), points.max(0)
    movable = sliders(program, shown_parts)
    content = {
        "frame": frame_comment(frame, program),
        "title": title or (shape.name if shape is not None else Path(path).stem),
        "facts": " · ".join(scores_text(scores, program)),
        "middle": (_TO_PAGE @ ((low + high) / 2)).tolist(),
        "radius": max(1.0, float(np.linalg.norm(high - low)) / 2),
        "lines": [_line(line, [slider.name for slider in movable]) for line in listing(program, None)],
        "parts": [
            {"name": part.name, "block": part.block, "colour": [channel / 255 for channel in colour(part.word)]}
            | _buffers(corners)
            for part, corners in zip(shown_parts, corners_of(shown_parts), strict=True)
        ],
        "sliders": [_slider(slider) for slider in movable],
        "digits": digits_in(program.unit),
        "input": None if model is None else _buffers(np.concatenate([model.vertices[model.faces], model.normals], -1)),
    }
    text = json.dumps(content, separators=(",", ":")).replace("<", "\\u003c")
    target = Path(path)
    write_text(target, Path(__file__).with_suffix(".html").read_text(encoding="utf-8").replace("@DATA@", text))
    return target


def _line(line: Any, movable: list[str]) -> dict[str, Any]:
    before, word, after = parted(line)
    record = {"before": before, "word": word, "after": after, "blocks": list(line.blocks), "colour": None, "ink": None}
    if line.role:
        record["colour"] = "rgb({}, {}, {})".format(*colour(line.role))
        record["ink"] = "rgb({}, {}, {})".format(*readable(line.role))
    return record | {"pieces": pieces(line.text, movable)}


def _slider(slider: Slider) -> dict[str, Any]:
    steps = [
        {"at": at, "parts": [None if part is None else _packed(_turned(part)) for part in meshes]}
        for at, meshes in sorted(slider.places.items())
    ]
    ends = {"low": slider.low, "high": slider.high, "unit": slider.unit}
    return {"name": slider.name, "value": slider.value, **ends, "places": steps}


def _buffers(corners: Array) -> dict[str, str]:
    """Triangles (F, 3, 6) as positions and normals in the axes of the page, and creases as pairs of their corners."""
    return {
        "triangles": _packed(_turned(corners)),
        "creases": _packed(_creases(corners[..., :3], corners[..., 3:]), "<u4"),
    }


def _turned(corners: Array) -> Array:
    """Positions and normals in the axes of the page."""
    return np.concatenate([corners[..., :3] @ _TO_PAGE.T, corners[..., 3:] @ _TO_PAGE.T], -1)


def _creases(corners: Array, normals: Array) -> Array:
    """Indices (E, 2) of the corners, over all triangles, at the ends of creases."""
    starts, ends = corners.reshape(-1, 3), np.roll(corners, -1, 1).reshape(-1, 3)
    tilt = np.asarray(normals).reshape(-1, 3) + np.roll(normals, -1, 1).reshape(-1, 3)
    extent = float(np.ptp(corners.reshape(-1, 3), axis=0).max()) if len(corners) else 1.0
    inside = np.stack([starts, ends], 1) - corners.reshape(-1, 3).min(0, initial=np.inf)
    keys = np.rint(inside / max(extent, 1e-30) * 1e5).astype(np.int64)
    swap = [tuple(start) > tuple(end) for start, end in keys.tolist()]
    keys[swap] = keys[swap][:, ::-1]
    _, first, edge, count = np.unique(
        keys.reshape(-1, 6), axis=0, return_index=True, return_inverse=True, return_counts=True
    )
    total = np.zeros((len(first), 3))
    np.add.at(total, edge.reshape(-1), tilt / np.maximum(np.linalg.norm(tilt, axis=1, keepdims=True), 1e-12))
    sharp = (count == 1) | (np.linalg.norm(total, axis=1) < 0.94 * count)
    sharp &= (keys[first, 0] != keys[first, 1]).any(1)
    corner = first[sharp]
    return np.stack([corner, corner - corner % 3 + (corner % 3 + 1) % 3], 1)


def _packed(values: Array, kind: str = "<f4") -> str:
    return base64.b64encode(np.ascontiguousarray(values, kind).tobytes()).decode()

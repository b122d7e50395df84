"""Where an export lies: on the input when its frame is known, upright on the format's own axes when not.

A ``.shape`` file may carry its frame as a comment in its first lines, which the parser ignores:

    # frame: {"scale": 0.0417, "centre": [0, 0.5, 0], "axes": [[0, 0, 1], [1, 0, 0], [0, 1, 0]]}

``shapeprog infer`` writes it there, so that ``shapeprog export chair.shape chair.glb`` lies on the mesh it was
inferred from.  Without it one unit of the file is one of the program (a cell unless it has another unit), the centre
of the grid is the origin, and the axes are those of the format.
"""

from __future__ import annotations

import json
import math
import re
from reprlib import repr as shortened
from typing import Any

import numpy as np

from shapeprog.errors import InputError
from shapeprog.formats.format import Format
from shapeprog.language.unit import Unit
from shapeprog.space import Frame, grid_axes

_HEADER = re.compile(r"^#[ \t]*frame:(.*)$", re.MULTILINE)
_CURE = (
    'write it as # frame: {"scale": 1, "centre": [0, 0, 0], "axes": [[1, 0, 0], [0, 1, 0], [0, 0, 1]]}, or remove it'
)


def upright(chosen: Format, unit: Unit | None = None) -> Frame | None:
    """The default frame of a format: one unit of a program is one unit of the file; up and front are those of the
    format.

    Program files have none.
    """
    if chosen.axes is None:
        return None
    axes = tuple((float(a), float(b), float(c)) for a, b, c in grid_axes(*chosen.axes))
    return Frame(1.0 if unit is None else unit.per_cell, axes=axes)


def frame_dict(frame: Frame) -> dict[str, Any]:
    """A frame as plain numbers for JSON: scale, centre and the rows of its axes, exact."""
    return {"scale": frame.scale, "centre": list(frame.centre), "axes": [list(row) for row in frame.axes]}


def frame_from(data: Any, name: str) -> Frame:
    """The frame that :func:`frame_dict` wrote.

    Raises
    ------
    InputError
        If numbers are missing or not finite, the scale is not positive or the axes are not a rotation.
    """
    try:
        scale, centre = float(data["scale"]), [float(value) for value in data["centre"]]
        axes = [[float(value) for value in row] for row in data["axes"]]
        matrix = np.array(axes)
        good = matrix.shape == (3, 3) and len(centre) == 3 and scale > 0
        good = good and all(map(math.isfinite, [scale, *centre])) and (np.abs(matrix) < 2).all()
        good = good and np.allclose(matrix @ matrix.T, np.eye(3), atol=1e-6) and np.linalg.det(matrix) > 0
    except (KeyError, TypeError, ValueError, OverflowError):
        good = False
    if not good:
        raise InputError(f"{name}: the frame {shortened(data)} is not a scale, a centre and a rotation", _CURE)
    return Frame(scale, (centre[0], centre[1], centre[2]), tuple((a, b, c) for a, b, c in axes))


def frame_comment(frame: Frame | None) -> str:
    """The comment line that stores a frame in program text; empty without a frame."""
    return "" if frame is None else f"# frame: {json.dumps(frame_dict(frame))}\n"


def without_frame(text: str) -> str:
    """Program text without the comment that stores its frame; line numbers do not change."""
    return _HEADER.sub("", text)


def frame_in(text: str, name: str = "<program>") -> Frame | None:
    """The frame stored in program text, or None.

    Raises
    ------
    InputError
        If the comment cannot be read.
    """
    found = _HEADER.search(text)
    if not found:
        return None
    try:
        data = json.loads(found.group(1))
    except (ValueError, RecursionError) as error:
        raise InputError(f"{name}: the comment '# frame:' holds no JSON", _CURE) from error
    return frame_from(data, name)

"""Where an export lies: on the input when its frame is known, upright on the format's own axes when not.

Formats for makers, in millimetres, are always upright and stand on the origin unless ``on_input`` is asked for.

A ``.shape`` file may keep the frame of the input in a comment above its first statement:

    # placed: up y, front z, origin 0 0.5 0, 1 unit = 0.01 m

``up`` and ``front`` are axes of the input, or directions of three numbers each; ``origin`` is where the point x = 0,
y = 0, z = 0 of the text lies in it, which is the middle of the floor, or for statements in cells that of the grid; the
last entry is the length of a unit of the text in the unit of the input.

Without a frame one unit of the file is one of the program (a cell unless it has another unit), the centre of the grid
is the origin, and the axes are those of the format.
"""

from __future__ import annotations

import math
import re
from dataclasses import astuple, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from shapeprog.errors import InputError
from shapeprog.formats.format import CELLS, GRID, Y_UP, Z_UP, Format
from shapeprog.language.ast import Scale
from shapeprog.language.evaluate import evaluated
from shapeprog.language.printer import source_of
from shapeprog.language.program import Program
from shapeprog.language.text import Text
from shapeprog.language.unit import METRES, Unit, assumed_unit, metres
from shapeprog.space import SPAN, FloatArray, Frame, axis_direction, axis_name, grid_axes, is_rotation

_LINE_END = r"(?:\r?\n|\r(?!\n))"
_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_DIRECTION = rf"([-+]?[xyz]|{_NUMBER} +{_NUMBER} +{_NUMBER})"
_PLACED = re.compile(rf"((?:(?:#[^\r\n]*|[ \t]*){_LINE_END})*?)#[ \t]*placed:[ \t]*([^\r\n]*)")
_ENTRIES = re.compile(
    rf"up +{_DIRECTION} *, *front +{_DIRECTION} *, *origin +({_NUMBER}) +({_NUMBER}) +({_NUMBER}) *, *"
    rf"1 unit *= *({_NUMBER})(?: +[a-z]+)?\s*"
)

_UNKNOWN = "the size of the object is unknown"
_CURE = "infer it with --unit, or write its unit at the top, as in '# unit: cm'"
_ALIGNED = 1e-9  # largest difference of a direction from the axis as which it is written
_ROUNDED = 1e-7  # share of the longest side by which the origin of a text is rounded

_GRID = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
"""Directions x, y, z of a text in the axes of the grid, as columns."""

BY_UP = {"x": GRID, "y": Y_UP, "z": Z_UP}  # up and front axes of a file by the axis that points up


class Placement(NamedTuple):
    """How a file lies: the map from the grid to its coordinates, and their unit, empty if it is not known."""

    frame: Frame | None
    unit: str = ""


def placement(
    file_format: Format,
    program: Program,
    *,
    unit: str = "",
    file_unit: str = "",
    up: str = "",
    on_input: bool | None = None,
) -> Placement:
    """How a program lies in a file: on its input, or upright.

    Parameters
    ----------
    file_format
        The format of the file.
    program
        What is written; its frame leads to the coordinates of its input, if they are known.
    unit
        Unit of the coordinates of the file: ``mm``, ``cm``, ``m``, ``in`` or ``cells``; empty for that of the format.
    file_unit
        Unit of the coordinates of the input; by default metres, or millimetres or centimetres if it would be larger
        than 10 m.
    up
        Axis of the file that points up: ``x``, ``y`` or ``z``; empty for that of the format, or of the input.
    on_input
        Whether the file lies on the input; by default if the input is known, except for formats in millimetres.

    Raises
    ------
    InputError
        If the input, the axis or the size of the object is not known, or a unit or an axis has no effect on the file.
    """
    frame = program.frame
    if unit not in ("", CELLS):
        metres(unit)
    if up and (file_format.axes is None or file_format.unit == CELLS or file_format.kind == "list"):
        raise InputError(f"--up has no effect on {file_format.suffixes[0]}", "leave it out")
    if file_format.axes is None:
        return Placement(frame)
    if file_format.unit == CELLS:
        if unit:
            raise InputError(f"--unit has no effect on {file_format.suffixes[0]}", "its lengths are in cells")
        return Placement(Frame())
    if up and up.removeprefix("+") not in BY_UP:
        raise InputError(f"{up!r} is no axis that points up", "use x, y or z")
    if up and on_input:
        raise InputError("--on-input takes the axes of the input, --up another one", "give one of them")
    if on_input and frame is None and file_format.kind != "list":
        raise InputError("the program does not say how its input lies", "export a program that infer has written")
    if on_input is None:
        on_input = not file_format.maker
    per_cell, name = cell_size(file_format, program, unit, file_unit)
    if frame is not None and on_input and not up:
        if not unit and file_format.unit != "text":
            return Placement(frame)
        centre = per_cell / frame.scale * np.array(frame.centre)
        return Placement(Frame.of(per_cell, centre, np.array(frame.axes)), name)
    matrix = grid_axes(*(BY_UP[up.removeprefix("+")] if up else file_format.axes))
    centre = -per_cell * (matrix @ _ground(program, file_format.rests)) + 0.0 if file_format.maker else np.zeros(3)
    return Placement(Frame.of(per_cell, centre, matrix), name)


def cell_size(file_format: Format, program: Program, unit: str = "", file_unit: str = "") -> tuple[float, str]:
    """The size of a cell in a file, and the unit that it is in, empty if it is not known; all is as for
    :func:`placement`."""
    if unit == CELLS:
        return 1.0, ""
    frame, (per_cell, source_unit) = program.frame, _real_size(program, file_unit)
    target_unit = unit or file_format.unit
    if target_unit == "text":
        target_unit = source_unit if frame is None or (program.unit and program.unit.name) else "mm"
    if not target_unit:
        return (per_cell, source_unit) if frame is None else (frame.scale, "")
    if source_unit:
        return per_cell * (metres(source_unit) / metres(target_unit)), target_unit
    if unit:
        raise InputError(f"cannot write {' '.join(file_format.suffixes)} in {unit}: {_UNKNOWN}", _CURE)
    return per_cell, ""


def _real_size(program: Program, file_unit: str) -> tuple[float, str]:
    """The size of a cell of the object, and its unit, empty if it is not known; ``file_unit`` is that of the input, or
    without a frame that of the program."""
    unit, scale, stated = program.unit, program.scale, "" if program.unit is None else program.unit.name
    if stated and file_unit:
        message = f"--file-unit {file_unit} has no effect: the program states its unit, {stated}"
        raise InputError(message, f"leave it out, or correct the line '# unit: {stated}'")
    if program.frame is not None and not stated:
        return program.frame.scale, file_unit or assumed_unit(SPAN * program.frame.scale)
    per_cell = 1 / scale.cells_per_unit if scale else unit.per_cell if unit else 1.0  # the first is not rounded
    return per_cell, stated or file_unit


def asked_unit(program: Program, unit: str | None, file_unit: str, path: Path) -> Unit | None:
    """The unit ``unit`` of the object that is written to ``path``, ``None`` for cells; without one that of the program.

    ``file_unit`` is as for :func:`placement`; an ``InputError`` if the size of the object is not known.
    """
    if unit is None:
        return program.unit
    if unit == CELLS:
        return None
    metres(unit)
    per_cell, source_unit = _real_size(program, file_unit)
    if not source_unit:
        in_cells = f"statements in cells have no size: infer the object with --unit {unit}"
        raise InputError(f"cannot write {path} in {unit}: {_UNKNOWN}", _CURE if program.unit else in_cells)
    return Unit(unit, per_cell * metres(source_unit) / metres(unit))


def _ground(program: Program, rests: bool) -> FloatArray:
    """The point of the grid where a program stands: the middle of the bottom of the whole, or of what is drawn.

    The end of a slanted bar dips below its end point: ``rests`` if the lowest point is asked for.
    """
    from shapeprog.formats.parts import parts  # reading a program needs no geometry
    from shapeprog.language.convert import placed_if_possible

    scale = placed_if_possible(program).scale
    floor = np.zeros(3) if scale is None else np.array([scale.floor, scale.middle, scale.side])
    vertices = [part.vertices for part in parts(program)] if rests or scale is None else []
    if not vertices:
        return floor
    every = np.concatenate(vertices)
    low, high = every.min(0), every.max(0)
    return np.array([low[0], *((low[1:] + high[1:]) / 2 if scale is None else floor[1:])])


def frame_of_text(frame: Frame, scale: Scale) -> Frame:
    """The map from x, y, z of a text to the world, given that from the grid."""
    axes = np.asarray(frame.axes) @ _GRID
    origin = np.asarray(frame.centre) + frame.scale * (axes @ scale.origin)
    return Frame.of(frame.scale * scale.cells_per_unit, origin, axes)


def frame_of_grid(text: Frame, scale: Scale) -> Frame:
    """The map from the grid to the world, given that from x, y, z of a text."""
    size, axes = text.scale / scale.cells_per_unit, np.asarray(text.axes)
    return Frame.of(size, np.asarray(text.centre) - size * (axes @ scale.origin), axes @ _GRID.T)


def in_grid_of(program: Program, other: Frame) -> Program:
    """The same program in the grid of another frame, such as that of the shape that it was inferred from.

    Unchanged if its frame is not known, its parts are not placed, or the frames have other axes.
    """
    frame = program.frame
    if frame is None or program.scale is None or not np.allclose(frame.axes, other.axes, atol=1e-6):
        return program
    size = frame.scale / other.scale
    if not math.isfinite(size):
        return program
    scale, *origin = (size * value for value in astuple(program.scale))
    return evaluated(replace(source_of(program), scale=Scale(scale, *(origin + other.to_grid(frame.centre)))))


def scale_of(program: Program) -> Scale:
    """How x, y, z of a text lie in the grid; statements in cells have their origin in the middle of it."""
    return program.scale or Scale(1.0, 0.0)


def frame_comment(program: Program) -> str:
    """The comment line above the text of a program that stores the map from the grid to the world; empty without it."""
    if program.frame is None:
        return ""
    scale = scale_of(program)
    text, unit_name = frame_of_text(program.frame, scale), "" if program.unit is None else program.unit.name
    size = f"{text.scale:.8g}"
    factors = {name: METRES[unit_name] / length for name, length in METRES.items()} if unit_name else {"": 1.0}
    for name, factor in factors.items():
        if math.isclose(factor, text.scale, rel_tol=2e-7):
            size = f"{factor:.8g} {name}".rstrip()
    step = _ROUNDED * text.scale * SPAN / scale.cells_per_unit
    digits = -math.ceil(math.log10(max(step, 1e-300)))
    origin = " ".join(f"{round(value, digits) + 0.0:.15g}" for value in text.centre)
    axes = np.asarray(text.axes)
    up, front = _direction_text(axes[:, 2]), _direction_text(-axes[:, 1])
    return f"# placed: up {up}, front {front}, origin {origin}, 1 unit = {size}\n"


def split_frame(text: str, name: str) -> tuple[str, Frame | None]:
    """The text of a program without the comment that stores its frame, and the map from x, y, z of the text to the
    world if it has one.  Line numbers do not change.

    Parameters
    ----------
    text, name
        The text, and its name in errors.

    Raises
    ------
    ProgramError
        If the comment cannot be read.
    """
    comment = _PLACED.match(text)
    if comment is None:
        return text, None
    wrong, entries = "this is no frame of a text", _ENTRIES.fullmatch(comment[2])
    if entries is not None:
        *origin, size = (float(number) for number in entries.groups()[2:])
        up, rear = _direction(entries[1]), -_direction(entries[2])
        rotation = np.stack([up, rear, np.cross(up, rear)], 1)
        if not is_rotation(rotation):
            wrong = "up and front are not perpendicular unit directions"
        elif np.isfinite([*origin, size]).all() and size > 0:
            return text[: comment.end(1)] + text[comment.end() :], Frame.of(size, np.array(origin), rotation @ _GRID)
    row, column = len(re.findall(_LINE_END, comment[1])) + 1, comment.start(2) - comment.end(1) + 1
    cure = "write it as # placed: up y, front z, origin 0 0.5 0, 1 unit = 1, or remove it"
    raise Text(text, name).at(row, column, wrong, cure)


def _direction(text: str) -> FloatArray:
    """A signed axis, or a direction of three numbers, each at most 2."""
    if text[-1] in "xyz":
        return axis_direction(text)
    return np.clip([float(word) for word in text.split()], -2, 2)


def _direction_text(direction: FloatArray) -> str:
    """The same as text."""
    if np.abs(direction - np.rint(direction)).max() > _ALIGNED:
        return " ".join(f"{value:.9g}" for value in direction)
    return axis_name(direction).removeprefix("+")

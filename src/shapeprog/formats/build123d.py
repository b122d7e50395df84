"""build123d: the program itself below a prelude that defines its words; STEP files are made by running that script."""

from __future__ import annotations

import builtins
import importlib.util
import re
from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from shapeprog.errors import OutputError
from shapeprog.formats.parts import drawn_parts
from shapeprog.formats.scripts import Script, needed, number, prelude, script
from shapeprog.language.ast import Call, Function, Line, Part, body_of, changed_lines
from shapeprog.language.printer import lines_text
from shapeprog.language.program import Program
from shapeprog.space import Frame

HEAD, TOOLS, TAIL = prelude("prelude.build123d").split("# ---\n")  # imports; definitions; names, and the STEP file

_UNITS = {"mm": "MM", "cm": "CM", "m": "M", "in": "IN"}  # units of build123d
MOST_SOLIDS = 1 << 11  # most solids of a STEP file: build123d takes some milliseconds for each


def step(program: Program, frame: Frame, stem: str, unit: str = "") -> bytes:
    """Named, coloured solids as STEP; an ``OutputError`` if build123d is not installed, or the program draws nothing or
    more than ``MOST_SOLIDS``."""
    if (count := len(drawn_parts(program))) > MOST_SOLIDS:
        raise OutputError(
            f"the {count} parts of this program are too many for STEP, which takes at most {MOST_SOLIDS}",
            "lower the counts, or export a .py script, which keeps the loops, and run it where there is time",
        )
    if importlib.util.find_spec("build123d") is None:
        message = "cannot write STEP: it needs the library build123d, which is not installed"
        raise OutputError(message, "pip install build123d, or export a .py script and run it where build123d is")
    made: dict[str, Any] = {"__name__": "shapeprog_model"}
    # The script consists of checked names and numbers; running it avoids a second implementation of the geometry.
    exec(compile(script_text(program, frame, stem, unit), f"{stem}.py", "exec"), made)
    with TemporaryDirectory() as folder:
        file = Path(folder) / f"{stem}.step"
        if not made["export_step"](made["model"], str(file), unit=getattr(made["Unit"], _UNITS.get(unit, "MM"))):
            raise OutputError("build123d could not write the STEP file", "check the disk of temporary files")
        return file.read_bytes()


def script_text(program: Program, frame: Frame, stem: str = "model", unit: str = "") -> str:
    """The build123d script of a program: x to the right, y to the rear, z up, in the unit of the program.

    Parameters
    ----------
    program
        What to write.
    frame
        From the grid to the coordinates of the model.
    stem
        Name of the STEP file that the script writes.
    unit
        Unit of the coordinates of the model; empty if it is not known.
    """
    made = script(program, frame, _reserved(), "here.")
    stem = "".join(letter for letter in stem if letter.isprintable() and letter not in "\"'\\{}") or "model"
    lines = [HEAD.replace("@STEM@", stem)]
    if made.unit:
        lines += [f"# Numbers are in {made.unit}{f', the model is in {unit}' if unit else ''}."]
    lines += [*lines_text(made.numbers), "", *_world(made), f"colours = {made.colours}"]
    body = "\n".join(_body(made))
    tail = TAIL.replace("@STEM@", stem).replace("@UNIT@", _UNITS.get(unit, "MM"))
    tools = "\n\n\n".join(needed(TOOLS.strip().split("\n\n\n"), body))
    return "\n".join(lines) + f"\n\n{tools}\n\n\n{body}\n{tail}"


def _world(made: Script) -> Iterator[str]:
    """The lines that place the whole in the model."""
    if made.meshes:
        yield "width = depth = height = 0"
        yield "world = ()"
        return
    yield f"scale = {number(made.scale)}  # units of the model in a unit of the numbers"
    corner = "Pos(-scale * width / 2, -scale * depth / 2, 0)"
    if made.moved:
        x_dir, z_dir = (_tuple(made.world[:3, axis] / made.scale) for axis in (0, 2))
        corner = f"Plane({_tuple(made.world[:3, 3])}, x_dir={x_dir}, z_dir={z_dir}).location * {corner}"
    yield f"corner = {corner}"
    yield "world = (lambda solid: corner * solid,)"


def _body(made: Script) -> Iterator[str]:
    """The roles, functions and lines of the program."""
    for mesh in made.meshes:
        points = ", ".join(_tuple(np.round(vertex, 6)) for vertex in mesh.vertices)
        yield f'mesh("{mesh.word}", [{points}], {[tuple(face) for face in mesh.faces.tolist()]})'
    roles = dict(_roles(made.lines))
    yield from (f'{word} = role("{name}")' for name, word in sorted(roles.items()))
    for line in made.lines:
        if isinstance(line, Function):
            yield from ("", "", "@function")
        yield from lines_text(changed_lines([line], lambda part: _with_role(part, roles)))
        if isinstance(line, Function):
            yield from ("", "")


def _roles(lines: tuple[Line, ...]) -> Iterator[tuple[str, str]]:
    """Roles, and functions of the script that name parts by them."""
    for line in lines:
        yield from _roles(body_of(line))
        if isinstance(line, Part | Call) and line.role and line.role != getattr(line, "kind", ""):
            yield line.role, f"{line.role}_" if line.role in _reserved() else line.role


def _with_role(line: Line, roles: dict[str, str]) -> Line:
    return replace(line, role=roles.get(line.role, line.role)) if isinstance(line, Part | Call) else line


@cache
def _reserved() -> set[str]:
    """Reserved words of these scripts: imports, functions and variables at their top level."""
    _, _, imports = HEAD.split('"""')
    functions = re.findall(r"^def (\w+)", TOOLS + TAIL, re.MULTILINE)
    variables = re.findall(r"^(?:for )?(\w+(?:, \w+)*)(?: = | in )", TOOLS + TAIL, re.MULTILINE)
    names = re.findall(r"\w+", " ".join([imports, *functions, *variables]))
    return {*dir(builtins), *names, "scale", "world", "corner", "colours"}


def _tuple(values: Any) -> str:
    return f"({', '.join(number(float(value)) for value in values)})"

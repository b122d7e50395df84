"""Programs as JSON for other programs: the text, and a list of the solids that it draws.

{"format": "shapeprog", "version": 4, "text": "width, depth, height = 40, 40, 45\\nleg(left=0, width=4)...",
 "unit": "cm",
 "solids": [{"line": 2, "role": "leg", "kind": "box", "low": [-20, -20, 0], "high": [-16, 20, 45]}, ...],
 "frame": {"origin": [0, 0, 0], "scale": 0.01, "axes": [[1, 0, 0], [0, 0, 1], [0, -1, 0]]}}

``text`` is the content of a ``.shape`` file; it alone is read.  The bounds of solids are along x (right), y (rear) and
z (up) in the unit of the text; those of round solids that are turned are exact to .2 %.  ``frame`` maps them to the
coordinates of the input: origin + scale * axes @ (x, y, z).
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from reprlib import repr as shortened
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from shapeprog.errors import InputError, ShapeProgError
from shapeprog.formats.frames import frame_of_text, scale_of
from shapeprog.formats.shape import program_in, program_text, read_text
from shapeprog.language.ast import Draw, Part
from shapeprog.language.evaluate import provenance
from shapeprog.language.parameters import LARGEST
from shapeprog.language.printer import printed, source_of
from shapeprog.language.program import Program, program_of
from shapeprog.language.statement import language
from shapeprog.language.text import Text
from shapeprog.space import Frame

FORMAT = "shapeprog"
VERSION = 4

MOST_SOLIDS = 10_000  # solids of the largest list; longer ones are left out


class SavedResult(NamedTuple):
    """The contents of a JSON file.

    Parameters
    ----------
    program
        The program, with the frame of the input if its text has one.
    snapped
        Its form in whole cells, if the file has one.
    scores
        The scores that are finite numbers.
    source
        The file that the program was inferred from, if recorded.
    """

    program: Program
    snapped: Program | None = None
    scores: Mapping[str, float] = MappingProxyType({})
    source: str | None = None


def read_result(path: Path) -> SavedResult:
    """The contents of a JSON file; raises what :func:`program_from_json` does."""
    return _result(read_text(path), str(path))


def _result(text: str, name: str) -> SavedResult:
    content = _document(text, name)

    def parsed(entry: str) -> Program:
        if not isinstance(text := content.get(entry), str):
            message = f"{name}: {entry}: {shortened(text)} is not a string"
            raise InputError(message, "write the text of the program, with \\n at the end of each line")
        return program_in(text, f"{name}: {entry}")

    scores, source = content.get("scores"), content.get("source")
    named = scores.items() if isinstance(scores, dict) else ()
    return SavedResult(
        parsed("text"), parsed("snapped") if "snapped" in content else None,
        {word: value for word, value in named if type(value) in (int, float) and abs(value) <= LARGEST},
        source if isinstance(source, str) else None,
    )  # fmt: skip


def program_to_json(program: Program, frame: Frame | None = None, **more: Any) -> str:
    """A program as JSON text, with a line for each solid; numbers of its text have the fewest digits that are exact.

    Parameters
    ----------
    program
        What to write.
    frame
        From the grid to the coordinates of the input; by default that of the program, if it is known.
    more
        Further entries, such as ``scores``.

    Raises
    ------
    ShapeProgError
        As for :func:`shapeprog.format_program`.
    """
    program = program_of(program, frame)
    text, unit = program_text(program), program.unit
    content = {"format": FORMAT, "version": VERSION, "text": text, "unit": "cells" if unit is None else unit.name}
    if program.frame is not None:
        placed = frame_of_text(program.frame, scale_of(program))
        content["frame"] = {"origin": placed.centre, "scale": placed.scale, "axes": placed.axes}
    lines = [f'  "{key}": {json.dumps(value, allow_nan=False)}' for key, value in {**content, **more}.items()]
    with suppress(ShapeProgError):  # too many or too large for a list
        if solids := _solids(program):
            lines.append('  "solids": [\n' + ",\n".join(f"    {json.dumps(solid)}" for solid in solids) + "\n  ]")
    return "{\n" + ",\n".join(lines) + "\n}\n"


def _solids(program: Program) -> list[dict[str, Any]]:
    """The line, role, kind and bounds of each solid that a program draws."""
    from shapeprog.geometry.mesh import bounds  # reading a program needs no geometry
    from shapeprog.language.unroll import exact_scene

    if program.size > MOST_SOLIDS:
        raise ShapeProgError(f"more than {MOST_SOLIDS} solids")
    source, scale = source_of(program), scale_of(program)
    drawn, lines = provenance(source), dict[int, tuple[int, str]]()
    for row, (_, line) in enumerate(printed(source), 1 if program.frame is None else 2):
        if isinstance(line, Draw | Part):
            lines |= dict.fromkeys(drawn[id(line)], (row, line.kind if isinstance(line, Part) else line.name))
    roles = [draw.word if draw.word in language().roles else "" for draw in program.draws]
    solids = []
    with exact_scene(program) as scene:
        blocks = scene.block.tolist()
        for slot, (bottom, front, right), (top, rear, left) in bounds(scene):  # the third axis points to the left
            corners = np.array([(-left, front, bottom), (-right, rear, top)]) - scale.origin
            low, high = ([float(f"{value + 0.0:.6g}") for value in corner] for corner in corners / scale.cells_per_unit)
            row, kind = lines[blocks[slot]]
            solids.append({"line": row, "role": roles[blocks[slot]], "kind": kind, "low": low, "high": high})
    return solids


def program_from_json(text: str, name: str = "<json>") -> Program:
    """The program of a JSON text.

    Raises
    ------
    ProgramError
        If the text is not JSON, or the program in it is not valid, at its place.
    InputError
        If it is JSON of another kind, naming the entry.
    """
    return _result(text, name).program


def _document(text: str, name: str) -> dict[str, Any]:
    """The entries of a JSON text that holds a program of this version."""
    source = Text(text, name)
    try:
        content = json.loads(source.text)
    except json.JSONDecodeError as error:
        raise source.at(error.lineno, error.colno, f"this is not JSON: {error.msg}", "was the file cut off?") from None
    except RecursionError:
        raise InputError(f"{name}: this is nested too deeply to be a program", "loops nest at most 64 deep") from None
    except ValueError as error:  # raised by Python for integers of thousands of digits
        raise InputError(f"{name}: a number has too many digits to be read", "write shorter numbers") from error
    if not isinstance(content, dict) or content.get("format") != FORMAT:
        raise InputError(f"{name}: this JSON holds no program", f'it begins {{"format": "{FORMAT}", ...')
    if (version := content.get("version")) != VERSION:
        message = f"{name}: version {shortened(version)} of the program format is not read, only version {VERSION}"
        raise InputError(message, "read the .shape file that was written with it, or infer the shape again")
    return content

"""Programs as JSON: versioned, with names, exact for every float32.

{"format": "shapeprog", "version": 1, "program": [
  {"statement": "translate", "parameters": {"count": 2, "by": [0, 0, 18]}, "body": [
    {"statement": "leg", "parameters": {"at": [-12, -8, -10], "size": [16, 2, 2]}}]}]}

Programs with names, expressions or functions have version 2, those whose lengths are not in cells version 3, with a key
"unit": {"name": "cm", "per_cell": 3.75}.  The entries are in :mod:`shapeprog.formats.json_lines`.
"""

from __future__ import annotations

import json
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from reprlib import repr as shortened
from typing import Any, NoReturn

from shapeprog.errors import InputError, ProgramError, ShapeProgError
from shapeprog.files import write_text
from shapeprog.formats.frames import frame_dict, frame_from
from shapeprog.formats.json_lines import entries_of, program_from_entries
from shapeprog.formats.shape import LARGEST_FILE, read_text
from shapeprog.language.parameters import LARGEST, shortest
from shapeprog.language.place import proper_text
from shapeprog.language.program import Program
from shapeprog.language.unit import Unit
from shapeprog.space import Frame

FORMAT = "shapeprog"
VERSIONS = (1, 2, 3)
"""Those that can be read."""


@dataclass(frozen=True)
class Result:
    """A JSON file: a program and its metadata.

    Parameters
    ----------
    name
        Name of the file in errors.
    content
        Its entries; only the form and its version have been checked.
    """

    name: str
    content: dict[str, Any]

    @property
    def program(self) -> Program:
        """The program; an ``InputError`` if it is not valid."""
        return program_from_entries(self.content.get("program"), self.name, "program", self.unit)

    @property
    def unit(self) -> Unit | None:
        """The unit of the program if the file has one; an ``InputError`` if it is not valid."""
        kept = self.content.get("unit")
        if kept is None:
            return None
        cure = 'write {"name": "cm", "per_cell": 3.75}, or leave it out'
        if not isinstance(kept, dict) or {*kept} != {"name", "per_cell"} or type(kept["per_cell"]) not in (int, float):
            raise InputError(f"{self.name}: unit: {shortened(kept)} is not a name and a number per cell", cure)
        try:
            return Unit(str(kept["name"]), kept["per_cell"])
        except ShapeProgError as mistake:
            raise InputError(f"{self.name}: unit: {mistake.message}", mistake.hint) from None

    @property
    def snapped(self) -> Program | None:
        """Its form in whole cells, if the file has one; an ``InputError`` if that is not valid."""
        body = self.content.get("snapped")
        return None if body is None else program_from_entries(body, self.name, "snapped")

    @property
    def frame(self) -> Frame | None:
        """The frame of the input if the file has one; an ``InputError`` if it is not valid."""
        kept = self.content.get("frame")
        return None if kept is None else frame_from(kept, self.name)

    @property
    def scores(self) -> dict[str, float]:
        """The scores that are finite numbers; other values are ignored."""
        kept = self.content.get("scores")
        named = kept.items() if isinstance(kept, dict) else ()
        return {name: value for name, value in named if type(value) in (int, float) and abs(value) <= LARGEST}

    @property
    def source(self) -> str | None:
        """The file that the program was inferred from, if recorded."""
        source = self.content.get("source")
        return source if isinstance(source, str) else None


def read_result(path: Path) -> Result:
    """The contents of a JSON file.

    Raises
    ------
    ProgramError, InputError
        As for :func:`program_from_json`.
    """
    return Result(str(path), _document(read_text(path, LARGEST_FILE), str(path)))


def read_json(path: Path) -> tuple[Program, Frame | None]:
    """The program of a JSON file, and its frame if it has one."""
    result = read_result(path)
    return result.program, result.frame


def write_json(program: Program, path: Path, frame: Frame | None) -> None:
    """Write the JSON form."""
    write_text(path, result_json(program, frame))


def result_json(program: Program, frame: Frame | None = None, **more: Any) -> str:
    """The JSON form of a program with its frame and further entries, such as scores."""
    content = json.loads(program_to_json(program))
    if frame is not None:
        content["frame"] = frame_dict(frame)
    return json.dumps({**content, **more}, indent=2, allow_nan=False) + "\n"


def program_to_json(program: Program, indent: int | None = 2) -> str:
    """A program as JSON text; numbers have the fewest digits that read back exactly.

    Raises
    ------
    ShapeProgError
        If a number is not finite, a statement is not declared, or loops nest too deeply to be read back.
    """
    unit = program.unit
    content: dict[str, Any] = {"format": FORMAT, "version": 1 if program.source is None else 2 if unit is None else 3}
    if unit is not None:
        content["unit"] = {"name": unit.name, "per_cell": json.loads(shortest(unit.per_cell))}
    return json.dumps({**content, "program": entries_of(program)}, indent=indent) + "\n"


def program_from_json(text: str, name: str = "<json>") -> Program:
    """The program of a JSON text.

    Raises
    ------
    ProgramError
        If the text is not JSON, at its place.
    InputError
        If it is JSON of another kind, naming the entry.
    """
    return Result(name, _document(text, name)).program


def _document(text: str, name: str) -> dict[str, Any]:
    def refuse(constant: str) -> NoReturn:
        raise InputError(f"{name}: {constant} is not a number of a program", "write finite numbers")

    def unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        found = dict(pairs)
        if len(found) != len(pairs):
            twice, _ = Counter(word for word, _ in pairs).most_common(1)[0]
            raise InputError(f"{name}: {shortened(twice)} is given twice in one entry", "leave one of them out")
        return found

    text = proper_text(text, name)
    try:
        content = json.loads(text, parse_constant=refuse, object_pairs_hook=unique)
    except json.JSONDecodeError as error:
        lines = text.split("\n")
        source = lines[min(error.lineno, len(lines)) - 1]
        raise ProgramError(
            f"this is not JSON: {error.msg}", line=error.lineno, column=error.colno, source=source,
            hint="was the file cut off?", name=name,
        ) from None  # fmt: skip
    except RecursionError:
        raise InputError(f"{name}: this is nested too deeply to be a program", "loops nest at most 64 deep") from None
    except ValueError as error:  # raised by Python for integers of thousands of digits
        raise InputError(f"{name}: a number has too many digits to be read", "write shorter numbers") from error
    if not isinstance(content, dict) or content.get("format") != FORMAT:
        raise InputError(f"{name}: this JSON holds no program", f'it begins {{"format": "{FORMAT}", ...')
    if content.get("version") not in VERSIONS:
        raise InputError(
            f"{name}: unknown version {shortened(content.get('version'))} of the program format",
            f"this release reads versions {', '.join(map(str, VERSIONS))}; a newer one may read it",
        )
    return content

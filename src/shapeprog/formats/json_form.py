"""Programs and their tensors as JSON: versioned, with names, exact for every float32.

{"format": "shapeprog", "version": 1, "program": [
  {"statement": "translate", "parameters": {"count": 2, "by": [0, 0, 18]}, "body": [
    {"statement": "leg", "parameters": {"at": [-12, -8, -10], "size": [16, 2, 2]}}]}]}

Programs with names, expressions or functions are of version 2, those whose lengths are not in cells of version 3; these
have "unit": {"name": "cm", "per_cell": 3.75} beside "program".  The entries are in :mod:`shapeprog.formats.json_lines`.
"""

from __future__ import annotations

import json
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from reprlib import repr as shortened
from typing import Any, NoReturn

import torch

from shapeprog.errors import InputError, ProgramError, ShapeProgError
from shapeprog.files import write_text
from shapeprog.formats.frames import frame_dict, frame_from
from shapeprog.formats.json_lines import entries_of, program_from_entries
from shapeprog.formats.shape import LARGEST_FILE, read_text
from shapeprog.language.parameters import LARGEST, shortest
from shapeprog.language.place import proper_text
from shapeprog.language.program import Program
from shapeprog.language.statement import SLOTS
from shapeprog.language.tensors import Code
from shapeprog.language.unit import Unit
from shapeprog.space import Frame

FORMAT, CODE_FORMAT = "shapeprog", "shapeprog-code"
VERSIONS = {FORMAT: (1, 2, 3), CODE_FORMAT: (1,)}
"""Those that can be read, by form."""


@dataclass(frozen=True)
class Result:
    """A JSON file: a program, and what else there was to say about it.

    Parameters
    ----------
    name
        What the file is called in errors.
    content
        Its entries, of which only the form and its version have been looked at.
    """

    name: str
    content: dict[str, Any]

    @property
    def program(self) -> Program:
        """The program; an ``InputError`` if it is none."""
        return program_from_entries(self.content.get("program"), self.name, "program", self.unit)

    @property
    def unit(self) -> Unit | None:
        """The unit of the program where the file tells one; an ``InputError`` if it is none."""
        kept = self.content.get("unit")
        if kept is None:
            return None
        cure = 'write {"name": "cm", "per_cell": 3.75}, or leave it out'
        if not isinstance(kept, dict) or {*kept} != {"name", "per_cell"} or type(kept["per_cell"]) not in (int, float):
            raise InputError(f"{self.name}: unit: {shortened(kept)} is no name and number per cell", cure)
        try:
            return Unit(str(kept["name"]), kept["per_cell"])
        except ShapeProgError as mistake:
            raise InputError(f"{self.name}: unit: {mistake.message}", mistake.hint) from None

    @property
    def snapped(self) -> Program | None:
        """Its whole-numbered form, in cells, where the file holds one; an ``InputError`` if that is no program."""
        body = self.content.get("snapped")
        return None if body is None else program_from_entries(body, self.name, "snapped")

    @property
    def frame(self) -> Frame | None:
        """The way to the world of the input where the file keeps it; an ``InputError`` if it is none."""
        kept = self.content.get("frame")
        return None if kept is None else frame_from(kept, self.name)

    @property
    def scores(self) -> dict[str, float]:
        """The measures that are finite numbers; whatever else a foreign file calls its scores is left out."""
        kept = self.content.get("scores")
        named = kept.items() if isinstance(kept, dict) else ()
        return {name: value for name, value in named if type(value) in (int, float) and abs(value) <= LARGEST}

    @property
    def source(self) -> str | None:
        """The file that the program was inferred from, as the file says."""
        source = self.content.get("source")
        return source if isinstance(source, str) else None


def read_result(path: Path) -> Result:
    """All that a JSON file holds.

    Raises
    ------
    ProgramError, InputError
        As for :func:`program_from_json`.
    """
    return Result(str(path), _document(read_text(path, LARGEST_FILE), str(path), FORMAT))


def read_json(path: Path) -> tuple[Program, Frame | None]:
    """The program of a JSON file, and its frame where it keeps one."""
    result = read_result(path)
    return result.program, result.frame


def write_json(program: Program, path: Path, frame: Frame | None) -> None:
    """Write the JSON form."""
    write_text(path, result_json(program, frame))


def result_json(program: Program, frame: Frame | None = None, **more: Any) -> str:
    """The JSON form of a program with its frame and whatever else there is to say, such as scores."""
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
    return Result(name, _document(text, name, FORMAT)).program


def code_to_json(code: Code) -> str:
    """Program tensors as JSON text, exact for float32 and float64.

    Raises
    ------
    ShapeProgError
        If a parameter is not finite, which JSON cannot say.
    """
    if not bool(torch.isfinite(code.parameters).all()):
        raise ShapeProgError(
            "these program tensors hold numbers that are not finite", "JSON cannot say them; mend them"
        )
    content = {"ids": code.ids.tolist(), "parameters": code.parameters.detach().tolist()}
    if code.roles is not None:
        content["roles"] = code.roles.tolist()
    shape = {"dtype": str(code.parameters.dtype).removeprefix("torch."), "shape": list(code.ids.shape)}
    return json.dumps({"format": CODE_FORMAT, "version": 1, **shape, **content}) + "\n"


def code_from_json(text: str, name: str = "<json>") -> Code:
    """The program tensors of a JSON text.

    Raises
    ------
    ProgramError, InputError
        As for :func:`program_from_json`.
    """
    content = _document(text, name, CODE_FORMAT)
    dtype = {"float32": torch.float32, "float64": torch.float64}.get(str(content.get("dtype")))
    try:
        shape = [int(extent) for extent in content["shape"]]
        ids = torch.tensor(content["ids"], dtype=torch.long).reshape(shape)
        numbers = torch.tensor(content["parameters"], dtype=dtype)
        parameters = numbers.reshape(*shape, numbers.shape[-1] if numbers.numel() else SLOTS)
        roles = None
        if "roles" in content:
            roles = torch.tensor(content["roles"], dtype=torch.long).reshape(shape[:-1])
    except (KeyError, TypeError, ValueError, RuntimeError, OverflowError, IndexError) as error:
        raise InputError(
            f"{name}: ids and parameters are no tensors of programs",
            "ids are (..., blocks, steps), parameters as many numbers for each of them, shape that of the ids",
        ) from error
    if dtype is None or len(shape) < 2 or not bool(torch.isfinite(parameters).all()):
        raise InputError(f"{name}: these program tensors are incomplete", "write them with code_to_json")
    return Code(ids, parameters, roles)


def _document(text: str, name: str, wanted: str) -> dict[str, Any]:
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
    except ValueError as error:  # what Python says of a whole number of thousands of digits
        raise InputError(f"{name}: a number has too many digits to be read", "write shorter numbers") from error
    if not isinstance(content, dict) or content.get("format") != wanted:
        raise InputError(f"{name}: this JSON is not in the form {wanted!r}", f'it begins {{"format": "{wanted}", ...')
    if content.get("version") not in VERSIONS[wanted]:
        raise InputError(
            f"{name}: version {shortened(content.get('version'))} of the form {wanted!r} is not known",
            f"this program reads version {' and '.join(map(str, VERSIONS[wanted]))}; a newer one may read it",
        )
    return content

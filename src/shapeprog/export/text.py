"""Programs as text and JSON, with the frame that leads back to the input."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

from shapeprog.errors import InputError
from shapeprog.export.frames import frame_comment, frame_dict, frame_from, frame_in
from shapeprog.files import write_text
from shapeprog.language.program import Program
from shapeprog.space import Frame


def shape_text(program: Program, frame: Frame | None = None) -> str:
    """Canonical program text, with the frame in a comment above it where one is given."""
    from shapeprog.language.text import format_program

    return (frame_comment(frame) if frame is not None else "") + format_program(program)


def write_shape(program: Program, path: Path, frame: Frame | None) -> None:
    """Write program text."""
    write_text(path, shape_text(program, frame))


def result_json(program: Program, frame: Frame | None = None, **more: Any) -> str:
    """The JSON form of a program with its frame and whatever else there is to say, such as scores."""
    from shapeprog.language.json_form import program_to_json

    content = json.loads(program_to_json(program))
    if frame is not None:
        content["frame"] = frame_dict(frame)
    return json.dumps({**content, **more}, indent=2, allow_nan=False) + "\n"


def write_json(program: Program, path: Path, frame: Frame | None) -> None:
    """Write the JSON form."""
    write_text(path, result_json(program, frame))


def read_program(path: str | os.PathLike[str]) -> tuple[Program, Frame | None]:
    """The program in a ``.shape`` or ``.json`` file, and its frame where the file keeps one.

    Raises
    ------
    InputError
        If the file cannot be read or is of another kind.
    ProgramError
        If its text is not in the language.
    """
    from shapeprog.language.json_form import program_from_json
    from shapeprog.language.text import parse, read_text

    file = Path(path)
    suffix = file.suffix.lower()
    if suffix not in (".shape", ".json", ".txt"):
        raise InputError(f"{file} holds no program: its name ends in {suffix!r}", "programs are .shape or .json files")
    text = read_text(file)
    if suffix != ".json":
        return parse(text, str(file)), frame_in(text, str(file))
    program = program_from_json(text, str(file))
    kept = json.loads(text.removeprefix("\ufeff")).get("frame")
    return program, None if kept is None else frame_from(kept, str(file))

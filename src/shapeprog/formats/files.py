"""Program files in and out, in the format that the suffix names."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from shapeprog.errors import InputError, OutputError, did_you_mean
from shapeprog.files import write_bytes
from shapeprog.formats.format import Format, format_of, listed, program_suffixes, suffixes
from shapeprog.formats.frames import asked_unit, placement
from shapeprog.formats.shape import read_text
from shapeprog.language.program import Program, program_of
from shapeprog.space import Frame


def load(path: str | os.PathLike[str]) -> Program:
    """The program in a file, program text or JSON by its suffix, with the frame of its input if the file has one.

    Raises
    ------
    InputError
        If the file cannot be read or has another format.
    ProgramError
        If its text is not a valid program.
    """
    file = Path(path)
    file_format = format_of(file)
    if file_format is None or not file_format.reader:
        endings = " or ".join(program_suffixes())
        if file.is_dir():
            held = sorted(entry.name for entry in file.glob("*") if entry.suffix.lower() in program_suffixes())
            cure = f"name one of its programs, such as {file / held[0]}" if held else f"programs are {endings} files"
            raise InputError(f"{file} is a folder", cure)
        ending = f"its name ends in {file.suffix!r}" if file.suffix else "its name has no suffix"
        cure = f"programs are {endings} files; infer one from a shape: shapeprog infer {file}"
        raise InputError(f"{file} holds no program: {ending}", cure)
    return file_format.read(read_text(file), str(file))


def program_files(folder: Path) -> list[Path]:
    """The programs in a folder in the order of their names; NAME.json, which keeps most, stands for all of that name.

    Raises
    ------
    InputError
        If there is no such folder, or it holds no programs.
    """
    cure = f"give a folder that holds {' or '.join(suffixes('program'))} files"
    if not folder.is_dir():
        raise InputError(f"there is no folder {folder}", cure)
    files = [file for file in folder.glob("*") if file.suffix.lower() in suffixes("program")]
    result = {file.with_suffix(""): file for file in sorted(files, key=lambda file: file.suffix.lower() == ".json")}
    if not result:
        raise InputError(f"the folder {folder} holds no programs", cure)
    return [result[key] for key in sorted(result)]


def save(program: Program, path: str | os.PathLike[str], frame: Frame | None = None) -> None:
    """Write a program so that :func:`load` returns the same program with the same frame.

    A program in cells that names sizes of the whole, or its floor, is written with its parts placed from the sides.

    Parameters
    ----------
    program
        What to write, or a result of :func:`shapeprog.infer`.
    path
        Where to; ends in .shape or .json.
    frame
        From the grid to the coordinates of the input, which is stored; by default that of the program.

    Raises
    ------
    OutputError
        If the suffix is not that of a program file, or the file cannot be written.
    """
    if Path(path).suffix.lower() not in suffixes("program"):
        endings = " or ".join(suffixes("program"))
        raise OutputError(f"{path} could not be read back as a program", f"name a {endings} file, or use sp.export")
    export(program, path, frame)


def written_format(path: Path) -> Format:
    """The format of a file to write; an ``OutputError`` if none ends so."""
    file_format, suffix = format_of(path), path.suffix.lower()
    if file_format is None or not file_format.writer:
        wrong = f"no export ends in {suffix!r}" if suffix else f"{path} has no suffix, so its format is unknown"
        raise OutputError(wrong, did_you_mean(suffix, suffixes()))
    return file_format


def export(
    program: Program,
    path: str | os.PathLike[str],
    frame: Frame | None = None,
    *,
    unit: str = "",
    file_unit: str = "",
    up: str = "",
    on_input: bool | None = None,
    **options: int,
) -> Path:
    """Write a program in the format that the suffix of ``path`` names, whole or not at all, and return the path.

    ::

        {formats}

    Parameters
    ----------
    program
        What to write, or a result of :func:`shapeprog.infer`.
    path
        Where to; the folder must exist.
    frame
        From the grid to the coordinates of the input, so that the export lies on it; by default that of the program.
        Without any the shape stands upright in the axes of the format, as with ``on_input=False``.  Formats for makers
        (.stl .3mf .scad .py .step) are upright, z up, on z = 0 and in millimetres in any case
        (:mod:`shapeprog.formats.frames`).
    unit, file_unit, up, on_input
        Other coordinates than those of the format, see :func:`~shapeprog.formats.frames.placement`.
    options
        For .npy the ``resolution`` in cells along each side (32), for .xyz how many ``points`` (5000) and their
        ``seed`` (0).

    Raises
    ------
    OutputError
        If the suffix is unknown, the program draws nothing that the format can hold, or the file cannot be written.
    """
    program = program_of(program, frame)
    target = Path(path)
    file_format, suffix = written_format(target), target.suffix.lower()
    if file_format.kind == "program" and unit:
        from shapeprog.language.dimensions import in_unit  # few programs are converted

        asked = asked_unit(program, unit, file_unit, target)
        if asked != program.unit:  # statements in cells can be in no other
            program = in_unit(program, asked, workshop=True)
    lies = placement(file_format, program, unit=unit, file_unit=file_unit, up=up, on_input=on_input)
    known: dict[str, Any] = {"frame": lies.frame, "unit": lies.unit, "stem": target.stem}
    takes = file_format.options
    for name in options.keys() - takes:
        raise OutputError(f"{suffix} takes no {name}", f"it takes {', '.join(takes - known.keys()) or 'no options'}")
    known = {name: known[name] for name in known.keys() & takes}
    content = file_format.content(program, **known, **options)
    for ending, part in content.items() if isinstance(content, Mapping) else [(suffix, content)]:
        file = target if ending == suffix else target.with_suffix(ending)
        write_bytes(file, part if isinstance(part, bytes) else part.encode("utf-8", "surrogateescape"))
    return target


export.__doc__ = (export.__doc__ or "").replace("{formats}", listed().replace("\n", "\n        "))

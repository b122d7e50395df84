"""Program files in and out, in the format that the suffix names."""

from __future__ import annotations

import os
from pathlib import Path

from shapeprog.errors import InputError, OutputError, did_you_mean
from shapeprog.files import output_error
from shapeprog.formats.format import format_of, listed, program_suffixes, suffixes
from shapeprog.formats.frames import upright
from shapeprog.language.program import Program
from shapeprog.space import Frame


def load(path: str | os.PathLike[str]) -> Program:
    """The program in a file: program text, JSON or the notation of the paper, by its suffix.

    Raises
    ------
    InputError
        If the file cannot be read or is of another kind.
    ProgramError
        If its text is not a valid program.
    """
    return load_with_frame(path)[0]


def load_with_frame(path: str | os.PathLike[str]) -> tuple[Program, Frame | None]:
    """The program in a file, and the frame of its input if the file has one.

    Raises
    ------
    InputError, ProgramError
        As for :func:`load`.
    """
    file = Path(path)
    chosen = format_of(file)
    if chosen is None or not chosen.reader:
        known = " or ".join(program_suffixes())
        if file.is_dir():
            held = sorted(each.name for each in file.iterdir() if each.suffix.lower() in program_suffixes())
            cure = f"name one of its programs, such as {file / held[0]}" if held else f"programs are {known} files"
            raise InputError(f"{file} is a folder", cure)
        ending = f"its name ends in {file.suffix!r}" if file.suffix else "its name has no suffix"
        raise InputError(f"{file} holds no program: {ending}", f"programs are {known} files")
    return chosen.read(file)


def save(program: Program, path: str | os.PathLike[str], frame: Frame | None = None) -> None:
    """Write a program so that :func:`load_with_frame` returns the same program and frame.

    Parameters
    ----------
    program
        What to write.
    path
        Where to; ends in .shape, .json or .notation.
    frame
        From the grid to the coordinates of the input, if it is to be stored.

    Raises
    ------
    OutputError
        If the suffix is not that of a program file, or the file cannot be written.
    """
    if Path(path).suffix.lower() not in suffixes("program"):
        known = " or ".join(suffixes("program"))
        raise OutputError(f"{path} could not be read back as a program", f"name a {known} file, or use export")
    export(program, path, frame)


def export(program: Program, path: str | os.PathLike[str], frame: Frame | None = None, **options: int) -> Path:
    """Write a program in the format that the suffix of ``path`` names, whole or not at all, and return the path.

    ::

        {formats}

    Parameters
    ----------
    program
        What to write.
    path
        Where to; the folder must exist.
    frame
        From the grid to the coordinates of the input, so that the export lies on it; without it the shape stands
        upright in the axes of the format, one unit of the program one of the file (:mod:`shapeprog.formats.frames`).
    options
        For .npy the ``resolution`` in cells along each side (32), for .xyz how many ``points`` (5000) and their
        ``seed`` (0).

    Raises
    ------
    OutputError
        If the suffix is unknown, the program draws nothing that the format can hold, or the file cannot be written.
    """
    target = Path(path)
    chosen, suffix = format_of(target), target.suffix.lower()
    if chosen is None or not chosen.writer:
        wrong = f"no export ends in {suffix!r}" if suffix else f"{target} has no suffix, so its format is unknown"
        raise OutputError(wrong, did_you_mean(suffix, suffixes()))
    for name in options:
        if name not in chosen.options:
            raise OutputError(f"{suffix} takes no {name}", f"it takes {', '.join(chosen.options) or 'no options'}")
    placed = upright(chosen, program.unit) if frame is None else frame
    try:
        chosen.write(program, target, placed, **options)
    except OSError as error:
        raise output_error(target, error) from error
    return target


export.__doc__ = (export.__doc__ or "").replace("{formats}", listed().replace("\n", "\n        "))

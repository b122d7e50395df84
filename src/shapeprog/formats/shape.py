"""Program text in ``.shape`` files, with the frame that leads back to the input in a comment above it."""

from __future__ import annotations

import os
from pathlib import Path

from shapeprog.errors import InputError
from shapeprog.files import write_text
from shapeprog.formats.frames import frame_comment, frame_in
from shapeprog.language.program import Program
from shapeprog.language.text import format_program, parse
from shapeprog.space import Frame


def read_shape(path: Path) -> tuple[Program, Frame | None]:
    """The program of a text file, and its frame where it keeps one."""
    text = read_text(path)
    return parse(text, str(path)), frame_in(text, str(path))


def write_shape(program: Program, path: Path, frame: Frame | None) -> None:
    """Write canonical program text."""
    write_text(path, frame_comment(frame) + format_program(program))


def read_text(path: str | os.PathLike[str]) -> str:
    """The text of a UTF-8 file, with or without a byte order mark.

    Raises
    ------
    InputError
        If the file cannot be read or is not UTF-8.
    """
    try:
        return Path(path).read_bytes().decode("utf-8-sig")
    except FileNotFoundError as error:
        raise InputError(f"there is no file {path}", "check the path") from error
    except IsADirectoryError as error:
        raise InputError(f"{path} is a folder, not a file", "name a file in it") from error
    except UnicodeDecodeError as error:
        raise InputError(
            f"{path} is not text: byte {error.start} is not UTF-8", "save it as UTF-8, or check that it is a program"
        ) from error
    except (OSError, ValueError) as error:
        raise InputError(f"cannot read {path}: {error}", "check the path and its permissions") from error

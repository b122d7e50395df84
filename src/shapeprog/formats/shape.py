"""Program text in ``.shape`` files, with the frame of the input in a comment above it."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

from shapeprog.errors import InputError
from shapeprog.files import check_file, unreadable
from shapeprog.formats.frames import frame_comment, frame_of_grid, scale_of, split_frame
from shapeprog.language.parser import parse
from shapeprog.language.printer import format_program
from shapeprog.language.program import Program

LARGEST_FILE = 16_000_000  # bytes of the largest program file


def program_in(text: str, name: str) -> Program:
    """The program of a text, with its frame if a comment stores one."""
    text, frame = split_frame(text, name)
    program = parse(text, name)
    return program if frame is None else replace(program, frame=frame_of_grid(frame, scale_of(program)))


def program_text(program: Program) -> str:
    """Canonical program text with its frame in a comment above it."""
    return frame_comment(program) + format_program(program)


def read_text(path: str | os.PathLike[str]) -> str:
    """The text of a UTF-8 file, with or without a byte order mark; an ``InputError`` if the file cannot be read, is no
    regular file, is larger than ``LARGEST_FILE``, or is not UTF-8."""
    file = Path(path)
    check_file(file)
    try:
        if file.stat().st_size > LARGEST_FILE:
            raise InputError(f"{path} is larger than {LARGEST_FILE / 1e6:.0f} MB", "check that it is a program")
        return file.read_bytes().decode("utf-8-sig")
    except UnicodeDecodeError as error:
        message = f"{path} is not text: byte {error.start} is not UTF-8"
        raise InputError(message, "save it as UTF-8, or check that it is a program") from error
    except OSError as error:
        raise unreadable(file, error) from error

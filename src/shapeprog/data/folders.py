"""Files in folders by their suffix; unreadable folders are listed instead of raising an error."""

from __future__ import annotations

import os
from collections.abc import Collection
from pathlib import Path

from shapeprog.errors import ShapeProgError
from shapeprog.files import unreadable

Skipped = list[tuple[Path, ShapeProgError]]
"""Folders that could not be read, each with its error; the functions of this module add to it."""


def entries(folder: Path, skipped: Skipped) -> list[Path]:
    """The entries of a folder, sorted by name."""
    try:
        return sorted(folder / name for name in os.listdir(folder))
    except OSError as error:
        skipped.append((folder, unreadable(folder, error)))
        return []


def is_folder(path: Path, skipped: Skipped) -> bool:
    """Whether there is a folder, or a link to one."""
    try:
        path.stat()
    except (FileNotFoundError, NotADirectoryError):
        return False
    except OSError as error:
        skipped.append((path, unreadable(path, error)))
        return False
    return path.is_dir()


def files_below(folder: Path, suffixes: Collection[str], skipped: Skipped) -> list[Path]:
    """Every file in a folder and in those within, whose suffix in lower case is in ``suffixes``, sorted by name.

    Links to folders are not followed, and links to nothing are left out.
    """
    files: list[Path] = []

    def skip(error: OSError) -> None:
        folder_path = Path(error.filename or folder)
        skipped.append((folder_path, unreadable(folder_path, error)))

    for folder_path, _, names in os.walk(folder, onerror=skip):
        candidates = (Path(folder_path, name) for name in names if os.path.splitext(name)[1].lower() in suffixes)
        files += [path for path in candidates if not os.path.islink(path) or os.path.exists(path)]
    return sorted(files)

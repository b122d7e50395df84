"""What is in folders: files by their suffix, with folders that may not be read named instead of ending everything."""

from __future__ import annotations

import os
from collections.abc import Collection
from pathlib import Path

from shapeprog.data.reading import unreadable
from shapeprog.errors import ShapeProgError

Skipped = list[tuple[Path, ShapeProgError]]
"""Folders that could not be read, each with its error; the functions of this module add to it."""


def entries(folder: Path, skipped: Skipped) -> list[Path]:
    """What is in a folder, in the order of the names."""
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
    """Every file in a folder and in those within, whose suffix in lower case is wanted, in the order of the names.

    Links to folders are not followed, and links to nothing are left out.
    """
    found: list[Path] = []

    def skip(error: OSError) -> None:
        place = Path(error.filename or folder)
        skipped.append((place, unreadable(place, error)))

    for place, _, names in os.walk(folder, onerror=skip):
        wanted = (Path(place, name) for name in names if os.path.splitext(name)[1].lower() in suffixes)
        found += [path for path in wanted if not _leads_nowhere(path)]
    return sorted(found)


def _leads_nowhere(path: Path) -> bool:
    return os.path.islink(path) and not os.path.exists(path)

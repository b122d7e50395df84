"""Files that are either whole or not there: every output is written beside its place and moved in."""

from __future__ import annotations

import contextlib
import errno
import os
import secrets
from collections.abc import Iterator
from pathlib import Path

from shapeprog.errors import OutputError

_CURES = {
    errno.ENOSPC: ("the disk is full", "free some space or write to another disk"),
    errno.EDQUOT: ("the disk quota is used up", "free some space or write to another disk"),
    errno.EFBIG: ("the file is larger than the disk allows", "write to another disk"),
    errno.EACCES: ("there is no permission to write there", "choose a folder that you may write to"),
    errno.EPERM: ("there is no permission to write there", "choose a folder that you may write to"),
    errno.EROFS: ("the disk is read-only", "choose a folder that you may write to"),
    errno.ENOENT: ("its folder does not exist", "make the folder first, or correct the path"),
    errno.ENOTDIR: ("a part of its path is a file, not a folder", "correct the path"),
    errno.EISDIR: ("there is a folder of that name", "give a file name instead"),
    errno.ENAMETOOLONG: ("the name is too long", "choose a shorter name"),
}


@contextlib.contextmanager
def atomic_path(path: str | os.PathLike[str]) -> Iterator[Path]:
    """A temporary path beside ``path`` that takes its place if the block succeeds and vanishes if it fails.

    Readers see the old file or the whole new one, never a part.  The folder must exist.  The temporary name keeps the
    suffix, so that writers which look at it behave alike.

    Raises
    ------
    OutputError
        If the file cannot be written (full disk, no permission, missing folder...), naming cause and cure.
    """
    target = Path(path)
    temporary = target.parent / f".{secrets.token_hex(4)}~{target.name[-200:]}"
    try:
        if target.is_dir():
            raise IsADirectoryError(errno.EISDIR, "is a folder", str(target))
        if not target.parent.is_dir():
            raise FileNotFoundError(errno.ENOENT, "no such folder", str(target.parent))
        yield temporary
        os.replace(temporary, target)
    except OSError as error:
        raise output_error(target, error) from error
    finally:
        with contextlib.suppress(OSError):
            temporary.unlink(missing_ok=True)


def write_bytes(path: str | os.PathLike[str], content: bytes) -> None:
    """Write ``content`` to ``path``, whole or not at all."""
    with atomic_path(path) as temporary:
        temporary.write_bytes(content)


def write_text(path: str | os.PathLike[str], content: str) -> None:
    """Write ``content`` to ``path`` as UTF-8 with plain newlines, whole or not at all.

    Names of files that are no text, as any is where the locale knows ASCII alone, are written byte for byte.
    """
    write_bytes(path, content.encode("utf-8", "surrogateescape"))


def make_folder(path: str | os.PathLike[str]) -> Path:
    """The folder ``path``, made with its parents where missing; an ``OutputError`` if it cannot be."""
    folder = Path(path)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except FileExistsError as error:
        raise OutputError(f"cannot make the folder {folder}: there is a file of that name", "choose another") from error
    except OSError as error:
        raise output_error(folder, error) from error
    return folder


def output_error(path: Path, error: OSError) -> OutputError:
    """The error in words for an ``OSError`` met while writing ``path``."""
    cause, cure = _CURES.get(error.errno or 0, (error.strerror or str(error), "check the path and the disk"))
    return OutputError(f"cannot write {path}: {cause}", cure)

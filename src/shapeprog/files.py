"""Files: only regular ones are read; every output is written to a temporary one in the same folder, then renamed.

An output is whole after a power failure, too: its content reaches the disk before the file is renamed.
"""

from __future__ import annotations

import contextlib
import errno
import os
import secrets
import stat
import sys
from collections.abc import Iterator
from pathlib import Path

from shapeprog.errors import InputError, OutputError

if sys.platform == "win32":
    import msvcrt
else:
    import fcntl

_WINDOWS = sys.platform == "win32"

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

_UNREADABLE = {
    errno.EACCES: ("there is no permission to read it", "change its permissions, or leave it out"),
    errno.EPERM: ("there is no permission to read it", "change its permissions, or leave it out"),
    errno.ENOENT: ("it is not there", "check the path"),
    errno.ENOTDIR: ("a part of its path is a file, not a folder", "correct the path"),
    errno.EISDIR: ("it is a folder", "name a file in it"),
    errno.ELOOP: ("it is a link that leads to itself", "correct the link"),
    errno.ENAMETOOLONG: ("its name is too long", "check the path"),
    errno.EIO: ("the disk has a fault there", "copy the file from where it came from"),
}

_UNFINISHED = "." + 8 * "[0-9a-f]" + "~*"  # pattern of the names of temporary files


@contextlib.contextmanager
def atomic_path(path: str | os.PathLike[str]) -> Iterator[Path]:
    """A temporary file in the folder of ``path`` that replaces it if the block succeeds and is removed if it fails.

    Readers see the old file or the whole new one, never a part.  The folder must exist.  The temporary name keeps the
    suffix, because some writers depend on it.  The file is locked while it is written: an unlocked one belongs to a
    process that was killed, and :func:`make_folder` removes it.

    Raises
    ------
    OutputError
        If the file cannot be written (full disk, no permission, missing folder...), with cause and remedy.
    """
    target = Path(os.path.realpath(path) if os.path.islink(path) else path)  # a link stays one
    temporary = target.parent / f".{secrets.token_hex(4)}~{target.name[-200:]}"
    try:
        if target.is_dir():
            raise IsADirectoryError(errno.EISDIR, "is a folder", str(target))
        if not target.parent.is_dir():
            raise FileNotFoundError(errno.ENOENT, "no such folder", str(target.parent))
        with temporary.open("xb") as stream:
            if not _WINDOWS:  # there a lock would keep the writer out
                lock(stream.fileno())
            yield temporary
            os.fsync(stream.fileno())
            if _WINDOWS:  # there a file that is open can be neither moved nor removed
                stream.close()
            os.replace(temporary, target)
        sync(target.parent)
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

    File names that are not valid text, as all others than ASCII in an ASCII locale, are written byte for byte.
    """
    write_bytes(path, content.encode("utf-8", "surrogateescape"))


def make_folder(path: str | os.PathLike[str]) -> Path:
    """The folder ``path``, made with its parents where missing, without what killed processes left unfinished in it.

    Raises
    ------
    OutputError
        If it cannot be made.
    """
    folder = Path(path)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except FileExistsError as error:
        raise OutputError(f"cannot make the folder {folder}: there is a file of that name", "choose another") from error
    except OSError as error:
        raise output_error(folder, error) from error
    remove_unfinished(folder)
    return folder


def remove_unfinished(folder: Path) -> None:
    """Remove the files that processes were writing into a folder when they were killed."""
    for path in folder.glob(_UNFINISHED):
        with contextlib.suppress(OSError):
            if _WINDOWS:
                path.unlink()
                continue
            with path.open("r+b") as stream:
                if lock(stream.fileno()):
                    path.unlink()


def lock(file: int) -> bool:
    """Lock an open file for this process, if no other has; the lock falls when it is closed or the process ends."""
    try:
        if sys.platform == "win32":
            msvcrt.locking(file, msvcrt.LK_NBLCK, 1)
        else:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return False
    return True


def sync(path: Path) -> None:
    """Flush a file, or the names in a folder, to the disk, where the system supports it."""
    with contextlib.suppress(OSError):
        file = os.open(path, os.O_RDONLY)
        try:
            os.fsync(file)
        finally:
            os.close(file)


def output_error(path: Path, error: OSError) -> OutputError:
    """The error in words for an ``OSError`` met while writing ``path``."""
    cause, cure = _CURES.get(error.errno or 0, (error.strerror or str(error), "check the path and the disk"))
    return OutputError(f"cannot write {path}: {cause}", cure)


def check_file(path: Path) -> None:
    """Refuse everything but regular files (a pipe or a device may never end) before it is opened.

    Raises
    ------
    InputError
        If there is no such file, it is a folder, a pipe, a socket or a device, or the system refuses access.
    """
    try:
        kind = os.stat(path).st_mode
    except FileNotFoundError as error:
        raise InputError(f"there is no file {path}", "check the path") from error
    except OSError as error:
        raise unreadable(path, error) from error
    except ValueError as error:  # a zero byte in the name
        raise InputError(f"there is no file {str(path)!r}", "check the path") from error
    if stat.S_ISDIR(kind):
        raise InputError(f"{path} is a folder", "name a file in it; in Python sp.load_all reads the shapes of a folder")
    if not stat.S_ISREG(kind):
        raise InputError(f"{path} is a pipe, a socket or a device, no file", "copy its content to a file first")


def unreadable(path: Path, error: OSError) -> InputError:
    """The error in words for an ``OSError`` met while reading a file or a folder."""
    cause, cure = _UNREADABLE.get(error.errno or 0, (error.strerror or "the system refuses it", "check the path"))
    return InputError(f"{path} cannot be read: {cause}", cure)

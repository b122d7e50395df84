"""Common parts of the readers of shapes: regular files only, size limits, and messages for all failures."""

from __future__ import annotations

import contextlib
import errno
from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np

from shapeprog.errors import InputError, ShapeProgError
from shapeprog.files import check_file, unreadable

BYTES = 2**30
"""Most bytes of a file that is read whole, and of an array once it is unpacked: 1 GiB."""

CELLS = 1024**3
"""Most cells of a voxel grid."""

POINTS = 5_000_000
"""Most points of a cloud, and most triangles of a mesh with all its parts placed."""

SHAPES = 1_000_000
"""Most shapes in one file."""

ANY_NUMBERS = np.errstate(invalid="ignore", over="ignore")
"""Context for arbitrary numbers of a file; numbers that are not finite are reported when a shape is made."""

_FEW = 5


def read_whole(path: Path) -> bytes:
    """The bytes of a regular file.

    Raises
    ------
    InputError
        If it is no regular file, is empty, or is larger than :data:`BYTES`.
    """
    check_file(path)
    check_count(path.name, "bytes", path.stat().st_size, BYTES)
    content = path.read_bytes()
    if not content[:1000].strip() and not content.strip():
        raise InputError(f"{path.name} is empty", "write the file again")
    return content


def check_count(name: str, what: str, count: int, most: int) -> None:
    """Refuse a file that announces or holds more than can be read, before memory is taken for it."""
    if count > most:
        raise InputError(f"{name} has {count:,} {what}; at most {most:,} can be read", "make it smaller, or split it")


@contextlib.contextmanager
def in_words(path: Path, kind: str = "") -> Iterator[None]:
    """Turn every exception of a reader into an ``InputError`` with its cause; ``kind`` names the format.

    The readers of the libraries raise whatever the bytes of a damaged file lead them to, so that no list of
    exceptions is complete.
    """
    try:
        yield
    except ShapeProgError:
        raise
    except MemoryError as error:
        raise InputError(f"{path.name} needs more memory than there is", "make it smaller, or split it") from error
    except OSError as error:
        if error.errno in (None, errno.EINVAL):  # from a library, or a place in the file that cannot be
            raise _damaged(path, kind) from error
        raise unreadable(path, error) from error
    except Exception as error:
        raise _damaged(path, kind) from error


def few(names: Iterable[object]) -> str:
    """The first of some names, for a message; ``nothing`` where there are none."""
    listed = [str(name)[:40] for name in names]
    return ", ".join(listed[:_FEW]) + (", ..." if len(listed) > _FEW else "") or "nothing"


def _damaged(path: Path, kind: str) -> InputError:
    kind = kind or path.suffix.removeprefix(".").upper() or "a shape"
    return InputError(
        f"{path.name} cannot be read as {kind}: it is damaged, cut short or of another format",
        "write the file again, or convert it; --debug shows what its reader met",
    )

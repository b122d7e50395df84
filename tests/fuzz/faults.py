"""One fault of every kind that the suite must see, committed on purpose; :mod:`tests.test_fuzz` counts them."""

from __future__ import annotations

import ctypes
import re
import time
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from shapeprog.errors import InputError


def _refuse(message: str, hint: str = "write it again") -> None:
    raise InputError(message, hint)


def _speak_raw(path: Path) -> None:
    error = InputError(path.name, "write it again")
    error.message += "holds \x1b[31mred"  # behind the back of the class, which tells escapes
    raise error


def _hide_memory(path: Path) -> None:
    try:
        np.ones(1 << 32, np.uint8)
    except MemoryError as error:
        raise InputError(f"{path.name} is too large", "make it smaller") from error


FAULTS: dict[str, tuple[str, Callable[[Path], object]]] = {
    "nothing": ("", lambda path: None),
    "refusal": ("", lambda path: _refuse(f"{path.name} is cut short")),
    "exception": ("foreign exception", lambda path: {}["key"]),
    "raw": ("raw Python text", lambda path: _refuse(f"{path.name}: 'NoneType' object has no attribute 'x'")),
    "nameless": ("no name", lambda path: _refuse("something is wrong")),
    "cureless": ("no cure", lambda path: _refuse(f"{path.name} is cut short", "")),
    "escape": ("unprintable", _speak_raw),
    "warning": ("warning", lambda path: warnings.warn("look", stacklevel=1)),
    "print": ("printed", lambda path: print("look")),
    "file": ("touched", lambda path: Path(path.parents[1], "elsewhere").write_text("x")),
    "memory": ("memory", lambda path: np.ones(1 << 32, np.uint8)),
    "hidden": ("memory", _hide_memory),
    "crash": ("crash", lambda path: ctypes.string_at(0)),
    "wait": ("hang", lambda path: time.sleep(600)),
    "hang": ("hang", lambda path: re.match(r"(a*)*b", 40 * "a")),
    "last": ("", lambda path: None),
}
"""What is said of each, and how it is done."""


def cases(seed: int) -> Iterator[tuple[str, bytes]]:
    """A file of the name of each fault."""
    return ((f"{name}.fault", b"") for name in FAULTS)


def commit(path: Path) -> None:
    """Commit the fault that a file is named after; what makes its file again has put a number before the name."""
    FAULTS[path.stem.rpartition("-")[2]][1](path)

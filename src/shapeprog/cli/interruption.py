"""Interruptions: Ctrl-C ends a command in a line at any moment, and in words of its own while it works.

Python would print a traceback instead, so this is imported first, and imports next to nothing.  Where interruptions are
ignored, as in the background of a script, they stay so.
"""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator
from contextlib import contextmanager, suppress

INTERRUPTED = 130
"""The exit code of a command that was interrupted."""


def expect() -> None:
    """From here on an interruption ends the process at once: nothing has begun that would have to be tidied up."""
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, _end)


@contextmanager
def tidied() -> Iterator[None]:
    """What is inside is interrupted by an exception, so that it can tidy up."""
    if signal.getsignal(signal.SIGINT) is not _end:
        yield
        return
    signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, _end)


def _end(number: int, frame: object) -> None:
    with suppress(OSError):
        os.write(2, b"Interrupted.\n")
    os._exit(INTERRUPTED)

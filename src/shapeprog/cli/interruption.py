"""Interruptions: Ctrl-C ends a command at any moment with one line instead of a traceback.

Python would print a traceback, so ``shapeprog.__main__`` sets a handler before it imports anything.
Where interruptions are ignored, as in the background of a script, they stay so.
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager

INTERRUPTED = 130
"""The exit code of a command that was interrupted."""

_ending: object = None
"""The handler that ends the process at once, if the command is the whole process."""


def adopt() -> None:
    """Keep the present handler, which ends the process at once, unless it is that of Python."""
    global _ending
    handler = signal.getsignal(signal.SIGINT)
    _ending = handler if callable(handler) and handler is not signal.default_int_handler else None


@contextmanager
def tidied() -> Iterator[None]:
    """In this block an interruption is an exception, so that the block can clean up."""
    handler = signal.getsignal(signal.SIGINT)
    if handler is None or handler is not _ending:
        yield
        return
    signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, handler)


@contextmanager
def stop_event() -> Iterator[threading.Event]:
    """An event that the first Ctrl-C or SIGTERM sets; the second interrupts at once."""
    stop = threading.Event()

    def ask(*_: object) -> None:
        if stop.is_set():
            raise KeyboardInterrupt
        stop.set()

    with ExitStack() as restore:
        for number in (signal.SIGINT, signal.SIGTERM):
            if signal.getsignal(number) != signal.SIG_IGN:
                restore.callback(signal.signal, number, signal.signal(number, ask))
        yield stop

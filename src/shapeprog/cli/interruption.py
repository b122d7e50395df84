"""Interruptions: Ctrl-C ends a command in a line at any moment, and in words of its own while it works.

Python would print a traceback instead, so ``shapeprog.__main__`` sets what ends the process before it imports anything.
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
"""What ends the process at once, where the command is the whole of it."""


def adopt() -> None:
    """Take what an interruption does now for what ends the process at once, unless that is what Python does."""
    global _ending
    now = signal.getsignal(signal.SIGINT)
    _ending = now if callable(now) and now is not signal.default_int_handler else None


@contextmanager
def tidied() -> Iterator[None]:
    """What is inside is interrupted by an exception, so that it can tidy up."""
    now = signal.getsignal(signal.SIGINT)
    if now is None or now is not _ending:
        yield
        return
    signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, now)


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

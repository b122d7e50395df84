"""The commands of ``shapeprog``, and how the process of a command begins and ends."""

from __future__ import annotations

import atexit
import gc
import os
import sys
from collections.abc import Sequence


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command with the arguments of the process, or with those given; ends in ``SystemExit``.

    With the arguments of the process it is the whole of the process, which then ends at once.
    """
    from shapeprog.cli import terminal
    from shapeprog.cli.app import app

    if arguments is None:
        gc.set_threshold(100_000, 50, 50)  # imports make many objects that stay, which the collector would count often
    words = sys.argv[1:] if arguments is None else arguments
    terminal.write_anything()
    terminal.debugging = "--debug" in words  # wherever it stands
    terminal.quiet = "--quiet" in words or "-q" in words
    try:
        app(args=[word for word in words if word not in ("--debug", "--quiet", "-q")], prog_name="shapeprog")
    except SystemExit as stop:
        if arguments is None and isinstance(stop.code, int | None):
            _leave(stop.code or 0, stop.code == terminal.INTERRUPTED)
        raise
    finally:  # the next call in this process is not quiet because this one was
        terminal.debugging = terminal.quiet = False


def _leave(code: int, interrupted: bool) -> None:
    """End the process without tearing down torch, which takes longer than many a command; not under a profiler.

    After an interruption within an ``exec`` Python would end itself by a signal instead of the exit code.
    """
    if not ("torch" in sys.modules or interrupted) or sys.gettrace() or sys.getprofile():
        return
    try:
        sys.stdout.flush()
        sys.stderr.flush()
    except OSError:
        return  # the interpreter reports it
    atexit._run_exitfuncs()
    os._exit(code)

"""The command as a process: how it begins and how it ends."""

from __future__ import annotations

import atexit
import gc
import os
import sys
from collections.abc import Sequence

from shapeprog.cli import interruption


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command with the arguments of the process, or with those given; ends in ``SystemExit``.

    With the arguments of the process it is the whole of the process, which then ends at once.
    """
    if arguments is not None:
        _run(arguments)
        return
    interruption.adopt()
    gc.set_threshold(100_000, 50, 50)  # importing makes many objects that stay, which the collector would count often
    try:
        _run(sys.argv[1:])
    except SystemExit as stop:
        _leave(stop)
        raise


def _run(words: Sequence[str]) -> None:
    from shapeprog.cli import terminal
    from shapeprog.cli.app import app

    terminal.write_anything()
    terminal.debugging = "--debug" in words  # wherever it stands
    app(args=[word for word in words if word != "--debug"], prog_name="shapeprog")


def _leave(stop: SystemExit) -> None:
    """End the process without tearing down torch, which takes longer than many a command.

    Registered exit functions run; only the modules are not torn down.  With a profiler or tracer the process ends as
    usual.  After an interruption within an ``exec`` Python would end itself by a signal instead of the exit code.
    """
    watched = sys.gettrace() or sys.getprofile()
    quick = "torch" in sys.modules or stop.code == interruption.INTERRUPTED
    if not quick or watched or not isinstance(stop.code, int | None):
        return
    try:
        sys.stdout.flush()
        sys.stderr.flush()
    except OSError:
        return  # the interpreter reports it
    atexit._run_exitfuncs()
    os._exit(stop.code or 0)

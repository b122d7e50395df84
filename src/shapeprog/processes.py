"""Other Python processes that answer lines with lines, and end with the process that asks, however that ends.

The one that asks holds a module's standard input and output; the module calls :func:`serve`.  When the input ends,
because the asking process closed it or was killed, so does the other, whatever it is at.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
from collections.abc import Callable
from queue import SimpleQueue
from typing import NoReturn

from shapeprog.errors import ShapeProgError


class Worker:
    """Another process, which runs a module that calls :func:`serve`; an interruption of this one does not reach it.

    Parameters
    ----------
    module
        Full name of the module.
    quiet
        Whether what it writes on the standard error is dropped.
    """

    def __init__(self, module: str, quiet: bool = False) -> None:
        path = os.pathsep.join(str(each) for each in sys.path if each)
        try:
            self._process = subprocess.Popen(
                [sys.executable, "-m", module], stdin=subprocess.PIPE, stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL if quiet else None, encoding="utf-8", env={**os.environ, "PYTHONPATH": path},
                start_new_session=True,
            )  # fmt: skip
        except OSError as error:
            raise ShapeProgError(f"cannot start another process: {error.strerror}", "end other programs") from error

    def ask(self, line: str) -> str:
        """Its answer to a line.

        Raises
        ------
        ShapeProgError
            If it ends instead.
        """
        asked, answers = self._process.stdin, self._process.stdout
        assert asked is not None
        assert answers is not None
        try:
            asked.write(f"{line}\n")
            asked.flush()
            answer = answers.readline()
        except OSError:  # it has closed its input
            answer = ""
        if not answer.endswith("\n"):
            raise ShapeProgError(
                f"worker ended: {_ending(self._process.wait())}",
                "it may have run out of memory",
            )
        return answer[:-1]

    def close(self) -> None:
        """End it and give back what it held; nobody may be asking any more."""
        self._process.kill()
        self._process.communicate()


def serve(answer: Callable[[str], str]) -> NoReturn:
    """Answer each line of the standard input with one on the standard output, until the input ends.

    What else is printed goes to the standard error.
    """
    asked, told = sys.stdin.buffer, os.fdopen(os.dup(sys.stdout.fileno()), "wb", buffering=0)
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # where there are no sessions, a terminal interrupts all processes
    lines: SimpleQueue[bytes] = SimpleQueue()

    def read() -> None:
        for line in asked:
            lines.put(line)
        os._exit(0)

    threading.Thread(target=read, daemon=True).start()
    while True:
        reply = answer(lines.get().decode().rstrip("\n"))
        try:
            told.write(f"{reply}\n".encode())
        except OSError:  # nobody listens any more
            os._exit(0)


def _ending(code: int) -> str:
    """How a process ended, from its exit code."""
    if code >= 0:
        return f"exit code {code}"
    names = {each.value: each.name for each in signal.Signals}
    return f"killed ({names.get(-code, -code)})"

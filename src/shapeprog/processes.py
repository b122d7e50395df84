"""Worker processes that answer lines with lines and end with their parent process, however that ends.

The parent holds the standard input and output of a module that calls :func:`serve`.  When the input ends, because the
parent closed it or was killed, the worker exits at once.
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
    """A process that runs a module which calls :func:`serve`; an interruption of the parent does not reach it.

    Parameters
    ----------
    module
        Full name of the module.
    quiet
        Whether its standard error is dropped.
    """

    def __init__(self, module: str, quiet: bool = False) -> None:
        path = os.pathsep.join(str(entry) for entry in sys.path if entry)
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
        requests, answers = self._process.stdin, self._process.stdout
        assert requests is not None
        assert answers is not None
        try:
            requests.write(f"{line}\n")
            requests.flush()
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
        """Kill the process and release its memory; no other thread may be waiting for an answer."""
        self._process.kill()
        self._process.communicate()


def serve(answer: Callable[[str], str]) -> NoReturn:
    """Answer each line of the standard input with one on the standard output, until the input ends.

    All other output goes to the standard error.
    """
    requests, replies = sys.stdin.buffer, os.fdopen(os.dup(sys.stdout.fileno()), "wb", buffering=0)
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # where there are no sessions, a terminal interrupts all processes
    lines: SimpleQueue[bytes] = SimpleQueue()

    def read() -> None:
        for line in requests:
            lines.put(line)
        os._exit(0)

    threading.Thread(target=read, daemon=True).start()
    while True:
        reply = answer(lines.get().decode().rstrip("\n"))
        try:
            replies.write(f"{reply}\n".encode())
        except OSError:  # nobody listens any more
            os._exit(0)


def _ending(code: int) -> str:
    """How a process ended, from its exit code."""
    if code >= 0:
        return f"exit code {code}"
    names = {number.value: number.name for number in signal.Signals}
    return f"killed ({names.get(-code, -code)})"

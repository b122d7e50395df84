"""The command ``shapeprog``, which is ``python -m shapeprog``: importing this module makes the process the command.

From its first lines on Ctrl-C ends the process in a line, since nothing has begun that would have to be tidied up.  So
they import only what the interpreter has loaded already; ``signal`` would take milliseconds.
"""

import _signal as signal  # type: ignore[import-not-found]
import os


def end(number: int, frame: object) -> None:
    """End the process with the exit code of :mod:`shapeprog.cli.interruption`."""
    try:
        os.write(2, b"Interrupted.\n")
    finally:
        os._exit(130)


if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
    signal.signal(signal.SIGINT, end)

from shapeprog.cli import main  # noqa: E402

if __name__ == "__main__":
    main()

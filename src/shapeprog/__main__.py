"""The command ``shapeprog``, which is ``python -m shapeprog``."""

import sys


def main() -> None:
    """Run the command; Ctrl-C ends it in a line, while it imports its modules too."""
    try:
        from shapeprog.cli import main as command

        command()
    except KeyboardInterrupt:
        sys.stderr.write("Interrupted.\n")
        sys.exit(130)


if __name__ == "__main__":
    main()

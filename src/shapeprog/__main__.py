"""``python -m shapeprog`` is the command ``shapeprog``."""

from shapeprog.cli import main

if __name__ == "__main__":
    main()

"""The commands of ``shapeprog``."""

from shapeprog.cli.entry import main

__all__ = ["main"]

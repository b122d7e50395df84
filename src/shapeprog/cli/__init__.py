"""The commands of ``shapeprog``."""

from shapeprog.cli.app import main

__all__ = ["main"]

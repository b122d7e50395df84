"""The time budget of inference: a safety net.  Only if it is too short for a shape, which the result reports, does the
result depend on the speed and the load of the machine."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

Progress = Callable[[str, float], None]
"""Called with the name of the current step and the share of it that is done."""

BUDGET = 60.0  # seconds for one shape: some twenty times what the slowest of 182 validation shapes takes on one core


@dataclass
class Deadline:
    """A moment after which no further step starts."""

    at: float = float("inf")  # value of ``time.monotonic()``; never by default
    cut: str = ""  # the first step that it cut short, and the progress of that step; empty if none was

    def passed(self, work: str) -> bool:
        """Whether it is too late for the next step; ``work`` names that step and its progress."""
        if time.monotonic() <= self.at:
            return False
        self.cut = self.cut or work
        return True


NEVER = Deadline()

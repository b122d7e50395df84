"""The time budget of inference: a safety net, far from the common path.

What is found is decided by rounds, steps and the seed.  Only a shape that the budget is too short for depends on how
fast and how busy the machine is, and then the result says so.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

Progress = Callable[[str, float], None]
"""Called with what is being done and the share of it that is done."""

BUDGET = 60.0
"""Seconds for one shape: some twenty times what the slowest of 182 validation shapes takes on one core."""


@dataclass
class Deadline:
    """A moment after which no further step starts.

    Parameters
    ----------
    at
        Value of ``time.monotonic()``; never by default.
    cut
        What it cut short, and after how much of it; empty as long as nothing was.
    """

    at: float = float("inf")
    cut: str = ""

    def passed(self, work: str) -> bool:
        """Whether it is too late for the next step; ``work`` names what is cut short then, and how far it has come."""
        if time.monotonic() <= self.at:
            return False
        self.cut = work
        return True


NEVER = Deadline()

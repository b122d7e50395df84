"""Settings of the choice among candidates."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Settings:
    """Settings of the choice among candidates, beside its prices; lengths in cells, chosen on val."""

    rounds: int = 1000  # rounds of ruin and recreate of all searches together
    restarts: int = 4  # independent searches, of which the best set counts
    earlier: float = 1e-4  # price of the last candidate above that of the first: all seeds prefer the same
    interior: tuple[float, ...] = (8.0, 1.0)  # initial penalties of points in interiors, in weights

    # Connecting
    floating: float = 0.02  # largest loss of value by connecting a part: four legs may explain no more than .01
    removed: float = 0.005  # the same by removing it
    ways: int = 24  # most ways to connect a part that are tested, the most valuable first
    lines: tuple[float, ...] = (0.8, 0.98)  # as ``within`` of candidates: boards may meet at their rims

    # Coverage
    batch: int = 16  # samples of one batch on a primitive
    least_samples: int = 64  # smallest and largest number for a candidate without loops, else one per cell
    most_samples: int = 256
    skin: float = 0.5  # height of samples above the surface, in tolerances, where others may hide them
    every: int = 4  # one of so many points is tested for a surface near it:
    near: float = 0.5  # within this share of the tolerance,
    agreement: float = 0.8  # with at least this cosine between the normals
    free_points: int = 2048  # points drawn in free space
    parts: int = 16  # parts of a mesh from which the value of all is constant: a lattice is not drawn at any price
    even: float = 0.1  # distance from the middle, and difference of the sides of a section, that count as none
    outside: float = 0.5  # distance beyond the box around the target from which a candidate is outside


SETTINGS = Settings()

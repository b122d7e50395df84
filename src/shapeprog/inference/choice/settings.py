"""Settings of the choice among candidates."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Settings:
    """Settings of the choice among candidates, beside its prices; lengths in cells, chosen on val.

    Parameters
    ----------
    rounds, restarts
        Rounds of ruin and recreate of all searches together, and independent searches, of which the best set counts.
    earlier
        Price of the last candidate above that of the first: of nearly equal sets, all seeds prefer the same.
    blink
        Probability with which a round overlooks a candidate.
    interior
        Initial penalties of points in interiors, as multiples of their weights.
    floating, removed, ways
        Largest loss of value by connecting a part, and by removing it, as shares of the target: four legs may explain
        no more than .01; most ways to connect a part that are tested, the most valuable first.
    lines
        Shares of a face within which lines test which parts an extension reaches: boards may meet at their rims.
    batch, least_samples, most_samples
        Samples of one batch on a primitive; smallest and largest number for a candidate without loops, else one per
        cell.
    skin
        Height above the surface, in tolerances, at which the test whether another candidate hides a sample is made.
    free_points
        Points drawn in free space.
    parts
        Parts of a mesh from which the value of all is constant: a lattice of many slats is not drawn at any price.
    centred
        Distance within which a candidate is in the middle.
    """

    rounds: int = 1000
    restarts: int = 4
    earlier: float = 1e-4
    blink: float = 0.05
    interior: tuple[float, ...] = (8.0, 1.0)
    floating: float = 0.02
    removed: float = 0.005
    ways: int = 24
    lines: tuple[float, ...] = (0.8, 0.98)
    batch: int = 16
    least_samples: int = 64
    most_samples: int = 256
    skin: float = 0.5
    free_points: int = 2048
    parts: int = 16
    centred: float = 0.1


SETTINGS = Settings()

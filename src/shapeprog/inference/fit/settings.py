"""Settings of fitting."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class FitSettings:
    """Numbers of fitting; lengths in cells, chosen on val.

    Parameters
    ----------
    steps, last
        Steps of Gauss and Newton, of which the last ones fix rounded angles and close the joints that are still open.
    explained
        Width of the weights of residuals at the end, in tolerances of the evidence.
    measure_prior, place_prior
        Weights, against that of the whole target, of a squared move from the start: of lengths and angles, which
        nothing else may hold, and of places.
    nearly, touching
        Gaps up to which parts nearly touch, and touch.
    points, samples
        Points of the target, and samples of the surface of the program, that one step uses.
    partners
        Samples among which the partner of a point is found, and points among which that of a sample is.
    turned
        How far away a sample of right place counts whose normal is at a right angle to that of the point.
    same
        Least cosine between normals on one face.
    """

    steps: int = 12
    last: int = 5
    explained: float = 2.0
    measure_prior: float = 3e-5
    place_prior: float = 1e-6
    nearly: float = 0.3
    touching: float = 0.05
    points: int = 1_200
    samples: int = 1_200
    partners: int = 6
    turned: float = 0.5
    same: float = 0.5


FIT = FitSettings()

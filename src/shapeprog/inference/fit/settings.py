"""Settings of fitting."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class FitSettings:
    """Settings of fitting; lengths in cells, chosen on val."""

    steps: int = 12  # Gauss-Newton steps
    last: int = 5  # the last of them, which fix rounded angles and close the joints that are still open
    explained: float = 2.0  # width of the weights of residuals at the end, in tolerances of the evidence
    measure_prior: float = 3e-5  # weight of a squared move of a length or angle, against that of the whole target
    place_prior: float = 1e-6  # the same of a position
    nearly: float = 0.3  # gap up to which parts nearly touch
    touching: float = 0.05  # gap up to which they touch
    pairs: int = 1_200  # points of the target, and of the surface of the program, that one step uses
    partners: int = 6  # samples among which the partner of a point is found, and points for a sample
    turned: float = 0.5  # distance that counts as much as a normal at a right angle
    component: float = 0.5  # distance within which the faces of a part are those of a component,
    shared: float = 0.85  # or which share of the box around both they have in common, at least
    same: float = 0.5  # least cosine between normals on one face
    compared: int = 4_000  # points of the target, and of the program, whose closeness is compared
    near: float = 0.01  # share of the diagonal of the target within which surfaces are close, as in the evaluation

    # Straight faces on planes of a mesh
    plane_reach: float = 0.3  # distance within which planes are looked for: farther ones never count enough
    plane_falloff: float = 0.25  # distance at which a plane counts 1/e of what it covers
    covered: float = 0.3  # share of a face that its plane covers at least, discounted by that
    level: float = 0.9999  # cosine from which a triangle is perpendicular to an axis
    plane_step: float = 0.01  # triangles with smaller steps in between are one plane,
    plane_width: float = 0.05  # if they are all within so much
    uncovered: float = 0.01  # weight of a face without a plane, against that of one which its plane covers
    on_plane: float = 0.02  # distance from its plane at which a face has half its weight, and up to which ties hold it
    reweighted: int = 8  # solutions of reweighted least squares


FIT = FitSettings()

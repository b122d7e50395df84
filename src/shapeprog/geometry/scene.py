"""A scene: what programs unroll to, primitives with the statement that drew them."""

from __future__ import annotations

from dataclasses import dataclass

from jaxtyping import Float, Int, UInt8

from shapeprog.arguments import check_points
from shapeprog.geometry.batch import Batch
from shapeprog.lazy_torch import Tensor, torch
from shapeprog.space import RESOLUTION


@dataclass(frozen=True)
class Scene(Batch):
    """Unrolled programs: of each primitive the id of its statement, its block, and which of the copies it is."""

    statement: Int[Tensor, "*batch N"]
    block: Int[Tensor, "*batch N"]
    copy: Int[Tensor, "*batch N"]

    def sample(self, n: int, generator: torch.Generator | None = None) -> Float[Tensor, "*batch n 3"]:
        """Points drawn uniformly by area from the visible surface, with gradient; see ``sample_surface``."""
        from shapeprog.geometry.surface import sample_surface

        return sample_surface(self, n, generator).points

    def distance(self, points: Float[Tensor, "*shared P 3"]) -> Float[Tensor, "*batch P"]:
        """Signed distance of points to the union, with gradient; see ``signed_distance``."""
        from shapeprog.geometry.distance import signed_distance

        distance = signed_distance(self, points)
        check_points("points", points)
        return distance

    def voxels(self, resolution: int = RESOLUTION) -> UInt8[Tensor, "*batch R R R"]:
        """The cells that the primitives occupy, 1 or 0; see ``cells.voxels``."""
        from shapeprog.geometry.cells import voxels

        return voxels(self, resolution)

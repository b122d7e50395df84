"""A scene: primitives as a batch of structures of arrays, each with the statement that drew it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields

import torch
from jaxtyping import Bool, Float, Int, UInt8
from torch import Tensor

from shapeprog.space import RESOLUTION


@dataclass(frozen=True)
class Solids:
    """Primitives of one kind as a statement returns them: sizes and poses with any leading batch dimensions.

    Parameters
    ----------
    kind
        Index into the registry of primitives.
    size
        Sizes (..., 4) in cells, in the order the primitive declares.
    centre
        Centres (..., 3) in the grid frame.
    rotation
        Orientations (..., 3, 3) whose columns are the local axes, or ``None`` when aligned with the grid.
    """

    kind: int
    size: Float[Tensor, "*batch 4"]
    centre: Float[Tensor, "*batch 3"]
    rotation: Float[Tensor, "*batch 3 3"] | None = None


@dataclass(frozen=True)
class Scene:
    """Unrolled programs: ``N`` slots of primitives for each program of a batch, padded with a mask.

    A local point p of slot n lies at ``centre[n] + rotation[n] @ p``.

    Parameters
    ----------
    kind
        Which primitive (index into the registry).
    size
        Sizes in cells; zero in padding.
    centre, rotation
        Pose in the grid frame; zero and identity in padding.
    mask
        Which slots hold a primitive.
    statement
        Id of the statement that drew it.
    block, copy
        Which block of the program it came from, and which of its copies it is.
    """

    kind: Int[Tensor, "*batch N"]
    size: Float[Tensor, "*batch N 4"]
    centre: Float[Tensor, "*batch N 3"]
    rotation: Float[Tensor, "*batch N 3 3"]
    mask: Bool[Tensor, "*batch N"]
    statement: Int[Tensor, "*batch N"]
    block: Int[Tensor, "*batch N"]
    copy: Int[Tensor, "*batch N"]

    @property
    def batch_shape(self) -> torch.Size:
        """Leading dimensions: one scene for each of them."""
        return self.mask.shape[:-1]

    def __getitem__(self, index: int | slice) -> Scene:
        """The scene or scenes at an index of the first batch dimension."""
        return Scene(**{field.name: getattr(self, field.name)[index] for field in fields(self)})

    def __len__(self) -> int:
        return self.mask.shape[0]

    def __iter__(self) -> Iterator[Scene]:
        return (self[index] for index in range(len(self)))

    def flatten(self) -> Scene:
        """The same scenes with exactly one batch dimension."""
        lead, count = len(self.batch_shape), self.batch_shape.numel()
        return Scene(
            **{
                field.name: getattr(self, field.name).reshape(count, *getattr(self, field.name).shape[lead:])
                for field in fields(self)
            }
        )

    def detach(self) -> Scene:
        """The same scene without gradient."""
        return Scene(**{field.name: getattr(self, field.name).detach() for field in fields(self)})

    def sample(self, n: int, generator: torch.Generator | None = None) -> Float[Tensor, "*batch n 3"]:
        """Points drawn uniformly by area from the visible surface, with gradient; see ``sample_surface``."""
        from shapeprog.geometry.sampling import sample_surface

        return sample_surface(self, n, generator).points

    def distance(self, points: Float[Tensor, "*batch P 3"]) -> Float[Tensor, "*batch P"]:
        """Signed distance of points to the union, with gradient; see ``signed_distance``."""
        from shapeprog.geometry.distance import signed_distance

        return signed_distance(self, points)

    def voxels(self, resolution: int = RESOLUTION) -> UInt8[Tensor, "*batch R R R"]:
        """The cells that the primitives occupy, 1 or 0; see ``occupancy.voxels``."""
        from shapeprog.geometry.occupancy import voxels

        return voxels(self, resolution)

    def local(self, points: Float[Tensor, "*batch P 3"]) -> Float[Tensor, "*batch P N 3"]:
        """Positions of points (P, 3) in the local frame of every slot."""
        offset = points[..., :, None, :] - self.centre[..., None, :, :]
        return torch.einsum("...nij,...pni->...pnj", self.rotation, offset)

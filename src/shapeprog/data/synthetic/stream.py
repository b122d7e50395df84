"""Endless synthetic shapes: batch ``index`` of a stream depends on its seed and index alone."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from jaxtyping import Float, UInt8
from torch import Tensor

from shapeprog.data.synthetic.mixture import Prior
from shapeprog.errors import InputError
from shapeprog.geometry.cells import unpack
from shapeprog.geometry.surface import sample_surface
from shapeprog.kernels.bits import FIRST, GOLDEN
from shapeprog.language.tensors import Code
from shapeprog.language.unroll import unroll

GROUP = 2048
"""About as many shapes are drawn together: templates cost the same for few programs as for many."""


@dataclass(frozen=True)
class Batch:
    """Synthetic shapes.

    Parameters
    ----------
    code
        Their programs, in whole numbers.
    voxels
        The cells that these draw.
    points
        Points on their surfaces in the grid frame, if asked for.
    """

    code: Code
    voxels: UInt8[Tensor, "B 32 32 32"]
    points: Float[Tensor, "B P 3"] | None = None


class Stream:
    """Batches of shapes from a prior, each found by its index.

    Resuming is going on at an index, and rank r of W processes takes the indices i * W + r.

    Parameters
    ----------
    prior
        Where the programs come from.
    batch
        Shapes of a batch B.
    seed
        Streams of other seeds hold other shapes.
    blocks
        Blocks K of the tensors.
    points
        Points P on the surface of each shape; none by default.
    device
        Where the tensors are.

    Raises
    ------
    InputError
        If the batch is empty, or the blocks do not hold the programs of the prior.
    """

    def __init__(
        self, prior: Prior, batch: int, *, seed: int, blocks: int = 10, points: int = 0,
        device: torch.device | str = "cpu",
    ) -> None:  # fmt: skip
        if batch < 1:
            raise InputError(f"a batch of {batch} shapes holds nothing", "ask for at least one shape")
        if blocks < prior.blocks:
            raise InputError(
                f"{blocks} blocks do not hold the programs of {prior.name}", f"allow {prior.blocks} blocks or more"
            )
        self.prior, self.batch, self.seed, self.blocks, self.points = prior, batch, seed, blocks, points
        self.device = torch.device(device)
        self._together = max(1, GROUP // batch)
        self._known: tuple[int, Code, Tensor] | None = None

    def __getitem__(self, index: int) -> Batch:
        """The batch of an index, 0 or more."""
        if index < 0:
            raise IndexError(f"batch {index}: batches are counted from 0")
        group, place = divmod(index, self._together)
        if self._known is None or self._known[0] != group:
            code, canvas = self.prior.drawn(self._together * self.batch, self._random(2 * group))
            missing = self.blocks - code.ids.shape[1]
            code = Code(
                torch.nn.functional.pad(code.ids, (0, 0, 0, missing)),
                torch.nn.functional.pad(code.parameters, (0, 0, 0, 0, 0, missing)),
            )
            self._known = group, code, canvas
        rows = slice(place * self.batch, (place + 1) * self.batch)
        code = Code(self._known[1].ids[rows].clone(), self._known[1].parameters[rows].clone())
        points = None
        if self.points:
            points = sample_surface(unroll(code), self.points, self._random(2 * index + 1)).points
        return Batch(code, unpack(self._known[2][rows]), points)

    def _random(self, number: int) -> torch.Generator:
        """Randomness of its own for each group of batches, and for the points of each batch."""
        mixed = (self.seed * GOLDEN + number * FIRST + 1) % 2**63
        return torch.Generator(self.device).manual_seed(mixed)

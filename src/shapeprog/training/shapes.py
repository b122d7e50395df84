"""Real shapes as endless seeded batches: batch ``index`` depends on the packs, the seed and the index alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt
import torch
from jaxtyping import Bool, Float, Int, UInt8
from torch import Tensor

from shapeprog.data.packs import read_pack
from shapeprog.data.shape import Shape
from shapeprog.errors import InputError
from shapeprog.inference.surface import points_of_cells

GUESSED = 5000
"""Points guessed on the surface of a target that is known by its cells alone."""


@dataclass(frozen=True)
class Targets:
    """A batch of targets.

    Parameters
    ----------
    cells
        Their touched cells, 1 or 0.
    points
        Points on their surfaces in the grid frame.
    place
        Which shapes of the packs they are.
    mirrored
        Which of them were turned left to right.
    """

    cells: UInt8[Tensor, "B 32 32 32"]
    points: Float[Tensor, "B P 3"]
    place: Int[Tensor, " B"]
    mirrored: Bool[Tensor, " B"]


class TargetStream:
    """Batches of the shapes of packs: every shape once, in an order of its own, before any comes again.

    Parameters
    ----------
    packs
        Files of shapes.
    batch
        Shapes of a batch B.
    seed
        Of order, points and mirroring.
    points
        Points P drawn from those of each shape.
    mirror
        Share of the shapes that are mirrored left to right.
    places
        The shapes to draw from, by their places in the packs; all by default.

    Raises
    ------
    InputError
        If there are no shapes, or a pack cannot be read.
    """

    def __init__(
        self, packs: Sequence[Path], batch: int, *, seed: int, points: int = 1000, mirror: float = 0.0,
        places: npt.NDArray[np.int64] | None = None,
    ) -> None:  # fmt: skip
        self._packs = [read_pack(path) for path in packs]
        ends = np.cumsum([0, *(len(pack) for pack in self._packs)])
        self._starts = ends[:-1]
        self._places = np.arange(ends[-1]) if places is None else places
        if not len(self._places):
            raise InputError("there are no shapes to adapt to", "give packs made with 'shapeprog prepare'")
        self._batch, self._seed, self._points, self._mirror = batch, seed, points, mirror

    @property
    def names(self) -> list[str]:
        """Names of the shapes in the order of their places."""
        return [str(name) for pack in self._packs for name in pack.ids]

    def shape(self, place: int) -> Shape:
        """The shape at a place."""
        pack = int(np.searchsorted(self._starts, place, side="right")) - 1
        return self._packs[pack][place - int(self._starts[pack])]

    def __getitem__(self, index: int) -> Targets:
        """The batch of an index, 0 or more."""
        rounds, within = np.divmod(np.arange(index * self._batch, (index + 1) * self._batch), len(self._places))
        orders = {n: np.random.default_rng((self._seed, 0, n)).permutation(self._places) for n in set(rounds.tolist())}
        places = np.array([orders[n][at] for n, at in zip(rounds.tolist(), within, strict=True)])
        random = np.random.default_rng((self._seed, 1, index))
        mirrored = random.random(self._batch) < self._mirror
        cells, points = zip(*(self._drawn(int(place), random) for place in places), strict=True)
        turned, clouds = torch.from_numpy(np.stack(cells)), torch.from_numpy(np.stack(points))
        which = torch.from_numpy(mirrored)
        return Targets(*mirror(turned, clouds, which), torch.from_numpy(places), which)

    def _drawn(self, place: int, random: np.random.Generator) -> tuple[npt.NDArray[np.uint8], npt.NDArray[np.float32]]:
        shape = self.shape(place)
        cloud = shape.points
        if cloud is None or not len(cloud):
            cloud = points_of_cells(shape.voxels, GUESSED)
        some = random.permutation(len(cloud))[: self._points]
        few = some if len(some) == self._points else np.resize(some, self._points)
        return shape.voxels.astype(np.uint8), cloud[few]


def mirror(
    cells: UInt8[Tensor, "B 32 32 32"], points: Float[Tensor, "B P 3"], which: Bool[Tensor, " B"]
) -> tuple[UInt8[Tensor, "B 32 32 32"], Float[Tensor, "B P 3"]]:
    """Targets with those in ``which`` mirrored left to right."""
    flipped = torch.where(which[:, None, None, None], cells.flip(-1), cells)
    sign = torch.where(which, -1.0, 1.0)
    return flipped, torch.cat([points[..., :2], points[..., 2:] * sign[:, None, None]], -1)

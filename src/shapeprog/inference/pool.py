"""A pool of blocks from which the structure search may put one in instead of looking for a new one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from shapeprog.inference.block_layout import WIDTH
from shapeprog.inference.descent_kernels import sound, statements
from shapeprog.inference.drawing import cells_shared, draw_each
from shapeprog.space import FloatArray


@dataclass(frozen=True)
class Pool:
    """Blocks that were suggested or were of use before, with the cells they draw.

    Parameters
    ----------
    blocks
        The blocks (P, 20), each once.
    drawn
        Their cells as rows of bits (P, 1024).
    prices
        Cells that each has to gain for its statements.
    """

    blocks: FloatArray
    drawn: npt.NDArray[np.uint32]
    prices: FloatArray

    @classmethod
    def of(cls, groups: Sequence[FloatArray], price: float) -> Pool:
        """The blocks of all groups that descent can start from; ``price`` in cells for one statement."""
        every = np.concatenate([np.zeros((0, WIDTH)), *groups])
        usable = np.empty(len(every), np.bool_)
        sound(every, usable)
        blocks = np.unique(every[usable], axis=0)
        return cls(blocks, draw_each(blocks), price * statements(blocks.T))

    def best(
        self, occupied: npt.NDArray[np.uint32], covered: npt.NDArray[np.uint32], waste: float
    ) -> tuple[float, FloatArray]:
        """The block that gains most on what is not covered, and its gain in cells; zero when none gains.

        Parameters
        ----------
        waste
            Weight of an empty cell against an occupied one.
        """
        if not len(self.blocks):
            return 0.0, np.zeros(WIDTH)
        found = self._gains(occupied, covered, waste)
        best = int(found.argmax())
        return max(float(found[best]), 0.0), self.blocks[best]

    def several(
        self, occupied: npt.NDArray[np.uint32], covered: npt.NDArray[np.uint32], waste: float, number: int
    ) -> FloatArray:
        """The blocks (at most ``number``, 20) that gain most or lose least, best first."""
        return self.blocks[np.argsort(-self._gains(occupied, covered, waste), kind="stable")[:number]]

    def _gains(self, occupied: npt.NDArray[np.uint32], covered: npt.NDArray[np.uint32], waste: float) -> FloatArray:
        """Cells that each block gains."""
        counts = cells_shared(self.drawn, occupied & ~covered, ~occupied & ~covered)
        return counts[:, 0] - waste * counts[:, 1] - self.prices

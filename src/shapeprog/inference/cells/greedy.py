"""The named baseline: cover the cells by axis-aligned boxes, one after another, each exactly the best."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from shapeprog.inference.cells.block_layout import BOX, COUNT1, COUNT2, EXTENT, FIRST, FORM, WIDTH
from shapeprog.inference.cells.blocks import to_program
from shapeprog.language.program import Program
from shapeprog.space import HALF, RESOLUTION


def greedy_boxes(voxels: npt.NDArray[np.bool_], boxes: int = 10) -> Program:
    """At most ``boxes`` boxes, each with the largest count of newly covered occupied minus empty cells.

    No learning, no loops, no search beyond the exact maximum-sum box: a baseline for programs of equal size.
    """
    from shapeprog.inference.cells.box_kernels import heaviest

    weights = np.where(voxels, np.float32(1), np.float32(-1))
    blocks = []
    for _ in range(boxes):
        box = np.zeros(6, np.int64)
        gain = heaviest(weights.reshape(-1), *weights.shape, RESOLUTION, RESOLUTION, 0.0, box)
        if gain <= 0:
            break
        low, high = box[0::2], box[1::2]
        weights[tuple(slice(a, b) for a, b in zip(low, high, strict=True))] = 0
        block = np.zeros(WIDTH)
        block[FORM], block[COUNT1], block[COUNT2] = BOX, 1, 1
        block[FIRST:EXTENT], block[EXTENT : EXTENT + 3] = low - HALF, high - low
        blocks.append(block)
    return to_program(np.stack(blocks)) if blocks else Program()

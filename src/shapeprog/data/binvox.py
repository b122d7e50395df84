"""Binvox files: runs of full and empty cells, the axes x, z, y from slowest to fastest.

The format is Patrick Min's; its cubes are anchored at a corner: cell ``(i, j, k)`` along x, y, z covers
``translate + scale * [i, i + 1) / d`` along x, and so on.
"""

from __future__ import annotations

import math
import os
from pathlib import Path

import numpy as np

from shapeprog.errors import InputError
from shapeprog.space import Array

_HEAD = 4096  # most bytes of a header

_CURE = "write the file again; binvox files start with '#binvox 1' and hold runs of 0 and 1"


def read_binvox(path: str | os.PathLike[str]) -> tuple[Array, Array, float]:
    """Occupied cells (d, d, d) along x, y and z, the corner of the cube and the side of a cell; an ``InputError`` if
    the file is not a binvox file, is truncated, or has values other than 0 and 1."""
    name = Path(path).name
    content = Path(path).read_bytes()
    head, mark, _ = content[:_HEAD].partition(b"data\n")
    lines = {line.split()[0]: line.split()[1:] for line in head.decode("latin-1").splitlines() if line.strip()}
    if not mark or "#binvox" not in lines:
        raise InputError(f"{name} is not a binvox file", _CURE)
    try:
        shape = tuple(int(word) for word in lines["dim"])
        corner = np.array([float(word) for word in lines.get("translate", ["0", "0", "0"])])
        scale = float(lines.get("scale", ["1"])[0])
    except (KeyError, ValueError, IndexError):
        raise InputError(f"{name}: the head of the binvox file cannot be read", _CURE) from None
    good_shape = len(shape) == 3 and shape[0] == shape[1] == shape[2] and 0 < shape[0] <= 1024
    if not good_shape or corner.shape != (3,) or not np.isfinite([*corner, scale]).all() or scale <= 0:
        raise InputError(f"{name}: dim {shape}, translate {corner}, scale {scale} is no cube of cells", _CURE)
    runs = np.frombuffer(content, np.uint8, offset=len(head) + len(mark))
    values, lengths = runs[: len(runs) // 2 * 2 : 2], runs[1::2]
    total, held = math.prod(shape), int(lengths.sum(dtype=np.int64))
    if len(runs) % 2 or held != total:
        raise InputError(f"{name} holds {held} cells where its head says {total}: it is cut short or damaged", _CURE)
    if (values > 1).any():
        raise InputError(f"{name} holds cells with the value {values.max()}; only 0 and 1 have a meaning", _CURE)
    cells = np.repeat(values.astype(np.bool_), lengths)
    return cells.reshape(shape).transpose(0, 2, 1), corner, scale / shape[0]

"""Scenes as plain arrays for the kernels, and the pool of threads that runs them."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor

from shapeprog.geometry.primitive import primitives
from shapeprog.geometry.scene import Scene

Array = npt.NDArray[Any]

BUILT_IN = 2
"""The first kinds of primitive, cuboid and cylinder, are known to the kernels; later ones use their declaration."""

ROW = 17
"""Numbers of one primitive in the table for the kernels."""

_pool: ThreadPoolExecutor | None = None


def array(tensor: Tensor) -> Array:
    """The values of a tensor as a contiguous array, without copying where that is possible."""
    values: Array = tensor.detach().cpu().contiguous().numpy()
    return values


def numbers(tensor: Tensor) -> Array:
    """The values of a tensor as a contiguous array of float64, which is all that kernels take."""
    values: Array = array(tensor).astype(np.float64, copy=False)
    return values


def solids(scene: Scene) -> Array:
    """The primitives of all scenes as rows (B * N, 17) of float64: kind, 4 sizes, centre, rotation row by row.

    The kind is negative for padding and for kinds that only their declaration knows.
    """
    count = scene.mask.numel()
    kind = array(scene.kind).reshape(count)
    table: Array = np.empty((count, ROW))
    table[:, 0] = np.where(array(scene.mask).reshape(count) & (kind < BUILT_IN), kind, -1)
    table[:, 1:5] = array(scene.size).reshape(count, 4)
    table[:, 5:8] = array(scene.centre).reshape(count, 3)
    table[:, 8:] = array(scene.rotation).reshape(count, 9)
    return table


def slopes(table: Array, like: Tensor, *shape: int) -> tuple[Tensor, Tensor, Tensor]:
    """Gradient by sizes, centres and rotations of scenes (B, N) from rows of gradient by :func:`solids`."""
    found = torch.from_numpy(table).to(like).reshape(*shape, ROW)
    return found[..., 1:5], found[..., 5:8], found[..., 8:].unflatten(-1, (3, 3))


def declared_kinds(scene: Scene) -> list[int]:
    """Kinds of primitive in use that only their declaration knows."""
    if len(primitives) <= BUILT_IN:
        return []
    return [kind for kind in torch.unique(scene.kind[scene.mask]).tolist() if kind >= BUILT_IN]


def over_threads(work: Callable[[int, int], None], count: int, *, least: int = 1) -> None:
    """Run ``work(first, last)`` on parts of ``range(count)``, one for each of torch's threads.

    The kernels hold no lock of the interpreter.  Fewer than ``least`` items for each thread run right here.
    """
    threads = min(torch.get_num_threads(), count // max(least, 1))
    if threads <= 1:
        work(0, count)
        return
    cuts = [count * part // threads for part in range(threads + 1)]
    jobs = [_threads().submit(work, cuts[part], cuts[part + 1]) for part in range(1, threads)]
    work(cuts[0], cuts[1])
    for job in jobs:
        job.result()


def _threads() -> ThreadPoolExecutor:
    global _pool
    if _pool is None:
        _pool = ThreadPoolExecutor(max(1, (os.cpu_count() or 2) - 1), thread_name_prefix="shapeprog")
    return _pool


def _forget_threads() -> None:
    global _pool
    _pool = None


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_forget_threads)

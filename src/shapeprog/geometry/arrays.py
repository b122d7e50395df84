"""Between tensors and kernels: the table of primitives, and threads."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from functools import cache, wraps
from typing import Any

import numpy as np
from threadpoolctl import ThreadpoolController

from shapeprog.errors import ShapeProgError
from shapeprog.geometry.batch import Batch
from shapeprog.kernels.table import CENTRE, ROTATION, SIZE, WIDTH
from shapeprog.lazy_torch import Tensor, torch
from shapeprog.space import Array


def array(tensor: Tensor) -> Array:
    """The values of a tensor as a contiguous array, without copying where that is possible."""
    return tensor.detach().cpu().contiguous().numpy()


def numbers(tensor: Tensor) -> Array:
    """The values of a tensor as a contiguous array of float64, which is all that kernels take."""
    return array(tensor).astype(np.float64, copy=False)


def cast(values: Array, like: Tensor) -> Tensor:
    """An array as a tensor of another's type and device, cast by numpy: torch wakes threads that occupy the cores."""
    with np.errstate(over="ignore"):  # beyond single precision is infinite
        values = np.ascontiguousarray(values, array(like[:0]).dtype)
    return torch.from_numpy(values).to(like.device)


def table_of(batch: Batch) -> Array:
    """All primitives as rows of the table (B * N, WIDTH) for kernels, see ``kernels.table``."""
    mask = array(batch.mask)
    kind, rotation = np.where(mask, array(batch.kind), -1), array(batch.rotation).reshape(*mask.shape, 9)
    columns = kind[..., None], array(batch.size), array(batch.centre), rotation
    return np.concatenate(columns, -1, dtype=np.float64).reshape(-1, WIDTH)


def gradients(table: Array, like: Tensor, *shape: int) -> tuple[Tensor, Tensor, Tensor]:
    """Gradient by sizes, centres and rotations of primitives (B, N) from rows of gradient by :func:`table_of`."""
    tensors = torch.from_numpy(table).to(like).reshape(*shape, WIDTH)
    return tensors[..., SIZE:CENTRE], tensors[..., CENTRE:ROTATION], tensors[..., ROTATION:].unflatten(-1, (3, 3))


def first_order(backward: Callable[..., Any]) -> Callable[..., Any]:
    """Declare a backward step whose own derivative is not known: asked for it, torch would take zero."""

    @wraps(backward)
    def checked(*arguments: Any) -> Any:
        if torch.is_grad_enabled():  # create_graph=True
            raise ShapeProgError(
                "the renderer has no second derivatives", "call backward or torch.autograd.grad without create_graph"
            )
        return backward(*arguments)

    return checked


_kernel_threads = 0  # threads that kernels run in; 0 for as many as torch has


@contextmanager
def one_thread(kernels: int = 0) -> Iterator[None]:
    """Let torch and the linear algebra of NumPy compute in one thread within: idle threads would spin on the cores, and
    sums of several threads differ in their last digits from those of one.

    Kernels keep as many threads as there were, or run in ``kernels``.
    """
    global _kernel_threads
    before = torch.get_num_threads(), _kernel_threads
    torch.set_num_threads(1)
    _kernel_threads = kernels or before[1] or before[0]
    try:
        with _libraries().limit(limits=1, user_api="blas"):
            yield
    finally:
        torch.set_num_threads(before[0])
        _kernel_threads = before[1]


def over_threads(work: Callable[[int, int], None], count: int, *, least: int = 1) -> None:
    """Run ``work(first, last)`` on parts of ``range(count)``, one for each thread of kernels.

    The kernels hold no lock of the interpreter.  Fewer than ``least`` items for each thread run right here.
    """
    threads = min(_kernel_threads or torch.get_num_threads(), count // max(least, 1))
    if threads <= 1:
        work(0, count)
        return
    cuts = [count * part // threads for part in range(threads + 1)]
    jobs = [_threads().submit(work, *cuts[part : part + 2]) for part in range(1, threads)]
    work(0, cuts[1])
    for job in jobs:
        job.result()


@cache
def _libraries() -> ThreadpoolController:
    """The libraries of linear algebra that are loaded at the first call: those of NumPy and SciPy."""
    return ThreadpoolController()


@cache
def _threads() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(max(1, (os.cpu_count() or 2) - 1), thread_name_prefix="shapeprog")


if hasattr(os, "register_at_fork"):  # threads do not survive a fork
    os.register_at_fork(after_in_child=_threads.cache_clear)

"""The engine: processes, device and precision through accelerate, and batches that are made ahead of their step.

Under ``torchrun`` or ``accelerate launch`` every process runs the same program.  There is no wrapper around the
network: gradients are averaged in one message after each backward pass, so any method of a module can be trained.
"""

from __future__ import annotations

import contextlib
import ctypes
import sys
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any, TypeVar

import torch
from torch import Tensor, nn

from shapeprog.errors import ShapeProgError
from shapeprog.kernels.bits import FIRST, GOLDEN, SECOND

AHEAD = 2
"""Batches that are made while a step is under way."""

Made = TypeVar("Made")


class Engine:
    """Where training runs.

    Parameters
    ----------
    device
        ``auto`` is a GPU where there is one; ``cpu``; or ``cuda``.
    precision
        ``bf16`` or ``float32``.  There is no fp16, which is hundreds of times slower on a CPU.
    threads
        Threads of torch in each process; by default its own choice.

    Raises
    ------
    ShapeProgError
        If accelerate is not installed, or the device is not there.
    """

    def __init__(self, device: str = "auto", precision: str = "float32", threads: int | None = None) -> None:
        try:
            from accelerate import Accelerator
        except ImportError as error:
            raise ShapeProgError("training needs accelerate", "pip install 'shapeprog[train]'") from error
        if device not in ("auto", "cpu", "cuda"):
            raise ShapeProgError(f"there is no device {device!r}", "choose auto, cpu or cuda")
        if device == "cuda" and not torch.cuda.is_available():
            raise ShapeProgError("torch finds no GPU", "use --device cpu, or install a build of torch for your GPU")
        try:
            self._accelerator = Accelerator(cpu=device == "cpu" or not torch.cuda.is_available())
        except ValueError as error:
            raise ShapeProgError(f"cannot train on {device!r} now: {error}", "start a new process") from error
        if threads is not None:
            torch.set_num_threads(threads)
        self.device: torch.device = self._accelerator.device
        self._precision = precision

    @property
    def processes(self) -> int:
        """How many processes train together."""
        return int(self._accelerator.num_processes)

    @property
    def rank(self) -> int:
        """Number of this process."""
        return int(self._accelerator.process_index)

    @property
    def writes(self) -> bool:
        """Whether this is the process that writes files and speaks: the first."""
        return bool(self._accelerator.is_main_process)

    def place(self, module: nn.Module) -> nn.Module:
        """The module on the device, its 3D convolutions with channels last, which is faster on all devices."""
        module.to(self.device)
        for weight in module.parameters():
            if weight.dim() == 5:
                weight.data = weight.data.contiguous(memory_format=torch.channels_last_3d)
        return module

    def autocast(self) -> contextlib.AbstractContextManager[Any]:
        """Run what is inside in the precision of the engine."""
        if self._precision == "float32":
            return contextlib.nullcontext()
        return torch.autocast(self.device.type, dtype=torch.bfloat16)

    def random(self, seed: int, step: int) -> torch.Generator:
        """The source of everything random in one step of one process; seeds torch's own for dropout as well."""
        number = scrambled(seed, step, self.rank)
        torch.manual_seed(number)
        return torch.Generator(self.device).manual_seed(number)

    def average(self, tensors: Sequence[Tensor]) -> None:
        """Replace tensors by their mean over the processes, all in one message."""
        if self.processes == 1 or not tensors:
            return
        from accelerate.utils import reduce

        flat: Any = reduce(torch.cat([each.flatten().float() for each in tensors]), "mean")
        for each, mean in zip(tensors, flat.split([each.numel() for each in tensors]), strict=True):
            each.copy_(mean.view(each.shape))

    def average_gradients(self, weights: Sequence[Tensor]) -> list[Tensor]:
        """The gradients of weights, each the mean over the processes; one that a process lacks counts as zero there."""
        if self.processes > 1:
            for weight in weights:
                if weight.grad is None:
                    weight.grad = torch.zeros_like(weight)
        gradients = [weight.grad for weight in weights if weight.grad is not None]
        self.average(gradients)
        return gradients

    def share(self, value: Made) -> Made:
        """The value that the first process has."""
        if self.processes == 1:
            return value
        from accelerate.utils import broadcast_object_list

        return broadcast_object_list([value])[0]

    def wait(self) -> None:
        """Wait until every process is here."""
        self._accelerator.wait_for_everyone()

    def ahead(self, make: Callable[[int], Made], steps: Iterable[int]) -> Iterator[Made]:
        """What ``make`` returns for this process's index of each step, in order, made in a thread of its own."""
        waiting: deque[Future[Made]] = deque()
        with ThreadPoolExecutor(1, thread_name_prefix="shapeprog-data") as pool:
            try:
                for step in steps:
                    waiting.append(pool.submit(make, step * self.processes + self.rank))
                    if len(waiting) > AHEAD:
                        yield waiting.popleft().result()
                while waiting:
                    yield waiting.popleft().result()
            finally:
                for future in waiting:
                    future.cancel()


def scrambled(*numbers: int) -> int:
    """One seed of 63 bits from several numbers; nearby ones give unrelated seeds (the mixing of splitmix64)."""
    state = 0
    for number in numbers:
        state = (state + number + GOLDEN) % 2**64
        state = (state ^ state >> 30) * FIRST % 2**64
        state = (state ^ state >> 27) * SECOND % 2**64
        state ^= state >> 31
    return state >> 1


def tune_allocator() -> bool:
    """Keep freed memory for the next step instead of handing it back; 1.4 to 2 times faster on Linux.

    For commands that only train: the process keeps the most it has ever used.  Returns whether it could be done,
    which takes glibc.
    """
    if not sys.platform.startswith("linux"):
        return False
    mmap_max, trim_threshold, top_pad = -4, -1, -2
    try:
        mallopt = ctypes.CDLL("libc.so.6").mallopt
    except (OSError, AttributeError):
        return False
    return all(
        mallopt(name, value) == 1 for name, value in ((mmap_max, 0), (trim_threshold, 2**31 - 1), (top_pad, 256 << 20))
    )

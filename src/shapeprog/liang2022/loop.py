"""The training loop: batch, loss, step, record.

Batches and samples are functions of the seed and the step, so a run resumes exactly.  Under ``torchrun`` every process
runs the same program: gradients and running statistics are averaged in one message after each backward pass.
"""

from __future__ import annotations

import contextlib
import ctypes
import io
import itertools
import json
import math
import os
import sys
import threading
import time
import zipfile
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

import torch
import torch.distributed as dist
from torch import Tensor, nn
from torch.optim import AdamW

from shapeprog.errors import InputError, ShapeProgError
from shapeprog.files import lock, make_folder, output_error, write_bytes, write_text
from shapeprog.liang2022.prior import scramble
from shapeprog.liang2022.settings import BEST, LOG, STATE, WEIGHTS, TrainingSettings
from shapeprog.liang2022.weights import save_weights

SAVE_SECONDS = 120.0  # time between saved states
Record = dict[str, float]  # values of one step by name, step and samples_seen among them


@runtime_checkable
class Task(Protocol):
    """A network, its data and its losses."""

    data: str  # what it learns from, for the card of the weights

    @property
    def module(self) -> nn.Module:
        """All that learns."""

    @property
    def network(self) -> nn.Module:
        """The part that is saved."""

    def batch(self, index: int) -> Any:
        """The batch of an index, always the same; called from another thread."""

    def losses(self, batch: Any, progress: float, rng: torch.Generator) -> dict[str, Tensor]:
        """Scalars whose sum is minimised; names that begin with ``_`` are reported and not added."""

    def validate(self) -> Record:
        """Scores by name, ``score`` among them, the larger the better."""


def train(
    task: Task, settings: TrainingSettings, folder: str | Path, *, device: str = "auto", restart: bool = False,
    stop: threading.Event | None = None, command: str = "",
) -> Iterator[Record]:  # fmt: skip
    """Train, yielding one record per step: it goes on only while the records are read.

    The folder gets ``state.pt`` (weights, optimiser, step, settings) as it was before the first step, every two minutes
    and at the end, ``log.jsonl``, and after each validation ``weights.safetensors``, and ``best.safetensors`` where the
    score is the best so far.  A run in it is resumed, or with ``restart`` overwritten after the first loss.  The device
    is ``auto``, ``cpu`` or ``cuda``.  Once ``stop`` is set, the state is saved after the current step and
    training ends.  The card of the weights holds ``command``.  Raises a ``ShapeProgError`` if the saved run has other
    settings, another process trains there, the loss is not finite, or a file cannot be written; the last state stays.
    """
    rank, world, where = _processes(device)
    module = task.module.to(where).to(memory_format=torch.channels_last_3d).train()  # type: ignore[call-overload]
    weights = [weight for weight in module.parameters() if weight.requires_grad]
    buffers = [buffer for buffer in module.buffers() if buffer.is_floating_point()]
    optimiser = AdamW(weights, betas=(settings.beta1, 0.999), weight_decay=settings.weight_decay)
    together = settings.batch_size * world
    steps, step, best = math.ceil(settings.num_shapes / together), 0, -math.inf
    folder = make_folder(folder)
    with (folder / "lock").open("a") as stream:
        if rank == 0 and not lock(stream.fileno()):
            raise ShapeProgError(f"another process trains in {folder}", "wait for it, or choose another folder")
        if (folder / STATE).exists() and not restart:
            step, best = _resume(folder / STATE, settings, module, optimiser)
        if rank == 0 and step:
            records = [record for record in read_log(folder / LOG) if record["step"] <= step]
            write_text(folder / LOG, "".join(f"{json.dumps(record)}\n" for record in records))

        def state_now() -> bytes:
            state: dict[str, Any] = {"settings": asdict(settings), "step": step, "best": best}
            state |= {"module": module.state_dict(), "optimiser": optimiser.state_dict()}
            torch.save(state, content := io.BytesIO())
            return content.getvalue()

        begun = state_now() if rank == 0 and not step else b""  # written after the first loss, which may fail
        saved, saved_at = step, time.monotonic()
        clock = time.monotonic()
        for batch in _prefetch(task.batch, range(step * world + rank, steps * world, world)):
            for group in optimiser.param_groups:
                group["lr"] = settings.learning_rate_at(step * together)
            seed = scramble(settings.seed, step, rank)
            torch.manual_seed(seed)
            rng = torch.Generator(where).manual_seed(seed)
            losses = task.losses(batch, step / steps, rng)
            loss = torch.stack([value.float() for name, value in losses.items() if name[0] != "_"]).sum()
            optimiser.zero_grad()
            loss.backward()
            stopping = torch.tensor(float(stop is not None and stop.is_set()), device=where)
            values = torch.stack([value.detach().float() for value in (loss, stopping, *losses.values())])
            if world > 1:
                for weight in weights:
                    weight.grad = torch.zeros_like(weight) if weight.grad is None else weight.grad
                _average([*(weight.grad for weight in weights if weight.grad is not None), *buffers, values])
            norm = float(torch.nn.utils.clip_grad_norm_(weights, settings.clip_norm or math.inf))
            total, stopped, *parts = values.tolist()
            if begun:
                write_bytes(folder / STATE, begun)
                write_text(folder / LOG, "")
                begun = b""
            if not math.isfinite(total + norm):
                added = [(name, value) for name, value in zip(losses, parts, strict=True) if name[0] != "_"]
                wrong = ", ".join(repr(name) for name, value in added if not math.isfinite(value))
                by = f" because of {wrong}" if wrong else ""
                cause = f"the loss of step {step + 1} is {total}{by}, the norm of its gradient {norm}"
                cure = "start over with --restart and a lower learning rate"
                if not step:  # no step was taken, so that the rate cannot be the reason
                    cure = "correct the loss, the initial weights or the shapes, then start over with --restart"
                raise ShapeProgError(cause, f"{cure}; {folder} holds the state of step {saved}" if rank == 0 else cure)
            optimiser.step()
            step += 1
            record = {"step": step, "samples_seen": step * together, "loss": total, "gradient_norm": norm}
            record |= {name.lstrip("_"): value for name, value in zip(losses, parts, strict=True)}
            record |= {"learning_rate": optimiser.param_groups[0]["lr"], "seconds": time.monotonic() - clock}
            if rank == 0:
                every, last = settings.validate_every, step == steps
                if last or (every and step * together // every > (step - 1) * together // every):
                    module.eval()
                    with torch.no_grad():
                        scores = {name: value for name, value in task.validate().items() if math.isfinite(value)}
                    module.train()
                    record |= {f"val_{name}": value for name, value in scores.items()}
                    improved = scores.get("score", -math.inf) > best
                    card: dict[str, Any] = {"data": task.data, "seed": settings.seed, "command": command}
                    for name in (WEIGHTS, BEST) if improved else (WEIGHTS,):
                        save_weights(folder / name, task.network, samples_seen=step * together, scores=scores, **card)
                    best = max(best, scores.get("score", -math.inf))
                append_line(folder / LOG, json.dumps({k: v for k, v in record.items() if math.isfinite(v)}))
                if last or stopped or time.monotonic() - saved_at >= SAVE_SECONDS:
                    write_bytes(folder / STATE, state_now())
                    saved, saved_at = step, time.monotonic()
            yield record
            if stopped:
                return
            clock = time.monotonic()


def read_log(path: Path) -> list[Any]:
    """Records of a file, one a line, none if it is missing; a last line that was cut short is left out."""
    lines = path.read_bytes().splitlines(keepends=True) if path.exists() else []
    try:
        return [json.loads(line) for line in lines if line.endswith(b"\n")]
    except ValueError as error:
        raise InputError(f"the log {path} is damaged", "move it away, or start over with --restart") from error


def tune_allocator() -> None:
    """Keep freed memory for the next step on Linux, which makes 3D convolutions up to twice as fast."""
    if sys.platform.startswith("linux"):
        with contextlib.suppress(OSError, AttributeError):
            libc = ctypes.CDLL("libc.so.6")
            for option, value in ((-4, 0), (-1, 2**31 - 1), (-2, 256 << 20)):  # M_MMAP_MAX, M_TRIM_THRESHOLD, M_TOP_PAD
                libc.mallopt(option, value)


def _processes(device: str) -> tuple[int, int, torch.device]:
    """Rank, number of processes and device; joins the process group of ``torchrun``."""
    if device not in ("auto", "cpu", "cuda"):
        raise ShapeProgError(f"unknown device {device!r}", "choose auto, cpu or cuda")
    if device == "cuda" and not torch.cuda.is_available():
        raise ShapeProgError("torch finds no GPU", "use --device cpu, or install a build of torch for your GPU")
    gpu = device != "cpu" and torch.cuda.is_available()
    if "RANK" not in os.environ:
        return 0, 1, torch.device("cuda" if gpu else "cpu")
    if not dist.is_initialized():
        dist.init_process_group("nccl" if gpu else "gloo")
    local = int(os.environ.get("LOCAL_RANK", "0"))
    return dist.get_rank(), dist.get_world_size(), torch.device(f"cuda:{local}" if gpu else "cpu")


def _average(tensors: Sequence[Tensor]) -> None:
    """Replace tensors by their mean over the processes."""
    flat = torch.cat([tensor.flatten().float() for tensor in tensors])
    dist.all_reduce(flat)
    for tensor, mean in zip(tensors, flat.split([tensor.numel() for tensor in tensors]), strict=True):
        tensor.copy_(mean.view(tensor.shape) / dist.get_world_size())


def _prefetch(make: Callable[[int], Any], indices: Iterable[int]) -> Iterator[Any]:
    """Batches of indices in order; the next is made in another thread."""
    with ThreadPoolExecutor(1) as pool:
        coming: Iterator[Any] = (pool.submit(make, index) for index in indices)
        for batch, _ in itertools.pairwise(itertools.chain(coming, [None])):
            yield batch.result()


def _resume(path: Path, settings: TrainingSettings, module: nn.Module, optimiser: AdamW) -> tuple[int, float]:
    """Load the state of a run, by torch's reader that runs no code; its step and best score."""
    try:
        with zipfile.ZipFile(path) as archive:
            if archive.testzip():  # torch does not compare the checksums
                raise ValueError
        state = torch.load(path, map_location="cpu", weights_only=True)
        settings.check_resumable(state["settings"], str(path.parent))
        module.load_state_dict(state["module"])
        optimiser.load_state_dict(state["optimiser"])
        return int(state["step"]), float(state["best"])
    except ShapeProgError:
        raise
    except Exception as error:  # no list of what torch raises for a state that is damaged or does not fit
        raise InputError(f"{path} is damaged, or of another network", "start over with --restart") from error


def append_line(path: str | Path, line: str) -> None:
    """Add a line to a file; an ``OutputError`` if it does not fit on the disk, where it may lack its end."""
    remaining = f"{line}\n".encode()
    try:
        with Path(path).open("ab", buffering=0) as stream:  # a buffer would fail again when it is closed
            while remaining:
                remaining = remaining[stream.write(remaining) :]
    except OSError as error:
        raise output_error(Path(path), error) from error

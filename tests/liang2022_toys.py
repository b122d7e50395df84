"""What tests of the paper's package share: small networks, a few targets, and a task that trains in no time.

    torchrun --nproc-per-node 2 tests/liang2022_toys.py FOLDER

trains that task in several processes, in one go in FOLDER/whole and in two parts in FOLDER/parts.
"""

from __future__ import annotations

import os
import sys
import threading
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor, nn

from shapeprog.data.cells import points_of_cells
from shapeprog.data.packs import write_pack
from shapeprog.data.shape import Shape
from shapeprog.liang2022.fast import Fast, FastSettings
from shapeprog.liang2022.generator import Generator
from shapeprog.liang2022.loop import Record, train
from shapeprog.liang2022.prior import PRIORS
from shapeprog.liang2022.settings import TrainingSettings
from shapeprog.liang2022.tian2019 import Tian2019, Tian2019Settings

SMALL = FastSettings(widths=(4, 8, 8), squeeze=8, feature=32)
TOY = TrainingSettings(num_shapes=80, batch_size=4, validate_every=20, warm_up=8, clip_norm=1.0, weight_decay=0.01)


def small(design: str = "fast") -> Generator:
    """A generator with random weights, none of them zero, always the same; in evaluation mode."""
    torch.manual_seed(0)
    generator = Fast(SMALL) if design == "fast" else Tian2019(Tian2019Settings())
    if isinstance(generator, Fast):
        for weight in (*generator.offset_head[-1].parameters(), *generator.block_memory.parameters()):
            nn.init.normal_(weight, std=0.3)
    return generator.eval()


def targets(count: int = 4) -> Tensor:
    """Cells of synthetic tables and chairs."""
    return PRIORS["narrow"].batch(count, 5, 0).voxels


def write_targets(path: Path, count: int = 4) -> Path:
    """A pack of them, with points."""
    grids = [each.astype(np.bool_) for each in targets(count).numpy()]
    write_pack(path, [Shape(f"s{n}", grid, points_of_cells(grid, 500)) for n, grid in enumerate(grids)])
    return path


class Toy:
    """A small network with running statistics and dropout, and noise in its loss."""

    def __init__(self) -> None:
        torch.manual_seed(0)
        layers = nn.Linear(8, 16), nn.BatchNorm1d(16), nn.ReLU(), nn.Dropout(0.2), nn.Linear(16, 1)
        self.module = self.network = nn.Sequential(*layers)
        self.data = "noise"

    def batch(self, index: int) -> Tensor:
        return torch.randn(4, 8, generator=torch.Generator().manual_seed(index))

    def losses(self, batch: Tensor, progress: float, rng: torch.Generator) -> dict[str, Tensor]:
        miss = self.module(batch)[:, 0] - batch.sum(-1) + 0.1 * torch.randn(4, generator=rng)
        return {"square": miss.square().mean(), "size": 0.01 * progress * miss.abs().mean(), "_worst": miss.abs().max()}

    def validate(self) -> Record:
        batch = self.batch(10**6)
        return {"score": -float((self.module(batch)[:, 0] - batch.sum(-1)).square().mean())}


def run(
    folder: Path, *, stop_at: int = 0, task: Any = None, settings: TrainingSettings = TOY, command: str = ""
) -> tuple[Any, list[Record]]:
    """Train, asking to stop after a step; the task, and the records without times."""
    task, stop, records = task or Toy(), threading.Event(), []
    for record in train(task, settings, folder, device="cpu", stop=stop, command=command):
        if record["step"] == stop_at:
            stop.set()
        records.append({name: value for name, value in record.items() if name != "seconds"})
    return task, records


def same(one: Any, two: Any) -> bool:
    """Whether two states are equal bit for bit."""
    if isinstance(one, Tensor):
        return torch.equal(one, two)
    if isinstance(one, dict):
        return one.keys() == two.keys() and all(same(one[key], two[key]) for key in one)
    if isinstance(one, list | tuple):
        return len(one) == len(two) and all(map(same, one, two))
    return bool(one == two)


if __name__ == "__main__":
    torch.set_num_threads(1)
    place = Path(sys.argv[1])
    run(place / "whole")
    run(place / "parts", stop_at=3)
    torch.distributed.barrier()  # the first process has written the state
    last, _ = run(place / "parts")
    torch.save(last.module.state_dict(), place / f"rank{os.environ['RANK']}.pt")
    torch.distributed.destroy_process_group()

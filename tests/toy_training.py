"""A small regression that the training loop can run in no time, and a program that trains it."""

from __future__ import annotations

import sys
import time
from pathlib import Path

import torch
from torch import Tensor, nn

from shapeprog.training.engine import Engine
from shapeprog.training.loop import run
from shapeprog.training.settings import Settings


class Toy:
    """Learns a fixed linear map from batches that are a function of their index; its loss is a mean over the batch."""

    def __init__(self, shapes: int = 4, together: int = 1, pause: float = 0.0) -> None:
        torch.manual_seed(3)
        self.module = nn.Sequential(nn.Conv3d(1, 4, 3), nn.Flatten(), nn.Dropout(0.2), nn.Linear(32, 3))
        self._shapes, self._together, self._pause = shapes, together, pause

    def batch(self, index: int) -> tuple[Tensor, Tensor]:
        parts = []
        for each in range(index * self._together, (index + 1) * self._together):
            random = torch.Generator().manual_seed(each)
            parts.append(torch.randn(self._shapes, 1, 4, 4, 4, generator=random))
        inputs = torch.cat(parts)
        return inputs, inputs.flatten(1)[:, :3] * 2 - 1

    def loss(self, batch: tuple[Tensor, Tensor], progress: float, random: torch.Generator) -> dict[str, Tensor]:
        time.sleep(self._pause)
        inputs, wanted = batch
        if self._together == 1 and self._pause == 0.0:
            inputs = inputs + 0.01 * torch.randn(inputs.shape, generator=random)
        off = (self.module(inputs) - wanted).square().mean()
        return {"fit": off, "_progress": torch.tensor(progress)}

    def validate(self) -> dict[str, float]:
        inputs, wanted = self.batch(10**6)
        return {"score": -float((self.module(inputs) - wanted).square().mean()), "odd": float("inf")}

    def save(self, path: Path, visits: int, scores: dict[str, float]) -> None:
        assert "odd" not in scores
        path.write_text(str(visits))


def plain(shapes: int, together: int) -> Toy:
    """One whose loss is a function of the batch alone."""
    toy = Toy(shapes, together)
    toy.module[2] = nn.Identity()
    toy.loss = lambda batch, progress, random: {"fit": (toy.module(batch[0]) - batch[1]).square().mean()}  # type: ignore[method-assign]
    return toy


if __name__ == "__main__":
    kind, folder, visits = sys.argv[1], Path(sys.argv[2]), int(sys.argv[3])
    engine = Engine("cpu", threads=1)
    toy = plain(4, 1) if kind == "plain" else Toy(pause=0.02)
    for record in run(toy, Settings(visits=visits, batch=4), folder, engine, save_seconds=0.1):
        print(int(record["step"]), flush=True)
    if kind == "plain":
        torch.save(toy.module.state_dict(), folder / f"rank{engine.rank}.pt")

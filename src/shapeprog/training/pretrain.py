"""Pretraining: the generator learns from synthetic furniture, whose programs are known.

Ids are taught by cross-entropy and parameters by the loss of the design, on the canvases of the program itself
(teacher forcing) and, for a share of the shapes, on canvases that the generator drew (scheduled sampling).
"""

from __future__ import annotations

import threading
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar, Literal

import torch
from torch import Tensor

from shapeprog.data.synthetic import Stream, prior
from shapeprog.errors import ShapeProgError
from shapeprog.models.checkpoint import card_of, load_generator, save_checkpoint
from shapeprog.models.designs import build_generator
from shapeprog.models.generator import Generator
from shapeprog.training.engine import Engine
from shapeprog.training.folder import Record
from shapeprog.training.lessons import Lesson, lesson, lesson_losses
from shapeprog.training.loop import run
from shapeprog.training.settings import Settings
from shapeprog.training.validation import Validation


@dataclass(frozen=True, kw_only=True)
class PretrainSettings(Settings):
    """What pretraining is told, besides what every training is.

    Parameters
    ----------
    design
        Name of the network.
    prior
        Name of the synthetic furniture it learns from.
    shapes
        Number of different shapes, seen again and again; 0 for an endless stream.
    blocks
        Most blocks of a program.
    order
        ``coverage``: the block that newly covers most is the next one; ``written``: as the prior wrote them.
    rows
        Canvases that are learned from in each shape, drawn at random; 0 for all.
    sampled
        Share of the steps on whose canvases the generator draws itself, reached halfway.
    ids_weight, parameters_weight
        How much the two losses count.
    """

    batch: int = 48
    rate: float = 2e-3
    warm_up: int = 4800
    optimiser: Literal["adam", "adamw"] = "adamw"
    decay: float = 0.01
    clip: float = 1.0
    precision: Literal["bf16", "float32"] = "bf16"
    validate_every: int = 20_000
    design: str = "chained"
    prior: str = "wide"
    shapes: int = 0
    blocks: int = 10
    order: Literal["coverage", "written"] = "coverage"
    rows: int = 3
    sampled: float = 0.3
    ids_weight: float = 1.0
    parameters_weight: float = 1.0

    CHOICES: ClassVar[Mapping[str, tuple[str, ...]]] = {**Settings.CHOICES, "order": ("coverage", "written")}


PRESETS: dict[str, PretrainSettings] = {
    "default": PretrainSettings(),
    "tian2019": PretrainSettings(
        design="tian2019", prior="narrow", shapes=120_000, visits=20 * 120_000, batch=32, rate=1e-3,
        schedule="constant", warm_up=0, optimiser="adam", decay=0.0, clip=0.1, clip_by="value", order="written",
        rows=0, sampled=0.0, parameters_weight=3.0, precision="float32", validate_every=120_000,
    ),
}  # fmt: skip
"""Settings by name: ours, and those of Tian et al. 2019, section B."""


class Pretraining:
    """What pretraining minimises; an objective of the loop.

    Parameters
    ----------
    generator
        What learns.
    settings
        How.
    device
        Where the data is made.
    packs
        Files of real shapes to validate on too.
    command
        How to make the weights again, for their card.
    """

    def __init__(
        self,
        generator: Generator,
        settings: PretrainSettings,
        device: torch.device | str = "cpu",
        packs: Sequence[Path] = (),
        command: str = "",
    ) -> None:
        self.module, self._settings, self._command = generator, settings, command
        self._stream = Stream(
            prior(settings.prior), settings.batch, seed=settings.seed, blocks=settings.blocks, device=device
        )
        self._validation = Validation(settings.prior, settings.blocks, settings.order, packs, device)

    def batch(self, index: int) -> Lesson:
        """The lesson of a batch of the stream."""
        different = self._settings.shapes // self._settings.batch
        made = self._stream[index % different if different else index]
        return lesson(made.voxels, made.code, self._settings.order)

    def loss(self, batch: Lesson, progress: float, random: torch.Generator) -> dict[str, Tensor]:
        """Cross-entropy of ids and loss of parameters, as means over live steps."""
        settings = self._settings
        terms = lesson_losses(
            self.module, batch, sampled=settings.sampled, rows=settings.rows, progress=progress, random=random
        )
        weights = {"ids": settings.ids_weight, "parameters": settings.parameters_weight}
        return {name: weights[name] * value for name, value in terms.items()}

    def validate(self) -> Record:
        """Scores on fixed synthetic shapes and on the packs."""
        return self._validation(self.module)

    def save(self, path: Path, visits: int, scores: Record) -> None:
        """Write the generator with its card."""
        told = f"synthetic, prior {self._settings.prior}"
        card = card_of(
            self.module, data=told, seed=self._settings.seed, command=self._command, visits=visits, scores=dict(scores)
        )
        save_checkpoint(path, self.module, card)


def pretrain(
    folder: Path,
    settings: PretrainSettings,
    engine: Engine,
    *,
    packs: Sequence[Path] = (),
    start: str | None = None,
    command: str = "",
    restart: bool = False,
    stop: threading.Event | None = None,
    tensorboard: bool = False,
) -> Iterator[Record]:
    """Pretrain a generator, yielding one record per step; see :func:`shapeprog.training.loop.run`.

    Parameters
    ----------
    packs
        Files of real shapes to validate on too.
    start
        Weights to begin from: a file, or the name of weights that ship; by default random ones.
    command
        How to make the weights again, for their card.

    Raises
    ------
    ShapeProgError
        If the settings do not fit the run in the folder, or the weights to begin from.
    """
    torch.manual_seed(settings.seed)
    generator = build_generator(settings.design) if start is None else load_generator(start)[0]
    if generator.design != settings.design:
        raise ShapeProgError(
            f"the weights {start} are of the design {generator.design}, not {settings.design}",
            f"train with --design {generator.design}",
        )
    objective = Pretraining(generator, settings, engine.device, packs, command)
    return run(objective, settings, folder, engine, restart=restart, stop=stop, tensorboard=tensorboard)

"""Adaptation: the generator learns from real shapes, whose programs are not known.

It writes a program for each shape; the program is drawn, compared with the shape, and what the comparison says flows
back through the drawing into the generator.  Which terms compare makes the method: through the neural executor
(*guided*, Tian et al. 2019), through the analytic renderer (*direct*, Liang 2022), through both (*hybrid*); or programs
that a search found are taught (*distill*), alone or beside any of these.
"""

from __future__ import annotations

import threading
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import torch
from jaxtyping import Float
from torch import Tensor, nn

from shapeprog.data.packs import read_pack
from shapeprog.errors import ShapeProgError
from shapeprog.evaluation.generated import code_iou, scores_on_packs
from shapeprog.geometry.cells import iou, pack
from shapeprog.geometry.losses import occupancy_cross_entropy
from shapeprog.geometry.surface import has_surface
from shapeprog.language.tensors import Code
from shapeprog.language.unroll import Plan
from shapeprog.models.checkpoint import card_of, load_executor, load_generator, save_checkpoint
from shapeprog.models.decoding import Choice, decode
from shapeprog.models.executor import NeuralExecutor
from shapeprog.models.generator import Generator, Prediction
from shapeprog.training import choices
from shapeprog.training.adapt_settings import AdaptSettings
from shapeprog.training.engine import Engine
from shapeprog.training.folder import Record
from shapeprog.training.lessons import Lesson
from shapeprog.training.loop import run
from shapeprog.training.shapes import Targets, TargetStream
from shapeprog.training.teaching import Teaching, teach
from shapeprog.training.terms import NEURAL, Comparison, compare, lacking

FLOOR = 0.1
"""Added to a loss before its logarithm is taken to judge ids, so that perfection is not worth everything."""


class Work(NamedTuple):
    """What one step learns from."""

    targets: Targets | None
    taught: Lesson | None


class Learner(nn.Module):
    """All that learns: the generator, and with NVIL the network that says what to expect."""

    def __init__(self, generator: Generator, baseline: choices.Baseline | None) -> None:
        super().__init__()
        self.generator = generator
        self.baseline = baseline


class Adaptation:
    """What adaptation minimises; an objective of the loop.

    Parameters
    ----------
    generator
        What learns.
    settings
        How, and from what.
    executor
        The neural executor, where the loss asks for it; it stays as it is.
    val
        Packs to validate on.
    device
        Where the data goes.
    origin, command
        The weights it began with, and how to make the new ones again, for their card.
    """

    def __init__(
        self,
        generator: Generator,
        settings: AdaptSettings,
        executor: NeuralExecutor | None = None,
        val: Sequence[Path] = (),
        device: torch.device | str = "cpu",
        origin: str = "",
        command: str = "",
    ) -> None:
        self._settings, self._device, self._origin, self._command = settings, torch.device(device), origin, command
        self._generator = generator
        baseline = choices.Baseline(_width(generator)) if settings.ids == "nvil" else None
        self.module = Learner(generator, baseline)
        if settings.learn == "offsets":
            _freeze_all_but_offsets(generator)
        self._executor = None if executor is None else executor.to(device).eval().requires_grad_(False)
        self._targets = self._teaching = None
        if settings.terms:
            self._targets = TargetStream(
                [Path(path) for path in settings.packs], settings.batch, seed=settings.seed, points=settings.points,
                mirror=settings.mirror,
            )  # fmt: skip
        if settings.labels:
            self._teaching = Teaching(settings, generator.vocabulary, device)
        self._val = {Path(path).stem: list(read_pack(path)) for path in val}

    def batch(self, index: int) -> Work:
        """Targets and lessons of an index."""
        targets = None
        if self._targets is not None:
            targets = Targets(*(each.to(self._device) for each in _parts(self._targets[index])))
        return Work(targets, None if self._teaching is None else self._teaching[index])

    def loss(self, batch: Work, progress: float, random: torch.Generator) -> dict[str, Tensor]:
        """The terms of the comparison, of the choice of ids, and of the lesson, each a mean over shapes."""
        terms: dict[str, Tensor] = {}
        if batch.taught is not None:
            terms |= teach(self._generator, batch.taught, self._settings, progress, random)
        if batch.targets is not None:
            terms |= self._compared(batch.targets, random)
        return terms

    def _compared(self, targets: Targets, random: torch.Generator) -> dict[str, Tensor]:
        settings, generator = self._settings, self._generator.eval()
        if settings.ids == "rloo":
            parts = (torch.cat([each] * settings.tries) for each in _parts(targets))
            targets = Targets(*parts)
        choose: Choice = "ids" if settings.ids in ("nvil", "rloo") else settings.choose
        drawn = decode(generator, targets.cells, blocks=settings.blocks, choose=choose, random=random)
        prediction = generator.predict(targets.cells, drawn.canvases, drawn.drawn)
        with torch.autocast(self._device.type, enabled=False):
            values = prediction.parameters.float()
            code = Code(drawn.code.ids, values)
            each = self._judged(code, targets, random)
            if NEURAL in settings.terms:
                each[NEURAL] = settings.terms[NEURAL] * self._neural(prediction, code, targets)
            # Where nothing is drawn, numbers and offsets have a gradient all the same: none.
            idle = 0 * (prediction.values.sum() + values.sum())
            terms = {name: value.mean() + idle for name, value in each.items()}
            if settings.ids != "none":
                total = torch.stack(list(each.values())).sum(0).detach()
                terms |= self._chosen(prediction, code, drawn.drawn, total, targets, random)
        return terms

    def _judged(self, code: Code, targets: Targets, random: torch.Generator) -> dict[str, Float[Tensor, " B"]]:
        """The terms (B,) of programs, with gradient to their parameters; those that draw nothing have none."""
        weights = self._settings.terms
        plan = Plan(Code(code.ids, code.parameters.detach()))
        scene = plan.scene(code.parameters)
        there = has_surface(scene)
        values = lacking(targets.points, weights)
        if not bool(there.any()):
            return values
        if not bool(there.all()):
            some = Code(code.ids[there], code.parameters[there])
            scene = Plan(Code(some.ids, some.parameters.detach())).scene(some.parameters)
        seen = Comparison(scene, targets.points[there], targets.cells[there], self._settings.points, random)
        return {name: values[name].masked_scatter(there, found) for name, found in compare(seen, weights).items()}

    def _neural(self, prediction: Prediction, code: Code, targets: Targets) -> Float[Tensor, " B"]:
        """Cross-entropy of the cells that the neural executor draws, as a mean over cells; ids reach it softly."""
        assert self._executor is not None
        soft = prediction.logits.float().exp()
        ids = soft.new_zeros(*prediction.live.shape, *soft.shape[1:])
        ids = ids.masked_scatter(prediction.live[..., None, None], soft)
        logits = self._executor.union(ids, code.parameters, prediction.live & (code.ids[..., 0] > 0))
        return occupancy_cross_entropy(logits, targets.cells)

    def _chosen(
        self,
        prediction: Prediction,
        code: Code,
        drawn: Code,
        total: Float[Tensor, " B"],
        targets: Targets,
        random: torch.Generator,
    ) -> dict[str, Tensor]:
        """What teaches the ids, see :mod:`shapeprog.training.choices`; cells are those of the programs as drawn."""
        settings = self._settings
        if settings.ids == "expected":
            other = choices.alternatives(self._generator, prediction.feature, settings.tries)
            judged = drawn if settings.cost == "iou" else code
            costs = self._costs_in_place(judged, prediction, other, targets, random)
            return {"choice": settings.ids_weight * choices.expected(other.chance, costs, len(total))}
        costs = (total + FLOOR).log() if settings.cost == "loss" else 1 - code_iou(drawn, targets.cells).to(total)
        chance = prediction.log_probability(code.ids)
        if settings.ids == "rloo":
            surprise = choices.leave_one_out(costs.reshape(settings.tries, -1)).flatten()[:, None].expand_as(chance)
            return {"choice": settings.ids_weight * choices.surrogate(chance, surprise), "_cost": costs.mean()}
        assert self.module.baseline is not None
        surprise, miss = self.module.baseline(prediction.feature, prediction.live, costs)
        choice = settings.ids_weight * choices.surrogate(chance, surprise)
        return {"choice": choice, "baseline": miss, "_cost": costs.mean()}

    def _costs_in_place(
        self, code: Code, prediction: Prediction, other: choices.Alternatives, targets: Targets, random: torch.Generator
    ) -> Float[Tensor, "M A"]:
        """The cost of each alternative with all other blocks as they are."""
        live = prediction.live
        if self._settings.cost == "iou":
            cells, owner = choices.in_place(code, live, other)
            return 1 - iou(cells, pack(targets.cells)[owner][:, None]).to(other.chance)
        costs = []
        for choice in range(other.ids.shape[1]):
            trial, owner = choices.replaced(code, live, other, choice)
            few = Targets(*(each[owner] for each in _parts(targets)))
            with torch.no_grad():
                values = self._judged(trial, few, random)
            costs.append((torch.stack(list(values.values())).sum(0) + FLOOR).log())
        return torch.stack(costs, 1)

    def validate(self) -> Record:
        """IoU and CD of single-pass programs on each pack; ``score`` is their mean IoU, or minus their mean CD."""
        scores = scores_on_packs(self._generator, self._val, self._settings.blocks)
        if self._val:
            chosen = [scores[f"{name}_{self._settings.select}"] for name in self._val]
            scores["score"] = sum(chosen) / len(chosen) * (1 if self._settings.select == "iou" else -1)
        return scores

    def save(self, path: Path, visits: int, scores: Record) -> None:
        """Write the generator with its card."""
        told = f"{self._origin}, adapted to {', '.join(Path(each).stem for each in self._settings.packs)}"
        card = card_of(
            self._generator, data=told, seed=self._settings.seed, command=self._command, visits=visits,
            scores=dict(scores),
        )  # fmt: skip
        save_checkpoint(path, self._generator, card)


def adapt(
    folder: Path,
    settings: AdaptSettings,
    engine: Engine,
    *,
    start: str,
    val: Sequence[Path] = (),
    command: str = "",
    restart: bool = False,
    stop: threading.Event | None = None,
    tensorboard: bool = False,
) -> Iterator[Record]:
    """Adapt a generator to real shapes, yielding one record per step; see :func:`shapeprog.training.loop.run`.

    Parameters
    ----------
    start
        Weights to begin from: a file, or the name of weights that ship.
    val
        Packs to validate on; what is best is chosen on them.
    command
        How to make the weights again, for their card.

    Raises
    ------
    ShapeProgError
        If the settings do not fit the run in the folder, or something cannot be read.
    """
    torch.manual_seed(settings.seed)
    generator, card = load_generator(start)
    executor = load_executor(settings.executor)[0] if NEURAL in settings.terms else None
    objective = Adaptation(generator, settings, executor, val, engine.device, card.data or str(start), command)
    return run(objective, settings, folder, engine, restart=restart, stop=stop, tensorboard=tensorboard)


def _freeze_all_but_offsets(generator: Generator) -> None:
    """Let only those weights learn that say offsets."""
    if not generator.says_offsets:
        raise ShapeProgError(f"the design {generator.design} says no offsets", "adapt all of it with --learn all")
    generator.requires_grad_(False)
    for weight in generator.offset_weights():
        weight.requires_grad_(True)


def _parts(targets: Targets) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    return targets.cells, targets.points, targets.place, targets.mirrored


def _width(generator: Generator) -> int:
    """Width of what a generator sees."""
    nothing = torch.zeros(1, 32, 32, 32, device=next(generator.parameters()).device)
    with torch.no_grad():
        return int(generator.eval().perceive(nothing, nothing, None)[0].shape[1])

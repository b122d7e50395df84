"""Adaptation to real shapes, whose programs are not known (section 4.3 and Table 1).

The loss of the rendering of each decoded program trains all weights of the generator.  *Direct* adaptation renders
analytically (the paper), *guided* through the neural executor (Tian et al. 2019), *hybrid* through both: ``AdaptTask``.
A sketch of direct adaptation in ten lines, without rehearsal and KL; endless: stop it yourself, then ``save_weights``;
an error if a program has no surface.  After ``import torch, shapeprog as sp``, ``from shapeprog.liang2022 import *``:

    generator = load_generator("fast-wide")
    optimiser = torch.optim.Adam(generator.parameters(), lr=2e-4)
    for cells, points in TargetStream(["packs/chair_train.npz"]):  # voxels, surface points in cells
        decoded = decode(generator, cells, decoder="argmax")
        code = predicted_code(generator.predict(decoded))
        sample = sp.sample(sp.unroll(code, shortest=0.2), 5000)  # no part vanishes
        loss = sp.chamfer(sample.points, points, weights=sample.weights).mean()
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
"""

from __future__ import annotations

import copy
from collections.abc import Sequence
from pathlib import Path
from typing import TypeAlias

import numpy as np
import torch
from jaxtyping import Float, UInt8
from torch import Tensor, nn

from shapeprog.arguments import check_number
from shapeprog.data.cells import points_of_cells
from shapeprog.data.packs import read_pack
from shapeprog.errors import ShapeProgError
from shapeprog.geometry.surface import face_areas
from shapeprog.language import Code, Draw, Program, encode, unroll
from shapeprog.language.statement import EMPTY
from shapeprog.liang2022.decode import Decoded, decode
from shapeprog.liang2022.evaluate import scores_on_packs
from shapeprog.liang2022.generator import IDS, STEPS, Prediction, TeacherForcingBatch
from shapeprog.liang2022.losses import (
    SHORTEST,
    Comparison,
    NvilBaseline,
    compute,
    leave_one_out,
    parse_losses,
    reinforce_loss,
)
from shapeprog.liang2022.pretrain import teacher_forcing
from shapeprog.liang2022.prior import PRIORS, scramble
from shapeprog.liang2022.settings import METHODS, NEURAL, AdaptSettings
from shapeprog.liang2022.weights import load_executor, load_generator

REHEARSAL_CANVASES = 3  # canvases of each synthetic shape that a step rehearses
RLOO_SAMPLES = 4  # programs sampled for each shape by the leave-one-out estimator

DOT = Program((Draw("leg", (-0.1,) * 3 + (0.2,) * 3),))  # the smallest part, in the centre; for programs that draw none

Targets: TypeAlias = tuple[UInt8[Tensor, "B 32 32 32"], Float[Tensor, "B P 3"]]  # cells; points on surfaces, in cells
AdaptBatch: TypeAlias = tuple[Targets, TeacherForcingBatch | None]  # real shapes, and synthetic ones to rehearse


class TargetStream:
    """Endless batches of real shapes, a function of packs, seed and index; all shapes once before any comes again.

    ``packs`` is a path or several.
    """

    def __init__(
        self, packs: str | Path | Sequence[str | Path], batch_size: int = 32, points: int = 1000, seed: int = 0
    ) -> None:
        check_number("batch_size", batch_size, 1, whole=True)
        check_number("points", points, 1, whole=True)
        paths = [packs] if isinstance(packs, str | Path) else packs
        self._shapes = [(pack, index) for pack in map(read_pack, paths) for index in range(len(pack))]
        if not self._shapes:
            raise ShapeProgError("there are no shapes to adapt to", "give packs made with: shapeprog prepare")
        self._batch_size, self._seed, self._points = batch_size, seed, points

    def __getitem__(self, index: int) -> Targets:
        """The batch of an index, 0 or more."""
        check_number("index", index, 0, whole=True)
        count, rng, cells, points = len(self._shapes), np.random.default_rng((self._seed, 1, index)), [], []
        for number in range(index * self._batch_size, (index + 1) * self._batch_size):
            order = np.random.default_rng((self._seed, 0, number // count)).permutation(count)
            pack, row = self._shapes[order[number % count]]
            shape = pack[row]
            cloud = points_of_cells(shape.voxels, 5000) if shape.points is None else shape.points
            cells.append(shape.voxels.astype(np.uint8))
            points.append(np.resize(rng.permutation(cloud)[: self._points], (self._points, 3)))
        return torch.from_numpy(np.stack(cells)), torch.from_numpy(np.stack(points).astype(np.float32))


class AdaptTask:
    """Adaptation of a generator; a task of :func:`~shapeprog.liang2022.loop.train`."""

    def __init__(self, settings: AdaptSettings) -> None:
        torch.manual_seed(settings.seed)
        self._settings, self._losses = settings, parse_losses(settings.loss or METHODS[settings.method])
        method = "direct" if NEURAL not in self._losses else "hybrid" if len(self._losses) > 1 else "guided"
        if method != settings.method:
            cause = f"the losses {settings.loss} are those of {method} adaptation, and the method is {settings.method}"
            raise ShapeProgError(cause, f"give --method {method}, or other losses")
        packs = ", ".join(Path(pack).stem for pack in settings.train)
        self.data = f"{Path(settings.initial).stem}, adapted to {packs}"
        generator = load_generator(settings.initial)
        self._executor = load_executor(settings.executor).requires_grad_(False) if NEURAL in self._losses else None
        self._initial = copy.deepcopy(generator).requires_grad_(False) if settings.kl else None
        if settings.learn == "offsets":
            if generator.offset_head is None:
                raise ShapeProgError(f"the design {generator.design} has no offsets", "use --learn all")
            generator.requires_grad_(False)
            generator.offset_head.requires_grad_(True)
        self.network, self.module = generator, nn.ModuleDict({"generator": generator})
        if settings.estimator == "nvil":
            self.module["baseline"] = NvilBaseline(generator.feature_width)
        self._targets = TargetStream(settings.train, settings.batch_size, settings.points, settings.seed)
        for path in settings.val:  # a missing pack is reported now, not at the first validation
            if not len(read_pack(Path(path))):
                raise ShapeProgError(f"there are no shapes to validate on in {path}", "leave it out")

    def batch(self, index: int) -> AdaptBatch:
        """Real shapes, and synthetic ones to rehearse."""
        settings = self._settings
        if not settings.rehearsal or settings.learn == "offsets":
            return self._targets[index], None
        made = PRIORS[settings.prior].batch(settings.rehearsal, settings.seed, index)
        rng = torch.Generator().manual_seed(scramble(settings.seed, 2, index))
        rehearsed = teacher_forcing(made.voxels, made.code, self.network.order)
        return self._targets[index], rehearsed.subset(REHEARSAL_CANVASES, rng)

    def losses(self, batch: AdaptBatch, progress: float, rng: torch.Generator) -> dict[str, Tensor]:
        """Losses of the rendered programs, of their ids, and of the rehearsal."""
        settings, generator = self._settings, self.network.eval()  # statistics of the normalisation stay
        repeats = RLOO_SAMPLES if settings.estimator == "rloo" else 1
        cells, points = (torch.cat([part] * repeats).to(rng.device) for part in batch[0])
        decoder = settings.decoder if settings.estimator == "none" else "sample-ids"
        decoded = decode(generator, cells, decoder=decoder, rng=rng)
        prediction = generator.predict(decoded)
        losses = {name: value.mean() for name, value in self._render_losses(prediction, points, rng).items()}
        losses |= self._id_losses(prediction, decoded)
        if batch[1] is not None:
            rehearsed = generator.losses(generator.predict(batch[1].to(rng.device)))
            losses |= {f"rehearsal_{name}": value for name, value in rehearsed.items()}
        return losses

    def _render_losses(
        self, prediction: Prediction, points: Float[Tensor, "B P 3"], rng: torch.Generator
    ) -> dict[str, Float[Tensor, " B"]]:
        """Losses of predicted programs, with gradient to their numbers.

        A program without a surface is rendered as a dot without gradient; the executor reads it as it is, and leaves
        out its empty blocks.
        """
        code = predicted_code(prediction, base=self._settings.learn == "all")
        area = face_areas(unroll(code.having(code.parameters.detach()))).double().flatten(1).sum(-1)
        draws = ((area > 0) & area.isfinite())[:, None, None]
        dot = encode([DOT] * len(draws), blocks=code.ids.shape[1])
        ids = torch.where(draws, code.ids, dot.ids.to(code.ids))
        numbers = torch.where(draws[..., None], code.parameters, dot.parameters.to(code.parameters))
        canvas = Code(ids, numbers - draws[..., None] * prediction.scatter(prediction.offsets))
        scene, cells = unroll(Code(ids, numbers), shortest=SHORTEST), prediction.batch.target
        values = compute(Comparison(scene, points, cells, self._settings.points, rng, canvas), self._losses)
        if self._executor is not None:
            executor, one_hot = self._executor.to(rng.device), torch.nn.functional.one_hot(code.ids, IDS).float()
            logits = executor.union(one_hot, code.parameters, prediction.batch.live & (code.ids[..., 0] != EMPTY))
            logits = logits.clamp(-1e4, 1e4)  # of an empty scene they may be infinite
            of_cells = torch.nn.functional.binary_cross_entropy_with_logits
            loss = of_cells(logits, cells.to(logits), reduction="none").flatten(1).mean(1)
            values[NEURAL] = self._losses[NEURAL] * loss
        return values

    def _id_losses(self, prediction: Prediction, decoded: Decoded) -> dict[str, Tensor]:
        """Losses that train ids: cross-entropy to the decoded ones, KL to the initial ones, or an estimator."""
        settings, losses = self._settings, {}
        log_prob = prediction.log_prob()
        if settings.decoded_ids and settings.learn == "all":
            losses["decoded_ids"] = -settings.decoded_ids * log_prob.sum() / (STEPS * prediction.batch.live.sum())
        if self._initial is not None:
            with torch.no_grad():
                before = self._initial.to(log_prob.device).eval().predict(prediction.batch).logits
            # Ids that are not legal have log-probability -inf in both, and no weight.
            difference = torch.where(before.isfinite(), before - prediction.logits, 0.0)
            losses["kl"] = settings.kl * (before.exp() * difference).sum(-1).mean()
        if settings.estimator == "none":
            return losses
        costs = 1 - decoded.iou().to(log_prob)
        if settings.estimator == "rloo":
            advantage = leave_one_out(costs.reshape(RLOO_SAMPLES, -1)).reshape(-1, 1)
        else:
            advantage, losses["baseline"] = self.module["baseline"](prediction.feature, prediction.batch.live, costs)
        return losses | {"estimator": reinforce_loss(log_prob, advantage), "_cost": costs.mean()}

    def validate(self) -> dict[str, float]:
        """IoU and CD of the programs of each pack; the score is minus the sum of these CD."""
        packs = self._settings.val
        scores = scores_on_packs(self.network, packs, self._settings.decoder)
        return scores | ({"score": -sum(scores[f"{Path(path).stem}_cd"] for path in packs)} if packs else {})


def predicted_code(prediction: Prediction, base: bool = True) -> Code:
    """Decoded programs with the predicted numbers, with gradient to all weights, or without ``base`` to offsets."""
    numbers = (prediction.numbers if base else prediction.inputs) + prediction.offsets
    return Code(prediction.batch.code.ids, prediction.scatter(numbers.float()))

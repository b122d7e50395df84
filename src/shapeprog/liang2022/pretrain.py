"""Pretraining: a generator learns from synthetic shapes, whose programs are known, by teacher forcing."""

from __future__ import annotations

from pathlib import Path

import torch
from torch import Tensor

from shapeprog.errors import ShapeProgError
from shapeprog.liang2022.decode import decode_all
from shapeprog.liang2022.evaluate import scores_on_packs
from shapeprog.liang2022.generator import Generator, TeacherForcingBatch
from shapeprog.liang2022.loop import Record
from shapeprog.liang2022.prior import SyntheticStream, prior
from shapeprog.liang2022.settings import PretrainSettings
from shapeprog.liang2022.teacher import scheduled_sampling, teacher_forcing
from shapeprog.liang2022.weights import build_generator, load_generator, save_weights

VALIDATION_BATCHES = 4
"""Batches of synthetic shapes that validation measures."""


class PretrainTask:
    """Supervised training of a generator; a task of :func:`~shapeprog.liang2022.loop.train`."""

    def __init__(self, settings: PretrainSettings, command: str = "") -> None:
        torch.manual_seed(settings.seed)
        self._settings, self._command = settings, command
        self.module = load_generator(settings.initial) if settings.initial else build_generator(settings.design)
        if self.module.design != settings.design:
            raise ShapeProgError(
                f"{settings.initial} holds the design {self.module.design}", f"give --design {self.module.design}"
            )
        self._stream = SyntheticStream(prior(settings.prior), settings.batch_size, settings.seed)
        held_out = SyntheticStream(prior(settings.prior), 64, -1)
        batches = [held_out[index] for index in range(VALIDATION_BATCHES)]
        self._validation = [teacher_forcing(batch.voxels, batch.code, settings.order) for batch in batches]

    def batch(self, index: int) -> TeacherForcingBatch:
        """Synthetic shapes, canvases and blocks."""
        made = self._stream[index]
        return teacher_forcing(made.voxels, made.code, self._settings.order)

    def losses(self, batch: TeacherForcingBatch, progress: float, rng: torch.Generator) -> dict[str, Tensor]:
        """Losses of ids and numbers."""
        settings, batch = self._settings, batch.to(rng.device)
        if float(torch.rand((), generator=rng, device=rng.device)) < settings.scheduled_sampling * min(
            1.0, 2 * progress
        ):
            batch = scheduled_sampling(self.module, batch, rng)
        if settings.canvases_per_shape:
            batch = batch.subset(settings.canvases_per_shape, rng)
        losses = self.module.predict(batch).losses()
        return {"ids": losses["ids"], "numbers": settings.number_weight * losses["numbers"]}

    def validate(self) -> Record:
        """Share of ids that are right and error of numbers in cells, by teacher forcing; IoU by arg-max; packs."""
        scores = teacher_forcing_scores(self.module, self._validation)
        scores |= scores_on_packs(self.module, self._settings.val, "argmax")
        real = [value for name, value in scores.items() if name.endswith("_iou")]
        return {**scores, "score": sum(real) / len(real) if real else scores["iou"]}

    def save(self, path: Path, samples_seen: int, scores: Record) -> None:
        """Write the generator with its card."""
        data = f"synthetic, prior {self._settings.prior}"
        if self._settings.initial:
            data += f", from {Path(self._settings.initial).stem}"
        save_weights(
            path, self.module, data=data, seed=self._settings.seed, command=self._command, samples_seen=samples_seen,
            scores=dict(scores),
        )  # fmt: skip


def teacher_forcing_scores(generator: Generator, batches: list[TeacherForcingBatch]) -> Record:
    """Accuracy of ids, mean error of numbers in cells, and IoU of programs decoded by arg-max."""
    right = steps = error = slots = 0.0
    overlaps: list[Tensor] = []
    device = next(generator.parameters()).device
    for batch in (held_out.to(device) for held_out in batches):
        prediction = generator.predict(batch)
        used = generator.used[prediction.ids]
        right += float((prediction.logits.argmax(-1) == prediction.ids).sum())
        error += float(((prediction.numbers - prediction.given).abs() * used).sum())
        steps, slots = steps + prediction.ids.numel(), slots + float(used.sum())
        overlaps.append(decode_all(generator, batch.target, decoder="argmax").iou())
    return {"ids": right / steps, "numbers": error / slots, "iou": float(torch.cat(overlaps).mean())}

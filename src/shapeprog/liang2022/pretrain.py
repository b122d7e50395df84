"""Pretraining: a generator learns from synthetic shapes, whose programs are known, by teacher forcing.

Blocks that draw the same shape may come in any order.  In order of *coverage* each block is the one that newly covers
most cells, so that there is a right block on every canvas, those that the generator drew itself included: scheduled
sampling (Bengio et al. 2015) with the labels of dataset aggregation (Ross et al. 2011).
"""

from __future__ import annotations

from pathlib import Path

import torch
from jaxtyping import Bool, Int, UInt8
from torch import Tensor
from torch.nn.functional import pad

from shapeprog.errors import ShapeProgError
from shapeprog.geometry.cells import count
from shapeprog.language.tensors import Code
from shapeprog.language.unroll import draw_blocks
from shapeprog.liang2022.decode import decode
from shapeprog.liang2022.generator import Generator, TeacherForcingBatch, live_blocks, preceding, preceding_blocks, take
from shapeprog.liang2022.prior import PRIORS
from shapeprog.liang2022.settings import Order, PretrainSettings
from shapeprog.liang2022.weights import build_generator, load_generator

VALIDATION_BATCHES = 4  # batches of synthetic shapes that validation measures


class PretrainTask:
    """Supervised training of a generator; a task of :func:`~shapeprog.liang2022.loop.train`."""

    def __init__(self, settings: PretrainSettings) -> None:
        torch.manual_seed(settings.seed)
        self._settings = settings
        origin = f", from {Path(settings.initial).stem}" if settings.initial else ""
        self.data = f"synthetic, prior {settings.prior}{origin}"
        generator = load_generator(settings.initial) if settings.initial else build_generator(settings.design)
        self.module = self.network = generator
        if (design := generator.design) != settings.design:
            raise ShapeProgError(f"{settings.initial} holds the design {design}", f"give --design {design}")
        batches = [PRIORS[settings.prior].batch(64, -1, index) for index in range(VALIDATION_BATCHES)]
        self._validation = [teacher_forcing(batch.voxels, batch.code, settings.order) for batch in batches]

    def batch(self, index: int) -> TeacherForcingBatch:
        """Synthetic shapes, canvases and blocks."""
        made = PRIORS[self._settings.prior].batch(self._settings.batch_size, self._settings.seed, index)
        return teacher_forcing(made.voxels, made.code, self._settings.order)

    def losses(self, batch: TeacherForcingBatch, progress: float, rng: torch.Generator) -> dict[str, Tensor]:
        """Losses of ids and numbers."""
        settings, batch = self._settings, batch.to(rng.device)
        probability = settings.scheduled_sampling * min(1.0, 2 * progress)
        if float(torch.rand((), generator=rng, device=rng.device)) < probability:
            batch = scheduled_sampling(self.module, batch, rng)
        if settings.canvases_per_shape:
            batch = batch.subset(settings.canvases_per_shape, rng)
        losses = self.module.losses(self.module.predict(batch))
        return {"ids": losses["ids"], "numbers": settings.number_weight * losses["numbers"]}

    def validate(self) -> dict[str, float]:
        """Accuracy of ids, mean error of numbers in cells, and IoU of programs decoded by arg-max: the score."""
        generator, measured = self.module, []
        for batch in (held_out.to(generator.used.device) for held_out in self._validation):
            prediction = generator.predict(batch)
            right = (prediction.logits.argmax(-1) == prediction.ids).double().flatten()
            error = (prediction.numbers - prediction.inputs).abs()[generator.used[prediction.ids]]
            measured.append((right, error, decode(generator, batch.target, decoder="argmax").iou()))
        ids, numbers, iou = (float(torch.cat(part).mean()) for part in zip(*measured, strict=True))
        return {"ids": ids, "numbers": numbers, "iou": iou, "score": iou}


def teacher_forcing(target: UInt8[Tensor, "B 32 32 32"], code: Code, order: Order = "coverage") -> TeacherForcingBatch:
    """Whole-numbered programs (B, K, J) of targets on the canvases that their own blocks leave, followed by their end.

    The order of ``coverage`` drops blocks that add nothing; blocks as ``written`` all stay.
    """
    code = Code(pad(code.ids, (0, 0, 0, 1)), pad(code.parameters, (0, 0, 0, 0, 0, 1)))
    drawn = draw_blocks(code)
    if order == "coverage":
        canvas, blocks = torch.zeros_like(drawn[:, :1]), []
        for _ in range(drawn.shape[1]):
            blocks.append(_best(drawn, canvas))
            canvas = canvas | drawn.gather(1, blocks[-1][0][..., None, None].expand_as(canvas))
        block, adds = (torch.cat(part, 1) for part in zip(*blocks, strict=True))
        code, drawn = take(code, block, adds), drawn.gather(1, block[..., None, None].expand_as(drawn))
    return TeacherForcingBatch(target, preceding(drawn), preceding_blocks(code), code, live_blocks(code.ids))


def scheduled_sampling(generator: Generator, batch: TeacherForcingBatch, rng: torch.Generator) -> TeacherForcingBatch:
    """The same targets on canvases that the generator draws by sampling, with the right block on each."""
    training = generator.training
    decoded = decode(generator.eval(), batch.target, blocks=batch.code.ids.shape[1], decoder="sample", rng=rng)
    generator.train(training)
    code = take(batch.code, *_best(draw_blocks(batch.code), decoded.canvases))
    return TeacherForcingBatch(batch.target, decoded.canvases, decoded.previous, code, decoded.live)


def _best(
    drawn: Int[Tensor, "B K 32 32"], canvases: Int[Tensor, "B L 32 32"]
) -> tuple[Int[Tensor, "B L"], Bool[Tensor, "B L"]]:
    """The block that newly covers most cells of each canvas, the lowest of equals, and whether it covers any."""
    new = count(drawn[:, None] & ~canvases[:, :, None])
    words = drawn.flatten(2) != 0
    score = new * words.shape[-1] - words.int().argmax(-1)[:, None]
    block = score.argmax(-1)
    return block, new.gather(-1, block[..., None])[..., 0] > 0

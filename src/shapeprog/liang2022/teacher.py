"""Teacher forcing: which block is right on which canvas.

Blocks that draw the same shape may come in any order.  In order of *coverage* each block is the one that newly covers
most cells, so that there is a right block on every canvas, those that the generator drew itself included: scheduled
sampling (Bengio et al. 2015) with the labels of dataset aggregation (Ross et al. 2011).
"""

from __future__ import annotations

from typing import Literal

import torch
from jaxtyping import Bool, Int, UInt8
from torch import Tensor

from shapeprog.geometry.cells import count, preceding
from shapeprog.language.tensors import Code
from shapeprog.language.unroll import draw_blocks
from shapeprog.liang2022.decode import decode
from shapeprog.liang2022.generator import Generator, TeacherForcingBatch, live_blocks, preceding_blocks

Order = Literal["coverage", "written"]


def teacher_forcing(target: UInt8[Tensor, "B 32 32 32"], code: Code, order: Order = "coverage") -> TeacherForcingBatch:
    """Programs on the canvases that their own blocks leave; room for the end is added after the last block.

    Parameters
    ----------
    target
        Cells to rebuild.
    code
        Programs (B, K, J) in whole numbers.
    order
        ``coverage`` sorts the blocks and drops those that add nothing; ``written`` keeps them.
    """
    code = _with_end(code)
    drawn = draw_blocks(code)
    if order == "coverage":
        code, drawn = _by_coverage(code, drawn)
    return TeacherForcingBatch(target, preceding(drawn), preceding_blocks(code), code, live_blocks(code.ids))


def scheduled_sampling(generator: Generator, batch: TeacherForcingBatch, rng: torch.Generator) -> TeacherForcingBatch:
    """The same targets on canvases that the generator draws by sampling, with the right block on each."""
    training = generator.training
    decoded = decode(generator.eval(), batch.target, blocks=batch.code.ids.shape[1], decoder="sample", rng=rng)
    generator.train(training)
    block, enough = _best(draw_blocks(batch.code), decoded.canvases)
    end = torch.full_like(block, batch.code.ids.shape[1] - 1)
    code = _take(batch.code, torch.where(enough, block, end))
    live = live_blocks(decoded.drawn.ids)
    return TeacherForcingBatch(batch.target, decoded.canvases, preceding_blocks(decoded.drawn), code, live)


def supervised_losses(
    generator: Generator,
    batch: TeacherForcingBatch,
    *,
    scheduled_sampling_prob: float,
    canvases_per_shape: int,
    rng: torch.Generator,
) -> dict[str, Tensor]:
    """Losses of ids and numbers on the canvases of the program, or by chance on the generator's own.

    Parameters
    ----------
    scheduled_sampling_prob
        Probability of the generator's own canvases, for the whole batch.
    canvases_per_shape
        Canvases learned from in each shape, drawn at random; 0 for all.
    """
    if float(torch.rand((), generator=rng, device=rng.device)) < scheduled_sampling_prob:
        batch = scheduled_sampling(generator, batch, rng)
    if canvases_per_shape:
        batch = batch.subset(canvases_per_shape, rng)
    return generator.predict(batch).losses()


def _by_coverage(code: Code, drawn: Int[Tensor, "B K 32 32"]) -> tuple[Code, Int[Tensor, "B K 32 32"]]:
    """Programs with their blocks in order of coverage, and the cells of each; blocks that add nothing are emptied."""
    canvas = torch.zeros_like(drawn[:, :1])
    order = []
    for _ in range(code.ids.shape[1]):
        block, enough = _best(drawn, canvas)
        order.append(torch.where(enough, block, -1))
        canvas = canvas | drawn.gather(1, block[..., None, None].expand_as(canvas))
    index = torch.cat(order, 1)
    written, index = index >= 0, index.clamp(min=0)
    ordered = _take(code, index)
    cells = drawn.gather(1, index[..., None, None].expand_as(drawn)) * written[..., None, None]
    return Code(ordered.ids * written[..., None], ordered.parameters * written[..., None, None]), cells


def _best(
    drawn: Int[Tensor, "B K 32 32"], canvases: Int[Tensor, "B L 32 32"]
) -> tuple[Int[Tensor, "B L"], Bool[Tensor, "B L"]]:
    """The block that newly covers most cells of each canvas, the lowest of equals, and whether it covers any."""
    new = count(drawn[:, None] & ~canvases[:, :, None])
    words = drawn.flatten(2) != 0
    score = new * words.shape[-1] - words.int().argmax(-1)[:, None]
    block = score.argmax(-1)
    return block, new.gather(-1, block[..., None])[..., 0] > 0


def _with_end(code: Code) -> Code:
    pad = torch.nn.functional.pad
    return Code(pad(code.ids, (0, 0, 0, 1)), pad(code.parameters, (0, 0, 0, 0, 0, 1)))


def _take(code: Code, block: Int[Tensor, "B L"]) -> Code:
    row = torch.arange(len(block), device=block.device)[:, None]
    return Code(code.ids[row, block], code.parameters[row, block])

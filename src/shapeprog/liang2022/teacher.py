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
from torch.nn.functional import pad

from shapeprog.geometry.cells import count, preceding
from shapeprog.language.tensors import Code
from shapeprog.language.unroll import draw_blocks
from shapeprog.liang2022.decode import decode
from shapeprog.liang2022.generator import Generator, TeacherForcingBatch, live_blocks, preceding_blocks

Order = Literal["coverage", "written"]


def teacher_forcing(target: UInt8[Tensor, "B 32 32 32"], code: Code, order: Order = "coverage") -> TeacherForcingBatch:
    """Whole-numbered programs (B, K, J) of targets on the canvases that their own blocks leave, followed by their end.

    The order of ``coverage`` drops blocks that add nothing; blocks as ``written`` all stay.
    """
    code = Code(pad(code.ids, (0, 0, 0, 1)), pad(code.parameters, (0, 0, 0, 0, 0, 1)))
    drawn = draw_blocks(code)
    canvases = preceding(drawn)
    if order == "coverage":
        code, canvases = _by_coverage(code, drawn)
    return TeacherForcingBatch(target, canvases, preceding_blocks(code), code, live_blocks(code.ids))


def scheduled_sampling(generator: Generator, batch: TeacherForcingBatch, rng: torch.Generator) -> TeacherForcingBatch:
    """The same targets on canvases that the generator draws by sampling, with the right block on each."""
    training = generator.training
    decoded = decode(generator.eval(), batch.target, blocks=batch.code.ids.shape[1], decoder="sample", rng=rng)
    generator.train(training)
    code = _take(batch.code, *_best(draw_blocks(batch.code), decoded.canvases))
    live = live_blocks(decoded.code.ids)
    return TeacherForcingBatch(batch.target, decoded.canvases, preceding_blocks(decoded.code), code, live)


def _by_coverage(code: Code, drawn: Int[Tensor, "B K 32 32"]) -> tuple[Code, Int[Tensor, "B K 32 32"]]:
    """Blocks in order of coverage, emptied where they add nothing, and the canvas before each."""
    canvas, canvases, blocks, added = torch.zeros_like(drawn[:, :1]), [], [], []
    for _ in range(drawn.shape[1]):
        block, adds = _best(drawn, canvas)
        canvases.append(canvas)
        blocks.append(block)
        added.append(adds)
        canvas = canvas | drawn.gather(1, block[..., None, None].expand_as(canvas))
    return _take(code, torch.cat(blocks, 1), torch.cat(added, 1)), torch.cat(canvases, 1)


def _best(
    drawn: Int[Tensor, "B K 32 32"], canvases: Int[Tensor, "B L 32 32"]
) -> tuple[Int[Tensor, "B L"], Bool[Tensor, "B L"]]:
    """The block that newly covers most cells of each canvas, the lowest of equals, and whether it covers any."""
    new = count(drawn[:, None] & ~canvases[:, :, None])
    words = drawn.flatten(2) != 0
    score = new * words.shape[-1] - words.int().argmax(-1)[:, None]
    block = score.argmax(-1)
    return block, new.gather(-1, block[..., None])[..., 0] > 0


def _take(code: Code, block: Int[Tensor, "B L"], keep: Bool[Tensor, "B L"]) -> Code:
    """Blocks of programs in another order, emptied where not kept."""
    row = torch.arange(len(block), device=block.device)[:, None]
    return Code(code.ids[row, block] * keep[..., None], code.parameters[row, block] * keep[..., None, None])

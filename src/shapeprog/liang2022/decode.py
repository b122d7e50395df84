"""Decoding: one program for each target, block by block.

Each block is drawn on the canvas, with rounded numbers, before the next is written.  Decoders, by name:

- ``argmax``: the likeliest id at each step, as published;
- ``novel``: the likeliest of a few blocks that draws a new cell, or the end; it looks at the canvas, not at the target;
- ``select``: render and select: of a few blocks the one that agrees best with the target, or the end where none helps;
- ``sample``: ids and numbers sampled; ``sample-ids``: ids alone.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

import torch
from jaxtyping import Float, Int, UInt8
from torch import Tensor

from shapeprog.arguments import check_number, check_tensor
from shapeprog.errors import ShapeProgError, did_you_mean
from shapeprog.geometry.cells import count, iou, pack, unpack
from shapeprog.language import Code, Program, unroll
from shapeprog.language import decode as programs_of
from shapeprog.language.statement import EMPTY, SLOTS
from shapeprog.language.unroll import draw_blocks
from shapeprog.liang2022.generator import (
    STEPS,
    Generator,
    TeacherForcingBatch,
    live_blocks,
    preceding_blocks,
    take,
    union,
)
from shapeprog.liang2022.settings import Decoder
from shapeprog.space import HALF, RESOLUTION

AnyDecoder = Literal[Decoder, "sample", "sample-ids"]

NUM_CANDIDATES = 8  # blocks that novel and select choose from; chosen on validation shapes
EXACT_WEIGHT = 0.5  # of exact cells against cells within a tolerance of one in select; chosen on validation shapes


@dataclass(frozen=True)
class Decoded(TeacherForcingBatch):
    """Programs of a generator, on their own canvases: input of :meth:`Generator.predict`."""

    offsets: Float[Tensor, "B K J 7"]  # sub-cell offsets of the surfaces from the numbers, which the canvas has not

    def programs(self, rounded: bool = False) -> list[Program]:
        """Programs with numbers to a hundredth of a cell, or ``rounded`` as drawn on the canvas."""
        numbers = (self.code.parameters + (0 if rounded else self.offsets)).double().round(decimals=0 if rounded else 2)
        return programs_of(self.code.having(numbers + 0.0))  # no minus zero

    def iou(self) -> Float[Tensor, " B"]:
        """IoU of the canvas after the last block with the target."""
        return iou(union(draw_blocks(self.code)), pack(self.target))


@torch.no_grad()
def decode(
    generator: Generator, target: UInt8[Tensor, "B 32 32 32"], *, blocks: int = 10, decoder: AnyDecoder = "select",
    rng: torch.Generator | None = None,
) -> Decoded:  # fmt: skip
    """Decode a program of at most so many blocks K for each target, by a generator in evaluation mode.

    The default decoder, ``select``, reads the target when it chooses blocks; that of the paper is ``argmax``.
    ``rng`` is the source of randomness for sampling, a fixed one by default.  Raises a ``ShapeProgError`` if there is
    no such decoder, the target has another shape, or the generator is in training mode.
    """
    check_tensor("target", target, "B", *[RESOLUTION] * 3, lead=False, floating=False)
    check_number("blocks", blocks, 0, whole=True)
    if decoder not in get_args(AnyDecoder):
        raise ShapeProgError(f"unknown decoder {decoder!r}", did_you_mean(decoder, get_args(AnyDecoder)))
    if generator.training:  # it would normalise by the batch and change its running statistics
        raise ShapeProgError("the generator is in training mode", "call generator.eval() first")
    size, device = len(target), target.device
    rng = (rng or torch.Generator(device)) if decoder.startswith("sample") else None
    ids = torch.zeros(size, blocks, STEPS, dtype=torch.long, device=device)
    numbers = torch.zeros(size, blocks, STEPS, SLOTS, device=device)
    offsets = torch.zeros_like(numbers)
    code = Code(ids, numbers)
    canvases = torch.zeros(size, blocks + 1, *target.shape[1:3], dtype=torch.int32, device=device)
    active, dense, cells = torch.arange(size, device=device), target.float(), pack(target)
    state: tuple[Tensor, ...] = ()
    for k in range(blocks):
        canvas = canvases[active, k]
        feature, state = generator.encode(dense[active], unpack(canvas).float(), code[active, k - 1], state)
        candidates, log_prob = _candidates(generator, feature, decoder, rng)
        if decoder in ("novel", "select"):
            block = _choose(candidates, log_prob, canvas, cells[active] if decoder == "select" else None)
        else:
            block = candidates[:, 0]
        ids[active, k], numbers[active, k] = block.ids, block.parameters
        if generator.offset_head is not None:
            hidden = generator.steps(feature, block)[1]
            offsets[active, k] = generator.offsets(hidden, block.ids, block.parameters)
        canvases[:, k + 1 :] = canvases[:, k : k + 1]
        going = block.ids[:, 0] != EMPTY
        active, state = active[going], tuple(part[going] for part in state)
        if not len(active):
            break
        canvases[active, k + 1] |= draw_blocks(block[going][:, None])[:, 0]
    return Decoded(target, canvases[:, :-1], preceding_blocks(code), code, live_blocks(ids), offsets)


def _candidates(
    generator: Generator, feature: Float[Tensor, "N F"], decoder: AnyDecoder, rng: torch.Generator | None
) -> tuple[Code, Float[Tensor, "N W"]]:
    """The likeliest blocks (N, W, J) by a beam over steps, or one by sampling; log-probabilities, 0 of sampled ones."""
    size, log_prob = len(feature), feature.new_zeros(len(feature), 1)
    state: tuple[Tensor, ...] = ()
    ids = torch.zeros(size, 1, 0, dtype=torch.long, device=feature.device)
    numbers = feature.new_zeros(size, 1, 0, SLOTS)
    shape = torch.arange(size, device=feature.device)[:, None]
    width = NUM_CANDIDATES if decoder in ("novel", "select") else 1
    for j in range(STEPS):
        lanes = ids.shape[1]
        previous = Code(ids[..., -1].flatten(), numbers[:, :, -1].flatten(0, 1)) if j else None
        logits, hidden, state = generator.step(feature.repeat_interleave(lanes, 0), previous, j, state)
        if rng is None:
            total = (log_prob[..., None] + logits.unflatten(0, (size, lanes))).nan_to_num(nan=-torch.inf)
            log_prob, choice = total.flatten(1).topk(min(width, total[0].numel()))
        else:
            choice = torch.multinomial(logits.exp(), 1, generator=rng)
        parent, selected = choice.div(logits.shape[-1], rounding_mode="floor"), choice % logits.shape[-1]
        row = (shape * lanes + parent).flatten()
        values = generator.numbers(hidden[row], selected.flatten(), None, rng if decoder == "sample" else None)
        ids = torch.cat([ids[shape, parent], selected[..., None]], -1)
        numbers = torch.cat([numbers[shape, parent], values.float().unflatten(0, selected.shape)[:, :, None]], 2)
        state = tuple(part[row] for part in state)
    return Code(ids, numbers), log_prob


def _choose(
    candidates: Code, log_prob: Float[Tensor, "B W"], canvas: Int[Tensor, "B 32 32"],
    target_cells: Int[Tensor, "B 32 32"] | None,
) -> Code:  # fmt: skip
    """The likeliest candidate that draws a new cell or ends; with a target, the one that agrees best with it.

    Agreement counts new cells inside the target minus those outside, exactly and with a tolerance of one cell, so that
    a part which is a little off is better than none.  Blocks with a copy outside the grid do not qualify.
    """
    drawn, before = draw_blocks(candidates[:, :, None])[:, :, 0], canvas[:, None]
    new = drawn & ~before
    ends = candidates.ids[..., 0] == EMPTY
    if target_cells is None:
        score = (((count(new) > 0) | ends) & log_prob.isfinite()).float()
    else:
        target = target_cells[:, None]
        exact = 2 * count(new & target) - count(new)
        nearby = count(target & widen(drawn) & ~widen(before)) - count(new & ~widen(target))
        scene = unroll(Code(candidates.ids.flatten(0, 1)[:, None], candidates.parameters.flatten(0, 1)[:, None]))
        inside = ((scene.centre.abs() <= HALF).all(-1) | ~scene.mask).all(-1).reshape(ends.shape)
        score = (EXACT_WEIGHT * exact + nearby) * (inside & log_prob.isfinite() & ~ends)
    best = score.argmax(-1, keepdim=True)  # the likeliest of equals
    return take(candidates, best, score.gather(1, best) > 0)[:, 0]


def widen(cells: Int[Tensor, "*batch 32 32"]) -> Int[Tensor, "*batch 32 32"]:
    """All cells that share a face with a filled one, and these themselves."""
    wide = cells | (cells << 1) | ((cells >> 1) & 0x7FFFFFFF)  # the sign must not be drawn in
    wide[..., 1:, :] |= cells[..., :-1, :]
    wide[..., :-1, :] |= cells[..., 1:, :]
    wide[..., 1:] |= cells[..., :-1]
    wide[..., :-1] |= cells[..., 1:]
    return wide

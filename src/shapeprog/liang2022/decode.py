"""Decoding: one program for each target, block by block.

Each block is drawn on the canvas, with rounded numbers, before the next is written.  Decoders, by name:

``argmax``
    The likeliest id at each step, as published.
``novel``
    The likeliest of a few blocks that draws a new cell, or the end.  It depends on the canvas, never on the target.
``select``
    Render and select: of a few blocks the one that agrees best with the target, or the end where none helps.
``sample``
    Ids and numbers sampled.  ``sample-ids`` samples ids alone.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal, get_args

import torch
from jaxtyping import Bool, Float, Int, UInt8
from torch import Tensor

from shapeprog.errors import ShapeProgError, did_you_mean
from shapeprog.geometry.cells import count, iou, pack, union, unpack, widen
from shapeprog.language.program import Program
from shapeprog.language.statement import EMPTY, SLOTS
from shapeprog.language.tensors import Code
from shapeprog.language.tensors import decode as programs_of
from shapeprog.language.unroll import draw_blocks, unroll
from shapeprog.liang2022.generator import STEPS, Generator, TeacherForcingBatch, live_blocks, preceding_blocks
from shapeprog.space import HALF

Decoder = Literal["argmax", "novel", "select", "sample", "sample-ids"]

NUM_CANDIDATES = 8
"""Blocks that ``novel`` and ``select`` choose from; chosen on validation shapes."""

EXACT_WEIGHT = 0.5
"""Weight of exact cells against cells within a tolerance of one in ``select``; chosen on validation shapes."""


@dataclass(frozen=True)
class Decoded:
    """Programs of a generator.

    Parameters
    ----------
    code
        The programs: numbers and offsets.
    drawn
        The numbers alone, as drawn on the canvas.
    canvases
        Packed cells drawn before each block.
    log_prob
        Log-probability of the ids of each program.
    """

    code: Code
    drawn: Code
    canvases: Int[Tensor, "B K 32 32"]
    log_prob: Float[Tensor, " B"]

    def programs(self, whole: bool = False) -> list[Program]:
        """Programs with numbers to a hundredth of a cell, or ``whole`` numbers as drawn on the canvas."""
        code = self.drawn if whole else self.code
        numbers = code.parameters.double().round(decimals=0 if whole else 2)
        return programs_of(Code(code.ids, numbers + 0.0))  # no minus zero

    def iou(self, target: UInt8[Tensor, "B 32 32 32"]) -> Float[Tensor, " B"]:
        """IoU of the canvas after the last block with the target."""
        return iou(union(draw_blocks(self.drawn)), pack(target))

    def teacher_forcing(self, target: UInt8[Tensor, "B 32 32 32"]) -> TeacherForcingBatch:
        """These programs as input of :meth:`Generator.predict`, which gives their numbers with gradient."""
        previous = preceding_blocks(self.drawn)
        return TeacherForcingBatch(target, self.canvases, previous, self.drawn, live_blocks(self.drawn.ids))


@torch.no_grad()
def decode(
    generator: Generator,
    target: UInt8[Tensor, "B 32 32 32"],
    *,
    blocks: int = 10,
    decoder: Decoder = "select",
    num_candidates: int = NUM_CANDIDATES,
    rng: torch.Generator | None = None,
) -> Decoded:
    """Decode a program for each target.

    Parameters
    ----------
    generator
        The network, in evaluation mode.
    target
        Cells, 1 or 0.
    blocks
        Largest number of blocks K.
    decoder
        How blocks are chosen; see the module.
    num_candidates
        Blocks that ``novel`` and ``select`` choose from.
    rng
        Source of randomness for sampling.

    Raises
    ------
    ShapeProgError
        If there is no such decoder.
    """
    if decoder not in get_args(Decoder):
        raise ShapeProgError(f"unknown decoder {decoder!r}", did_you_mean(decoder, get_args(Decoder)))
    size, device = len(target), target.device
    ids = torch.zeros(size, blocks, STEPS, dtype=torch.long, device=device)
    numbers = torch.zeros(size, blocks, STEPS, SLOTS, device=device)
    offsets = torch.zeros_like(numbers)
    canvases = torch.zeros(size, blocks + 1, *target.shape[1:3], dtype=torch.int32, device=device)
    log_prob = torch.zeros(size, device=device)
    active, dense, cells, state = torch.arange(size, device=device), target.float(), pack(target), None
    for k in range(blocks):
        canvas = canvases[active, k]
        before = Code(ids[active, k - 1] * (k > 0), numbers[active, k - 1] * (k > 0))
        feature, state = generator.encode(dense[active], unpack(canvas).float(), before, state)
        if decoder in ("novel", "select"):
            block, chance = _likeliest_blocks(generator, feature, num_candidates)
            target_cells = cells[active] if decoder == "select" else None
            block, chance = _choose(block, chance, canvas, target_cells)
        else:
            block, chance = _one_block(generator, feature, decoder, rng)
        ids[active, k], numbers[active, k] = block.ids, block.parameters
        if generator.has_offsets:
            hidden = generator.steps(feature, block)[1]
            offsets[active, k] = generator.offsets(hidden, block.ids, block.parameters)
        log_prob[active] += chance
        canvases[:, k + 1] = canvases[:, k]
        going = block.ids[:, 0] != EMPTY
        active, state = active[going], _rows(state, going)
        if not len(active):
            canvases[:, k + 1 :] = canvases[:, k : k + 1]
            break
        drawn = draw_blocks(Code(block.ids[going][:, None], block.parameters[going][:, None]))[:, 0]
        canvases[active, k + 1] |= drawn
    return Decoded(Code(ids, numbers + offsets), Code(ids, numbers), canvases[:, :-1], log_prob)


def decode_all(
    generator: Generator, target: UInt8[Tensor, "B 32 32 32"], batch_size: int = 64, **options: Any
) -> Decoded:
    """As :func:`decode`, in batches; ``options`` are its keywords."""
    parts = [decode(generator, part, **options) for part in target.split(batch_size)]
    code, drawn = (
        Code(torch.cat([code.ids for code in group]), torch.cat([code.parameters for code in group]))
        for group in ([part.code for part in parts], [part.drawn for part in parts])
    )
    canvases, log_prob = torch.cat([part.canvases for part in parts]), torch.cat([part.log_prob for part in parts])
    return Decoded(code, drawn, canvases, log_prob)


def _one_block(
    generator: Generator, feature: Float[Tensor, "B F"], decoder: Decoder, rng: torch.Generator | None
) -> tuple[Code, Float[Tensor, " B"]]:
    """A block by arg-max or by sampling, and the log-probability of its ids."""
    ids: list[Tensor] = []
    numbers: list[Tensor] = []
    log_prob, state = feature.new_zeros(len(feature)), None
    for j in range(STEPS):
        logits, hidden, state = generator.step(feature, Code(ids[-1], numbers[-1]) if ids else None, j, state)
        selected = logits.argmax(-1) if decoder == "argmax" else torch.multinomial(logits.exp(), 1, generator=rng)[:, 0]
        if decoder == "sample":
            assert rng is not None, "sampling numbers needs a source of randomness"
            numbers.append(generator.sample_numbers(hidden, selected, rng))
        else:
            numbers.append(generator.numbers(hidden, selected))
        log_prob = log_prob + logits.gather(-1, selected[:, None])[:, 0]
        ids.append(selected)
    return Code(torch.stack(ids, 1), torch.stack(numbers, 1).float()), log_prob


def _likeliest_blocks(
    generator: Generator, feature: Float[Tensor, "N F"], width: int
) -> tuple[Code, Float[Tensor, "N W"]]:
    """The ``width`` likeliest blocks (N, W, J) by a beam over their steps, likeliest first, and their log_prob."""
    size, state = len(feature), None
    log_prob = feature.new_zeros(size, 1)
    ids = torch.zeros(size, 1, 0, dtype=torch.long, device=feature.device)
    numbers = feature.new_zeros(size, 1, 0, SLOTS)
    shape = torch.arange(size, device=feature.device)[:, None]
    for j in range(STEPS):
        lanes = ids.shape[1]
        previous = Code(ids[:, :, -1].flatten(), numbers[:, :, -1].flatten(0, 1)) if j else None
        logits, hidden, state = generator.step(feature.repeat_interleave(lanes, 0), previous, j, state)
        total = (log_prob[..., None] + logits.unflatten(0, (size, lanes))).nan_to_num(nan=-torch.inf)
        log_prob, choice = total.flatten(1).topk(min(width, total[0].numel()))
        parent, selected = choice.div(logits.shape[-1], rounding_mode="floor"), choice % logits.shape[-1]
        row = (shape * lanes + parent).flatten()
        values = generator.numbers(hidden[row], selected.flatten()).float().unflatten(0, selected.shape)
        ids = torch.cat([ids[shape, parent], selected[..., None]], -1)
        numbers = torch.cat([numbers[shape, parent], values[:, :, None]], 2)
        state = _rows(state, row)
    return Code(ids, numbers), log_prob


def _choose(
    candidates: Code,
    log_prob: Float[Tensor, "B W"],
    canvas: Int[Tensor, "B 32 32"],
    target_cells: Int[Tensor, "B 32 32"] | None,
) -> tuple[Code, Float[Tensor, " B"]]:
    """The likeliest candidate that draws a new cell or ends; with a target, the one that agrees best with it.

    Agreement counts new cells inside the target minus those outside, exactly and with a tolerance of one cell, so that
    a part which is a little off is better than none.  Blocks with a copy outside the grid do not qualify.
    """
    single_blocks = Code(candidates.ids[:, :, None], candidates.parameters[:, :, None])
    drawn, before = draw_blocks(single_blocks)[:, :, 0], canvas[:, None]
    new = drawn & ~before
    ends = candidates.ids[..., 0] == EMPTY
    if target_cells is None:
        qualifies = ((count(new) > 0) | ends) & log_prob.isfinite()
        best = qualifies.int().argmax(-1)
    else:
        target = target_cells[:, None]
        exact = 2 * count(new & target) - count(new)
        nearby = count(target & widen(drawn) & ~widen(before)) - count(new & ~widen(target))
        qualifies = _inside_grid(single_blocks)[..., 0] & log_prob.isfinite() & ~ends
        score = (EXACT_WEIGHT * exact + nearby).masked_fill(~qualifies, 0.0)
        best = score.argmax(-1)  # the likeliest of equals
        qualifies = score > 0
    row = torch.arange(len(best), device=best.device)
    good = qualifies[row, best]
    return (
        Code(candidates.ids[row, best] * good[:, None], candidates.parameters[row, best] * good[:, None, None]),
        torch.where(good, log_prob[row, best], 0.0),
    )


def _inside_grid(code: Code) -> Bool[Tensor, "*batch K"]:
    """Blocks whose every copy has its centre within the grid."""
    lead, (steps, slots) = code.ids.shape[:-1], code.parameters.shape[-2:]
    scene = unroll(Code(code.ids.reshape(-1, 1, steps), code.parameters.detach().reshape(-1, 1, steps, slots)))
    return ((scene.centre.abs() <= HALF).all(-1) | ~scene.mask).all(-1).reshape(lead)


def _rows(state: Any, index: Tensor) -> Any:
    """The state of some of the programs: ``None``, a tensor or a tuple of tensors with the batch first."""
    if isinstance(state, tuple):
        return tuple(part[index] for part in state)
    return state if state is None else state[index]

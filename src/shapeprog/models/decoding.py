"""Decoding: programs from targets, by drawing, by the likeliest ids, by sampling, or by beam search.

All are batched and write legal blocks only.  Each block is drawn with whole numbers before the next one is written, so
the generator sees what it has done.  *By drawing*, which is the default, the likeliest few blocks are drawn and the
one that helps most is written: the network is run once for each block all the same.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import torch
from jaxtyping import Bool, Float, Int, UInt8
from torch import Tensor

from shapeprog.geometry.cells import count, iou, pack, unpack, widen
from shapeprog.language.program import Program
from shapeprog.language.statement import EMPTY, SLOTS
from shapeprog.language.tensors import Code
from shapeprog.language.tensors import decode as programs_of
from shapeprog.language.unroll import draw_blocks, unroll
from shapeprog.models.generator import Generator, Memory, Said
from shapeprog.space import HALF

Choice = Literal["drawn", "argmax", "sample", "ids"]

WIDTH = 8
"""Blocks that are drawn to choose one of them; chosen on val."""

EXACT = 0.5
"""What an exact cell counts beside one that is right within a cell; chosen on val."""


@dataclass(frozen=True)
class Decoded:
    """Programs that a generator wrote.

    Parameters
    ----------
    code
        The programs (B, K, J), or (B, W, K, J) of a beam, best first.
    drawn
        The same as they were drawn on the canvas, before offsets moved them: rounded, within one of the programs.
    canvases
        What each block found drawn, packed.
    log_probability
        Of the ids of each program.
    """

    code: Code
    drawn: Code
    canvases: Int[Tensor, "*batch K 32 32"]
    log_probability: Float[Tensor, "*batch"]


def programs(code: Code) -> list[Program]:
    """What a generator wrote as programs for people to read: numbers end at the hundredth of a cell."""
    tidy = code.parameters.double().round(decimals=2) + 0.0  # no minus zero
    return programs_of(Code(code.ids, tidy))


def whole_programs(drawn: Code) -> list[Program]:
    """Programs in whole numbers, as they were drawn on the canvas."""
    return programs(Code(drawn.ids, drawn.parameters.round()))


@torch.no_grad()
def decode(
    generator: Generator,
    target: UInt8[Tensor, "B 32 32 32"],
    *,
    blocks: int = 10,
    choose: Choice = "drawn",
    width: int = WIDTH,
    temperature: float = 1.0,
    random: torch.Generator | None = None,
) -> Decoded:
    """One program for each target; stops as soon as every program has ended.

    Generators whose predictions depend on the batch write all of the likeliest blocks for all of it, as published.

    Parameters
    ----------
    target
        Cells, 1 or 0.
    blocks
        Most blocks K; the tensors have exactly so many.
    choose
        ``drawn`` draws the likeliest blocks and takes the one that helps most, or ends where none does; ``argmax``
        takes the likeliest ids and their numbers, ``sample`` samples both, ``ids`` samples the ids alone.
    width
        How many blocks are drawn.
    temperature
        Of the ids when sampling: below one keeps closer to the likeliest.
    random
        Source of randomness when sampling.
    """
    steps, device = generator.vocabulary.steps, target.device
    ids = torch.zeros(len(target), blocks, steps, dtype=torch.long, device=device)
    parameters = torch.zeros(len(target), blocks, steps, SLOTS, device=device)
    features: list[tuple[Tensor, Tensor]] = []
    canvases = torch.zeros(len(target), blocks, *target.shape[1:3], dtype=torch.int32, device=device)
    chance = torch.zeros(len(target), device=device)
    active = torch.arange(len(target), device=device)
    seen, cells, memory = target.float(), pack(target), None
    canvas = canvases[:, 0].clone()
    for k in range(blocks):
        feature, memory = generator.perceive(seen[active], unpack(canvas[active]).float(), memory)
        if choose == "drawn" and not generator.by_batch:
            said, values, chances = _helping(generator, feature, width, canvas[active], cells[active])
        else:
            said, values, chances = _block(generator, feature, choose, temperature, random)
        ids[active, k], parameters[active, k] = said, values.to(parameters)
        features.append((active, feature))
        chance[active] += chances.to(chance)
        going = (said[:, 0] != EMPTY) | generator.by_batch
        active, memory = active[going], _at(memory, going)
        if not len(active):
            break
        canvas[active] = canvas[active] | draw_blocks(Code(said[going][:, None], values[going][:, None]))[:, 0]
        canvases[:, k + 1 :] = canvas[:, None]
    drawn = Code(ids, parameters)
    return Decoded(_meant(generator, drawn, features), drawn, canvases, chance)


def _meant(generator: Generator, drawn: Code, features: list[tuple[Tensor, Tensor]]) -> Code:
    """Programs with their offsets, all at once.

    Parameters
    ----------
    features
        For each block in turn, which shapes it was written for and what was seen of them.
    """
    row = torch.cat([active for active, _ in features])
    block = torch.cat([torch.full_like(active, k) for k, (active, _) in enumerate(features)])
    seen = torch.cat([feature for _, feature in features])
    meant = drawn.parameters.clone()
    meant[row, block] += _offsets(generator, seen, drawn.ids[row, block], drawn.parameters[row, block])
    return Code(drawn.ids, meant)


def _offsets(
    generator: Generator, feature: Float[Tensor, "N F"], ids: Int[Tensor, "N J"], values: Float[Tensor, "N J 7"]
) -> Float[Tensor, "N J 7"]:
    """How far the surface of blocks is meant to be from what is drawn of them; zero where a design does not say."""
    if not generator.says_offsets:
        return torch.zeros_like(values)
    return generator.offsets(generator.tell(feature, Said(ids, values))[1], ids, values)


def _helping(
    generator: Generator,
    feature: Float[Tensor, "B F"],
    width: int,
    canvas: Int[Tensor, "B 32 32"],
    cells: Int[Tensor, "B 32 32"],
) -> tuple[Int[Tensor, "B J"], Float[Tensor, "B J 7"], Float[Tensor, " B"]]:
    """Of the likeliest blocks the one that helps most, or an empty one where none helps, and its log-probability.

    What helps is counted in cells that are drawn anew: those that the target has less those that it has not, and the
    same with a cell of tolerance, so that a part which is a little off still counts for more than none.  A block with
    copies outside of the grid does not help: there they are not seen, and far from everything.
    """
    ids, values, chance = _blocks(generator, feature, width)
    candidates = Code(ids[:, :, None], values[:, :, None])
    drawn, possible = draw_blocks(candidates)[:, :, 0], _stays_inside(candidates)[..., 0] & chance.isfinite()
    wanted, before = cells[:, None], canvas[:, None]
    new = drawn & ~before
    exact = 2 * count(new & wanted) - count(new)
    near = count(wanted & widen(drawn) & ~widen(before)) - count(new & ~widen(wanted))
    worth = (EXACT * exact + near).masked_fill(~possible, 0.0)
    best = worth.argmax(-1)  # the likeliest of equals
    row = torch.arange(len(ids), device=ids.device)
    helps = (worth[row, best] > 0) & (ids[row, best, 0] != EMPTY)
    return ids[row, best] * helps[:, None], values[row, best] * helps[:, None, None], chance[row, best] * helps


def _stays_inside(code: Code) -> Bool[Tensor, "*batch K"]:
    """Which blocks have the centre of every copy within the grid; what lies outside of it no canvas shows."""
    lead, (steps, slots) = code.ids.shape[:-1], code.parameters.shape[-2:]
    scene = unroll(Code(code.ids.reshape(-1, 1, steps), code.parameters.detach().reshape(-1, 1, steps, slots)))
    within = (scene.centre.abs() <= HALF).all(-1) | ~scene.mask
    return within.all(-1).reshape(lead)


def _block(
    generator: Generator,
    feature: Float[Tensor, "B F"],
    choose: Choice,
    temperature: float,
    random: torch.Generator | None,
) -> tuple[Int[Tensor, "B J"], Float[Tensor, "B J 7"], Float[Tensor, " B"]]:
    """Ids, parameters and log-probability of one block."""
    ids: list[Tensor] = []
    values: list[Tensor] = []
    chance, state = feature.new_zeros(len(feature)), None
    for j in range(generator.vocabulary.steps):
        logits, heads, state = generator.step(feature, Said(ids[-1], values[-1]) if ids else None, j, state)
        if choose in ("argmax", "drawn"):
            said = logits.argmax(-1)
            values.append(generator.values(heads, said))
        else:
            assert random is not None, "sampling needs a source of randomness"
            said = torch.multinomial((logits / temperature).softmax(-1), 1, generator=random)[:, 0]
            drawn = generator.sampled(heads, said, random) if choose == "sample" else generator.values(heads, said)
            values.append(drawn)
        chance = chance + logits.gather(-1, said[:, None])[:, 0]
        ids.append(said)
    return torch.stack(ids, 1), torch.stack(values, 1).float(), chance


@torch.no_grad()
def beam(
    generator: Generator,
    target: UInt8[Tensor, "B 32 32 32"],
    *,
    width: int,
    blocks: int = 10,
    rank: Literal["iou", "log_probability"] = "iou",
) -> Decoded:
    """The ``width`` programs that beam search finds for each target, best first.

    Of all continuations of the programs so far by one block, those with the likeliest ids are kept; numbers are the
    likeliest for their ids.  A program that has ended stays in the beam as it is.

    Parameters
    ----------
    target
        Cells, 1 or 0.
    width
        Programs W kept for each target.
    rank
        What orders the programs at the end: intersection over union with the target, or their log-probability.
    """
    shapes, steps, device = len(target), generator.vocabulary.steps, target.device
    ids = torch.zeros(shapes, width, blocks, steps, dtype=torch.long, device=device)
    parameters = torch.zeros(shapes, width, blocks, steps, SLOTS, device=device)
    offsets = torch.zeros_like(parameters)
    canvases = torch.zeros(shapes, width, blocks + 1, *target.shape[1:3], dtype=torch.int32, device=device)
    chance = torch.full((shapes, width), -torch.inf, device=device)
    chance[:, 0] = 0.0  # all start from one empty program
    going = chance.isfinite()
    seen = target.float()
    memory: Memory = None
    for k in range(blocks):
        shape, lane = going.nonzero(as_tuple=True)
        feature, memory = generator.perceive(seen[shape], unpack(canvases[shape, lane, k]).float(), memory)
        said, values, chances = _blocks(generator, feature, width)
        # Every program offers W continuations; one that has ended offers itself.
        offers = torch.full((shapes, width, width), -torch.inf, device=device)
        offers[..., 0] = torch.where(going, -torch.inf, chance)
        offers[shape, lane] = chance[shape, lane][:, None] + chances
        chance, choice = offers.flatten(1).topk(width)
        parent, offer = choice.div(width, rounding_mode="floor"), choice % width
        row = torch.full((shapes, width), -1, device=device)
        row[shape, lane] = torch.arange(len(shape), device=device)
        row = row.gather(1, parent)
        each = torch.arange(shapes, device=device)[:, None]
        ids, parameters, canvases = ids[each, parent], parameters[each, parent], canvases[each, parent]
        offsets = offsets[each, parent]
        grown = (row >= 0) & chance.isfinite()
        ids[:, :, k][grown], parameters[:, :, k][grown] = (
            said[row[grown], offer[grown]],
            values[row[grown], offer[grown]],
        )
        offsets[:, :, k][grown] = _offsets(
            generator, feature[row[grown]], ids[:, :, k][grown], parameters[:, :, k][grown]
        )
        drawn = draw_blocks(Code(ids[:, :, k : k + 1], parameters[:, :, k : k + 1]))[:, :, 0]
        canvases[:, :, k + 1] = canvases[:, :, k] | drawn
        going = grown & (ids[:, :, k, 0] != EMPTY)
        memory = _at(memory, row[going])
        if not bool(going.any()):
            canvases[:, :, k + 1 :] = canvases[:, :, k + 1 : k + 2]
            break
    score = chance if rank == "log_probability" else iou(canvases[:, :, -1], pack(target)[:, None])
    order = score.masked_fill(~chance.isfinite(), -torch.inf).argsort(dim=-1, descending=True, stable=True)
    each = torch.arange(shapes, device=device)[:, None]
    ids, parameters, offsets = ids[each, order], parameters[each, order], offsets[each, order]
    return Decoded(
        Code(ids, parameters + offsets), Code(ids, parameters), canvases[each, order, :-1], chance[each, order]
    )


def _blocks(
    generator: Generator, feature: Float[Tensor, "N F"], width: int
) -> tuple[Int[Tensor, "N W J"], Float[Tensor, "N W J 7"], Float[Tensor, "N W"]]:
    """The ``width`` likeliest blocks for each feature, by a beam over their steps."""
    many = len(feature)
    chance = feature.new_zeros(many, 1)
    ids = torch.zeros(many, 1, 0, dtype=torch.long, device=feature.device)
    values = feature.new_zeros(many, 1, 0, SLOTS)
    state = None
    for j in range(generator.vocabulary.steps):
        lanes = ids.shape[1]
        previous = Said(ids[:, :, -1].flatten(), values[:, :, -1].flatten(0, 1)) if j else None
        wide = feature.repeat_interleave(lanes, 0)
        logits, heads, state = generator.step(wide, previous, j, state)
        possible = chance.isfinite()[..., None]
        total = torch.where(possible, chance[..., None] + logits.unflatten(0, (many, lanes)), -torch.inf)
        chance, choice = total.flatten(1).topk(min(width, total[0].numel()))
        parent, said = choice.div(logits.shape[-1], rounding_mode="floor"), choice % logits.shape[-1]
        row = (torch.arange(many, device=feature.device)[:, None] * lanes + parent).flatten()
        numbers = generator.values(heads[row], said.flatten()).float().unflatten(0, said.shape)
        each = torch.arange(many, device=feature.device)[:, None]
        ids = torch.cat([ids[each, parent], said[..., None]], -1)
        values = torch.cat([values[each, parent], numbers[:, :, None]], 2)
        state = _at(state, row)
    return ids, values, chance


def _at(state: Memory, index: Tensor) -> Memory:
    """The state of some of the programs: a tensor or a tuple of tensors with the batch first."""
    if state is None:
        return None
    return tuple(each[index] for each in state) if isinstance(state, tuple) else state[index]


@torch.no_grad()
def suggest(
    generator: Generator,
    target: UInt8[Tensor, "1 32 32 32"],
    canvas: Int[Tensor, "1 32 32"],
    memory: Memory,
    number: int,
    random: torch.Generator,
) -> tuple[Code, Memory]:
    """Blocks that may come next on one canvas, as programs (number, 1, J): drawn at random, a single one the likeliest.

    The canvas is seen once for all of them, which is what costs.

    Parameters
    ----------
    canvas
        What has been drawn, packed, by whomever.
    memory
        What the call for the block before returned; ``None`` at the first.
    """
    feature, memory = generator.perceive(target.float(), unpack(canvas).float(), memory)
    choose: Choice = "sample" if number > 1 else "argmax"
    ids, values, _ = _block(generator, feature.expand(number, -1), choose, 1.0, random)
    return Code(ids[:, None], values[:, None]), memory

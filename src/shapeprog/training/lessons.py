"""Lessons: what a generator is shown and what it should say, made from programs.

A lesson is a target, the canvases that the blocks of a program find, and the block to write on each.  Programs say the
same in any order; in order of *coverage* each block is the one that newly covers the most cells of what is left, so
the order follows from the shape alone, and there is a right answer on every canvas, those that the generator drew
itself included (scheduled sampling; the relabelling is that of dataset aggregation, Ross et al., AISTATS 2011).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import torch
from jaxtyping import Bool, Int, UInt8
from torch import Tensor

from shapeprog.geometry.cells import count, preceding
from shapeprog.language.tensors import Code
from shapeprog.language.unroll import draw_blocks
from shapeprog.models.decoding import decode
from shapeprog.models.generator import Generator, live_blocks

Order = Literal["coverage", "written"]

ENOUGH = 1
"""Cells that a block must newly cover to be worth writing."""


@dataclass(frozen=True)
class Lesson:
    """Targets with canvases and the right block on each.

    Parameters
    ----------
    target
        Cells, 1 or 0.
    canvases
        What each block finds drawn, packed.
    code
        The block to write on each canvas; an empty one says stop.
    live
        The canvases that count.
    """

    target: UInt8[Tensor, "B 32 32 32"]
    canvases: Int[Tensor, "B K 32 32"]
    code: Code
    live: Bool[Tensor, "B K"]

    def pick(self, rows: int, random: torch.Generator) -> Lesson:
        """The same with at most ``rows`` live canvases for each shape, drawn at random."""
        chance = torch.rand(self.live.shape, generator=random, device=random.device).to(self.live.device)
        rank = chance.masked_fill(~self.live, 2.0).argsort(-1).argsort(-1)
        return Lesson(self.target, self.canvases, self.code, self.live & (rank < rows))


def lesson(target: UInt8[Tensor, "B 32 32 32"], code: Code, order: Order = "coverage") -> Lesson:
    """The lesson of programs, taught on the canvases that their own blocks leave (teacher forcing).

    Parameters
    ----------
    target
        The cells to rebuild.
    code
        The programs; room for a stop is added after the last block.
    order
        ``coverage`` sorts the blocks and drops those that add nothing, ``written`` keeps them as they are.
    """
    code = _with_stop(code)
    drawn = draw_blocks(code)
    if order == "coverage":
        code, drawn = by_coverage(code, drawn)
    return Lesson(target, preceding(drawn), code, live_blocks(code.ids))


def relabelled(
    target: UInt8[Tensor, "B 32 32 32"], code: Code, canvases: Int[Tensor, "B L 32 32"], live: Bool[Tensor, "B L"]
) -> Lesson:
    """The lesson of programs on other canvases, such as those the generator drew itself."""
    code = _with_stop(code)
    block, enough = _best(draw_blocks(code), canvases)
    stop = torch.full_like(block, code.ids.shape[1] - 1)
    return Lesson(target, canvases, _taken(code, torch.where(enough, block, stop)), live)


def scheduled(generator: Generator, taught: Lesson, share: float, random: torch.Generator) -> Lesson:
    """With the chance ``share`` the lesson on what the generator draws by sampling instead (scheduled sampling).

    All shapes of a batch or none: a network that draws a few costs about as much as one that draws many.
    """
    if float(torch.rand((), generator=random, device=random.device)) >= share:
        return taught
    training = generator.training
    generator.eval()
    drawn = decode(generator, taught.target, blocks=taught.code.ids.shape[1], choose="sample", random=random)
    generator.train(training)
    without_stop = Code(taught.code.ids[:, :-1], taught.code.parameters[:, :-1])
    return relabelled(taught.target, without_stop, drawn.canvases, live_blocks(drawn.code.ids))


def lesson_losses(
    generator: Generator, taught: Lesson, *, sampled: float, rows: int, progress: float, random: torch.Generator
) -> dict[str, Tensor]:
    """Cross-entropy of the ids and loss of the parameters, means over the canvases that are learned from.

    Parameters
    ----------
    sampled
        Chance that the canvases are of the generator's own drawing, reached halfway.
    rows
        Canvases that are learned from in each shape, drawn at random; 0 for all.
    progress
        Share of the training that is done.
    """
    taught = scheduled(generator, taught, sampled * min(1.0, 2 * progress), random)
    if rows:
        taught = taught.pick(rows, random)
    prediction = generator.predict(taught.target, taught.canvases, taught.code, taught.live)
    return generator.losses(prediction, taught.code)


def by_coverage(code: Code, drawn: Int[Tensor, "B K 32 32"]) -> tuple[Code, Int[Tensor, "B K 32 32"]]:
    """Programs with their blocks in order of coverage, and the cells of each; blocks that add nothing are emptied."""
    blocks = code.ids.shape[1]
    canvas = torch.zeros_like(drawn[:, :1])
    order = []
    for _ in range(blocks):
        block, enough = _best(drawn, canvas)
        order.append(torch.where(enough, block, -1))
        canvas = canvas | drawn.gather(1, block[..., None, None].expand_as(canvas))
    place = torch.cat(order, 1)
    written = place >= 0
    place = place.clamp(min=0)
    sorted_code = _taken(code, place)
    cells = drawn.gather(1, place[..., None, None].expand_as(drawn))
    return (
        Code(sorted_code.ids * written[..., None], sorted_code.parameters * written[..., None, None]),
        cells * written[..., None, None],
    )


def _best(
    drawn: Int[Tensor, "B K 32 32"], canvases: Int[Tensor, "B L 32 32"]
) -> tuple[Int[Tensor, "B L"], Bool[Tensor, "B L"]]:
    """On each canvas the block that newly covers the most cells, the lowest of equals; and whether it is enough."""
    new = count(drawn[:, None] & ~canvases[:, :, None])
    words = drawn.flatten(2) != 0
    lowest = words.int().argmax(-1)
    worth = new * words.shape[-1] - lowest[:, None]
    block = worth.argmax(-1)
    return block, new.gather(-1, block[..., None])[..., 0] >= ENOUGH


def _with_stop(code: Code) -> Code:
    return Code(
        torch.nn.functional.pad(code.ids, (0, 0, 0, 1)), torch.nn.functional.pad(code.parameters, (0, 0, 0, 0, 0, 1))
    )


def _taken(code: Code, place: Int[Tensor, "B L"]) -> Code:
    index = place[..., None].expand(*place.shape, code.ids.shape[-1])
    numbers = index[..., None].expand(*index.shape, code.parameters.shape[-1])
    return Code(code.ids.gather(1, index), code.parameters.gather(1, numbers))

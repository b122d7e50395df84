"""Priors over furniture: mixtures of templates, each of which writes many programs at once."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from shapeprog.data.synthetic.declared import own_statements, random_blocks
from shapeprog.data.synthetic.details import details
from shapeprog.data.synthetic.dice import Dice
from shapeprog.data.synthetic.draft import Draft
from shapeprog.data.synthetic.hiding import with_own_cells
from shapeprog.errors import ShapeProgError
from shapeprog.geometry.cells import Cells
from shapeprog.language.program import PUBLISHED_DEPTH
from shapeprog.language.statement import END, SLOTS, language
from shapeprog.language.tensors import Code
from shapeprog.language.unroll import draw_blocks

Template = Callable[[Draft], None]

OWN_SHARE = 0.25
"""Share of programs with a block of a statement that a user declared, where there are any."""

OWN_BLOCKS = 4
"""Most blocks of a program where the built-in statements are missing."""

ATTEMPTS = 20
"""Times that programs which draw nothing are drawn anew."""


@dataclass(frozen=True)
class Prior:
    """A distribution over programs.

    Parameters
    ----------
    name
        What commands call it.
    blocks
        Most blocks of a program.
    templates
        What it is mixed from, with the weight of each.
    off_centre
        Share of shapes that are moved by a cell along some axes.
    details
        Share of shapes with details on what the template writes.
    own
        Whether statements that users declare take part.
    """

    name: str
    blocks: int
    templates: tuple[tuple[Template, float], ...]
    off_centre: float = 0.0
    details: float = 0.0
    own: bool = False

    def __call__(self, count: int, generator: torch.Generator) -> Code:
        """Programs (count, blocks, 3) on the generator's device; the same state gives the same programs.

        Every block draws cells that no other does, and blocks without a statement come last.

        Raises
        ------
        ShapeProgError
            If the statements in force draw nothing within the grid.
        """
        return self.drawn(count, generator)[0]

    def drawn(self, count: int, generator: torch.Generator) -> tuple[Code, Cells]:
        """Programs, as by calling, and what they draw: packed cells (count, 32, 32)."""
        code, canvas = self._visible(self._propose(count, generator))
        if self.details and _furniture():
            some = Dice(count, generator).chance(self.details).nonzero()[:, 0]
            if len(some):
                more = details(Dice(len(some), generator), canvas[some])
                full = _joined([Code(code.ids[some], code.parameters[some]), more])
                full, canvas[some] = self._visible(_front(full, full.ids.any(-1), self.blocks))
                code.ids[some], code.parameters[some] = full.ids, full.parameters
        for _ in range(ATTEMPTS):
            blank = (code.ids[:, 0, 0] == 0).nonzero()[:, 0]
            if not len(blank):
                return code, canvas
            again, cells = self._visible(self._propose(len(blank), generator))
            code.ids[blank], code.parameters[blank], canvas[blank] = again.ids, again.parameters, cells
        raise ShapeProgError(
            f"the prior {self.name} found no programs that draw anything",
            "give the declared statements ranges within the grid, -16 to 16 along each axis",
        )

    def _propose(self, count: int, generator: torch.Generator) -> Code:
        """Programs with blocks that may be hidden."""
        dice = Dice(count, generator)
        own = own_statements() if self.own or not _furniture() else []
        if _furniture():
            code = self._mixed(count, generator)
            more = random_blocks(dice) if own else None
            if more is not None:
                here = dice.chance(OWN_SHARE)[:, None, None]
                code = _joined([Code(more.ids * here, more.parameters * here[..., None]), code])
        elif own:
            code = _joined([random_blocks(dice) for _ in range(OWN_BLOCKS)])
        else:
            raise ShapeProgError(
                "there are no statements to write programs with", "register statements, or use the built-in ones"
            )
        code = _front(code, code.ids.any(-1), self.blocks)
        if self.off_centre:
            some = dice.chance(self.off_centre).nonzero()[:, 0]
            shift = torch.stack([dice.whole(-1, 1) for _ in range(3)], -1)
            code.parameters[some] = _moved(Code(code.ids[some], code.parameters[some]), shift[some])
        return code

    def _mixed(self, count: int, generator: torch.Generator) -> Code:
        weights = torch.tensor([float(weight) for _, weight in self.templates], device=generator.device)
        which = torch.multinomial(weights, count, replacement=True, generator=generator)
        many = torch.bincount(which, minlength=len(weights)).tolist()
        parts = []
        for (template, _), each in zip(self.templates, many, strict=True):
            if each:
                draft = Draft(Dice(each, generator))
                template(draft)
                code = draft.code()
                parts.append(_front(code, code.ids.any(-1), self.blocks))
        order = torch.argsort(torch.argsort(which, stable=True), stable=True)
        ids = torch.cat([part.ids for part in parts])
        return Code(ids[order], torch.cat([part.parameters for part in parts])[order])

    def _visible(self, code: Code) -> tuple[Code, Cells]:
        """The programs without the blocks that the others hide or that lie outside of the grid."""
        keep, canvas = with_own_cells(draw_blocks(code))
        return _front(code, keep, self.blocks), canvas


def _furniture() -> bool:
    """Whether the language in force has all built-in statements, which templates use."""
    return all(number in language() for number in range(1, END))


def _front(code: Code, keep: Bool[Tensor, "n K"], blocks: int) -> Code:
    """The programs with the blocks to keep in their order, then empty ones; ``blocks`` in all."""
    order = torch.argsort((~keep).to(torch.int8), dim=-1, stable=True)[:, :blocks]
    ids = (code.ids * keep[..., None]).gather(1, order[..., None].expand(-1, -1, PUBLISHED_DEPTH))
    numbers = (code.parameters * keep[..., None, None]).gather(
        1, order[..., None, None].expand(-1, -1, PUBLISHED_DEPTH, SLOTS)
    )
    missing = blocks - ids.shape[1]
    if missing > 0:
        ids = torch.nn.functional.pad(ids, (0, 0, 0, missing))
        numbers = torch.nn.functional.pad(numbers, (0, 0, 0, 0, 0, missing))
    return Code(ids, numbers)


def _joined(codes: list[Code]) -> Code:
    return Code(torch.cat([code.ids for code in codes], 1), torch.cat([code.parameters for code in codes], 1))


def _moved(code: Code, shift: Float[Tensor, "n 3"]) -> Float[Tensor, "n K J 7"]:
    """The parameters of whole shapes that are moved: the shift is added to every position that a statement names."""
    parameters = code.parameters.clone()
    for declared in language():
        if not declared.taught:
            continue
        for parameter in declared.parameters:
            if parameter.quantity.kind == "position" and parameter.quantity.width == 3 and not declared.is_loop:
                here: Int[Tensor, "n K J"] = (code.ids == declared.id).long()
                parameters[..., parameter.slots] += here[..., None] * shift[:, None, None]
    return parameters

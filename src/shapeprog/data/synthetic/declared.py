"""Statements that users declare: blocks whose numbers are drawn from the declared ranges."""

from __future__ import annotations

import torch

from shapeprog.data.synthetic.dice import Dice
from shapeprog.language.program import PUBLISHED_DEPTH
from shapeprog.language.statement import END, SLOTS, Statement, language
from shapeprog.language.tensors import Code
from shapeprog.space import SPAN

LARGEST = SPAN / 2
"""Positions of such blocks stay within this many cells of the middle, lengths below it: most then fit the grid."""


def own_statements() -> list[Statement]:
    """The drawing statements of the language in force that are taught and not built in."""
    return [each for each in language() if each.taught and not each.is_loop and each.id > END]


def random_blocks(dice: Dice) -> Code:
    """One block (n, 1, 3) for each program: a declared statement, whole numbers, no loops."""
    known = own_statements()
    ids = torch.zeros(dice.count, 1, PUBLISHED_DEPTH, dtype=torch.long, device=dice.device)
    parameters = torch.zeros(dice.count, 1, PUBLISHED_DEPTH, SLOTS, device=dice.device)
    for declared, here in zip(known, dice.kind(*[1.0] * len(known)) if known else (), strict=True):
        ids[here, 0, 0] = declared.id
        for slot, quantity in enumerate(declared.quantities):
            low, high = quantity.low, quantity.high
            if quantity.kind in ("position", "shift"):
                low, high = max(low, min(-LARGEST, high)), min(high, max(LARGEST, low))
            elif quantity.kind == "length":
                low, high = max(low, min(1.0, high)), min(high, max(LARGEST, low))
            parameters[here, 0, 0, slot] = dice.whole(low, high)[here]
    return Code(ids, parameters)

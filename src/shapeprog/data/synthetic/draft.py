"""A draft: the blocks of many programs at once, collected statement by statement as columns of numbers."""

from __future__ import annotations

from collections.abc import Sequence

import torch
from jaxtyping import Float
from torch import Tensor

from shapeprog.data.synthetic.dice import Dice, Flag, Number
from shapeprog.language.program import PUBLISHED_DEPTH
from shapeprog.language.statement import SLOTS, Statement, language
from shapeprog.language.tensors import Code

Triple = tuple[Number, Number, Number]
"""Numbers along up, depth and left-right."""

Rows = tuple[Number, Triple]
"""A translation: how many copies, and the shift from each to the next."""

THIN = 2
"""Most cells that a lying board of odd extent is thick and still a bar."""

ROLES: dict[str, tuple[str, ...]] = {
    "top": ("top_square", "top_rectangle", "horizontal_bar", "locker"),
    "shelf": ("layer", "horizontal_bar", "locker"),
    "foot": ("base_square", "layer", "horizontal_bar", "locker"),
    "side": ("sideboard", "vertical_board"),
}
"""Names for boxes of one role, the first that can be written in whole numbers and fits the form."""


class Draft:
    """Blocks of ``count`` programs, in the order in which they are added.

    Numbers are whole, and either columns (one for each program) or one number for all.

    Parameters
    ----------
    dice
        Where the programs' random numbers come from; says how many programs there are, and where.
    """

    def __init__(self, dice: Dice) -> None:
        self.dice = dice
        self._ids: list[Tensor] = []
        self._parameters: list[Tensor] = []

    def add(
        self,
        name: str,
        *,
        keep: Flag | None = None,
        repeat: Sequence[Rows] = (),
        turns: tuple[Number, Number] | None = None,
        **numbers: Number | Sequence[Number],
    ) -> None:
        """Write a block for each program.

        Parameters
        ----------
        name
            A statement of the language in force.
        keep
            Which programs have the block; by default all.
        repeat
            Up to two translations, outermost first; those of a single copy are left out.
        turns
            Number of copies and quarter turns of a rotation.
        numbers
            The parameters of the statement by name.
        """
        declared = language()[name]
        values = self._values(declared, numbers)
        self._write(torch.full_like(values[:, 0], declared.id), values, keep, repeat, turns)

    def box(
        self,
        role: str | dict[str, Flag],
        low: Triple,
        size: Triple,
        *,
        keep: Flag | None = None,
        repeat: Sequence[Rows] = (),
        tilt: Number = 0,
    ) -> None:
        """Write a box from its low corner and its extents; its role and form give its name.

        Parameters
        ----------
        role
            One of ``ROLES``, or a statement; or several and which programs have each.
        tilt
            Shift of the top to the rear, for statements that have it.
        """
        roles: dict[str, Flag | None] = {role: None} if isinstance(role, str) else dict(role)
        ids: Tensor | None = None
        values: Tensor | None = None
        for each, chosen in reversed(roles.items()):
            for name in reversed(ROLES.get(each, (each,))):
                declared = language()[name]
                numbers = self._values(declared, _box_numbers(declared, low, size, tilt))
                column = torch.full_like(numbers[:, 0], declared.id)
                if ids is None or values is None:
                    ids, values = column, numbers
                    continue
                fits = self._fits(name, size) if chosen is None else self._fits(name, size) & chosen
                ids, values = torch.where(fits, column, ids), torch.where(fits[:, None], numbers, values)
        assert ids is not None
        assert values is not None
        self._write(ids, values, keep, repeat, None)

    def code(self) -> Code:
        """The programs (n, K, 3), steps of each block moved together and blocks without any left empty."""
        ids = torch.stack(self._ids, 1)
        order = torch.argsort((ids == 0).to(torch.int8), dim=-1, stable=True)
        parameters = torch.stack(self._parameters, 1)
        return Code(ids.gather(-1, order), parameters.gather(-2, order[..., None].expand_as(parameters)))

    def column(self, number: Number) -> Float[Tensor, " n"]:
        """The number for each program."""
        if isinstance(number, Tensor):
            return number.expand(self.dice.count)
        return torch.full((self.dice.count,), float(number), device=self.dice.device)

    def _fits(self, name: str, size: Triple) -> Flag:
        up, depth, side = (self.column(each) for each in size)
        even = depth % 2 == 0
        if name == "horizontal_bar":
            return up <= THIN
        if name == "sideboard":
            return even
        if name not in ("top_square", "base_square", "top_rectangle", "layer"):
            return torch.ones_like(even)
        if name in ("top_square", "base_square"):
            return even & (depth == side)
        return even & (side % 2 == 0)

    def _values(self, declared: Statement, numbers: dict[str, Number | Sequence[Number]]) -> Float[Tensor, "n 7"]:
        columns: list[Number] = [0.0] * SLOTS
        for parameter in declared.parameters:
            given = numbers[parameter.name]
            columns[parameter.slots] = list(given) if isinstance(given, Sequence) else [given]
        return torch.stack([self.column(each) for each in columns], -1)

    def _write(
        self,
        ids: Float[Tensor, " n"],
        values: Float[Tensor, "n 7"],
        keep: Flag | None,
        repeat: Sequence[Rows],
        turns: tuple[Number, Number] | None,
    ) -> None:
        steps_ids, steps_values = [], []
        for number, shift in repeat:
            declared, count = language()["translate"], self.column(number)
            steps_ids.append((count > 1) * declared.id)
            steps_values.append(self._values(declared, {"count": count, "by": shift}))
        if turns is not None:
            declared, count = language()["rotate"], self.column(turns[0])
            steps_ids.append((count > 1) * declared.id)
            steps_values.append(self._values(declared, {"count": count, "step": turns[1]}))
        while len(steps_ids) < PUBLISHED_DEPTH - 1:
            steps_ids.append(torch.zeros_like(ids, dtype=torch.long))
            steps_values.append(torch.zeros_like(values))
        block = torch.stack([*steps_ids, ids.long()], -1)
        parameters = torch.stack([*steps_values, values], -2)
        here = block > 0
        if keep is not None:
            here = here & keep[:, None]
        self._ids.append(block * here)
        self._parameters.append(parameters * here[..., None])


def _box_numbers(declared: Statement, low: Triple, size: Triple, tilt: Number) -> dict[str, Number | Sequence[Number]]:
    """The parameters of any statement that draws an upright box, by their names."""
    names = {parameter.name: parameter.quantity.width for parameter in declared.parameters}
    half = (size[1] / 2, size[2] / 2)
    at: Triple = low
    if "half" in names:
        at = (low[0], low[1] + half[0], low[2] + half[1])
    elif "half_depth" in names:
        at = (low[0], low[1] + half[0], low[2])
    return {
        "at": at, "size": size, "thickness": size[0], "height": size[0], "width": size[2], "half_depth": half[0],
        "half": half if names.get("half") == 2 else half[0], "tilt": tilt,
    }  # fmt: skip

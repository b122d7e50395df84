"""Unrolling: programs to scenes of primitives, vectorised over programs, blocks and copies.

Loops are transformations of what is inside.  Gradients reach every continuous parameter, shifts of loops included;
counts, turns and ids are discrete and carry none.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from shapeprog.errors import ShapeProgError
from shapeprog.geometry.primitive import SIZES, primitives
from shapeprog.geometry.scene import Scene
from shapeprog.language.program import Program
from shapeprog.language.statement import EMPTY, END, Statement, language
from shapeprog.language.tensors import Code, encode

MOST_PRIMITIVES = 1 << 20
"""Most copies that one batch may unroll to; more is a mistake in a loop count."""


def unroll(program: Program | Sequence[Program] | Code) -> Scene:
    """The scene of a program, or scenes (B, N) of a batch; N is the largest number of primitives in it.

    Blocks that are not loops followed by one drawing statement draw nothing, nor do loops without copies, nor
    primitives with a negative extent.

    Raises
    ------
    ShapeProgError
        If the loop counts multiply to more primitives than ``MOST_PRIMITIVES``.
    """
    code = program if isinstance(program, Code) else encode(program)
    return Plan(code).scene(code.parameters)


@dataclass(frozen=True)
class _Kind:
    """All copies that one kind of statement draws: its declaration, their items, rows and steps."""

    declared: Statement
    item: Int[Tensor, " m"]
    row: Int[Tensor, " m"]
    step: Int[Tensor, " m"]


@dataclass(frozen=True)
class _Level:
    """All copies, in drawing order, that one kind of loop moves at one level."""

    declared: Statement
    level: int
    place: Int[Tensor, " m"]
    row: Int[Tensor, " m"]
    copy: Int[Tensor, " m"]
    quarter: Bool[Tensor, " m"]


class Plan:
    """What of a batch of programs is discrete: which statement draws which copy, moved by which loops.

    Made once, it renders the same programs for other continuous parameters, which is what refinement does.

    Parameters
    ----------
    code
        Programs (..., K, J); of their parameters only the counts are read.
    """

    def __init__(self, code: Code) -> None:
        self._lead, (self._blocks, self._steps) = code.ids.shape[:-2], code.ids.shape[-2:]
        ids = code.ids.reshape(-1, self._steps)
        values = code.parameters.detach().reshape(-1, self._steps, code.parameters.shape[-1])
        row, step, copies = _copies(ids, values)
        self._programs = math.prod(self._lead)
        statement = ids[row].gather(-1, step[:, None])[:, 0] if len(row) else row
        present = [language()[number] for number in torch.unique(ids).tolist() if number in language()]
        self._kinds = []
        for declared in present:
            item = (statement == declared.id).nonzero()[:, 0]
            if len(item) and not declared.is_loop:
                self._kinds.append(_Kind(declared, item, row[item], step[item]))
        item = torch.cat([row[:0], *(kind.item for kind in self._kinds)])
        quarter = torch.cat(
            [row[:0].bool(), *(torch.full_like(k.item, k.declared.quarter).bool() for k in self._kinds)]
        )
        self._levels = []
        for level in reversed(range(self._steps)):
            for declared in present:
                place = ((ids[row[item], level] == declared.id) & (level < step[item])).nonzero()[:, 0]
                if len(place) and declared.is_loop:
                    here = item[place]
                    self._levels.append(_Level(declared, level, place, row[here], copies[here, level], quarter[place]))
        self._item, self._row, self._statement = item, row, statement
        self._copy = torch.arange(len(row), device=row.device) - torch.searchsorted(row, row)

    def scene(self, parameters: Float[Tensor, "*batch K J 7"]) -> Scene:
        """The scenes for parameters of the same programs, with gradient."""
        values = parameters.reshape(-1, self._steps, parameters.shape[-1])
        if not self._kinds:
            return self._padded(values.new_zeros(0, SIZES), values.new_zeros(0, 3), None, self._item, self._item)
        drawn = [kind.declared.solids(values[kind.row, kind.step]) for kind in self._kinds]
        motion = self._motion(values)
        sizes, centres, rotations, kinds, items, orders = [], [], [], [], [], []
        start = 0
        turned = motion[0] is not None or any(part.rotation is not None for parts in drawn for part in parts)
        for kind, parts in zip(self._kinds, drawn, strict=True):
            mine = slice(start, start + len(kind.item))
            start += len(kind.item)
            for index, part in enumerate(parts):
                centre, rotation = part.centre, part.rotation
                if rotation is None and turned:
                    rotation = torch.eye(3, device=values.device, dtype=values.dtype).expand(len(kind.item), 3, 3)
                if motion[0] is not None and rotation is not None:
                    matrix = motion[0][mine]
                    centre, rotation = (matrix @ centre[..., None])[..., 0], matrix @ rotation
                sizes.append(part.size)
                centres.append(centre + motion[1][mine])
                rotations.append(rotation)
                kinds.append(torch.full_like(kind.item, part.kind))
                items.append(kind.item)
                orders.append(torch.full_like(kind.item, index))
        item, order = torch.cat(items), torch.cat(orders)
        place = torch.argsort(item * (int(order.max()) + 1) + order)
        rotation = torch.cat([each for each in rotations if each is not None])[place] if turned else None
        return self._padded(
            torch.cat(sizes)[place], torch.cat(centres)[place], rotation, torch.cat(kinds)[place], item[place]
        )

    def _motion(self, values: Float[Tensor, "R J 7"]) -> tuple[Float[Tensor, "M 3 3"] | None, Float[Tensor, "M 3"]]:
        """The rigid motion of each copy in drawing order: its loops composed from the innermost outwards."""
        shift = values.new_zeros(len(self._item), 3)
        turn: Tensor | None = None
        axis: Tensor | None = None
        for level in self._levels:
            assert level.declared.move is not None
            named = level.declared.split(values[level.row, level.level])
            motion = level.declared.move(level.copy.to(values), level.quarter, **named)
            if motion.turn is not None:
                axis = self._axes(values) if axis is None else axis
                angle = torch.zeros_like(shift[:, 0]).index_copy(0, level.place, motion.turn.detach())
                shift = (_turned(angle) @ (shift - axis)[..., None])[..., 0] + axis
                turn = angle if turn is None else turn + angle
            if motion.shift is not None:
                shift = shift.index_add(0, level.place, motion.shift)
        return (None if turn is None else _turned(turn)), shift

    def _axes(self, values: Float[Tensor, "R J 7"]) -> Float[Tensor, "M 3"]:
        """A point at height zero on the axis about which rotation loops turn each copy, in drawing order."""
        points = []
        for kind in self._kinds:
            pivot = kind.declared.pivot
            if pivot is None:
                points.append(values.new_zeros(len(kind.item), 3))
            else:
                point = pivot(**kind.declared.split(values[kind.row, kind.step]))
                points.append(torch.cat([torch.zeros_like(point[:, :1]), point[:, 1:]], -1))
        return torch.cat(points)

    def _padded(
        self,
        size: Float[Tensor, "M 4"],
        centre: Float[Tensor, "M 3"],
        rotation: Float[Tensor, "M 3 3"] | None,
        kind: Int[Tensor, " M"],
        item: Int[Tensor, " M"],
    ) -> Scene:
        """Primitives in the order of programs, blocks and copies as padded slots (..., N)."""
        device, dtype = size.device, size.dtype
        row = self._row[item]
        program = row.div(max(self._blocks, 1), rounding_mode="floor")
        counts = torch.bincount(program, minlength=self._programs)
        slots = int(counts.max()) if len(counts) else 0
        first = counts.cumsum(0) - counts
        target = program * slots + torch.arange(len(item), device=device) - first[program]

        def pad(tensor: Tensor) -> Tensor:
            if self._programs == 1:
                return tensor.reshape(*self._lead, *tensor.shape)
            out = torch.zeros(self._programs * slots, *tensor.shape[1:], device=device, dtype=tensor.dtype)
            return out.index_copy(0, target, tensor).reshape(*self._lead, slots, *tensor.shape[1:])

        padded_size, padded_kind = pad(size), pad(kind)
        extents = torch.tensor([known.extents for known in primitives], device=device)[padded_kind]
        used = torch.arange(SIZES, device=device) < extents[..., None]
        drawable = ((padded_size.detach() >= 0) | ~used).all(-1)
        mask = pad(torch.ones_like(item, dtype=torch.bool)) & drawable
        identity = torch.eye(3, device=device, dtype=dtype).expand(*mask.shape, 3, 3)
        return Scene(
            kind=padded_kind,
            size=padded_size,
            centre=pad(centre),
            rotation=identity if rotation is None else torch.where(mask[..., None, None], pad(rotation), identity),
            mask=mask,
            statement=pad(self._statement[item]),
            block=pad(row % max(self._blocks, 1)),
            copy=pad(self._copy[item]),
        )


def _roles(ids: Int[Tensor, "R J"]) -> tuple[Bool[Tensor, "R J"], Bool[Tensor, "R J"]]:
    """Which steps are loops and which draw."""
    known = list(language())
    top = max([END, *(declared.id for declared in known)]) + 1
    table = torch.zeros(2, top, dtype=torch.bool)
    for declared in known:
        table[0 if declared.is_loop else 1, declared.id] = True
    table = table.to(ids.device)
    inside = ids.clamp(0, top - 1)
    valid = inside == ids
    return table[0][inside] & valid, table[1][inside] & valid


def _copies(
    ids: Int[Tensor, "R J"], values: Float[Tensor, "R J 7"]
) -> tuple[Int[Tensor, " M"], Int[Tensor, " M"], Int[Tensor, "M J"]]:
    """Block row, drawing step and copy index at each loop level of every drawn copy."""
    is_loop, draws = _roles(ids)
    steps = ids.shape[-1]
    loops = is_loop.long().cumprod(-1)
    step = loops.sum(-1).clamp(max=steps - 1)
    place = torch.arange(steps, device=ids.device)
    blank = (ids == EMPTY) | (ids == END)
    legal = draws.gather(-1, step[:, None])[:, 0] & (blank | (place <= step[:, None])).all(-1)
    levels = (place < step[:, None]) & legal[:, None]
    counts = torch.where(levels, values[..., 0].round().nan_to_num(0).clamp(0, MOST_PRIMITIVES + 1).long(), 1)
    total = counts.double().prod(-1) * legal
    if float(total.sum()) > MOST_PRIMITIVES:
        raise ShapeProgError(
            f"the loops of this program make {float(total.sum()):.0f} copies",
            f"lower the counts: at most {MOST_PRIMITIVES} primitives can be drawn at once",
        )
    total = total.long()
    row = torch.repeat_interleave(torch.arange(len(ids), device=ids.device), total)
    first = total.cumsum(0) - total
    rest = torch.arange(len(row), device=ids.device) - first[row]
    index = []
    for level in reversed(range(steps)):
        count = counts[row, level]
        index.append(rest % count)
        rest = rest.div(count, rounding_mode="floor")
    return row, step[row], torch.stack(index[::-1], -1)


def _turned(turn: Float[Tensor, "*batch"]) -> Float[Tensor, "*batch 3 3"]:
    """Rotation about the vertical axis by a fraction of a circle; exact at quarter turns."""
    nearest = (turn * 4).round()
    exact = (turn * 4 - nearest).abs() < 1e-6
    quarter = nearest.long() % 4
    table = torch.tensor([[1, 0, -1, 0], [0, 1, 0, -1]], device=turn.device).to(turn)
    angle = 2 * torch.pi * turn
    cos = torch.where(exact, table[0][quarter], angle.cos())
    sin = torch.where(exact, table[1][quarter], angle.sin())
    zero, one = torch.zeros_like(turn), torch.ones_like(turn)
    entries = [one, zero, zero, zero, cos, -sin, zero, sin, cos]
    return torch.stack(entries, -1).unflatten(-1, (3, 3))

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
from shapeprog.geometry.batch import Solids
from shapeprog.geometry.cells import rasterise_apart
from shapeprog.geometry.primitive import SIZES, primitives
from shapeprog.geometry.scene import Scene
from shapeprog.language.program import Program
from shapeprog.language.statement import EMPTY, END, Statement, language
from shapeprog.language.tensors import Code, encode
from shapeprog.space import RESOLUTION

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


def draw_blocks(code: Code) -> Int[Tensor, "*batch K 32 32"]:
    """The packed cells of every block on its own, as an executor of whole numbers draws it: parameters are rounded."""
    scene = unroll(Code(code.ids, code.parameters.detach().round()))
    return rasterise_apart(scene, scene.block, code.ids.shape[-2])


def stays_inside(code: Code) -> Bool[Tensor, "*batch K"]:
    """Which blocks have the centre of every copy within the grid; what lies outside of it no canvas shows."""
    lead, (steps, slots) = code.ids.shape[:-1], code.parameters.shape[-2:]
    scene = unroll(Code(code.ids.reshape(-1, 1, steps), code.parameters.detach().reshape(-1, 1, steps, slots)))
    within = (scene.centre.abs() <= RESOLUTION / 2).all(-1) | ~scene.mask
    return within.all(-1).reshape(lead)


@dataclass(frozen=True)
class _Level:
    """All copies, in drawing order, that one kind of loop moves at one level; ``place`` is where its numbers are."""

    declared: Statement
    copies: Int[Tensor, " m"]
    place: Int[Tensor, " m"]
    index: Int[Tensor, " m"]
    quarter: Bool[Tensor, " m"]


@dataclass(frozen=True)
class _Layout:
    """Where the solids that the statements return go, and what of a scene no parameter changes.

    ``source`` is the copy of each solid, ``None`` if they are the same; ``gather`` the solid of each slot, one past the
    last for padding; ``lengths`` which sizes must not be negative.
    """

    drawn: tuple[tuple[int, ...], ...]
    source: Int[Tensor, " S"] | None
    gather: Int[Tensor, " slots"]
    padded: bool
    kind: Int[Tensor, "*batch N"]
    lengths: Bool[Tensor, "*batch N 4"]
    mask: Bool[Tensor, "*batch N"]
    statement: Int[Tensor, "*batch N"]
    block: Int[Tensor, "*batch N"]
    copy: Int[Tensor, "*batch N"]


class Plan:
    """What of a batch of programs is discrete: which statement draws which copy, moved by which loops.

    Made once, it renders the same programs for other continuous parameters, which is what refinement does.

    Parameters
    ----------
    code
        Programs (..., K, J); of their parameters only the counts are read.
    """

    def __init__(self, code: Code) -> None:
        self._lead, (self._blocks, steps) = code.ids.shape[:-2], code.ids.shape[-2:]
        ids = code.ids.reshape(-1, steps)
        values = code.parameters.detach().reshape(-1, steps, code.parameters.shape[-1])
        row, step, copies = _copies(ids, values)
        self._programs = math.prod(self._lead)
        statement = ids[row].gather(-1, step[:, None])[:, 0] if len(row) else row
        present = [language()[number] for number in torch.unique(ids).tolist() if number in language()]
        draws = [(each, (statement == each.id).nonzero()[:, 0]) for each in present if not each.is_loop]
        draws = [(declared, item) for declared, item in draws if len(item)]
        self._kinds, self._counts = [declared for declared, _ in draws], [len(item) for _, item in draws]
        self._item = item = torch.cat([row[:0], *(each for _, each in draws)])
        quarter = torch.cat([row[:0].bool(), *(torch.full_like(each, d.quarter).bool() for d, each in draws)])
        self._place = row[item] * steps + step[item]
        self._levels = []
        for level in reversed(range(steps)):
            here = ids[row[item], level]
            for declared in present:
                if declared.is_loop:
                    moved = ((here == declared.id) & (level < step[item])).nonzero()[:, 0]
                    if len(moved):
                        place, index = row[item[moved]] * steps + level, copies[item[moved], level]
                        self._levels.append(_Level(declared, moved, place, index, quarter[moved]))
        self._row, self._statement = row, statement
        self._copy = torch.arange(len(row), device=row.device) - torch.searchsorted(row, row)
        self._known: _Layout | None = None

    def scene(self, parameters: Float[Tensor, "*batch K J 7"]) -> Scene:
        """The scenes for parameters of the same programs, with gradient."""
        values = parameters.reshape(-1, parameters.shape[-1])
        pieces = values.index_select(0, self._place).split(self._counts) if self._counts else ()
        drawn = [declared.solids(piece) for declared, piece in zip(self._kinds, pieces, strict=True)]
        layout = self._layout(tuple(tuple(solids.kind for solids in each) for each in drawn))
        parts = [solids for each in drawn for solids in each]
        size = torch.cat([values.new_zeros(0, SIZES), *(part.size for part in parts)])
        centre = torch.cat([values.new_zeros(0, 3), *(part.centre for part in parts)])
        rotation = _rotations(parts, values) if any(part.rotation is not None for part in parts) else None
        turn, shift = self._motion(values)
        if layout.source is not None:
            turn = None if turn is None else turn.index_select(0, layout.source)
            shift = None if shift is None else shift.index_select(0, layout.source)
        if turn is not None:
            centre = (turn @ centre[..., None])[..., 0]
            rotation = turn if rotation is None else turn @ rotation
        if shift is not None:
            centre = centre + shift
        return self._slots(layout, size, centre, rotation)

    def _slots(
        self,
        layout: _Layout,
        size: Float[Tensor, "S 4"],
        centre: Float[Tensor, "S 3"],
        rotation: Float[Tensor, "S 3 3"] | None,
    ) -> Scene:
        """Solids in the order of programs, blocks and copies as padded slots (..., N)."""
        table = torch.cat([size, centre] if rotation is None else [size, centre, rotation.flatten(1)], -1)
        if layout.padded:
            table = torch.cat([table, table.new_zeros(1, table.shape[1])])
        slots = table.index_select(0, layout.gather).reshape(*layout.mask.shape, table.shape[1])
        size = slots[..., :SIZES]
        mask = layout.mask & ((size.detach() >= 0) | ~layout.lengths).all(-1)
        identity = torch.eye(3, device=size.device, dtype=size.dtype).expand(*mask.shape, 3, 3)
        if rotation is not None:
            identity = torch.where(mask[..., None, None], slots[..., SIZES + 3 :].unflatten(-1, (3, 3)), identity)
        return Scene(
            kind=layout.kind, size=size, centre=slots[..., SIZES : SIZES + 3], rotation=identity, mask=mask,
            statement=layout.statement, block=layout.block, copy=layout.copy,
        )  # fmt: skip

    def _layout(self, drawn: tuple[tuple[int, ...], ...]) -> _Layout:
        """The layout for the kinds of primitive that each statement returned; made once."""
        if self._known is not None and self._known.drawn == drawn:
            return self._known
        device, copies = self._item.device, torch.arange(len(self._item), device=self._item.device)
        pieces = copies.split(self._counts) if self._counts else ()
        source = torch.cat([copies[:0], *(piece for piece, kinds in zip(pieces, drawn, strict=True) for _ in kinds)])
        flat = [
            (kind, n, many) for kinds, many in zip(drawn, self._counts, strict=True) for n, kind in enumerate(kinds)
        ]
        kind, number = (
            torch.cat([copies[:0], *(torch.full((f[2],), f[n], device=device) for f in flat)]) for n in (0, 1)
        )
        item = self._item[source]
        order = torch.argsort(item * (max([0, *(f[1] for f in flat)]) + 1) + number)
        item = item[order]
        program = self._row[item].div(max(self._blocks, 1), rounding_mode="floor")
        counts = torch.bincount(program, minlength=self._programs)
        slots = int(counts.max()) if len(counts) else 0
        target = program * slots + torch.arange(len(item), device=device) - (counts.cumsum(0) - counts)[program]
        gather = torch.full((self._programs * slots,), len(item), device=device).index_copy(0, target, order)
        owner = torch.zeros_like(gather).index_copy(0, target, item)
        mask, there = (gather < len(item)).reshape(*self._lead, slots), (gather < len(item)).long()

        def padded(each: Tensor) -> Tensor:
            return (each * there).reshape(mask.shape)

        kind = padded(torch.cat([kind, kind.new_zeros(1)])[gather])
        extents = torch.tensor([known.extents for known in primitives], device=device)[kind]
        row = self._row[owner] if len(item) else owner
        self._known = _Layout(
            drawn, None if all(len(kinds) == 1 for kinds in drawn) else source, gather, not bool(mask.all()), kind,
            torch.arange(SIZES, device=device) < extents[..., None], mask,
            padded(self._statement[owner] if len(item) else owner), padded(row % max(self._blocks, 1)),
            padded(self._copy[owner] if len(item) else owner),
        )  # fmt: skip
        return self._known

    def _motion(
        self, values: Float[Tensor, "R 7"]
    ) -> tuple[Float[Tensor, "M 3 3"] | None, Float[Tensor, "M 3"] | None]:
        """The rigid motion of each copy in drawing order: its loops composed from the innermost outwards."""
        if not self._levels:
            return None, None
        shift = values.new_zeros(len(self._item), 3)
        turn: Tensor | None = None
        axis: Tensor | None = None
        for level in self._levels:
            assert level.declared.move is not None
            named = level.declared.split(values.index_select(0, level.place))
            motion = level.declared.move(level.index.to(values), level.quarter, **named)
            if motion.turn is not None:
                axis = self._axes(values) if axis is None else axis
                angle = torch.zeros_like(shift[:, 0]).index_copy(0, level.copies, motion.turn.detach())
                shift = (_turned(angle) @ (shift - axis)[..., None])[..., 0] + axis
                turn = angle if turn is None else turn + angle
            if motion.shift is not None:
                shift = shift.index_add(0, level.copies, motion.shift)
        return (None if turn is None else _turned(turn)), shift

    def _axes(self, values: Float[Tensor, "R 7"]) -> Float[Tensor, "M 3"]:
        """A point at height zero on the axis about which rotation loops turn each copy, in drawing order."""
        points = []
        for declared, place in zip(self._kinds, self._place.split(self._counts), strict=True):
            if declared.pivot is None:
                points.append(values.new_zeros(len(place), 3))
            else:
                point = declared.pivot(**declared.split(values.index_select(0, place)))
                points.append(torch.cat([torch.zeros_like(point[:, :1]), point[:, 1:]], -1))
        return torch.cat(points)


def _rotations(parts: list[Solids], like: Tensor) -> Float[Tensor, "S 3 3"]:
    """Orientations of all solids, the identity where a statement gives none."""
    identity = torch.eye(3, device=like.device, dtype=like.dtype)
    return torch.cat([identity.expand(len(p.size), 3, 3) if p.rotation is None else p.rotation for p in parts])


def _groups(known: list[Statement]) -> tuple[set[int], set[int]]:
    """Ids of the loops and of the statements that draw."""
    loops = {declared.id for declared in known if declared.is_loop}
    return loops, {declared.id for declared in known} - loops


def _roles(ids: Int[Tensor, "R J"]) -> tuple[Bool[Tensor, "R J"], Bool[Tensor, "R J"]]:
    """Which steps are loops and which draw."""
    known = list(language())
    top = max([END, *(declared.id for declared in known)]) + 1
    table = torch.tensor([[number in group for number in range(top)] for group in _groups(known)], device=ids.device)
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
    last = total.cumsum(0)
    first = last - total
    many = torch.arange(int(last[-1]) if len(last) else 0, device=ids.device)
    row = torch.searchsorted(last, many, right=True)  # repeat_interleave wakes threads for a handful of rows
    rest = many - first[row]
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

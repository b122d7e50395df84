"""Unrolling: programs to scenes of primitives, vectorised over programs, blocks and copies.

Loops are transformations of what is inside.  Gradients reach every continuous parameter, shifts of loops included;
counts, turns and ids are discrete and carry none.
"""

from __future__ import annotations

from collections.abc import Sequence

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from shapeprog.errors import ShapeProgError
from shapeprog.geometry.primitive import primitives
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
    lead, (blocks, steps) = code.ids.shape[:-2], code.ids.shape[-2:]
    ids = code.ids.reshape(-1, steps)
    values = code.parameters.reshape(-1, steps, code.parameters.shape[-1])
    row, step, copies = _copies(ids, values.detach())
    flat = _Flat(ids, values, row, step, copies)
    programs = 1
    for extent in lead:
        programs *= extent
    scene = flat.scene(programs, max(blocks, 1))
    return Scene(**{name: tensor.reshape(*lead, *tensor.shape[1:]) for name, tensor in vars(scene).items()})


def _roles(ids: Int[Tensor, "R J"]) -> tuple[Bool[Tensor, "R J"], Bool[Tensor, "R J"]]:
    """Which steps are loops and which draw."""
    known = list(language())
    top = max([END, *(declared.id for declared in known)]) + 1
    table = torch.zeros(2, top, dtype=torch.bool, device=ids.device)
    for declared in known:
        table[0 if declared.is_loop else 1, declared.id] = True
    inside = ids.clamp(0, top - 1)
    valid = inside == ids
    return table[0][inside] & valid, table[1][inside] & valid


def _copies(
    ids: Int[Tensor, "R J"], values: Float[Tensor, "R J 7"]
) -> tuple[Int[Tensor, " M"], Int[Tensor, " M"], Int[Tensor, " M J"]]:
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


class _Flat:
    """All copies of all programs in one list; every step below is one pass over the kinds in use."""

    def __init__(
        self,
        ids: Int[Tensor, "R J"],
        values: Float[Tensor, "R J 7"],
        row: Int[Tensor, " M"],
        step: Int[Tensor, " M"],
        copies: Int[Tensor, "M J"],
    ) -> None:
        self.row = row
        self.copies = copies
        self.ids = ids[row]
        self.values = values[row]
        self.step = step
        self.statement = self.ids.gather(-1, step[:, None])[:, 0] if len(row) else row
        present = torch.unique(self.ids).tolist()
        self.declared = [language()[number] for number in present if number in language()]

    def scene(self, programs: int, blocks: int) -> Scene:
        """Draw, move and pad."""
        drawn = [part for declared in self.declared if not declared.is_loop for part in self._draw(declared)]
        device, dtype = self.values.device, self.values.dtype
        if not drawn:
            empty = torch.zeros(programs, 0, device=device, dtype=torch.long)
            return Scene(
                empty, torch.zeros(programs, 0, 4, device=device, dtype=dtype),
                torch.zeros(programs, 0, 3, device=device, dtype=dtype),
                torch.zeros(programs, 0, 3, 3, device=device, dtype=dtype), empty.bool(), empty, empty, empty,
            )  # fmt: skip
        item, order, kind = (torch.cat([part[i] for part in drawn]) for i in range(3))
        size, centre, rotation = (torch.cat([part[i] for part in drawn]) for i in range(3, 6))
        place = torch.argsort(item * len(drawn) + order)
        item = item[place]
        row = self.row[item]
        program = row.div(blocks, rounding_mode="floor")
        counts = torch.bincount(program, minlength=programs)
        slots = int(counts.max())
        first = counts.cumsum(0) - counts
        target = program * slots + torch.arange(len(item), device=device) - first[program]

        def pad(tensor: Tensor) -> Tensor:
            out = torch.zeros(programs * slots, *tensor.shape[1:], device=device, dtype=tensor.dtype)
            return out.index_copy(0, target, tensor).unflatten(0, (programs, slots))

        mask = pad(torch.ones_like(item, dtype=torch.bool))
        identity = torch.eye(3, device=device, dtype=dtype)
        padded_size, padded_kind = pad(size[place]), pad(kind[place])
        extents = torch.tensor([known.extents for known in primitives], device=device)[padded_kind]
        used = torch.arange(padded_size.shape[-1], device=device) < extents[..., None]
        mask = mask & ((padded_size.detach() >= 0) | ~used).all(-1)
        copy = torch.arange(len(self.row), device=device) - torch.searchsorted(self.row, self.row)
        return Scene(
            kind=padded_kind,
            size=padded_size,
            centre=pad(centre[place]),
            rotation=torch.where(mask[..., None, None], pad(rotation[place]), identity),
            mask=mask,
            statement=pad(self.statement[item]),
            block=pad(row % blocks),
            copy=pad(copy[item]),
        )

    def _draw(self, declared: Statement) -> list[tuple[Tensor, Tensor, Tensor, Tensor, Tensor, Tensor]]:
        """Item, order, kind, size, centre and rotation of all solids that one kind of statement draws."""
        item = (self.statement == declared.id).nonzero()[:, 0]
        if not len(item):
            return []
        values = self.values[item, self.step[item]]
        matrix, shift = self._motion(declared, item, values)
        parts = []
        for order, drawn in enumerate(declared.solids(values)):
            centre, rotation = drawn.centre, drawn.rotation
            if rotation is None:
                rotation = torch.eye(3, device=values.device, dtype=values.dtype).expand(len(item), 3, 3)
            if matrix is not None:
                centre = (matrix @ centre[..., None])[..., 0]
                rotation = matrix @ rotation
            kind = torch.full_like(item, drawn.kind)
            parts.append((item, torch.full_like(item, order), kind, drawn.size, centre + shift, rotation))
        return parts

    def _motion(
        self, declared: Statement, item: Int[Tensor, " m"], values: Float[Tensor, "m 7"]
    ) -> tuple[Float[Tensor, "m 3 3"] | None, Float[Tensor, "m 3"]]:
        """The rigid motion of each copy: its loops composed from the innermost outwards."""
        pivot = torch.zeros_like(values[:, :3]) if declared.pivot is None else declared.pivot(**declared.split(values))
        axis = torch.cat([torch.zeros_like(pivot[:, :1]), pivot[:, 1:]], -1)
        quarter = torch.full_like(item, declared.quarter, dtype=torch.bool)
        turn: Tensor | None = None
        shift = torch.zeros_like(axis)
        ids, loops = self.ids[item], [known for known in self.declared if known.is_loop]
        for level in reversed(range(self.ids.shape[-1])):
            for known in loops:
                here = (ids[:, level] == known.id) & (level < self.step[item])
                if not bool(here.any()):
                    continue
                assert known.move is not None
                copy = self.copies[item, level].to(values)
                motion = known.move(copy, quarter, **known.split(self.values[item, level]))
                if motion.turn is not None:
                    angle = torch.where(here, motion.turn.detach(), torch.zeros_like(copy))
                    turned = (_turned(angle) @ (shift - axis)[..., None])[..., 0] + axis
                    shift = torch.where(here[:, None], turned, shift)
                    turn = angle if turn is None else turn + angle
                if motion.shift is not None:
                    shift = torch.where(here[:, None], shift + motion.shift, shift)
        return (None if turn is None else _turned(turn)), shift

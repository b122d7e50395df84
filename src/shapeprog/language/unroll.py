"""Unrolling: programs to scenes of primitives, vectorised over programs, blocks and copies.

Loops are transformations of their bodies.  Gradients reach every continuous parameter, shifts of loops included;
counts, turns and ids are discrete and carry none.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass

from jaxtyping import Bool, Float, Int

from shapeprog.arguments import check_number
from shapeprog.errors import ShapeProgError
from shapeprog.geometry.primitive import SIZES
from shapeprog.geometry.primitives import primitives
from shapeprog.geometry.scene import Scene
from shapeprog.language.program import Program
from shapeprog.language.statement import EMPTY, END, Statement, language
from shapeprog.language.tensors import Code, encode
from shapeprog.lazy_torch import Tensor, on_numpy, torch

MOST_COPIES = 1 << 17
"""Most copies that one program may unroll to: points, cells, meshes and pictures of so many take seconds."""

MOST_PRIMITIVES = 1 << 20  # most copies that one batch may unroll to; more is a mistake in a loop count


def unroll(program: Program | Sequence[Program] | Code, *, shortest: float = 0.0) -> Scene:
    """The scene of a program, or scenes (B, N) of a batch; N is the largest number of primitives in it.

    Blocks that are not loops followed by one drawing statement draw nothing, nor do loops without copies, nor
    primitives with a negative extent.

    Parameters
    ----------
    program
        A program, several, or the tensors of either, whose parameters may require a gradient.
    shortest
        Where gradients are recorded, lengths below this many cells are drawn as this long, and their gradient ``g`` is
        ``-|g|``, so that descent lengthens them: no part vanishes while its network is trained.  The parameters, and
        the scene without gradient, do not change.  By default gradients are those of the program as it is written.

    Raises
    ------
    ShapeProgError
        If a program makes more than ``MOST_COPIES`` copies, or the batch more than ``MOST_PRIMITIVES``, or ``shortest``
        is no number of 0 or more.
    """
    if type(shortest) is not float or shortest:
        check_number("shortest", shortest, 0)
    code = program if isinstance(program, Code) else encode(program)
    recorded = torch.is_grad_enabled() and code.parameters.requires_grad
    return Plan(code).scene(code.parameters, shortest=shortest * recorded)


def on_numpy_if_shipped(program: Program) -> AbstractContextManager[None]:
    """Draw without torch within, if it is not loaded yet and every statement of a program comes with the package."""
    names = {node.name for node in program.walk()}
    return on_numpy(all(name in language() and language()[name].ships for name in names))


@contextmanager
def exact_scene(program: Program) -> Iterator[Scene]:
    """What a program draws, in double precision; without torch for statements that ship."""
    with on_numpy_if_shipped(program):
        yield unroll(encode(program, dtype=torch.float64))


def draw_blocks(code: Code) -> Int[Tensor, "*batch K 32 32"]:
    """The packed cells of every block on its own, as an executor of whole numbers draws it: parameters are rounded."""
    from shapeprog.geometry.cells import rasterise_apart

    scene = unroll(Code(code.ids, code.parameters.detach().round()))
    return rasterise_apart(scene, scene.block, code.ids.shape[-2])


@dataclass(frozen=True)
class _Level:
    """All copies, in drawing order, that one kind of loop moves at one level; ``place`` is the row of its numbers."""

    declared: Statement
    copies: Int[Tensor, " m"]
    place: Int[Tensor, " m"]
    index: Int[Tensor, " m"]
    quarter: Bool[Tensor, " m"]


@dataclass(frozen=True)
class _Layout:
    """Where the solids that the statements return go, and the fields of a scene that no parameter changes.

    ``drawn`` are the kinds of primitive by statement; ``source`` is the copy of each solid; ``gather`` the solid of
    each slot, one past the last for padding; ``signed`` which sizes may be negative; ``fixed`` the fields of a scene
    that hold whole numbers.
    """

    drawn: tuple[tuple[int, ...], ...]
    source: Int[Tensor, " S"]
    gather: Int[Tensor, " slots"]
    mask: Bool[Tensor, "*batch N"]
    signed: Bool[Tensor, "*batch N 4"]
    fixed: dict[str, Int[Tensor, "*batch N"]]


class Plan:
    """The discrete part of a batch of programs: which statement draws which copy, moved by which loops.

    Made once, it renders the same programs for other continuous parameters, which is what refinement does.  Copies are
    in drawing order: by statement, so that each draws all of its copies at once, and by position in the program.
    Of the parameters of ``code`` (..., K, J) only the counts are read.
    """

    def __init__(self, code: Code) -> None:
        self._lead, (blocks, steps) = code.ids.shape[:-2], code.ids.shape[-2:]
        ids = code.ids.reshape(-1, steps)
        row, step, index = _copies(ids, code.parameters.detach().reshape(-1, *code.parameters.shape[-2:]), blocks)
        copy = torch.arange(len(row), device=row.device) - torch.searchsorted(row, row)
        statement = ids[row, step]
        self._rank = torch.argsort(statement, stable=True)
        row, step, index, copy, statement = (field[self._rank] for field in (row, step, index, copy, statement))
        numbers, counts = torch.unique_consecutive(statement, return_counts=True)
        self._kinds, self._counts = [language()[number] for number in numbers.tolist()], counts.tolist()
        self._place = row * steps + step
        self._program = row.div(max(blocks, 1), rounding_mode="floor")
        self._whole = torch.stack([statement, row % max(blocks, 1), copy])
        quarter = _are(statement, lambda declared: declared.quarter)
        self._levels = []
        for level in reversed(range(steps)):
            loops = torch.where(level < step, ids[row, level], EMPTY)
            for number in torch.unique(loops[loops != EMPTY]).tolist():
                moved = (loops == number).nonzero()[:, 0]
                slot = row[moved] * steps + level
                self._levels.append(_Level(language()[number], moved, slot, index[moved, level], quarter[moved]))
        self._known: _Layout | None = None

    def scene(self, parameters: Float[Tensor, "*batch K J slots"], *, shortest: float = 0.0) -> Scene:
        """The scenes for parameters of the same programs, with gradient; lengths below ``shortest`` are drawn as it."""
        values = parameters.reshape(-1, parameters.shape[-1])
        numbers = values.index_select(0, self._place)
        if shortest:
            numbers = _clamped(numbers, self._least(numbers, shortest))
        pieces = numbers.split(self._counts)
        results = [declared.solids(piece) for declared, piece in zip(self._kinds, pieces, strict=True)]
        layout = self._layout(tuple(tuple(solids.kind for solids in group) for group in results))
        parts = [solids for group in results for solids in group]
        size = torch.cat([values.new_zeros(0, SIZES), *(part.size for part in parts)])
        centre = torch.cat([values.new_zeros(0, 3), *(part.centre for part in parts)])
        identity, rotation = torch.eye(3, device=values.device, dtype=values.dtype), None
        if any(part.rotation is not None for part in parts):
            turns = [identity.expand(len(p.size), 3, 3) if p.rotation is None else p.rotation for p in parts]
            rotation = torch.cat(turns)
        motion, hand, shift = self._motion(values, layout.source)
        if motion is not None:
            centre = (motion @ centre[..., None])[..., 0]
            rotation = motion if rotation is None else motion @ rotation
        if rotation is not None and hand is not None:  # primitives are their own mirror images along their last axis
            rotation = torch.cat([rotation[..., :2], rotation[..., 2:] * hand[:, None, None]], -1)
        if shift is not None:
            centre = centre + shift
        table = torch.cat([size, centre] if rotation is None else [size, centre, rotation.flatten(1)], -1)
        table = torch.cat([table, table.new_zeros(1, table.shape[1])]).index_select(0, layout.gather)
        slots = table.reshape(*layout.mask.shape, table.shape[1])
        size, centre = slots[..., :SIZES], slots[..., SIZES : SIZES + 3]
        mask = layout.mask & ((size.detach() >= 0) | layout.signed).all(-1)
        pose = identity.expand(*mask.shape, 3, 3)
        if rotation is not None:
            pose = torch.where(mask[..., None, None], slots[..., SIZES + 3 :].unflatten(-1, (3, 3)), pose)
        return Scene(size=size, centre=centre, rotation=pose, mask=mask, **layout.fixed)

    def _least(self, values: Float[Tensor, "M slots"], shortest: float) -> Float[Tensor, "M slots"]:
        """The least that each number of the drawing statements is drawn as; only lengths are bounded."""
        kinds = [[quantity.kind for quantity in declared.quantities] for declared in self._kinds]
        rows = [[shortest if kind == "length" else -math.inf for kind in row] for row in kinds]
        padded = [row + [-math.inf] * (values.shape[1] - len(row)) for row in rows]
        index = [row for row, count in enumerate(self._counts) for _ in range(count)]
        return values.new_tensor(padded).reshape(-1, values.shape[1])[index]

    def _layout(self, returned: tuple[tuple[int, ...], ...]) -> _Layout:
        """The layout for the kinds of primitive that each statement returned; made once."""
        if self._known is not None and self._known.drawn == returned:
            return self._known
        rank, programs = self._rank, math.prod(self._lead)
        pieces = torch.arange(len(rank), device=rank.device).split(self._counts)
        parts = [(piece, kind) for piece, kinds in zip(pieces, returned, strict=True) for kind in kinds]
        source = torch.cat([rank[:0], *(piece for piece, _ in parts)])
        kind = torch.cat([rank[:0], *(torch.full_like(piece, kind) for piece, kind in parts)])
        order = torch.argsort(rank[source], stable=True)
        program = self._program[source[order]]
        counts = torch.bincount(program, minlength=programs)
        slots = int(counts.max()) if programs else 0
        slot = torch.arange(len(order), device=rank.device) - (counts.cumsum(0) - counts)[program]
        gather = torch.full((programs * slots,), len(order), device=rank.device)
        gather = gather.index_copy(0, program * slots + slot, order).reshape(*self._lead, slots)
        integers = torch.cat([self._whole[:, source], kind[None]])
        fixed = torch.cat([integers, integers.new_zeros(4, 1)], -1)[:, gather]
        extents = torch.tensor([primitive.extents for primitive in primitives], device=rank.device)[fixed[3]]
        signed = torch.arange(SIZES, device=rank.device) >= extents[..., None]
        fields = dict(zip(("statement", "block", "copy", "kind"), fixed, strict=True))
        mask = gather < len(order)
        self._known = _Layout(returned, source, gather.flatten(), mask, signed, fields)
        return self._known

    def _motion(
        self, values: Float[Tensor, "R slots"], source: Int[Tensor, " S"]
    ) -> tuple[Float[Tensor, "S 3 3"] | None, Float[Tensor, " S"] | None, Float[Tensor, "S 3"] | None]:
        """The turn or reflection of each solid, -1 where it is a reflection, and its shift.

        Loops are composed from the innermost outwards; there is nothing where no loop turns, reflects or moves.
        """
        if not self._levels:
            return None, None, None
        shift = values.new_zeros(len(self._rank), 3)
        pose = hand = axes = None
        for level in self._levels:
            assert level.declared.move is not None
            named = level.declared.split(values.index_select(0, level.place))
            motion = level.declared.move(level.index.to(values), level.quarter, **named)
            if motion.signs is not None:
                flip = torch.ones_like(shift).index_copy(0, level.copies, motion.signs.detach())
                shift, sign = flip * shift, flip.prod(-1)
                pose = torch.diag_embed(flip) if pose is None else flip[..., None] * pose
                hand = sign if hand is None else hand * sign
            if motion.turn is not None or motion.rotation is not None:
                turned = _turned(motion.turn) if motion.rotation is None else motion.rotation  # type: ignore[arg-type]
                identity = torch.eye(3, device=values.device, dtype=values.dtype)
                matrix = identity.expand(len(shift), 3, 3).clone().index_copy(0, level.copies, turned)
                if motion.pivot is not None:
                    pivot = torch.zeros_like(shift).index_copy(0, level.copies, motion.pivot)
                else:
                    pivot = axes = self._axes(values) if axes is None else axes
                shift = (matrix @ (shift - pivot)[..., None])[..., 0] + pivot
                pose = matrix if pose is None else matrix @ pose
            if motion.shift is not None:
                shift = shift.index_add(0, level.copies, motion.shift)
        pose = None if pose is None else pose.index_select(0, source)
        hand = None if hand is None else hand.index_select(0, source)
        return pose, hand, shift.index_select(0, source)

    def _axes(self, values: Float[Tensor, "R slots"]) -> Float[Tensor, "M 3"]:
        """A point at height zero on the axis about which rotation loops turn each copy, in drawing order."""
        points = []
        for declared, slots in zip(self._kinds, self._place.split(self._counts), strict=True):
            if declared.pivot is None:
                points.append(values.new_zeros(len(slots), 3))
            else:
                point = declared.pivot(**declared.split(values.index_select(0, slots)))
                points.append(torch.cat([torch.zeros_like(point[:, :1]), point[:, 1:]], -1))
        return torch.cat(points)


def _clamped(values: Float[Tensor, "M slots"], bound: Float[Tensor, "M slots"]) -> Float[Tensor, "M slots"]:
    """Numbers clamped to at least ``bound``; where one was less, its gradient is minus its magnitude.

    A straight-through clamp (Bengio et al. 2013) lets lengths run off below zero; one that passes only the gradients
    that lengthen leaves them where momentum took them.
    """
    short = values.detach() < bound
    clamped = torch.where(short, bound + (values - values.detach()), values)
    clamped.register_hook(lambda slope: None if slope is None else torch.where(short, -slope.abs(), slope))
    return clamped


def _are(ids: Int[Tensor, "*batch"], accepts: Callable[[Statement], bool]) -> Bool[Tensor, "*batch"]:
    """Which ids are those of statements that are as wanted."""
    numbers = [declared.id for declared in language() if accepts(declared)]
    return torch.isin(ids, torch.tensor(numbers, dtype=ids.dtype, device=ids.device))


def _copies(
    ids: Int[Tensor, "R J"], values: Float[Tensor, "R J slots"], blocks: int
) -> tuple[Int[Tensor, " M"], Int[Tensor, " M"], Int[Tensor, "M J"]]:
    """Block row, drawing step and copy index at each loop level of every drawn copy; programs have ``blocks`` rows."""
    steps = ids.shape[-1]
    step = _are(ids, lambda declared: declared.is_loop).long().cumprod(-1).sum(-1, keepdim=True).clamp(max=steps - 1)
    level = torch.arange(steps, device=ids.device)
    draws = _are(ids.gather(-1, step), lambda declared: not declared.is_loop)
    legal = draws & ((ids == EMPTY) | (ids == END) | (level <= step)).all(-1, keepdim=True)
    counts = values[..., 0].round().nan_to_num(0).clamp(0, MOST_PRIMITIVES + 1).long()
    counts = torch.where((level < step) & legal, counts, 1)
    total = torch.where((counts == 0).any(-1), 0, counts.double().prod(-1)) * legal[:, 0]  # the product may be infinite
    sizes = total.reshape(-1, max(blocks, 1)).sum(-1)
    if float(sizes.sum()) > MOST_COPIES:
        if float(sizes.max()) > MOST_COPIES:
            message = f"the loops of this program make more than {MOST_COPIES} copies"
            raise ShapeProgError(message, "lower their counts: so many copies can be drawn of one program")
        if float(sizes.sum()) > MOST_PRIMITIVES:
            message = f"these {len(sizes)} programs make more than {MOST_PRIMITIVES} copies together"
            raise ShapeProgError(message, "unroll fewer of them at once")
    last = total.long().cumsum(0)
    numbers = torch.arange(int(total.sum()), device=ids.device)
    row = torch.searchsorted(last, numbers, right=True)  # repeat_interleave wakes threads for a handful of rows
    remainder = numbers - (last - total.long())[row]
    index = []
    for count in reversed(counts[row].unbind(-1)):
        index.append(remainder % count)
        remainder = remainder.div(count, rounding_mode="floor")
    return row, step[row, 0], torch.stack(index[::-1], -1)


def _turned(turn: Float[Tensor, "*batch"]) -> Float[Tensor, "*batch 3 3"]:
    """Rotation about the vertical axis by a fraction of a circle; exact at quarter turns."""
    nearest = (turn * 4).round()
    exact = (turn * 4 - nearest).abs() < 1e-6
    table = torch.tensor([[1, 0, -1, 0], [0, 1, 0, -1]], device=turn.device).to(turn)[:, nearest.long() % 4]
    angle = 2 * torch.pi * turn
    cos, sin = (
        way + torch.where(exact, rounded - way, 0.0).detach()
        for way, rounded in zip((angle.cos(), angle.sin()), table, strict=True)
    )
    zero, unit = torch.zeros_like(turn), torch.ones_like(turn)
    return torch.stack([unit, zero, zero, zero, cos, -sin, zero, sin, cos], -1).unflatten(-1, (3, 3))

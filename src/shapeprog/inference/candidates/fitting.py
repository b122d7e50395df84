"""Fitting: drawing statements brought onto the points of pieces by a few steps of Gauss and Newton, all at once.

What a statement draws is known from its declaration alone, so this fits any, one of a user's own too.  Where no hint
says how to start from the box of a piece, it starts from many places: every position at a corner, a face or the middle,
every length as one of the extents.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from itertools import product
from typing import NamedTuple

import numpy as np
import torch
from jaxtyping import Float, Int
from torch import Tensor

from shapeprog.geometry.arrays import one_tensor_thread
from shapeprog.geometry.batch import Batch
from shapeprog.geometry.distance import signed_distance
from shapeprog.geometry.primitive import safe_norm
from shapeprog.geometry.scene import Scene
from shapeprog.geometry.surface import has_surface, sample_surface
from shapeprog.inference.fit.tunable import ROW, least
from shapeprog.language.hints import Box
from shapeprog.language.parameters import Parameter, Quantity, to_float32
from shapeprog.language.program import Draw
from shapeprog.language.statement import Statement, language
from shapeprog.language.tensors import Code
from shapeprog.language.unroll import Plan
from shapeprog.space import HALF, FloatArray

STARTS, BEST = 192, 3
"""Starts of a statement on a piece, some of all at random where there are more; and those of them that are fitted."""

STEPS = 8
"""Steps of Gauss and Newton."""

SAMPLES = 32
"""Points of the surface of the statement that bring it back to its piece."""

BACK = 0.3
"""What all of these count, against all points of the piece."""

WIDEST, NARROWEST = 1.0, 0.2
"""Residuals in cells that count for a quarter, at the first step and at the last."""

DAMPING = 1e-3
"""What a squared move by a cell costs in one step."""

FARTHEST = 2.0
"""Farthest move of one number in one step, in cells; of angles in tens of degrees."""

THIN = 0.3
"""A length may start as this share of the least extent, too: the thickness of what has an inside."""

UNSURE = 0.3
"""Weight of a point where the normal of the surface is at a right angle to its own."""

BESIDE = 0.01
"""Cells off the surface at which the direction of a solid is asked for."""

COUNTS = 6
"""Most copies that a statement with a count starts from."""


class Target(NamedTuple):
    """Points and their normals (B, P, 3) that each of B programs is fitted to, and how far apart they are (B,)."""

    points: Float[Tensor, "B P 3"]
    normals: Float[Tensor, "B P 3"]
    spacing: Float[Tensor, " B"]

    @classmethod
    def of(cls, points: FloatArray, normals: FloatArray) -> Target:
        """The target of such points (B, P, 3)."""
        places = torch.from_numpy(points)
        apart = torch.cdist(places, places) + torch.diag(torch.full(places.shape[1:2], torch.inf).to(places))
        return cls(places, torch.from_numpy(normals), apart.amin(-1).mean(-1))

    @property
    def beside(self) -> Float[Tensor, "B P 3"]:
        """Just off the points: on a surface itself the distance has no slope."""
        return self.points + BESIDE * self.normals

    def take(self, rows: Int[Tensor, " C"]) -> Target:
        """Those of some of the programs."""
        return Target(*(part[rows] for part in self))


class Residuals(NamedTuple):
    """How far each of B programs is from its target, in R residuals.

    Parameters
    ----------
    off
        Distances in cells (B, R): of the points of the target, then of samples of the program's surface.
    weights
        What each counts (B, R): points more where the normals agree.
    turned
        Mean of 1 - the cosine between normals (B,).
    """

    off: Float[Tensor, "B R"]
    weights: Float[Tensor, "B R"]
    turned: Float[Tensor, " B"]


class Linear(NamedTuple):
    """Residuals and what each counts (B, R), as in :class:`Residuals`, and their slopes by the numbers (B, R, V)."""

    off: Float[Tensor, "B R"]
    weights: Float[Tensor, "B R"]
    slopes: Float[Tensor, "B R V"]


class Renderer:
    """What B statements draw, each for numbers of its own, of which it takes the first.

    How they are unrolled is worked out once for each number of copies.
    """

    def __init__(self, statements: Sequence[Statement]) -> None:
        self.statements = statements
        self._ids = torch.tensor([declared.id for declared in statements])
        self._plans: dict[torch.Size, Plan] = {}

    def __call__(self, values: Float[Tensor, "B *copies V"]) -> Scene:
        """A scene for each row of numbers, with gradient; of every statement there may be several."""
        shape, parameters = values.shape[:-1], values[..., None, None, :]
        if shape not in self._plans:
            ids = self._ids.reshape(-1, *(1 for _ in shape[1:])).expand(shape)
            self._plans[shape] = Plan(Code(ids[..., None, None], parameters))
        return self._plans[shape].scene(parameters)

    def table(self, of: Callable[[Quantity], float], rest: float) -> Float[Tensor, "B V"]:
        """Something of the quantity of every number, and what stands for it where a statement takes no more."""
        rows = [[of(quantity) for quantity in declared.quantities] for declared in self.statements]
        most = max(map(len, rows))
        return torch.tensor([row + [rest] * (most - len(row)) for row in rows], dtype=torch.float64)


def fit(declared: Statement, boxes: Sequence[Box], target: Target, seed: int = 0) -> list[Draw]:
    """The statement fitted to each piece, from many starts in its box; the same for the same seed."""
    if not boxes:
        return []
    random, generator = np.random.default_rng(seed), torch.Generator().manual_seed(seed)
    started = [_some(starts(declared, box), random) for box in boxes]
    owner = torch.from_numpy(np.repeat(np.arange(len(boxes)), [len(each) for each in started]))
    values = torch.from_numpy(np.concatenate(started))

    def best(count: int) -> Int[Tensor, " C"]:
        off = _misfit(Renderer([declared] * len(values)), values, target.take(owner), generator)
        mine = [(owner == number).nonzero()[:, 0] for number in range(len(boxes))]
        return torch.cat([here[off[here].argsort(stable=True)[:count]] for here in mine])

    chosen = best(BEST)
    values, owner = values[chosen], owner[chosen]
    values = _descended(Renderer([declared] * len(values)), values, target.take(owner), generator)
    return [_draw(declared, row) for row in values[best(1)].tolist()]


def improve(drawn: Sequence[Draw], target: Target, seed: int = 0) -> list[Draw]:
    """Statements fitted each to its own points, from the numbers that they have."""
    if not drawn:
        return []
    statements = [language()[draw.name] for draw in drawn]
    values = torch.zeros(len(drawn), max(len(draw.values) for draw in drawn), dtype=torch.float64)
    for row, draw in zip(values, drawn, strict=True):
        row[: len(draw.values)] = torch.tensor(draw.values)
    values = _descended(Renderer(statements), values, target, torch.Generator().manual_seed(seed))
    return [_draw(declared, row) for declared, row in zip(statements, values.tolist(), strict=True)]


def _draw(declared: Statement, values: Sequence[float]) -> Draw:
    return Draw(declared.name, tuple(map(to_float32, values[: len(declared.quantities)])))


def starts(declared: Statement, box: Box) -> FloatArray:
    """All starts (S, slots) of a statement in a box: every combination of what each parameter may start as."""
    options = [_options(parameter, box) for parameter in declared.parameters]
    many = math.prod(map(len, options))
    if many > STARTS**2:  # too many to list: those of each parameter in turn, out of step with each other
        rows = [[each[(row // (k + 1)) % len(each)] for k, each in enumerate(options)] for row in range(STARTS**2)]
        return np.array([np.concatenate(row) for row in rows])
    return np.array([np.concatenate(row) for row in product(*options)])


def _options(parameter: Parameter, box: Box) -> list[FloatArray]:
    """What a parameter may start as."""
    quantity = parameter.quantity
    if parameter.default is not None:
        return [np.array([parameter.default])]
    found = np.array(list(_values(quantity, box)), np.float64).clip(quantity.low, quantity.high)
    return list(np.unique(found.round(3), axis=0))


def _values(quantity: Quantity, box: Box) -> Iterator[Sequence[float]]:
    """What a quantity may start as: places of a box, its extents or half of them; shifts and angles at zero."""
    reach = np.abs(box.rotation) @ box.half
    width, half = quantity.width, 1.0 if quantity.high == HALF else 2.0
    if quantity.kind == "position" and width == len(reach):
        along = box.half.max() * box.rotation[:, box.half.argmax()]
        below = np.array([reach[0], 0, 0])
        for away in (np.zeros(3), -below, below, -reach, along, -along):
            yield (box.centre + away).tolist()
    elif quantity.kind == "length" and width == len(reach):
        yield (half * reach).tolist()
    elif quantity.kind in ("position", "length"):
        known = (
            box.centre
            if quantity.kind == "position"
            else half * np.concatenate([reach, box.half, [THIN * box.half.min()]])
        )
        yield from product(*[np.unique(known.round(3)).tolist()] * width)
    elif quantity.discrete:
        last = 3.0 if quantity.kind == "turn" else float(COUNTS)
        for number in range(max(round(quantity.low), 0), round(min(quantity.high, last)) + 1):
            yield [float(number)] * width
    else:
        yield [0.0] * width


def _some(rows: FloatArray, random: np.random.Generator) -> FloatArray:
    return rows if len(rows) <= STARTS else rows[np.sort(random.choice(len(rows), STARTS, replace=False))]


def _descended(
    render: Renderer, values: Float[Tensor, "B V"], target: Target, generator: torch.Generator
) -> Float[Tensor, "B V"]:
    """The numbers after some steps of Gauss and Newton, in which residuals of ever fewer cells count."""
    free = render.table(lambda quantity: not quantity.discrete, 0.0)
    scale = render.table(lambda quantity: 0.1 if quantity.kind == "angle" else 1.0, 1.0)
    low = render.table(least, -math.inf)
    damping = torch.diag_embed(torch.where(free > 0, DAMPING * scale**2, 1.0))
    with one_tensor_thread(kernels=1):
        for step in range(STEPS):
            width = WIDEST * (NARROWEST / WIDEST) ** (step / (STEPS - 1))
            off, weights, slopes = _linear(render, values, target, generator)
            slopes = slopes * free[:, None]
            weighted = (weights * (width**2 / (width**2 + off**2)) ** 2)[..., None] * slopes
            move = -torch.linalg.solve(weighted.mT @ slopes + damping, (weighted * off[..., None]).sum(1))
            values = torch.maximum(values + (move * scale).clamp(-FARTHEST, FARTHEST) / scale, low)
    return values


def _misfit(
    render: Renderer, values: Float[Tensor, "B V"], target: Target, generator: torch.Generator
) -> Float[Tensor, " B"]:
    """What is wrong with each program: its robust residuals and normals; infinite where it draws nothing."""
    scene = render(values)
    drawn = has_surface(scene)
    off = torch.full_like(values[:, 0], torch.inf)
    if drawn.any():
        here, scene = target.take(drawn.nonzero()[:, 0]), scene[drawn]
        beside = here.beside.requires_grad_()
        found = _compared(
            here, beside, signed_distance(scene, beside), sample_surface(scene, SAMPLES, generator).points
        )
        share = found.off**2 / (found.off**2 + WIDEST * NARROWEST)
        off[drawn] = (found.weights * share).sum(1) + found.turned
    return off


def _linear(render: Renderer, values: Float[Tensor, "B V"], target: Target, generator: torch.Generator) -> Linear:
    """The residuals to first order; what draws nothing has none.

    Every residual has the primitives to itself, so one backward pass tells how they move it; how the numbers move them
    is known from another, in which a copy of the program has each number of each primitive to itself.
    """
    moving = values[:, None].expand(-1, ROW, -1).clone().requires_grad_()
    moved = render(moving)
    scene = Batch(*(each[:, 0].detach() for each in (moved.kind, moved.size, moved.centre, moved.rotation, moved.mask)))
    drawn = has_surface(scene).nonzero()[:, 0]
    here, count, rows = target.take(drawn), len(values), target.points.shape[1] + SAMPLES
    off, weights, slopes = (values.new_zeros(count, rows, *rest) for rest in ((), (), values.shape[1:]))
    if len(drawn):
        leaves = [
            each[drawn, None].expand(-1, rows, *each.shape[1:]).detach().clone().requires_grad_()
            for each in (scene.size, scene.centre, scene.rotation)
        ]

        def copies(some: slice) -> Batch:
            kind, mask = (each[drawn, None].expand(-1, rows, -1)[:, some] for each in (scene.kind, scene.mask))
            size, centre, rotation = (leaf[:, some] for leaf in leaves)
            return Batch(kind, size, centre, rotation, mask)

        beside = here.beside.requires_grad_()
        ahead = signed_distance(copies(slice(-SAMPLES)), beside[:, :, None])[..., 0]
        sample = sample_surface(copies(slice(-SAMPLES, None)), 1, generator).points[:, :, 0]
        found = _compared(here, beside, ahead, sample)
        moves = torch.cat([each.flatten(3) for each in torch.autograd.grad(found.off.sum(), leaves)], -1)
        slopes[drawn] = (moves.nan_to_num(0).flatten(2) @ _moved(moved, moving)[drawn].flatten(1, 2)).to(slopes)
        off[drawn], weights[drawn] = found.off.detach(), found.weights
    return Linear(off, weights, slopes)


def _moved(scene: Scene, moving: Float[Tensor, "B 16 V"]) -> Float[Tensor, "B N 16 V"]:
    """How sizes, centre and rotation of every primitive of each program follow its numbers.

    The scene is that of 16 copies of the numbers: one for each number of a primitive.
    """
    rows = torch.cat([scene.size, scene.centre, scene.rotation.flatten(-2)], -1)  # (B, 16, N, 16)
    which = torch.arange(ROW)
    found = [
        torch.autograd.grad(rows[:, which, slot, which].sum(), moving, retain_graph=True)[0]
        for slot in range(rows.shape[2])
    ]
    return torch.stack(found, 1).nan_to_num(0)


def _compared(
    target: Target, beside: Float[Tensor, "B P 3"], ahead: Float[Tensor, "B P"], sample: Float[Tensor, "B S 3"]
) -> Residuals:
    """Residuals from the distances of the points beside a target, and samples of the surfaces."""
    (facing,) = torch.autograd.grad(ahead.sum(), beside, retain_graph=True)
    cosine = (facing * target.normals).sum(-1).abs()
    nearest = torch.cdist(sample.detach(), target.points).argmin(-1)
    apart = sample - target.points.gather(1, nearest[..., None].expand_as(sample))
    back = (safe_norm((apart**2).sum(-1)) - 2 * target.spacing[:, None]).clamp(min=0)
    weights = [(UNSURE + (1 - UNSURE) * cosine) / cosine.shape[1], torch.full_like(back, BACK / SAMPLES)]
    return Residuals(torch.cat([ahead - BESIDE, back], 1), torch.cat(weights, 1).detach(), (1 - cosine).mean(1))

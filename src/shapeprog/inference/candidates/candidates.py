"""Candidates: blocks that a program may consist of, from the pieces of a target.

Every statement that hints how it starts from an oriented box is tried on every piece.  What fits the points of its
piece best is kept, and of several statements that draw the same solid the one that writes the fewest numbers.
Statements without a hint are fitted to the most important pieces, and kept where they are as good.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import chain, compress
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import torch
from jaxtyping import Float
from torch import Tensor

from shapeprog.geometry.distance import signed_distance
from shapeprog.geometry.primitive import SIZES
from shapeprog.geometry.primitives import primitives
from shapeprog.geometry.scene import Scene
from shapeprog.geometry.surface import sample_surface
from shapeprog.inference.candidates.fitting import BESIDE, Target, fit, improve
from shapeprog.inference.candidates.stretching import stretched
from shapeprog.inference.fit.tunable import THINNEST, bounds
from shapeprog.inference.pieces.cover_kernels import near_boxes
from shapeprog.inference.pieces.pieces import Pieces, Source
from shapeprog.language.hints import Box
from shapeprog.language.parameters import to_float32
from shapeprog.language.printer import numbers_written
from shapeprog.language.program import Draw, Loop, Node, Program, nest
from shapeprog.language.statement import END, Statement, language
from shapeprog.language.tensors import encode
from shapeprog.language.unroll import unroll
from shapeprog.space import Array, FloatArray

NEAR = 0.3
"""Cells around a piece within which points of the surface belong to it."""

POINTS = 64
"""Points of a piece that a statement is measured by."""

SEEN = 5_000
"""Points of the surface among which they are looked for."""

FITTED = 48
"""Pieces to which statements are fitted, the most important but sheets, which do not tell of any solid."""

GOOD, WORTH = 0.08, 0.3
"""Misfit up to which a hint needs no fitting; and how much worse than the best one it may be to be worth it."""

WRONG = 0.5
"""Distance in cells that counts as much as a normal at right angles."""

SLACK = 0.05
"""How much worse than the best a statement may fit if it writes fewer numbers, see :func:`misfits`."""

SAME = 0.02
"""Relative difference of moments, and distance in cells, below which two solids are the same."""


Mask = npt.NDArray[np.bool_]


class Looks(NamedTuple):
    """What tells whether candidates are copies of each other.

    Parameters
    ----------
    kind
        The statements and counts that a block is made of.
    middle, spread, skew
        The mean (C, 3) of the centres of its solids, second moments (C, 3, 3) and third moments (C, 3) about it.
    lean
        How solids differ between their sides, in cells along each axis (C, 3): where a leg tapers, an arc bulges.
    """

    kind: tuple[str, ...]
    middle: FloatArray
    spread: FloatArray
    skew: FloatArray
    lean: FloatArray

    @property
    def size(self) -> FloatArray:
        """How far a candidate reaches from its middle (C,)."""
        return np.sqrt(np.trace(self.spread, axis1=1, axis2=2))


class Shells(NamedTuple):
    """Points (N, P, 3) on the surface close to the faces of each piece, their normals, and which have none (N,)."""

    points: FloatArray
    normals: FloatArray
    empty: Mask

    def target(self, pieces: Array) -> Target:
        """What statements for some pieces are fitted to."""
        return Target.of(self.points[pieces], self.normals[pieces])


def single_candidates(pieces: Pieces, seed: int = 0) -> list[Node]:
    """One drawing statement for every piece, in the order of the pieces; none where no statement starts from its box.

    Hints are improved where none of them fits yet; statements without one are fitted from many starts.
    """
    shells, half = shells_of(pieces), np.maximum(pieces.boxes.half, THINNEST / 2)
    boxes = [Box(*each) for each in zip(pieces.boxes.centre, pieces.boxes.rotation, half, strict=True)]
    hinted = [drawings(box) for box in boxes]
    drawn, owner = list(chain(*hinted)), np.repeat(np.arange(len(boxes)), [len(each) for each in hinted])
    misfit = misfits(drawn, owner, shells)
    least = _least(misfit, owner, len(boxes))
    some = np.flatnonzero(~shells.empty & (pieces.source != Source.SHEET.value))[:FITTED]
    unsure = np.isin(owner, some) & (least[owner] > GOOD) & (misfit <= least[owner] + WORTH)
    more = [(improve(list(compress(drawn, unsure)), shells.target(owner[unsure]), seed), owner[unsure])]
    more += [
        (fit(declared, [boxes[piece] for piece in some], shells.target(some), seed), some)
        for declared in filter(is_unhinted, language())
    ]
    for draws, whose in more:
        drawn, owner = [*drawn, *draws], np.append(owner, whose)
        misfit = np.append(misfit, misfits(draws, whose, shells))
    fitting = np.flatnonzero(misfit <= _least(misfit, owner, len(boxes))[owner] + SLACK).tolist()
    fitting.sort(key=lambda k: (numbers_written(drawn[k]), misfit[k]), reverse=True)
    found = {int(owner[k]): drawn[k] for k in fitting}
    return [found[piece] for piece in sorted(found)]


def is_unhinted(declared: Statement) -> bool:
    """Whether a drawing statement, but for those of the paper, does not say how it starts from a box."""
    return declared.hint is None and not declared.is_loop and declared.id > END


def as_unhinted(nodes: Sequence[Node], seed: int = 0) -> list[tuple[int, Node]]:
    """Blocks as statements without a hint draw them, each with the place of the block that it is fitted to.

    Pieces are boxes that others with a hint may fit as well; what was chosen in the end can be fitted without doubt.
    """
    statements = list(filter(is_unhinted, language()))
    if not statements or not nodes:
        return []
    programs = [Program((node,)) for node in nodes]
    single = [(place, program.chains[0]) for place, program in enumerate(programs) if program.blocks == 1]
    around = solid_boxes([chain[-1] for _, chain in single])
    blocks = [(place, chain, boxes[0]) for (place, chain), boxes in zip(single, around, strict=True) if len(boxes) == 1]
    if not blocks:
        return []
    scene = unroll(encode([Program((chain[-1],)) for _, chain, _ in blocks], dtype=torch.float64))
    surface = sample_surface(scene, POINTS, torch.Generator().manual_seed(seed))
    target = Target.of(surface.points.double().numpy(), surface.normals.double().numpy())
    return [
        (place, nest((*chain[:-1], stretched(drawn, box) or drawn)))  # points seldom lie where it ends
        for declared in statements
        for (place, chain, box), drawn in zip(
            blocks, fit(declared, [box for *_, box in blocks], target, seed), strict=True
        )
        if chain[-1].name != declared.name
    ]


def _least(misfit: FloatArray, owner: Array, count: int) -> FloatArray:
    """The least misfit for each piece; infinite where there is none."""
    least = np.full(count, np.inf)
    np.minimum.at(least, owner, misfit)
    return least


def plain(node: Node) -> Node:
    """The same block drawn by the statement that writes the fewest numbers, of those with a hint that draw the same.

    Nothing changes where the statement turns about an axis of its own, or draws several solids.
    """
    if isinstance(node, Loop):
        return Loop(node.name, node.values, tuple(plain(inner) for inner in node.body))
    if language()[node.name].pivot is not None:
        return node
    (boxes,) = solid_boxes([node])
    others = [replace(other, role=node.role) for other in drawings(boxes[0])] if len(boxes) == 1 else []
    same = list(_drawing_the_same(others, node, np.ones(3)))
    if not same or is_unhinted(language()[node.name]):  # those of the paper are said as a solid with a role
        same.append(node)
    return min(same, key=numbers_written)


def at_the_far_side(node: Node) -> Node:
    """The same block with what is mirrored about the middle of the shape drawn on the right, and at the rear.

    Nothing changes where the statement has no drawing of the image, or other loops stand between.
    """
    if Program((node,)).blocks != 1:
        return node
    *loops, drawn = Program((node,)).chains[0]
    assert isinstance(drawn, Draw)
    (boxes,) = solid_boxes([drawn])
    signs = np.ones(3)
    for loop in loops:
        if loop.name == "mirror" and loop.values[2] == 0 and boxes and boxes[0].centre[int(loop.values[1])] < 0:
            signs[int(loop.values[1])] = -1
    if (signs > 0).all() or len(boxes) != 1 or any(loop.name != "mirror" for loop in loops):
        return node
    turn = signs[:, None] * boxes[0].rotation * [1, 1, signs.prod()]  # a box is its own image along its last axis
    image = Box(signs * boxes[0].centre, turn, boxes[0].half)
    others = [replace(other, role=drawn.role) for other in redrawn(drawn, image)]
    found = next(_drawing_the_same(others, drawn, signs), None)
    return node if found is None else nest((*loops, found))


def _drawing_the_same(others: Sequence[Draw], node: Node, signs: FloatArray) -> Iterator[Draw]:
    """Those of some drawings whose surface is that of a node, or of its image by these signs of its coordinates."""
    if not others:
        return
    scene = unroll(encode(Program((node,)), dtype=torch.float64))
    points = sample_surface(scene, POINTS, torch.Generator().manual_seed(0)).points.double() * torch.from_numpy(signs)
    drawn = unroll(encode([Program((other,)) for other in others], dtype=torch.float64))
    off = signed_distance(drawn, points.expand(len(others), -1, -1)).abs().amax(-1).tolist()
    yield from (other for other, far in zip(others, off, strict=True) if far < SAME)


def drawings(box: Box) -> list[Draw]:
    """How the statements that have a hint draw a box."""
    return [drawn for declared in language() for drawn in _hinted(declared, box)]


def _hinted(declared: Statement, box: Box) -> list[Draw]:
    """How a statement draws a box by its hint."""
    if declared.hint is None:
        return []
    return [Draw(declared.name, tuple(to_float32(value) for value in values)) for values in declared.hint(box)]


def redrawn(drawn: Draw, box: Box) -> list[Draw]:
    """How the same statement draws another box."""
    declared = language()[drawn.name]
    if not is_unhinted(declared):
        return _hinted(declared, box)
    other = stretched(drawn, box)
    return [other] if other else []


def alike(drawn: Draw, box: Box) -> list[Draw]:
    """How the same statement draws another box; how all others do where it does not."""
    return redrawn(drawn, box) or drawings(box)


def solid_boxes(nodes: Sequence[Node]) -> list[list[Box]]:
    """The boxes around all solids that each block draws."""
    scene = unroll(encode([Program((node,)) for node in nodes], dtype=torch.float64))
    half = bounds(scene)
    return [
        [Box(*(each[row, slot].numpy() for each in (scene.centre, scene.rotation, half)))
         for slot in scene.mask[row].nonzero()[:, 0].tolist()]
        for row in range(len(nodes))
    ]  # fmt: skip


def shells_of(pieces: Pieces) -> Shells:
    """Points of the surface close to the faces of each piece."""
    cloud = pieces.cloud
    step = max(1, len(cloud.points) // SEEN)
    points, normals = cloud.points[::step], cloud.normals[::step]
    count = len(pieces.boxes.half)
    near, chosen = np.zeros((count, len(points)), np.bool_), np.zeros((count, POINTS), np.int64)
    near_boxes(np.ascontiguousarray(points), *map(np.ascontiguousarray, pieces.boxes), NEAR, near, np.zeros(count))
    empty = near.sum(1) == 0
    for piece in np.flatnonzero(~empty):
        inside = np.flatnonzero(near[piece])
        chosen[piece] = inside[np.arange(POINTS) * len(inside) // POINTS]
    return Shells(points[chosen], normals[chosen], empty)


def misfits(drawn: Sequence[Draw], owner: Array, shells: Shells) -> FloatArray:
    """How far statements are from the points of their pieces: mean distance over ``WRONG`` plus 1 - the mean cosine.

    Zero for pieces without points.
    """
    if not drawn:
        return np.zeros(0)
    normals = shells.normals[owner]
    beside = shells.points[owner] + BESIDE * normals  # on a surface itself the distance has no slope
    where = torch.from_numpy(beside).requires_grad_()
    scene = unroll(encode([Program((node,)) for node in drawn], dtype=torch.float64))
    distance = signed_distance(scene, where)
    (slope,) = torch.autograd.grad(distance.sum(), where)
    cosine = (slope.numpy() * normals).sum(-1)
    wrong = np.minimum(np.abs(distance.detach().numpy()) / WRONG, 1).mean(1) + 1 - np.abs(cosine).mean(1)
    return np.where(shells.empty[owner], 0.0, wrong)


def looks(nodes: Sequence[Node]) -> Looks:
    """What tells whether blocks are copies of each other."""
    return looks_of([Program((node,)) for node in nodes])


def looks_of(programs: Sequence[Program]) -> Looks:
    """What tells whether all that programs draw are copies of each other."""
    scene = unroll(encode(programs, dtype=torch.float64))
    share = scene.mask.double()
    share = share / share.sum(-1, keepdim=True).clamp(min=1)
    own, lean = _own_looks(scene)
    middle = (share[..., None] * scene.centre).sum(1)
    away = scene.centre - middle[:, None]
    squared = (away**2).sum(-1) + own.diagonal(dim1=-2, dim2=-1).sum(-1)
    spread = own + away[..., :, None] * away[..., None, :]
    skew = squared[..., None] * away + 2 * (own @ away[..., None])[..., 0]
    vectors = ((share[..., None] * each).sum(1) for each in (skew, lean))
    found = (share[..., None, None] * spread).sum(1), *vectors
    kinds = tuple(" ".join(map(_kind, program.body)) for program in programs)
    return Looks(kinds, middle.numpy(), *(each.numpy() for each in found))


def _own_looks(scene: Scene) -> tuple[Float[Tensor, "C N 3 3"], Float[Tensor, "C N 3"]]:
    """Second moments that stand for each solid, those of its box, and how its distance differs between its sides.

    They turn and mirror with the solid, and are the same for solids that are the same however their axes are named.
    """
    spread, leans = torch.zeros_like(scene.rotation), torch.zeros_like(scene.centre)
    signs = torch.cartesian_prod(*[torch.tensor([-1.0, 0.0, 1.0], dtype=torch.float64)] * 3)
    for kind in scene.kinds:
        here = scene.mask & (scene.kind == kind)
        size, rotation = scene.size[here], scene.rotation[here]
        half = primitives[kind].bound(size)
        places = signs * half[:, None]
        level = primitives[kind].distance(places, size[:, None].expand(*places.shape[:2], SIZES))
        lean = level @ signs / len(signs)
        twist = torch.einsum("mp,mpi,mpj->mij", level, places, places) / len(signs) / half.amax(-1)[:, None, None]
        twist = twist - torch.diag_embed(twist.diagonal(dim1=-2, dim2=-1))
        own = torch.diag_embed(half**2) + twist
        spread[here] = rotation @ own @ rotation.mT
        leans[here] = (rotation @ lean[..., None])[..., 0]
    return spread, leans


def _kind(node: Node) -> str:
    if isinstance(node, Loop):
        return f"{node.name} {node.count} {' '.join(_kind(inner) for inner in node.body)}"
    return node.name


def distinct(nodes: list[Node], seen: Looks) -> list[int]:
    """Of candidates that draw the same, the first; in their order."""
    kept: list[int] = []
    middle: FloatArray = np.zeros((0, 3))
    spread: FloatArray = np.zeros((0, 3, 3))
    for place in range(len(nodes)):
        scale = max(float(np.sqrt(np.trace(seen.spread[place]))), 1e-3)
        near = np.abs(middle - seen.middle[place]).max(1, initial=0) < SAME * scale if len(kept) else np.zeros(0, bool)
        same = near & (np.abs(spread - seen.spread[place]).max((1, 2), initial=0) < SAME * scale**2)
        if any(seen.kind[kept[k]] == seen.kind[place] for k in np.flatnonzero(same)):
            continue
        kept.append(place)
        middle, spread = np.append(middle, seen.middle[place][None], 0), np.append(spread, seen.spread[place][None], 0)
    return kept

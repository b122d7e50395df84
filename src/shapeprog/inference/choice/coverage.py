"""Coverage of a target by candidates: the points that each explains, its cost, and the parts of others that it hides.

A candidate is a program of one block.  All data for the selection is computed once as bits:

*   points of the evidence that its surface explains (near enough, with a fitting normal);
*   some of these points that are near even by half of the tolerance;
*   points deep inside it, where it hides every other candidate;
*   points of free space that it fills;
*   parts of a mesh that one of its primitives draws;
*   points near the sides of the box around the target that it explains;
*   samples of its surface that the target does not support, or that face the other way than the target's.  They are
    charged by their area unless they are hidden inside a selected candidate, including other copies of the same one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np
import torch

from shapeprog.geometry.arrays import over_threads
from shapeprog.geometry.primitives import KINDS
from shapeprog.geometry.scene import Scene
from shapeprog.geometry.surface import face_areas, sample_surface
from shapeprog.inference.candidates.loops import mirrors
from shapeprog.inference.choice.bits import WORD, BinnedPoints, Bits, by_word, covers, nearby, pack, sorted_by_cell
from shapeprog.inference.choice.coverage_kernels import charged
from shapeprog.inference.choice.settings import SETTINGS
from shapeprog.inference.surface.evidence import Evidence, off_parts
from shapeprog.inference.surface.oriented import Boxes
from shapeprog.language.ast import Assignment, Comment
from shapeprog.language.free import numbers_outside
from shapeprog.language.program import Loop, Node, Program
from shapeprog.language.unroll import unroll
from shapeprog.library.length import outside
from shapeprog.space import HALF, RESOLUTION, Array, BoolArray, FloatArray, IntArray

AWAY = 4.0 * HALF  # a coordinate outside all candidates, by which unused samples of a word are known


@dataclass(frozen=True)
class Prices:
    """Prices subtracted from the value of a program, in shares of the target explained; chosen on val.

    Each further block of a call costs as much as a loop; otherwise a box could be written as a drawer whose handle is
    hidden.  The reward for parts separates drawers, since the gaps between them have little surface; that for sides
    draws thin legs; that for close surface selects, among statements that explain the same points, the one with the
    shape of the target: a square leg is not drawn as a round one.
    """

    unsupported: float = 0.4  # of exposed surface that the target does not support, over the area of the target
    free: float = 0.5  # of free space filled, in cells, over the same area
    statement: float = 0.005  # of a drawing statement or call
    loop: float = 0.002
    number: float = 0.0008  # of every continuous number in the text
    part: float = 0.004  # added for every part of a mesh, along the axes, that one primitive draws, 16 times at most
    implausible: float = 0.02  # of reaching beyond the box around the target, as one copy too many; of overlapping ones
    side: float = 0.0  # added for all points near one side of the box around the target
    close: float = 0.015  # added for the share of the target within half a tolerance, with nearly the same normal

    def of(self, program: Program) -> float:
        """The price of the text of a program; function definitions cost nothing."""
        lines = program.walk() if program.source is None else outside(program.source.lines)
        priced = [line for line in lines if not isinstance(line, Comment | Assignment)]
        loops = sum(isinstance(line, Loop) for line in priced)
        statements = len(priced) - loops
        more = program.blocks - statements  # those of calls
        return float(self.statement * statements + self.loop * (loops + more) + self.number * numbers_outside(program))


class CoverageTable(NamedTuple):
    """Coverage of candidates, as rows of bits; each candidate has one word at the end.

    ``rows`` (C, E + N + F + K + S + C) are the points that each candidate explains, those near its surface, free points
    that it fills, parts that it draws, outermost points that it explains, and samples of every candidate that it hides.
    """

    rows: Bits
    weights: FloatArray  # value of a bit of each of the first E + N + F + K + S words, negative for free points
    evidence: int  # E, the number of words for points to be explained
    interior: Bits  # points deeper inside each candidate than the tolerance (C, E + N), which no other one explains
    exposed: Bits  # unsupported samples of the surface of each candidate that it does not hide itself (C,)
    sample_price: FloatArray  # price of each of these samples (C,)
    prices: FloatArray  # price of the text of each candidate (C,)


class Coverage:
    """Coverage of one surface by candidates, which are programs of one block; each is computed once."""

    def __init__(self, evidence: Evidence, prices: Prices | None = None) -> None:
        self.evidence, self.prices = evidence, prices or Prices()
        order = np.lexsort((nearby(evidence.points), -evidence.weights))  # points of a word weigh nearly the same
        self._points = sorted_by_cell(evidence.points[order], evidence.normals[order])
        few = order[:: SETTINGS.every]
        self._few = sorted_by_cell(evidence.points[few], evidence.normals[few])
        near = self.prices.close * evidence.weights[few] / evidence.weights[few].sum()
        points, volume = free_points(evidence)
        self._free = sorted_by_cell(points)
        free = np.full(len(points), -self.prices.free * volume / max(evidence.area, 1e-9))
        straight = evidence.parts.straight
        parts = np.full(len(straight), self.prices.part / max(1.0, straight.sum() / SETTINGS.parts))
        outer = outermost(evidence)
        self._outer, sides = sorted_by_cell(*outer), np.full(len(outer[0]), self.prices.side / WORD)
        self._weights = np.concatenate(list(map(by_word, (evidence.weights[order], near, free, parts, sides))))
        self._surface = sorted_by_cell(evidence.surface, evidence.surface_normals)
        self._index: dict[Program, int] = {}
        self._rows: list[Array] = []

    def table(self, candidates: Sequence[Node | Program]) -> CoverageTable:
        """The coverage of candidates, which are nodes or programs.

        A ``ShapeProgError`` if one draws more copies than :func:`shapeprog.language.unroll` takes.
        """
        programs = [each if isinstance(each, Program) else Program((each,)) for each in candidates]
        scene = unroll(programs)
        new = [program for program in dict.fromkeys(programs) if program not in self._index]
        if new or not self._rows:
            rows = self._rows_of(new, scene if len(new) == len(programs) else unroll(new))
            self._rows = list(map(np.concatenate, zip(self._rows, rows, strict=True))) if self._rows else rows
            self._index |= {program: index for index, program in enumerate(new, len(self._index))}
        selected = np.array([self._index[program] for program in programs], np.int64)
        covered, interior, samples, sample_price, price = (row[selected] for row in self._rows)
        _, hidden = covers(scene, sorted_by_cell(samples.reshape(-1, 3)), 0.0)
        # The samples that are used and that no candidate hides by itself.
        exposed = pack(samples[..., 0] != AWAY)[:, 0] & ~hidden.diagonal()
        bits, words = np.concatenate([covered, hidden], 1), -(-len(self.evidence.points) // WORD)
        return CoverageTable(bits, self._weights, words, interior, exposed, sample_price, price)

    def _rows_of(self, candidates: Sequence[Program], scene: Scene) -> list[Array]:
        """Arrays with a row for each candidate: bits covered, bits of the interior, unsupported samples (B, 64, 3), the
        price of each, and that of the text."""
        evidence, prices = self.evidence, self.prices
        tied = centred(scene, candidates) + square(scene)
        price = np.array([prices.of(program) for program in candidates]) - prices.number * tied
        beyond = protrusion(scene, evidence) > SETTINGS.outside
        price += prices.implausible * (beyond.astype(int) + overlapping(scene))
        explained, interior = covers(scene, self._points, evidence.tolerance, evidence.agreement)
        agreement = max(evidence.agreement, SETTINGS.agreement)
        near, deeper = covers(scene, self._few, SETTINGS.near * evidence.tolerance, agreement)
        _, free = covers(scene, self._free, evidence.tolerance)
        parts = pack(np.any((off_parts(scene, evidence) <= evidence.tolerance) & evidence.parts.straight, 1))
        sides, _ = covers(scene, self._outer, evidence.tolerance, evidence.agreement)
        interior = np.concatenate([interior, deeper], 1)
        covered = np.concatenate([np.concatenate([explained, near], 1) & ~interior, free, parts, sides], 1)
        points, owners, areas = unsupported(scene, evidence, self._surface)
        number = np.bincount(owners, minlength=len(candidates))[:, None]
        sampled, slot = np.minimum(number, WORD), np.arange(WORD)
        index = np.cumsum(number)[:, None] - number + slot * number // np.maximum(sampled, 1)
        samples = np.vstack([points, np.full((1, 3), AWAY)])[np.where(slot < sampled, index, -1)]
        cost = np.bincount(owners, areas, len(candidates)) / np.maximum(sampled[:, 0], 1)
        return [covered, interior, samples, prices.unsupported / evidence.area * cost, price]


def centred(scene: Scene, candidates: Sequence[Program]) -> IntArray:
    """Number of axes (B,) along which a candidate is centred, left to right or in depth; each saves one number, as the
    position follows from the size.  Mirrored and rotated candidates save none, nor do pairs along the axis."""
    share = (scene.mask / scene.mask.sum(1, keepdim=True).clamp(min=1)).numpy()
    middle = np.einsum("bn,bni->bi", share, scene.centre.numpy())
    saving = (np.abs(middle) < SETTINGS.even) & [False, True, True]
    for row, axis in np.argwhere(saving).tolist():
        for node in candidates[row].walk():
            pair = node.name == "translate" and node.values[0] == 2 and node.values[1 + axis] != 0
            saving[row, axis] &= not (pair or mirrors(node, axis) or node.name.startswith("rotate"))
    return saving.sum(1)


def square(scene: Scene) -> BoolArray:
    """Whether the first primitive of a candidate (B,) is a bar of square section, whose sides will be one number."""
    sides = np.sort(2 * scene.bounds[:, :1].numpy(), 2)
    bars = (scene.kind[:, :1].numpy() == KINDS["cuboid"]) & (sides[..., 1] - sides[..., 0] < SETTINGS.even)
    return np.any(bars, 1)


def protrusion(scene: Scene, evidence: Evidence) -> FloatArray:
    """How far the middle of a face of each candidate (B,) is outside the box around the surface; corners may be."""
    centre, reach = scene.centre.numpy(), (scene.rotation.abs() * scene.bounds[..., None, :]).amax(-1).numpy()
    low, high = evidence.surface.min(0), evidence.surface.max(0)
    beyond = np.maximum(low - (centre - reach), centre + reach - high).max(2)
    return np.where(scene.mask, beyond, 0.0).max(1, initial=0.0)


def overlapping(scene: Scene) -> BoolArray:
    """Whether copies of a candidate (B,) overlap, as do a board across the middle and its mirror image.

    They do where another primitive contains a corner of half of the box around the first.
    """
    centre, rotation, half = (tensor.double().numpy() for tensor in (scene.centre, scene.rotation, scene.bounds))
    same = (scene.mask & (scene.block == scene.block[:, :1])).numpy()  # a call may draw other blocks
    row, slot = np.nonzero(same & (np.arange(same.shape[1]) > 0))
    first = row, np.zeros_like(row)
    inner = Boxes(centre[first], rotation[first], half[first] / 2).corners()  # (copies, 8, 3)
    inside = (np.abs((inner - centre[row, slot, None]) @ rotation[row, slot]) <= half[row, slot, None]).all(-1)
    return np.isin(np.arange(len(same)), row[inside.any(-1)])


def free_points(evidence: Evidence) -> tuple[FloatArray, float]:
    """Points (F, 3) drawn evenly in the free cells within the box of the surface, and the volume of each."""
    side = RESOLUTION / len(evidence.free)
    low, high = ((end + HALF) / side for end in (evidence.surface.min(0), evidence.surface.max(0)))
    cells = np.argwhere(evidence.free)
    cells = cells[((cells + 0.5 >= low) & (cells + 0.5 <= high)).all(1)]
    random = np.random.default_rng(0)
    count = min(SETTINGS.free_points, len(cells))
    selected = cells[np.sort(random.choice(len(cells), count, replace=False))]
    points = (selected + random.random((count, 3))) * side - HALF
    return points[np.argsort(nearby(points), kind="stable")], len(cells) * side**3 / max(count, 1)


def outermost(evidence: Evidence) -> tuple[FloatArray, FloatArray]:
    """Points (S, 3) within a cell of each side of the box around the surface, as many for each, and their normals."""
    points, low, high = evidence.points, evidence.surface.min(0) + 1.0, evidence.surface.max(0) - 1.0
    sides = [np.flatnonzero(side) for side in np.concatenate([points <= low, points >= high], 1).T]
    index = np.concatenate([side[np.linspace(0, len(side) - 1, WORD).astype(int)] for side in sides if len(side)])
    return points[index], evidence.normals[index]


def unsupported(scene: Scene, evidence: Evidence, binned: BinnedPoints) -> tuple[FloatArray, IntArray, FloatArray]:
    """Samples of the surfaces of candidates (B, N) that the target, whose surface is ``binned``, does not support.

    Returns points (S, 3) just above the surface, indices of their candidates (S,), and the area charged for each (S,).
    """
    area = np.where(scene.mask, face_areas(scene).double().sum(-1), 0.0)
    total = area.sum(1, keepdims=True)
    samples = total.clip(SETTINGS.least_samples, SETTINGS.most_samples) / SETTINGS.batch
    expected = area / np.where(total > 0, total, 1) * samples
    times = np.where(area > 0, np.maximum(np.rint(expected), 1), 0).astype(np.int64)
    places = np.repeat(np.argwhere(times >= 0), times.reshape(-1), axis=0)  # candidate and slot of every batch
    owner, slot = torch.from_numpy(places)[..., None].unbind(1)
    sample = sample_surface(scene[owner, slot], SETTINGS.batch, torch.Generator().manual_seed(0))
    points, normals = (part.double().reshape(-1, 3).numpy() for part in (sample.points, sample.normals))
    share = shares(points, normals, evidence, binned)
    bare = share > 0
    source = tuple(places[np.flatnonzero(bare) // SETTINGS.batch].T)
    lifted = points[bare] + SETTINGS.skin * evidence.tolerance * normals[bare]
    return lifted, source[0], share[bare] * area[source] / (SETTINGS.batch * times[source])


def shares(samples: FloatArray, normals: FloatArray, evidence: Evidence, binned: BinnedPoints) -> FloatArray:
    """Share of the price of unsupported surface that each sample (S, 3) pays, see :func:`charged`; ``binned`` is the
    surface of the target."""
    share, outward = np.zeros(len(samples)), evidence.surface_outward[binned.order]
    points, sides, _, starts = binned
    data = samples, normals, points, sides, outward, starts, evidence.reach, evidence.agreement, share
    over_threads(partial(charged, *data), len(samples), least=1024)
    return share

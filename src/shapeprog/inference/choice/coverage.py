"""Coverage of a target by candidates: the points that each explains, its cost, and the parts of others that it hides.

A candidate is a program of one block.  All that choosing between them needs is put into bits once:

*   points of the evidence that its surface explains (near enough, with a fitting normal);
*   points that lie deep inside of it, where nothing that another candidate draws can be seen;
*   points of space known to be free that it fills;
*   samples of its own surface that the target gives no reason for, or that face the other way than the target's.  They
    are charged by their area, unless a chosen candidate holds them, its own other copies included: nobody sees them
    then.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import torch

from shapeprog.geometry.arrays import over_threads
from shapeprog.geometry.batch import Batch
from shapeprog.geometry.scene import Scene
from shapeprog.geometry.surface import face_areas, sample_surface
from shapeprog.inference.candidates.loops import mirrors
from shapeprog.inference.choice.bits import FINE, WORD, Bits, by_word, explains, holds, nearby, sorted_by_cell
from shapeprog.inference.choice.coverage_kernels import charged
from shapeprog.inference.surface.evidence import Evidence
from shapeprog.language.ast import Assignment, Comment
from shapeprog.language.free import numbers_outside
from shapeprog.language.printer import numbers_written
from shapeprog.language.program import Loop, Program
from shapeprog.language.unroll import unroll
from shapeprog.library.length import outside
from shapeprog.space import DEPTH, HALF, RESOLUTION, SIDE, FloatArray

DRAWN, LEAST, MOST = 16, 64, 256
"""Samples drawn together on one primitive; fewest and most of a candidate without loops, between them one a cell."""

SKIN = 0.5
"""How far above the surface, in tolerances, a sample is looked at to see whether another candidate hides it."""

AWAY = 4.0 * HALF
"""A coordinate where no candidate is looked for: that of samples which a word does not have."""

FREE_POINTS = 2048
"""Points drawn in free space."""

CENTRED = 0.1
"""Cells within which a candidate is in the middle."""


@dataclass(frozen=True)
class Prices:
    """What counts against a program, in shares of the target explained; chosen on val.

    Parameters
    ----------
    unsupported
        Of surface that the target gives no reason for and nobody hides, over the area of the target.
    free
        Of free space filled, in cells, over the same area.
    statement, loop, number
        Of a drawing statement or call, of a loop, and of every continuous number written in any; what a call draws
        beside its first block costs as much as a loop, or a box would be said as a drawer whose handle nobody sees.
    """

    unsupported: float = 0.4
    free: float = 0.5
    statement: float = 0.005
    loop: float = 0.002
    number: float = 0.0005

    def of(self, program: Program) -> float:
        """The price of a program as it is written; functions are known, and cost nothing."""
        if program.source is None:
            nodes = list(program.walk())
            loops = sum(isinstance(node, Loop) for node in nodes)
            calls, numbers = 0, sum(map(numbers_written, nodes))
            statements = len(nodes) - loops
        else:
            lines = [line for line in outside(program.source.lines) if not isinstance(line, Comment | Assignment)]
            loops = sum(isinstance(line, Loop) for line in lines)
            statements, numbers = len(lines) - loops, numbers_outside(program)
            calls = program.blocks - statements
        return float(self.statement * statements + self.loop * (loops + calls) + self.number * numbers)


class CoverageTable(NamedTuple):
    """What candidates cover, as rows of bits; each has a word of its own at the end.

    Parameters
    ----------
    rows
        Of each candidate (C, E + F + C) the points explained, the free points filled, and the samples hidden of every
        candidate.
    weights
        What a bit of each of the first E + F words is worth, negative for free points.
    evidence
        E, the number of words for points to be explained.
    interior
        Of each the points that lie deeper inside it than the tolerance (C, E): no other candidate explains them.
    own
        Samples of its own surface that have no reason, and that it does not hide itself (C,).
    sample_price
        What each of them costs (C,).
    prices
        What each costs as it is written (C,).
    """

    rows: Bits
    weights: FloatArray
    evidence: int
    interior: Bits
    own: Bits
    sample_price: FloatArray
    prices: FloatArray


class _Row(NamedTuple):
    """What one candidate covers: bits of points and free points, samples of its surface without a reason."""

    covered: Bits
    interior: Bits
    samples: FloatArray
    drawn: int
    sample_price: float
    price: float


class Coverage:
    """What candidates, each a program of one block, cover of one surface; that of each is computed once.

    Parameters
    ----------
    evidence, prices, seed
        The surface, what counts against a program, and the seed of the samples of surfaces and of free space.
    """

    def __init__(self, evidence: Evidence, prices: Prices | None = None, seed: int = 0) -> None:
        self.evidence, self.prices, self.seed = evidence, prices or Prices(), seed
        order = np.lexsort((nearby(evidence.points), -evidence.weights))  # points of a word weigh nearly the same
        self._points, self._normals = evidence.points[order], evidence.normals[order]
        self._free, volume = free_points(evidence, seed)
        free = np.full(len(self._free), -self.prices.free * volume / max(evidence.area, 1e-9))
        self._weights = np.concatenate([by_word(evidence.weights[order]), by_word(free)])
        self._rows: dict[Program, _Row] = {}

    def table(self, candidates: Sequence[Program]) -> CoverageTable:
        """What the candidates cover.

        A ``ShapeProgError`` if one draws more copies than :func:`shapeprog.language.unroll` takes.
        """
        if new := [each for each in dict.fromkeys(candidates) if each not in self._rows]:
            self._add(new)
        mine, count = [self._rows[each] for each in candidates], len(candidates)
        words = -(-len(self._points) // WORD)
        covered = np.array([each.covered for each in mine], np.uint64).reshape(count, len(self._weights))
        interior = np.array([each.interior for each in mine], np.uint64).reshape(count, words)
        samples = np.array([each.samples for each in mine]).reshape(-1, 3)
        hidden = holds(unroll(candidates).detach(), samples, 0.0)
        own = np.array([2**each.drawn - 1 for each in mine], np.uint64) & ~hidden.diagonal()
        return CoverageTable(
            np.concatenate([covered, hidden], 1), self._weights, words, interior, own,
            np.array([each.sample_price for each in mine]), np.array([each.price for each in mine]),
        )  # fmt: skip

    def _add(self, candidates: Sequence[Program]) -> None:
        evidence, prices = self.evidence, self.prices
        scene = unroll(candidates).detach()
        price = np.array([prices.of(each) for each in candidates]) - prices.number * centred(scene, candidates)
        interior = holds(scene, self._points, evidence.tolerance)
        explained = explains(scene, self._points, self._normals, evidence) & ~interior
        covered = np.concatenate([explained, holds(scene, self._free, evidence.tolerance)], 1)
        places, owners, areas = unsupported(scene, evidence, self.seed)
        starts = np.searchsorted(owners, np.arange(len(candidates) + 1))
        for k, candidate in enumerate(candidates):
            mine = np.arange(starts[k], starts[k + 1])
            samples, count = np.full((WORD, 3), AWAY), min(len(mine), WORD)
            if count:
                samples[:count] = places[mine[np.arange(count) * len(mine) // count]]
            cost = prices.unsupported / evidence.area * areas[mine].sum() / max(count, 1)
            self._rows[candidate] = _Row(covered[k], interior[k], samples, count, float(cost), float(price[k]))


def centred(scene: Scene, candidates: Sequence[Program]) -> npt.NDArray[np.int64]:
    """How many numbers (B,) of candidates are known because these are in the middle, left to right or in depth.

    Where such a part is follows from how large it is.  Of what is mirrored or turned it is no news.
    """
    share = (scene.mask / scene.mask.sum(1, keepdim=True).clamp(min=1)).numpy()
    middle = np.einsum("bn,bni->bi", share, scene.centre.numpy())
    count = np.zeros(len(candidates), np.int64)
    for axis in (SIDE, DEPTH):
        around = [any(mirrors(node, axis) or node.name == "rotate" for node in each.walk()) for each in candidates]
        count += (np.abs(middle[:, axis]) < CENTRED) & ~np.array(around, np.bool_)
    return count


def free_points(evidence: Evidence, seed: int) -> tuple[FloatArray, float]:
    """Points (F, 3) drawn evenly in the free cells within the box of the surface, and the volume of each."""
    side = RESOLUTION / len(evidence.free)
    low, high = ((end + HALF) / side for end in (evidence.surface.min(0), evidence.surface.max(0)))
    cells = np.argwhere(evidence.free)
    cells = cells[((cells + 0.5 >= low) & (cells + 0.5 <= high)).all(1)]
    random = np.random.default_rng(seed)
    count = min(FREE_POINTS, len(cells))
    chosen = cells[np.sort(random.choice(len(cells), count, replace=False))] if count else cells
    points = (chosen + random.random((count, 3))) * side - HALF
    return points[np.argsort(nearby(points), kind="stable")], len(cells) * side**3 / max(count, 1)


def unsupported(scene: Scene, evidence: Evidence, seed: int) -> tuple[FloatArray, npt.NDArray[np.int64], FloatArray]:
    """Samples of the surfaces of candidates (B, N) that the target gives no reason for.

    Returns places (S, 3) just above the surface, whose they are (S,), and the area that each pays for (S,).
    """
    area = np.where(scene.mask, face_areas(scene).double().sum(-1), 0.0)
    whole = area.sum(1, keepdims=True)
    wanted = area / np.where(whole > 0, whole, 1) * whole.clip(LEAST, MOST) / DRAWN
    times = np.where(area > 0, np.maximum(np.rint(wanted), 1), 0).astype(np.int64).reshape(-1)
    row = torch.from_numpy(np.repeat(np.arange(len(times)), times))
    single = Batch(*(
        each.flatten(0, 1)[row][:, None] for each in (scene.kind, scene.size, scene.centre, scene.rotation, scene.mask)
    ))  # fmt: skip
    if not len(row):
        return np.zeros((0, 3)), np.zeros(0, np.int64), np.zeros(0)
    drawn = sample_surface(single, DRAWN, torch.Generator().manual_seed(seed))
    points, normals = (each.double().reshape(-1, 3).numpy() for each in (drawn.points, drawn.normals))
    share = shares(points, normals, evidence)
    bare = share > 0
    source = np.repeat(row.numpy(), DRAWN)[bare]
    places = points[bare] + SKIN * evidence.tolerance * normals[bare]
    return (
        places,
        source // max(scene.mask.shape[1], 1),
        share[bare] * area.reshape(-1)[source] / (DRAWN * times[source]),
    )


def shares(samples: FloatArray, normals: FloatArray, evidence: Evidence) -> FloatArray:
    """Which share of the price of unsupported surface each sample (S, 3) of surfaces pays.

    None where a point of the target within reach has a normal that fits, ``TURNED`` where one is known to face the
    other way, as behind the wall of a solid, and all of it elsewhere.
    """
    places = sorted_by_cell(evidence.surface, FINE)
    found = np.zeros(len(samples))
    data = (
        samples, normals, places.points, evidence.surface_normals[places.order],
        evidence.surface_outward[places.order], places.starts, places.cells, evidence.reach, evidence.agreement,
        found,
    )  # fmt: skip
    over_threads(partial(charged, *data), len(samples), least=1024)
    return found

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

from shapeprog.geometry.arrays import over_threads, table_of
from shapeprog.geometry.batch import Batch
from shapeprog.geometry.scene import Scene
from shapeprog.geometry.surface import face_areas, sample_surface
from shapeprog.inference.candidates.repeating import mirrors
from shapeprog.inference.choice.coverage_kernels import TURNED, charged, explain, hold
from shapeprog.inference.surface.evidence import Evidence
from shapeprog.language.ast import Assignment, Comment
from shapeprog.language.free import numbers_outside
from shapeprog.language.program import Loop, Program
from shapeprog.language.unroll import unroll
from shapeprog.library.length import outside
from shapeprog.space import DEPTH, HALF, RESOLUTION, SIDE, FloatArray

WORD = 64
"""Bits of a word; every candidate has one for samples of its surface."""

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

COARSE, FINE = 16, 64
"""Cells along each side of the grids by which points are found near primitives, and near other points."""

Bits = npt.NDArray[np.uint64]
Flags = npt.NDArray[np.bool_]


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
        written = program.walk() if program.source is None else outside(program.source.lines)
        lines = [line for line in written if not isinstance(line, Comment | Assignment)]
        loops = [isinstance(line, Loop | Loop) for line in lines]
        price = sum(self.loop if each else self.statement for each in loops)
        called = program.blocks - loops.count(False)
        return float(price + self.loop * called + self.number * numbers_outside(program))


class Covers(NamedTuple):
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
    buried
        Of each the points that lie deeper inside it than the tolerance (C, E): none explains what another buries.
    own
        Samples of its own surface that have no reason, and that it does not hide itself (C,).
    charges
        What each of them costs (C,).
    prices
        What each costs as it is written (C,).
    """

    rows: Bits
    weights: FloatArray
    evidence: int
    buried: Bits
    own: Bits
    charges: FloatArray
    prices: FloatArray


class Places(NamedTuple):
    """Points sorted by the cells of a grid, see the kernels: where each was, and where those of each cell begin."""

    points: FloatArray
    order: npt.NDArray[np.int64]
    starts: npt.NDArray[np.int64]
    cells: int


def covers(candidates: Sequence[Program], evidence: Evidence, prices: Prices, seed: int = 0) -> Covers:
    """What candidates cover, each a program of one block.

    A ``ShapeProgError`` if one draws more copies than :func:`shapeprog.language.unroll` takes.
    """
    scene, count = unroll(candidates).detach(), len(candidates)
    written = np.array([prices.of(each) for each in candidates]) - prices.number * centred(scene, candidates)
    order = np.lexsort((nearby(evidence.points), -evidence.weights))  # so the points of a word weigh nearly the same
    explained = explains(scene, evidence.points[order], evidence.normals[order], evidence)
    buried = holds(scene, evidence.points[order], evidence.tolerance)
    free, volume = free_points(evidence, seed)
    filled = holds(scene, free, evidence.tolerance)
    places, owners, areas = unsupported(scene, evidence, seed)
    own, charges = np.zeros(count, np.uint64), np.zeros(count)
    samples = np.full((count, WORD, 3), AWAY)
    for owner, mine in enumerate(np.split(np.arange(len(owners)), np.searchsorted(owners, np.arange(1, count)))):
        if number := min(len(mine), WORD):
            samples[owner, :number] = places[mine[np.arange(number) * len(mine) // number]]
            own[owner] = np.uint64(2**number - 1)
            charges[owner] = areas[mine].sum() / number
    hidden = holds(scene, samples.reshape(-1, 3), 0.0)
    own &= ~hidden[np.arange(count), np.arange(count)]
    weights = np.concatenate([
        by_word(evidence.weights[order]), by_word(np.full(len(free), -prices.free * volume / evidence.area)),
    ])  # fmt: skip
    return Covers(
        np.concatenate([explained & ~buried, filled, hidden], 1), weights, explained.shape[1], buried, own,
        prices.unsupported / evidence.area * charges, written,
    )  # fmt: skip


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


def by_word(values: FloatArray) -> FloatArray:
    """Means of the values that share a word, zero beyond the last."""
    words = -(-len(values) // WORD)
    counts = np.minimum(WORD, len(values) - WORD * np.arange(words))
    return np.add.reduceat(values, WORD * np.arange(words)) / counts if words else np.zeros(0)


def pack(flags: Flags) -> Bits:
    """Flags (B, N) as rows of words, the first of each in its lowest bit."""
    padded = np.pad(flags, ((0, 0), (0, -flags.shape[1] % WORD)))
    return np.packbits(padded, axis=1, bitorder="little").view(np.uint64)


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


def shares_twin(samples: FloatArray, normals: FloatArray, evidence: Evidence) -> FloatArray:
    """The twin of :func:`shares`, over all pairs."""
    near = np.linalg.norm(samples[:, None] - evidence.surface, axis=2) <= evidence.reach
    unknown = np.linalg.norm(evidence.surface_normals, axis=1) < 0.5
    cosine = normals @ evidence.surface_normals.T
    fits = np.where(evidence.surface_outward, cosine, np.abs(cosine)) >= evidence.agreement
    turned = (near & (cosine <= -evidence.agreement)).any(1)
    return np.where((near & (fits | unknown)).any(1), 0.0, np.where(turned, TURNED, 1.0))


def explains(scene: Batch, points: FloatArray, normals: FloatArray, evidence: Evidence) -> Bits:
    """Which points (P, 3) each candidate (B, N) explains, as rows of bits (B, W)."""
    places, rows = sorted_by_cell(points, COARSE), _no_bits(scene, points)
    data = (
        table_of(scene), scene.mask.shape[1], places.points, normals[places.order], places.order, places.starts,
        places.cells, evidence.tolerance, evidence.agreement, rows,
    )  # fmt: skip
    over_threads(partial(explain, *data), len(rows))
    return rows


def holds(scene: Batch, points: FloatArray, depth: float) -> Bits:
    """Which points (P, 3) lie deeper than ``depth`` inside each candidate (B, N), as rows of bits (B, W)."""
    places, rows = sorted_by_cell(points, COARSE), _no_bits(scene, points)
    data = (
        table_of(scene), scene.mask.shape[1], places.points, places.order, places.starts, places.cells, depth, rows
    )  # fmt: skip
    over_threads(partial(hold, *data), len(rows))
    return rows


def _no_bits(scene: Batch, points: FloatArray) -> Bits:
    return np.zeros((len(scene), -(-len(points) // WORD)), np.uint64)


def nearby(points: FloatArray) -> npt.NDArray[np.int64]:
    """Numbers (P,) that are close together for points that are: places on a curve through the cells (Morton 1966).

    A word then holds points of one place, so candidates that are small have bits in few words.
    """
    index = np.clip(((points + HALF) * (FINE / RESOLUTION)).astype(np.int64), 0, FINE - 1)
    places = [((index[:, axis] >> bit) & 1) << (3 * bit + axis) for bit in range(6) for axis in range(3)]
    return np.sum(places, axis=0)


def sorted_by_cell(points: FloatArray, cells: int) -> Places:
    """Points (P, 3) in the order of the cells of a grid."""
    index = np.clip(((points + HALF) * (cells / RESOLUTION)).astype(np.int64), 0, cells - 1)
    key = (index[:, 0] * cells + index[:, 1]) * cells + index[:, 2]
    order = np.argsort(key, kind="stable")
    starts = np.concatenate([[0], np.bincount(key, minlength=cells**3).cumsum()])
    return Places(np.ascontiguousarray(points[order]), order, starts, cells)

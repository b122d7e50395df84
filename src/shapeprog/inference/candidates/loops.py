"""Loops over candidates that are copies of each other: runs of equal steps, mirror images, turns, and nested loops.

Copies are recognised by their moments, so loops are found for all statements, user-defined ones too.  Mirror images
about the middle plane need not be candidates: noise, holes and adjacent parts make them differ, so they are compared
with the surface.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import compress

import numpy as np
import numpy.typing as npt
import torch
from scipy.spatial import cKDTree

from shapeprog.geometry.surface import sample_surface
from shapeprog.inference.candidates.loop_kernels import at_steps, copies
from shapeprog.inference.candidates.moments import Moments, distinct, moments
from shapeprog.language.parameters import to_float32
from shapeprog.language.program import Loop, Node, Program
from shapeprog.language.tensors import encode
from shapeprog.language.unroll import unroll
from shapeprog.space import DEPTH, SIDE, Array, FloatArray

ALIKE = 0.08
"""Relative difference of moments up to which two candidates count as copies."""

LEANING = 0.1
"""The same for the asymmetry between their sides, in cells."""

STRAY = 0.35
"""Largest deviation in cells of a copy from its expected position."""

LEAST_STEP = 0.4
"""Least distance in cells between two copies."""

MISSING, LEAST_PRESENT = -1, 4
"""Index of a missing copy, and the least number of present copies in a run with a gap."""

MOST_ALIKE = 48
"""Most copies of one group that are searched for loops: the first ones."""

MOST_RUNS = 160
"""Most runs from one set of candidates: the longest."""

APART = 1.6
"""Least step, in half extents of the repeated block; at two, copies just touch."""

POINTS, ON = 48, 0.4
"""Points on each candidate whose mirror images are tested, and the largest distance in cells of one on the surface."""

SUPPORTED, AS_WELL = 0.6, 0.8
"""Least share of its points on the surface, and least ratio of the share of its image to that."""

TURNS = (6, 5, 4, 3)
"""Numbers of copies around the vertical axis of the grid that are searched for."""

CENTRED = 0.2
"""Cells within which a mirror plane is taken as the middle plane of the shape, and a step as along an axis."""


def repeated(singles: Sequence[Node], rows: Sequence[Node] = ()) -> list[Node]:
    """Runs, mirror images and turns of candidates, and runs and mirror images of these and of other rows."""
    loops = [*rows, *_rolled(singles)]
    nested = _rolled(loops)
    return [*loops, *nested]


def _rolled(nodes: Sequence[Node]) -> list[Node]:
    if len(nodes) < 2:
        return []
    stats = moments(nodes)
    loops: list[Node] = [replace(loop, body=(nodes[index],)) for index, loop in rows_and_pairs(stats)]
    plain = {index for index, node in enumerate(nodes) if not isinstance(node, Loop)}  # not pairs, which would overlap
    for count in TURNS if plain else ():
        loops += [
            Loop("rotate", loop_values(count, 1), (nodes[index],)) for index in turned(stats, count) if index in plain
        ]
    return distinct(loops)


def images(singles: Sequence[Node], surface: FloatArray) -> list[Node]:
    """Loops over candidates and their mirror images from left to right, front to rear, and both, if the images lie on
    the surface (P, 3) and do not overlap."""
    if not singles:
        return []
    scene = unroll(encode([Program((node,)) for node in singles], dtype=torch.float64))
    points = sample_surface(scene, POINTS, torch.Generator().manual_seed(0)).points.numpy()
    tree = cKDTree(surface)

    def on(tested: npt.NDArray[np.bool_], *axes: int) -> FloatArray:
        """Share of points on the surface, for the mirror image of each candidate that is tested; zero for others."""
        image, share = points[tested] * [-1.0 if axis in axes else 1.0 for axis in range(3)], np.zeros(len(points))
        share[tested] = np.isfinite(tree.query(image, distance_upper_bound=ON)[0]).mean(1)
        return share

    one_sided = (points.min(1) > 0) | (points.max(1) < 0)
    original = on(one_sided[:, [SIDE, DEPTH]].any(1))
    minimum = np.where(original >= SUPPORTED, AS_WELL * original, np.inf)
    side, depth = (on(one_sided[:, axis] & (minimum < np.inf), axis) >= minimum for axis in (SIDE, DEPTH))
    four = on(side & depth, SIDE, DEPTH) >= minimum
    return [
        *(_mirrored(node, SIDE) for node in compress(singles, side)),
        *(_mirrored(node, DEPTH) for node in compress(singles, depth)),
        *(_mirrored(_mirrored(node, DEPTH), SIDE) for node in compress(singles, four)),
    ]


def _mirrored(node: Node, axis: int) -> Loop:
    return Loop("mirror", loop_values(2, axis, 0), (node,))


def rows_and_pairs(stats: Moments) -> Iterator[tuple[int, Loop]]:
    """The index of the first candidate of each run or mirror pair, and the loop, without a body, that repeats it."""
    for index, count, step in runs(stats):
        yield index, Loop("translate", loop_values(count, *step), ())
    for axis in (SIDE, DEPTH):
        for index, _, plane in mirrored(stats, axis):
            yield index, Loop("mirror", loop_values(2, axis, plane), ())


def mirrors(node: Node, axis: int) -> bool:
    """Whether a loop mirrors along an axis."""
    return isinstance(node, Loop) and node.name == "mirror" and node.values[1] == axis


def loop_values(*numbers: float) -> tuple[float, ...]:
    """Numbers of a loop as float32 holds them."""
    return tuple(to_float32(number) + 0.0 for number in numbers)


def runs(stats: Moments) -> Iterator[tuple[int, int, tuple[float, float, float]]]:
    """The index of the first copy of each run, the number of copies, and the step; the longest runs first.

    One copy may be missing if four are present: the copy that fills the gap has no support, which lowers its score.
    """
    step_of: dict[tuple[int, ...], FloatArray] = {}
    for group in groups(stats):
        positions = stats.middle[group]
        steps = positions[None] - positions[:, None]
        onwards = (np.abs(steps).max(-1) > LEAST_STEP) & ~_backwards(steps) & ~_overlap(stats.spread[group[0]], steps)
        first = onwards & (_at_steps(positions, -1) < 0)
        if not first.any():
            continue
        before, after, beyond = (_at_steps(positions, times) for times in (-2, 2, 3))
        for a, b in np.argwhere(first).tolist():
            run = _followed(after, [a, b])
            candidates = [run]
            if (previous := int(before[a, b])) >= 0 and previous not in run and len(run) + 1 >= LEAST_PRESENT:
                candidates.append([previous, MISSING, *run])
            if (later := int(beyond[run[-2], run[-1]])) >= 0 and later not in run:
                onward = int(_nearest(positions, positions[later] + steps[run[-2], run[-1]]))
                tail = _followed(after, [later, onward]) if onward >= 0 and onward not in run else [later]
                if len(run) + len(tail) >= LEAST_PRESENT:
                    candidates.append([*run, MISSING, *tail])
            for indices in candidates:
                members = tuple(int(group[index]) if index != MISSING else MISSING for index in indices)
                step_of.setdefault(members, (positions[indices[-1]] - positions[indices[0]]) / (len(indices) - 1))
    for members in sorted(step_of, key=lambda members: (-len(members), members))[:MOST_RUNS]:
        step = np.where(np.abs(step_of[members]) * (len(members) - 1) < CENTRED, 0.0, step_of[members])
        yield members[0], len(members), (float(step[0]), float(step[1]), float(step[2]))


def _followed(after: Array, run: list[int]) -> list[int]:
    """The run extended by all copies that follow at the same step."""
    while (third := int(after[run[-2], run[-1]])) >= 0 and third not in run:
        run = [*run, third]
    return run


def mirrored(stats: Moments, axis: int) -> Iterator[tuple[int, int, float]]:
    """Pairs of mirror images along an axis, the one with the larger coordinate first, and their plane."""
    signs = np.ones(3)
    signs[axis] = -1
    across = [k for k in range(3) if k != axis]
    same = _copies(stats, stats.spread * signs[:, None] * signs, stats.skew * signs, stats.lean * signs)
    count = 0
    for first in np.flatnonzero(same.any(1)).tolist():
        candidates = np.flatnonzero(same[first])
        offsets = stats.middle[candidates] - stats.middle[first]
        opposite = (np.abs(offsets[:, across]).max(1) < STRAY) & (offsets[:, axis] < -LEAST_STEP)
        opposite &= ~_overlap(stats.spread[first], offsets * (1 - signs) / 2)
        for second in candidates[opposite].tolist():
            plane = float(stats.middle[first, axis] + stats.middle[second, axis]) / 2
            yield first, second, 0.0 if abs(plane) < CENTRED else plane
            count += 1
            if count == MOST_RUNS:
                return


def turned(stats: Moments, count: int) -> Iterator[int]:
    """The index of the first of ``count`` copies at equal angles around the vertical axis of the grid."""
    angle = 2 * np.pi / count
    turn = np.array([[1, 0, 0], [0, np.cos(angle), -np.sin(angle)], [0, np.sin(angle), np.cos(angle)]])
    middle = stats.middle @ turn.T
    same = _copies(stats, turn @ stats.spread @ turn.T, stats.skew @ turn.T, stats.lean @ turn.T)
    after = np.full(len(middle), -1)
    for index in np.flatnonzero(np.abs(middle - stats.middle).max(1, initial=0) > LEAST_STEP).tolist():
        candidates = np.flatnonzero(same[index])
        off = np.abs(stats.middle[candidates] - middle[index]).max(1)
        if (off < STRAY).any():
            after[index] = candidates[off.argmin()]
    used = np.zeros(len(middle), np.bool_)
    for index in range(len(middle)):
        circle = [index]
        while len(circle) < count and after[circle[-1]] >= 0:
            circle.append(int(after[circle[-1]]))
        image = np.abs(stats.middle[circle[1:]] - stats.middle[index] * [1, 1, -1]).max(1, initial=0)
        mirrors = count == 4 and (image < STRAY).any()  # four legs in a square are better written with two mirrors
        if len(set(circle)) == count and not used[circle].all() and not mirrors:
            used[circle] = True
            yield index


def groups(stats: Moments) -> Iterator[Array]:
    """Indices of candidates that are copies of each other by translation, each group once."""
    existing: set[tuple[int, ...]] = set()
    for row in _copies(stats, stats.spread, stats.skew, stats.lean):
        group = np.flatnonzero(row)[:MOST_ALIKE]
        if len(group) > 1 and (key := tuple(group.tolist())) not in existing:
            existing.add(key)
            yield group


def _copies(stats: Moments, spread: FloatArray, skew: FloatArray, lean: FloatArray) -> npt.NDArray[np.bool_]:
    """Whether a candidate (column) has the same shape as a candidate (row) with the given, transformed moments."""
    count = len(stats.kind)
    kind = np.unique(np.array(stats.kind), return_inverse=True)[1]
    original, moved = (stats.spread, stats.skew, stats.lean), (spread, skew, lean)
    rows = [np.ascontiguousarray(array).reshape(count, -1) for array in (*original, *moved)]
    out = np.zeros((count, count), np.bool_)
    copies(kind, np.maximum(stats.size, 1e-3), *rows, ALIKE, LEANING, out)
    return out


def _at_steps(positions: FloatArray, times: int) -> Array:
    """The index of the position ``times`` steps from one position (row) towards another (column); -1 if none."""
    out = np.zeros((len(positions), len(positions)), np.int64)
    at_steps(np.ascontiguousarray(positions), times, STRAY, out)
    return out


def _nearest(positions: FloatArray, target: FloatArray) -> Array:
    """The index of the position at each target (..., 3); -1 if none."""
    off = np.abs(positions - target[..., None, :]).max(-1)
    nearest = off.argmin(-1)
    return np.where(off.min(-1) < STRAY, nearest, -1)


def _overlap(spread: FloatArray, steps: FloatArray) -> npt.NDArray[np.bool_]:
    """Whether copies at these steps (..., 3) overlap considerably."""
    length = np.linalg.norm(steps, axis=-1)
    reach = np.sqrt((steps @ spread * steps).sum(-1).clip(0)) / np.maximum(length, 1e-9)
    overlaps: npt.NDArray[np.bool_] = length < APART * reach
    return overlaps


def _backwards(steps: FloatArray) -> npt.NDArray[np.bool_]:
    """Whether steps (..., 3) lead down, or level to the front, or only to the left: such runs are reversed."""
    signs = np.sign(np.where(np.abs(steps) < CENTRED, 0, steps))
    backwards: npt.NDArray[np.bool_] = signs @ np.array([9, 3, 1]) < 0
    return backwards

"""Loops over candidates that are copies of each other: runs of equal steps, mirror images, turns, and these of these.

Copies are recognised by their moments, so whatever a statement draws, one of a user's own too, becomes a loop in the
same way.  Mirror images about the middle need not be candidates: noise, holes and what meets them differ, so there the
surface decides.
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
"""The same for how they differ between their sides, in cells."""

STRAY = 0.35
"""Cells by which a copy may miss its place."""

LEAST_STEP = 0.4
"""Cells between two copies, at least."""

MISSING, LEAST_PRESENT = -1, 4
"""What stands for a copy that is not there, and how many others must be."""

MOST_ALIKE = 48
"""Most copies of one group that are rolled up: those that come first."""

MOST_RUNS = 160
"""Most runs that are made of one set of candidates, the longest."""

APART = 1.6
"""Least step, in half extents of what is repeated; two are where copies just touch."""

POINTS, ON = 48, 0.4
"""Points on each candidate whose mirror images are sought, and cells within which one is on the surface."""

SUPPORTED, AS_WELL = 0.6, 0.8
"""Share of its points that lie on the surface, at least; and how many as many of its image, at least."""

TURNS = (6, 5, 4, 3)
"""Copies around the vertical axis of the grid that are looked for."""

CENTRED = 0.2
"""Cells within which a mirror plane is taken as the middle plane of the shape, and a step as along an axis."""


def repeated(singles: Sequence[Node]) -> list[Node]:
    """Runs, mirror images and turns of candidates, and runs and mirror images of these; each once."""
    once = _rolled(singles)
    twice = _rolled(once)
    return [*once, *twice]


def _rolled(nodes: Sequence[Node]) -> list[Node]:
    if len(nodes) < 2:
        return []
    seen = moments(nodes)
    found: list[Node] = [replace(loop, body=(nodes[one],)) for one, loop in rows_and_pairs(seen)]
    drawn = {place for place, node in enumerate(nodes) if not isinstance(node, Loop)}  # not pairs, which would overlap
    for count in TURNS if drawn else ():
        found += [Loop("rotate", _values(count, 1), (nodes[one],)) for one in turned(seen, count) if one in drawn]
    return distinct(found)


def images(singles: Sequence[Node], surface: FloatArray) -> list[Node]:
    """Loops over candidates and their mirror images, left and right, in front and behind, and both, where these lie on
    the surface (P, 3) as well and not over each other."""
    if not singles:
        return []
    scene = unroll(encode([Program((node,)) for node in singles], dtype=torch.float64))
    points = sample_surface(scene, POINTS, torch.Generator().manual_seed(0)).points.numpy()
    tree = cKDTree(surface)

    def on(*axes: int) -> FloatArray:
        """Share of its points that lie on the surface, of the image of each candidate."""
        image = points * [-1.0 if axis in axes else 1.0 for axis in range(3)]
        share: FloatArray = np.isfinite(tree.query(image, distance_upper_bound=ON)[0]).mean(1)
        return share

    own = on()
    least = np.where(own >= SUPPORTED, AS_WELL * own, np.inf)
    beside = (points.min(1) > 0) | (points.max(1) < 0)
    side, depth = (beside[:, axis] & (on(axis) >= least) for axis in (SIDE, DEPTH))
    both = side & depth & (on(SIDE, DEPTH) >= least)
    return [
        *(_mirrored(node, SIDE) for node in compress(singles, side)),
        *(_mirrored(node, DEPTH) for node in compress(singles, depth)),
        *(_mirrored(_mirrored(node, DEPTH), SIDE) for node in compress(singles, both)),
    ]


def _mirrored(node: Node, axis: int) -> Loop:
    return Loop("mirror", _values(2, axis, 0), (node,))


def rows_and_pairs(seen: Moments) -> Iterator[tuple[int, Loop]]:
    """The first of candidates that are runs or mirror images, and the loop, without a body, that repeats it."""
    for one, count, step in runs(seen):
        yield one, Loop("translate", _values(count, *step), ())
    for axis in (SIDE, DEPTH):
        for one, _, plane in mirrored(seen, axis):
            yield one, Loop("mirror", _values(2, axis, plane), ())


def mirrors(node: Node, axis: int) -> bool:
    """Whether a loop mirrors along an axis."""
    return isinstance(node, Loop) and node.name == "mirror" and node.values[1] == axis


def _values(*numbers: float) -> tuple[float, ...]:
    return tuple(to_float32(number) + 0.0 for number in numbers)


def runs(seen: Moments) -> Iterator[tuple[int, int, tuple[float, float, float]]]:
    """The first of copies in equal steps, how many they are, and the step; the longest first.

    One copy may be missing if four are there: what is drawn in its place is not supported, and pays for that.
    """
    found: dict[tuple[int, ...], FloatArray] = {}
    for group in groups(seen):
        places = seen.middle[group]
        steps = places[None] - places[:, None]
        onwards = (np.abs(steps).max(-1) > LEAST_STEP) & ~_backwards(steps) & ~_overlap(seen.spread[group[0]], steps)
        first = onwards & (_at_steps(places, -1) < 0)
        before, after, beyond = (_at_steps(places, times) for times in (-2, 2, 3))
        for a, b in np.argwhere(first).tolist():
            run = _followed(after, [a, b])
            whole = [run]
            if (other := int(before[a, b])) >= 0 and other not in run and len(run) + 1 >= LEAST_PRESENT:
                whole.append([other, MISSING, *run])
            if (other := int(beyond[run[-2], run[-1]])) >= 0 and other not in run:
                onward = int(_nearest(places, places[other] + steps[run[-2], run[-1]]))
                rest = _followed(after, [other, onward]) if onward >= 0 and onward not in run else [other]
                if len(run) + len(rest) >= LEAST_PRESENT:
                    whole.append([*run, MISSING, *rest])
            for each in whole:
                members = tuple(int(group[one]) if one != MISSING else MISSING for one in each)
                found.setdefault(members, (places[each[-1]] - places[each[0]]) / (len(each) - 1))
    for members in sorted(found, key=lambda members: (-len(members), members))[:MOST_RUNS]:
        step = np.where(np.abs(found[members]) * (len(members) - 1) < CENTRED, 0.0, found[members])
        yield members[0], len(members), (float(step[0]), float(step[1]), float(step[2]))


def _followed(after: Array, run: list[int]) -> list[int]:
    """Two copies and all that follow in steps like theirs."""
    while (third := int(after[run[-2], run[-1]])) >= 0 and third not in run:
        run = [*run, third]
    return run


def mirrored(seen: Moments, axis: int) -> Iterator[tuple[int, int, float]]:
    """Pairs of mirror images along an axis, the farther along first, and where the plane between them is."""
    signs = np.ones(3)
    signs[axis] = -1
    across = [other for other in range(3) if other != axis]
    same = _copies(seen, seen.spread * signs[:, None] * signs, seen.skew * signs, seen.lean * signs)
    count = 0
    for one in np.flatnonzero(same.any(1)).tolist():
        others = np.flatnonzero(same[one])
        apart = seen.middle[others] - seen.middle[one]
        opposite = (np.abs(apart[:, across]).max(1) < STRAY) & (apart[:, axis] < -LEAST_STEP)
        opposite &= ~_overlap(seen.spread[one], apart * (1 - signs) / 2)
        for other in others[opposite].tolist():
            plane = float(seen.middle[one, axis] + seen.middle[other, axis]) / 2
            yield one, other, 0.0 if abs(plane) < CENTRED else plane
            count += 1
            if count == MOST_RUNS:
                return


def turned(seen: Moments, count: int) -> Iterator[int]:
    """The first of ``count`` copies spread evenly around the vertical axis of the grid."""
    angle = 2 * np.pi / count
    turn = np.array([[1, 0, 0], [0, np.cos(angle), -np.sin(angle)], [0, np.sin(angle), np.cos(angle)]])
    middle = seen.middle @ turn.T
    same = _copies(seen, turn @ seen.spread @ turn.T, seen.skew @ turn.T, seen.lean @ turn.T)
    after = np.full(len(middle), -1)
    for one in np.flatnonzero(np.abs(middle - seen.middle).max(1, initial=0) > LEAST_STEP).tolist():
        others = np.flatnonzero(same[one])
        off = np.abs(seen.middle[others] - middle[one]).max(1)
        if (off < STRAY).any():
            after[one] = others[off.argmin()]
    known = np.zeros(len(middle), np.bool_)
    for one in range(len(middle)):
        circle = [one]
        while len(circle) < count and after[circle[-1]] >= 0:
            circle.append(int(after[circle[-1]]))
        image = np.abs(seen.middle[circle[1:]] - seen.middle[one] * [1, 1, -1]).max(1, initial=0)
        mirrors = count == 4 and (image < STRAY).any()  # four legs in a square are better written with two mirrors
        if len(set(circle)) == count and not known[circle].all() and not mirrors:
            known[circle] = True
            yield one


def groups(seen: Moments) -> Iterator[Array]:
    """Indices of candidates that are copies of each other by translation, each group once."""
    known: set[tuple[int, ...]] = set()
    for row in _copies(seen, seen.spread, seen.skew, seen.lean):
        group = np.flatnonzero(row)[:MOST_ALIKE]
        if len(group) > 1 and (key := tuple(group.tolist())) not in known:
            known.add(key)
            yield group


def _copies(seen: Moments, spread: FloatArray, skew: FloatArray, lean: FloatArray) -> npt.NDArray[np.bool_]:
    """Which candidates (a column) look like each of them with these moments instead of its own (a row)."""
    count = len(seen.kind)
    kind = np.unique(np.array(seen.kind), return_inverse=True)[1]
    now, then = (seen.spread, seen.skew, seen.lean), (spread, skew, lean)
    rows = [np.ascontiguousarray(each).reshape(count, -1) for each in (*now, *then)]
    out = np.zeros((count, count), np.bool_)
    copies(kind, np.maximum(seen.size, 1e-3), *rows, ALIKE, LEANING, out)
    return out


def _at_steps(places: FloatArray, times: int) -> Array:
    """Which place so many steps from one place (a row) to another (a column) lead to, from the first; -1 if none."""
    out = np.zeros((len(places), len(places)), np.int64)
    at_steps(np.ascontiguousarray(places), times, STRAY, out)
    return out


def _nearest(places: FloatArray, wanted: FloatArray) -> Array:
    """Which place is where it is wanted (..., 3); -1 if none."""
    off = np.abs(places - wanted[..., None, :]).max(-1)
    nearest = off.argmin(-1)
    return np.where(off.min(-1) < STRAY, nearest, -1)


def _overlap(spread: FloatArray, steps: FloatArray) -> npt.NDArray[np.bool_]:
    """Whether copies so far apart (..., 3) lie over each other by much."""
    length = np.linalg.norm(steps, axis=-1)
    reach = np.sqrt(np.einsum("...i,ij,...j->...", steps, spread, steps)) / np.maximum(length, 1e-9)
    found: npt.NDArray[np.bool_] = length < APART * reach
    return found


def _backwards(steps: FloatArray) -> npt.NDArray[np.bool_]:
    """Whether steps (..., 3) go down, or level and to the front, or only to the left: those runs begin at their end."""
    signs = np.sign(np.where(np.abs(steps) < CENTRED, 0, steps))
    found: npt.NDArray[np.bool_] = signs @ np.array([9, 3, 1]) < 0
    return found

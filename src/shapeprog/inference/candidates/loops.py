"""Loops over candidates: runs of copies at equal steps, nested runs, mirror images and copies around an axis.

Copies of a run are recognised by their profiles, so runs are found for all statements, user-defined ones too.  Mirror
images and turned copies need not be candidates: noise, holes and adjacent parts make them differ, so they are compared
with the surface.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
import torch
from scipy.spatial import cKDTree
from scipy.spatial.distance import cdist

from shapeprog.geometry.distance import signed_distance
from shapeprog.geometry.scene import Scene
from shapeprog.geometry.surface import sample_surface
from shapeprog.inference.candidates.drawings import drawings, scene_of
from shapeprog.inference.candidates.settings import SETTINGS
from shapeprog.inference.fit.tunable import THINNEST
from shapeprog.language.hints import Box
from shapeprog.language.parameters import to_float32
from shapeprog.language.program import Loop, Node, Program, nest
from shapeprog.space import DEPTH, SIDE, FloatArray, IntArray


class Profiles(NamedTuple):
    """Profiles of candidates: equal for copies by translation, whatever the order of the axes of their solids."""

    kind: IntArray  # a number for the statements and counts of each block (C,)
    middle: FloatArray  # middle (C, 3) of the box around each along the axes of the grid, in cells
    half: FloatArray  # half extents (C, 3) of that box
    distance: FloatArray  # signed distances (C, 27) of the surface from its middle, corners, edges and faces


def profiles(nodes: Sequence[Node]) -> Profiles:
    """The profiles of blocks, at least one."""
    scene = scene_of(nodes)
    there, reach = scene.mask[..., None], scene.reach
    low, high = ((scene.centre + sign * reach).where(there, -sign * torch.inf) for sign in (-1, 1))
    ends = torch.stack([low.amin(1), high.amax(1)]).nan_to_num(posinf=0, neginf=0)
    middle, half = ends.mean(0), (ends[1] - ends[0]) / 2
    signs = torch.cartesian_prod(*[torch.tensor([-1.0, 0.0, 1.0], dtype=torch.float64)] * 3)
    distance = signed_distance(scene, middle[:, None] + signs * half[:, None]).nan_to_num(0, 0, 0)
    chains = (Program((node,)).walk() for node in nodes)
    names = [str([(node.name, isinstance(node, Loop) and node.count) for node in chain]) for chain in chains]
    kind = np.unique(names, return_inverse=True)[1]
    return Profiles(kind, middle.numpy(), half.numpy(), distance.numpy())


def distinct(nodes: Sequence[Node]) -> list[Node]:
    """The candidates without later ones of the same kind and nearly the same position and profile, in their order."""
    if not nodes:
        return []
    profile = profiles(nodes)
    size = np.linalg.norm(profile.half, axis=1)
    order = np.round(np.log2(np.maximum(size, SETTINGS.same)))  # order of magnitude
    features = np.concatenate([profile.middle, profile.half, profile.distance], 1)
    key = np.column_stack([profile.kind, order, np.round(features / (SETTINGS.same * 2 ** order[:, None]))])
    return [nodes[k] for k in np.sort(np.unique(key, axis=0, return_index=True)[1])]


def loop_values(*numbers: float) -> tuple[float, ...]:
    """Numbers of a loop as float32 holds them."""
    return tuple(to_float32(number) + 0.0 for number in numbers)


def mirror(axis: int) -> Loop:
    """A loop without a body that mirrors about the middle of the shape along an axis."""
    return Loop("mirror", (2.0, float(axis), 0.0), ())


def mirrors(node: Node, axis: int) -> bool:
    """Whether a loop mirrors along an axis."""
    return isinstance(node, Loop) and node.name == "mirror" and node.values[1] == axis


def repeated(singles: Sequence[Node], rows: Sequence[Node] = ()) -> list[Node]:
    """Runs of candidates, and runs of these and of other rows."""
    loops = [*rows, *_runs(singles)]
    return [*loops, *_runs(loops)]


def _runs(nodes: Sequence[Node]) -> list[Node]:
    """Loops over candidates that are copies of each other at equal steps, the longest first."""
    if len(nodes) < 2:
        return []
    kind, middle, half, distance = profiles(nodes)
    copies = cdist(half, half, "chebyshev") <= SETTINGS.alike * np.linalg.norm(half, axis=1)[:, None]
    copies &= (cdist(distance, distance, "chebyshev") <= SETTINGS.level) & (kind[:, None] == kind)
    runs = set[tuple[int, ...]]()
    for group in {tuple(np.flatnonzero(row)[: SETTINGS.most_alike].tolist()) for row in copies[copies.sum(1) > 1]}:
        members = (*group, -1)  # a missing copy has the index -1
        found = equal_steps(middle[list(group)], half[group[0]])
        runs.update(tuple(members[index] for index in run) for run in found)
    longest = sorted(runs, key=lambda run: (-len(run), run))[: SETTINGS.most_runs]
    return distinct([_row(nodes[run[0]], len(run), middle[run[-1]] - middle[run[0]]) for run in longest])


def _row(node: Node, count: int, way: FloatArray) -> Loop:
    """So many copies of a node, ``way`` (3,) being that from the first to the last."""
    step = np.where(np.abs(way) < SETTINGS.centred, 0.0, way / (count - 1))
    return Loop("translate", loop_values(count, *step.tolist()), (node,))


def equal_steps(positions: FloatArray, half: FloatArray) -> list[list[int]]:
    """Runs of two or more positions (N, 3) at equal steps, as indices, upwards or to the rear or to the left.  A copy
    may be missing, as -1, if most are present.  ``half`` (3,) are the half extents of a copy."""
    steps = positions[None] - positions[:, None]
    tree, count = cKDTree(positions), len(positions)

    def nearest(targets: FloatArray) -> IntArray:
        """The index of the position at each target (..., 3); -1 if none."""
        index = tree.query(targets, p=np.inf, distance_upper_bound=SETTINGS.stray)[1]
        return np.where(index < count, index, -1)

    far = (np.abs(steps) > np.maximum(SETTINGS.apart * half, SETTINGS.least_step)).any(-1)
    first, second = np.nonzero(far & (nearest(positions[:, None] - steps) < 0))
    step = steps[first, second]
    forwards = np.sign(np.where(np.abs(step) < SETTINGS.centred, 0, step)) @ [9, 3, 1] > 0
    run, last, end, going = [first, second], second, np.ones_like(second), np.ones(len(second), np.bool_)
    while going.any():
        start, copy = positions[first[going]], len(run)
        present = np.full(len(first), -1)
        present[going] = nearest(start + copy * (positions[last[going]] - start) / end[going, None])
        present[present == last] = -1
        run.append(present)
        last, end = np.where(present >= 0, present, last), np.where(present >= 0, copy, end)
        going &= copy - end <= 1  # one copy may be missing at once
    members = np.stack(run, 1)
    number, plain = (members >= 0).sum(1), np.logical_and.accumulate(members >= 0, 1).sum(1)
    enough = number >= np.maximum(SETTINGS.least_present, SETTINGS.present * (end + 1))
    runs = [members[k, : plain[k]].tolist() for k in np.flatnonzero(forwards)]
    for k in np.flatnonzero((number <= end) & enough):
        row = members[k, : end[k] + 1]
        runs.append((row if forwards[k] else row[::-1]).tolist())
    return runs


def rows(blocks: Sequence[Sequence[Box]]) -> Iterator[Node]:
    """Rows along an axis of boxes of one size that belong to several blocks, such as rungs, slats and shelves."""
    boxes = [box for parts in blocks for box in parts]
    owner = np.repeat(np.arange(len(blocks)), [len(parts) for parts in blocks])
    centre = np.reshape([box.centre for box in boxes], (-1, 3))
    half = np.reshape([np.abs(box.rotation) @ box.half for box in boxes], (-1, 3))
    for axis in range(3):
        across = np.arange(3) != axis
        limit = np.where(across, np.maximum(SETTINGS.off_size, half / 4), np.maximum(SETTINGS.off_size / 2, half / 2))
        similar = (
            (np.abs(half - own) <= limit[k]).all(1) & (np.abs(centre - centre[k])[:, across] <= SETTINGS.stray).all(1)
            for k, own in enumerate(half)
        )
        for group in dict.fromkeys(tuple(np.flatnonzero(row)[: SETTINGS.most_alike].tolist()) for row in similar):
            members = list(group)
            if len(members) < SETTINGS.least_row or len(set(owner[members])) < 2:
                continue
            middle, size = np.median(centre[members], 0), np.maximum(np.median(half[members], 0), THINNEST / 2)
            positions = np.where(across, middle, centre[members])
            run = max(equal_steps(positions, size * ~across), key=len, default=[])
            if SETTINGS.least_row <= len(run) <= SETTINGS.most_row:
                start, end = positions[run[0]], positions[run[-1]]
                yield from (_row(each, len(run), end - start) for each in drawings(Box(start, np.eye(3), size)))


def images(nodes: Sequence[Node], surface: FloatArray) -> list[Node]:
    """Loops over candidates and their images that lie on the surface (P, 3) and do not overlap.

    Images are mirrored from left to right, from front to rear, and both; those of single statements are also turned
    about vertical axes: that of the grid, and those of upright parts with a round or square section.
    """
    if not nodes:
        return []
    scene = scene_of(nodes)
    points = sample_surface(scene, SETTINGS.image_points, torch.Generator().manual_seed(0)).points.numpy()
    tree = cKDTree(surface, balanced_tree=False, compact_nodes=False)  # built in half of the time, queried as fast

    def on(image: FloatArray) -> FloatArray:
        """Share of points (C, P, 3) on the surface."""
        return np.asarray(np.isfinite(tree.query(image, distance_upper_bound=SETTINGS.image_distance)[0]).mean(1))

    share = on(points)
    supported = share >= SETTINGS.supported

    def kept(index: IntArray, image: FloatArray) -> IntArray:
        """Those candidates whose images (C, P, 3) lie on the surface."""
        return index[on(image) >= SETTINGS.as_well * share[index]]

    one_sided = ((points.min(1) > 0) | (points.max(1) < 0)) & supported[:, None]
    left, front = mirror(SIDE), mirror(DEPTH)
    side, depth = (np.flatnonzero(one_sided[:, axis]) for axis in (SIDE, DEPTH))
    side, depth = kept(side, points[side] * [1, 1, -1]), kept(depth, points[depth] * [1, -1, 1])
    four = np.intersect1d(side, depth)
    four = kept(four, points[four] * [1, -1, -1])
    mirrored = ((left,), side), ((front,), depth), ((left, front), four)
    result = [nest((*loops, nodes[k])) for loops, index in mirrored for k in index]
    plain = np.flatnonzero(supported & [not isinstance(node, Loop) for node in nodes])
    for axis in _axes(scene):
        around = (points[plain, :, DEPTH] - axis[0]) + 1j * (points[plain, :, SIDE] - axis[1])
        turn = np.abs(np.angle(around * around.mean(1, keepdims=True).conj()))
        for count in SETTINGS.turns:
            step = 2 * np.pi / count
            index = plain[(turn < step / 2).mean(1) >= SETTINGS.sector]
            index = np.setdiff1d(index, [*side, *depth]) if count == 4 else index  # mirrors follow changes of the width
            index = kept(index, _turned(points[index, ::6], axis, step))  # few points settle most candidates
            # There are no copies on a round surface.
            index = np.setdiff1d(index, kept(index, _turned(points[index], axis, step / 2)))
            for copy in range(1, count):
                index = kept(index, _turned(points[index], axis, copy * step))
            name, values = ("rotate_about", (count, 360 / count, *axis)) if axis.any() else ("rotate", (count, 1))
            result += [Loop(name, loop_values(*values), (nodes[k],)) for k in index.tolist()]
    return result


def _turned(points: FloatArray, axis: FloatArray, angle: float) -> FloatArray:
    """Points (C, P, 3) turned by an angle about the vertical axis at a depth and a side (2,)."""
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    return np.concatenate([points[..., :1], (points[..., 1:] - axis) @ turn.T + axis], -1)


def _axes(scene: Scene) -> FloatArray:
    """Depth and side (A, 2) of the axis of the grid, and of those nearest to it of parts that are as wide as deep."""
    extents = (scene.reach * 2).numpy()[:, 0, 1:]
    square = (scene.mask.sum(1) == 1).numpy() & (np.ptp(extents, axis=1) <= SETTINGS.square * extents.max(1))
    centre = scene.centre.numpy()[square, 0, 1:]
    centre = np.concatenate([np.zeros((1, 2)), np.where(np.abs(centre) < SETTINGS.centred, 0.0, centre)])
    first = np.sort(np.unique(np.round(centre / SETTINGS.centred), axis=0, return_index=True)[1])
    return centre[first[np.argsort((centre[first] ** 2).sum(1), kind="stable")[: SETTINGS.axes]]]

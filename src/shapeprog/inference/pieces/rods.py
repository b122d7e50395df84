"""Round rods among points with normals."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from shapeprog.inference.pieces.patches import upright
from shapeprog.inference.pieces.settings import SETTINGS
from shapeprog.inference.surface.cloud import Cloud
from shapeprog.inference.surface.oriented import Boxes, join
from shapeprog.inference.surface.settings import SURFACE
from shapeprog.space import FloatArray, IntArray


class Rod(NamedTuple):
    """A cylinder: its middle (3,), a frame (3, 3) whose last column is its axis, its radius and its half length."""

    middle: FloatArray
    frame: FloatArray
    radius: float
    half: float


def rods(cloud: Cloud) -> Boxes:
    """Boxes around round rods, best first; the first axis is that of the rod."""
    trials = _through_pairs(cloud)
    cloud = cloud._replace(points=np.asfortranarray(cloud.points))  # columns are read one by one
    sparse = cloud._replace(points=np.asfortranarray(cloud.points[::2]), normals=cloud.normals[::2])  # enough to rank
    ranked = sorted((_bounded(rod, sparse) for rod in trials), key=lambda trial: -trial[1])
    used, result = np.zeros(len(cloud.points), np.bool_), list[Boxes]()
    for rod, support in ranked:
        if not support or len(result) == SETTINGS.rods:
            break
        on, _ = _points_on(rod, cloud)
        if len(on) < SETTINGS.rod_points or used[on].mean() > 0.5:
            continue
        for _ in range(2):
            rod = _fitted(cloud.points[on], cloud.normals[on])
            on, _ = _points_on(rod._replace(half=rod.half + 0.5), cloud)
            if len(on) < SETTINGS.rod_points:
                break
        else:
            used[on] = True
            rod = _fitted(cloud.points[on], cloud.normals[on])
            half = np.array([[rod.half, rod.radius, rod.radius]])
            result.append(Boxes(rod.middle[None], rod.frame[None, :, [2, 0, 1]], half))
    return join(result)


def _points_on(rod: Rod, cloud: Cloud) -> tuple[IntArray, FloatArray]:
    """Which points (K,) lie on a cylinder and face across its axis, and their places (3, K) in its frame."""
    x, y, z = at = rod.frame.T @ (cloud.points.T - rod.middle[:, None])
    away = np.sqrt(x * x + y * y)
    near = np.flatnonzero(np.abs(away - rod.radius) < cloud.tolerance)
    outwards = np.einsum("ni,in->n", cloud.normals[near] @ rod.frame[:, :2], at[:2, near])
    facing = np.abs(outwards) > (0.85 if cloud.noise > SURFACE.noisy else 0.94) * away[near]
    near = near[facing & (np.abs(z[near]) <= rod.half)]
    return near, at[:, near]


def _bounded(rod: Rod, cloud: Cloud) -> tuple[Rod, int]:
    """A cylinder cut to the stretch of its axis from its middle that has points, and how many; 0 where it is no rod.

    The cloud has half of the points.  A stretch ends where half a cell is empty.
    """
    _, (x, y, z) = _points_on(rod, cloud)
    if 2 * len(z) < SETTINGS.rod_points:
        return rod, 0
    place = np.floor(2 * z)
    farthest = np.abs(place).max()
    empty = np.setdiff1d(np.arange(-farthest - 1, farthest + 2), place)
    start, end = empty[empty < 0].max() + 1, empty[empty >= 0].min()
    here = (place >= start) & (place < end)
    sectors = np.floor(8 * np.arctan2(y[here], x[here]) / np.pi) % 16
    support, length, share = 2 * len(sectors), (end - start) / 2, len(np.unique(sectors)) / 16
    least = max(SETTINGS.rod_points, SETTINGS.rod_dense * 2 * np.pi * rod.radius * length * share / cloud.spacing**2)
    good = support >= least and length > 2 * rod.radius and share >= SETTINGS.rod_round
    middle = rod.middle + rod.frame[:, 2] * (start + end) / 4
    return Rod(middle, rod.frame, rod.radius, length / 2), support if good else 0


def _through_pairs(cloud: Cloud) -> list[Rod]:
    """Endless cylinders through pairs of points that are near.

    The axis is normal to both normals, and passes through their intersection (as in Schnabel, Wahl and Klein 2007).
    """
    points, normals, neighbours = cloud.points, cloud.normals, cloud.neighbours
    draws = np.random.default_rng(0).integers(1 << 32, size=(SETTINGS.rod_trials, SETTINGS.rod_walk))
    first = second = draws[:, 0] % len(points)
    cosine = np.ones(SETTINGS.rod_trials)
    for draw in draws[:, 1:].T:  # walk until the normals differ
        going = np.abs(cosine) >= SETTINGS.rod_parallel
        second = np.where(going, neighbours[second, draw % neighbours.shape[1]], second)
        cosine = np.einsum("ti,ti->t", normals[first], normals[second])
    apart = np.abs(cosine) <= SETTINGS.rod_parallel
    first, second, cosine = first[apart], second[apart], cosine[apart]
    p, q, away = normals[first], normals[second], points[second] - points[first]
    axis = np.cross(p, q)
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    # first + s p and second + t q are equally far along the axis; elsewhere they meet
    along_p, along_q = np.einsum("ti,ti->t", away, p), np.einsum("ti,ti->t", away, q)
    s, t = (along_p - cosine * along_q) / (1 - cosine**2), (cosine * along_p - along_q) / (1 - cosine**2)
    radius = (np.abs(s) + np.abs(t)) / 2
    good = np.abs(np.abs(s) - np.abs(t)) <= cloud.tolerance + 0.1 * radius
    good &= (radius <= SETTINGS.rod_radius) & (radius >= 0.5 * cloud.tolerance)
    fields = points[first] + s[:, None] * p, upright(axis), radius, np.full(len(axis), np.inf)
    return [Rod(*row) for row in zip(*(field[good] for field in fields), strict=True)]


def _fitted(points: FloatArray, normals: FloatArray) -> Rod:
    """The cylinder that fits points (N, 3) best.

    The axis is the direction that the normals are least along; the circle is Kasa's (1976).
    """
    frame = upright(np.linalg.eigh(normals.T @ normals)[1][None, :, 0])[0]
    axis, across = frame[:, 2], frame[:, :2]
    mean = points.mean(0)
    flat = (points - mean) @ across
    solved = np.linalg.lstsq(np.column_stack([2 * flat, np.ones(len(flat))]), (flat**2).sum(1), rcond=None)[0]
    radius = float(np.sqrt(max(solved[2] + solved[:2] @ solved[:2], 0.0)))
    along = (points - mean) @ axis
    low, high = along.min(), along.max()
    return Rod(mean + across @ solved[:2] + axis * (low + high) / 2, frame, radius, float(high - low) / 2)

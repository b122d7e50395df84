"""Round rods among points with normals."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from shapeprog.inference.pieces.oriented import Boxes, join
from shapeprog.inference.pieces.patches import upright
from shapeprog.inference.pieces.point_kernels import count_rods, mark_rod
from shapeprog.inference.pieces.settings import SETTINGS
from shapeprog.inference.surface.cloud import Cloud
from shapeprog.inference.surface.settings import SURFACE
from shapeprog.space import FloatArray


def rods(cloud: Cloud) -> Boxes:
    """Boxes around round rods, best first; the first axis is that of the rod."""
    off, facing = cloud.tolerance, 0.85 if cloud.noise > SURFACE.noisy else 0.94
    centre, axis, radius = _through_pairs(cloud)
    frames, counts = _frames(axis), np.zeros((len(radius), 4))
    count_rods(cloud.points, cloud.normals, centre, frames, radius, off, facing, counts)
    support, start, end, share = counts.T
    length = end - start
    good = (support >= SETTINGS.rod_points) & (share >= SETTINGS.rod_round) & (length > 2 * radius)
    good &= support > SETTINGS.rod_dense * 2 * np.pi * radius * length * share / cloud.spacing**2
    centre = centre + axis * ((start + end) / 2)[:, None]

    def on_rod(middle: FloatArray, frame: FloatArray, radius: float, half: float) -> npt.NDArray[np.bool_]:
        """Whether points (N,) lie on a cylinder and face across its axis."""
        inside = np.zeros(len(cloud.points), np.bool_)
        mark_rod(cloud.points, cloud.normals, middle, frame, radius, half, off, facing, inside)
        return inside

    used, result = np.zeros(len(cloud.points), np.bool_), list[Boxes]()
    for k in np.flatnonzero(good)[np.argsort(-support[good], kind="stable")]:
        if len(result) == SETTINGS.rods:
            break
        inside = on_rod(centre[k], frames[k], radius[k], length[k] / 2)
        if inside.sum() < SETTINGS.rod_points or used[inside].mean() > 0.5:
            continue
        for _ in range(2):
            middle, frame, width, half = _fitted(cloud.points[inside], cloud.normals[inside])
            inside = on_rod(middle, frame, width, half + 0.5)
            if inside.sum() < SETTINGS.rod_points:
                break
        else:
            middle, frame, width, half = _fitted(cloud.points[inside], cloud.normals[inside])
            used |= inside
            result.append(Boxes(middle[None], frame[:, [2, 0, 1]][None], np.array([[half, width, width]])))
    return join(result)


def _through_pairs(cloud: Cloud) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Points on the axes (T, 3), axes (T, 3) and radii (T,) of cylinders through pairs of points that are near.

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
    return (points[first] + s[:, None] * p)[good], axis[good], radius[good]


def _frames(axis: FloatArray) -> FloatArray:
    """Frames (T, 3, 3) whose last columns are axes (T, 3)."""
    side = np.eye(3)[np.where(np.abs(axis[:, 0]) < 0.6, 0, 1)]
    across = np.cross(axis, side)
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    return np.ascontiguousarray(np.stack([np.cross(across, axis), across, axis], 2))


def _fitted(points: FloatArray, normals: FloatArray) -> tuple[FloatArray, FloatArray, float, float]:
    """Middle, frame about the axis (3, 3), radius and half length of the cylinder that fits points (N, 3) best.

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
    return mean + across @ solved[:2] + axis * (low + high) / 2, frame, radius, float(high - low) / 2

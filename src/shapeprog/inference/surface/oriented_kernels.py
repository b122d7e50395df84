"""Kernels that find small boxes around points, in any direction but along the world's axes where these do."""

from __future__ import annotations

import numpy as np

from shapeprog.kernels.compile import helper, kernel

WORTH = 0.93  # largest volume relative to a simpler orientation at which a less restricted one is selected
SLACK = 1.05  # largest volume relative to the smallest box at which the box along the axis of a rod is selected
COMPACT, ROD, FLAT = 0, 1, 2  # kinds of point sets


@helper
def along(points, frame, axis):
    """Where points (P, 3) lie along a column of a frame."""
    return points[:, 0] * frame[0, axis] + points[:, 1] * frame[1, axis] + points[:, 2] * frame[2, axis]


@helper
def outermost(points, directions):
    """The points that lie farthest out along some directions (3, D), or all of a few: these determine its box."""
    if len(points) <= 2 * directions.shape[1]:
        return points
    selected = np.empty((directions.shape[1], 2), np.int64)
    for d in range(directions.shape[1]):
        at = along(points, directions, d)
        selected[d, 0], selected[d, 1] = at.argmin(), at.argmax()
    return points[selected.ravel()]


@helper
def volume(points, frame, floor):
    """The volume of the box of points along a frame, each side at least ``floor``."""
    product = 1.0
    for axis in range(3):
        at = along(points, frame, axis)
        product *= max(at.max() - at.min(), floor)
    return product


@helper
def turned(points, frame, axis, floor):
    """A frame turned about one of its columns so that the rectangle about the points, seen along it, is smallest.

    One of its sides lies on an edge of the convex hull (Freeman and Shapira 1975), along which it is wrapped (Jarvis
    1973).
    """
    first, second = (axis + 1) % 3, (axis + 2) % 3
    a, b = along(points, frame, first), along(points, frame, second)
    start = (0.7648 * a + 0.6442 * b).argmin()  # a corner: no edges of furniture are square to this direction
    best, cosine, sine, corner = np.inf, 1.0, 0.0, start
    x, y = 1.0, 0.0  # the first candidate is the frame itself
    for step in range(len(points) + 1):
        low0, high0, low1, high1 = np.inf, -np.inf, np.inf, -np.inf
        after, u, v = -1, 0.0, 0.0
        for k in range(len(points)):
            length, width = a[k] * x + b[k] * y, b[k] * x - a[k] * y
            low0, high0 = min(low0, length), max(high0, length)
            low1, high1 = min(low1, width), max(high1, width)
            p, q = a[k] - a[corner], b[k] - b[corner]
            square, turn = p * p + q * q, u * q - v * p
            if square > 1e-18 and (after < 0 or turn < 0 or (turn == 0 and square > u * u + v * v)):
                after, u, v = k, p, q
        area = max(high0 - low0, floor) * max(high1 - low1, floor)
        if area < best * (1 - 1e-6):
            best, cosine, sine = area, x, y
        if after < 0 or (step > 0 and corner == start):
            break
        length = np.sqrt(u * u + v * v)
        x, y, corner = u / length, v / length, after
    while abs(sine) > cosine:  # the same rectangle, turned by less
        cosine, sine = sine, -cosine
    result = frame.copy()
    result[:, first] = cosine * frame[:, first] + sine * frame[:, second]
    result[:, second] = cosine * frame[:, second] - sine * frame[:, first]
    return result


@helper
def settled(points, frame, floor):
    """A frame turned about its axes in turn while the box becomes smaller, and the volume of the box."""
    best = volume(points, frame, floor)
    for _ in range(6):
        before = best
        for axis in range(3):
            frame = turned(points, frame, axis, floor)
        best = volume(points, frame, floor)
        if best > before * 0.999:
            break
    return frame, best


@kernel("void(f8[:, ::1], i8[::1], f8[:, ::1], f8[:, :, ::1], i8[::1], f8, f8[:, :, ::1])")
def turn_each(points, start, directions, frames, kind, floor, rotation):
    """The axes of a small oriented box around each run of points.

    The world's axes where no other direction is much better, then one turned about one of them, then the smallest.
    Run g has the points (P, 3) from ``start[g]`` to ``start[g + 1] - 1``, at least one; those farthest out along some
    ``directions`` (3, D), one of each opposite pair, define its box.  Sides shorter than ``floor`` count as so long.

    The ``frames`` (G, 3, 3) of ``COMPACT`` runs are principal axes, longest first, from which the search starts too; in
    those of a ``ROD``, the first axis is preferred to that of the smallest box; those that are ``FLAT`` are turned only
    about their last axis.  The output ``rotation`` (G, 3, 3) has axes as columns.
    """
    for g in range(len(start) - 1):
        own, flattened = outermost(points[start[g] : start[g + 1]], directions), kind[g] == FLAT
        frame = simple = frames[g] if flattened else np.eye(3)
        current = volume(own, simple, floor)
        best = WORTH * current
        for axis in range(2 if flattened else 0, 3):
            trial = turned(own, simple, axis, floor)
            size = volume(own, trial, floor)
            if size < best:
                best, current, frame = size, size, trial
        if not flattened:
            best, free = WORTH * current, False
            for initial in (frame, frames[g]):
                trial, size = settled(own, initial, floor)
                if size < best:
                    best, frame, free = size, trial, True
            if free and kind[g] == ROD:
                trial = turned(own, frames[g], 0, floor)
                if volume(own, trial, floor) < SLACK * best:
                    frame = trial
        rotation[g] = frame

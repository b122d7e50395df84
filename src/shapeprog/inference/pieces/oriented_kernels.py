"""Kernels that find small boxes around points, in any direction but along the world's axes where these do."""

from __future__ import annotations

import numpy as np

from shapeprog.kernels.compile import helper, kernel

WORTH = 0.93  # largest volume relative to a simpler orientation at which a less restricted one is selected
SLACK = 1.05  # largest volume relative to the smallest box at which the box along the axis of a rod is selected
COMPACT, ROD, FLAT = 0, 1, 2  # kinds of point sets
SWEEPS = 6  # rounds that turn a box about each of its axes to minimise its volume, at most
MANY = 160  # points above which only the outermost ones determine the directions


@helper
def copy(frame, result):
    """Write a frame over another; the compiler takes a second for an assignment of whole arrays."""
    for row in range(3):
        for column in range(3):
            result[row, column] = frame[row, column]


@helper
def extent(points, frame, axis):
    """How far points reach along a column of a frame, down and up."""
    low, high = np.inf, -np.inf
    for k in range(len(points)):
        at = points[k, 0] * frame[0, axis] + points[k, 1] * frame[1, axis] + points[k, 2] * frame[2, axis]
        low, high = min(low, at), max(high, at)
    return low, high


@helper
def volume(points, frame, floor):
    """The volume of the box of points along a frame, each side at least ``floor``."""
    product = 1.0
    for axis in range(3):
        low, high = extent(points, frame, axis)
        product *= max(high - low, floor)
    return product


@helper
def turn_about(points, frame, axis, floor, flat):
    """Turn a frame about one of its columns so that the rectangle about the points, seen along it, is smallest.

    One of its sides lies on an edge of the convex hull (Freeman and Shapira 1975), along which it is wrapped (Jarvis
    1973).
    """
    first, second = (axis + 1) % 3, (axis + 2) % 3
    start = 0
    for k in range(len(points)):
        for side in range(2):
            at = first if side == 0 else second
            flat[k, side] = points[k, 0] * frame[0, at] + points[k, 1] * frame[1, at] + points[k, 2] * frame[2, at]
        # a corner: no edges of furniture are square to this direction
        if 0.7648 * (flat[k, 0] - flat[start, 0]) + 0.6442 * (flat[k, 1] - flat[start, 1]) < 0:
            start = k
    best, cosine, sine, corner = np.inf, 1.0, 0.0, start
    x, y = 1.0, 0.0  # the first candidate is the frame itself
    for step in range(len(points) + 1):
        low0, high0, low1, high1 = np.inf, -np.inf, np.inf, -np.inf
        after, u, v = -1, 0.0, 0.0
        for k in range(len(points)):
            along, across = flat[k, 0] * x + flat[k, 1] * y, flat[k, 1] * x - flat[k, 0] * y
            low0, high0 = min(low0, along), max(high0, along)
            low1, high1 = min(low1, across), max(high1, across)
            p, q = flat[k, 0] - flat[corner, 0], flat[k, 1] - flat[corner, 1]
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
    if abs(sine) > abs(cosine):  # the same rectangle, turned by less
        cosine, sine = (sine, -cosine) if sine > 0 else (-sine, cosine)
    if cosine < 0:
        cosine, sine = -cosine, -sine
    for row in range(3):
        u, v = frame[row, first], frame[row, second]
        frame[row, first], frame[row, second] = cosine * u + sine * v, cosine * v - sine * u


@helper
def settle(points, frame, floor, flat):
    """Turn a frame about its axes in turn while the box becomes smaller; its volume is returned."""
    best = volume(points, frame, floor)
    for _ in range(SWEEPS):
        before = best
        for axis in range(3):
            turn_about(points, frame, axis, floor, flat)
        best = volume(points, frame, floor)
        if best > before * 0.999:
            break
    return best


@helper
def outermost(points, directions, selected):
    """The points that lie farthest out along some directions, copied to ``selected``, or all of a few."""
    if len(points) <= MANY:
        return points
    for d in range(len(directions)):
        low, high = 0, 0
        minimum, maximum = np.inf, -np.inf
        for k in range(len(points)):
            at = points[k, 0] * directions[d, 0] + points[k, 1] * directions[d, 1] + points[k, 2] * directions[d, 2]
            if at < minimum:
                minimum, low = at, k
            if at > maximum:
                maximum, high = at, k
        for axis in range(3):
            selected[2 * d, axis], selected[2 * d + 1, axis] = points[low, axis], points[high, axis]
    return selected[: 2 * len(directions)]


@kernel("void(f8[:, ::1], i8[::1], f8[:, ::1], f8[:, :, ::1], i8[::1], f8, f8[:, ::1], f8[:, :, ::1], f8[:, ::1])")
def box_each(points, start, directions, frames, kind, floor, centre, rotation, half):
    """A small oriented box around each run of points.

    The world's axes where no other direction is much better, then one turned about one of them, then the smallest.

    Parameters
    ----------
    points, start
        Points (P, 3); run g holds those from ``start[g]`` to ``start[g + 1] - 1``, at least one.
    directions
        Unit vectors (D, 3), one of each opposite pair, that define the outermost points; 2 D <= MANY.
    frames, kind
        Frames (G, 3, 3) and kinds (G,): ``COMPACT``, initial principal axes, longest first; ``ROD``, the same of a long
        thin part, whose first axis is preferred to that of the smallest box; ``FLAT``, turned only about the last axis.
    floor
        Smallest side: thinner boxes count as flat.
    centre, rotation, half
        Output (G, 3), (G, 3, 3) with axes as columns, and (G, 3), initially zero.
    """
    selected, flat = np.empty((MANY, 3)), np.empty((MANY, 2))
    world, trial = np.eye(3), np.empty((3, 3))
    for g in range(len(start) - 1):
        own, frame = points[start[g] : start[g + 1]], rotation[g]
        outer = outermost(own, directions, selected)
        flattened = kind[g] == FLAT
        simple = frames[g] if flattened else world
        copy(simple, frame)
        current = volume(outer, frame, floor)
        best = WORTH * current
        for axis in range(2 if flattened else 0, 3):
            copy(simple, trial)
            turn_about(outer, trial, axis, floor, flat)
            size = volume(outer, trial, floor)
            if size < best:
                best = current = size
                copy(trial, frame)
        if not flattened:
            best = WORTH * current
            free = False
            for way in range(2):
                copy(frame if way == 0 else frames[g], trial)
                size = settle(outer, trial, floor, flat)
                if size < best:
                    best, free = size, True
                    copy(trial, frame)
            if free and kind[g] == ROD:
                copy(frames[g], trial)
                turn_about(outer, trial, 0, floor, flat)
                if volume(outer, trial, floor) < SLACK * best:
                    copy(trial, frame)
        for axis in range(3):
            low, high = extent(own, frame, axis)
            half[g, axis] = (high - low) / 2
            for row in range(3):
                centre[g, row] += frame[row, axis] * (low + high) / 2

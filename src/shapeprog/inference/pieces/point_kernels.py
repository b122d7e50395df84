"""Kernels over the points of a surface: planar patches, points on round rods, and points that boxes explain."""

from __future__ import annotations

import numpy as np

from shapeprog.kernels.compile import helper, kernel

BINS = 16  # sectors around the axis of a rod
EVERY = 2  # stride over the points that are tested on rods
REACH = 0.5  # length in cells of the stretches along the axis of a rod; an empty one ends it
STRETCHES = 128  # stretches along the longest rod: more than the diagonal of the grid


@kernel("void(f8[:, ::1], f8[:, ::1], i4[:, ::1], i8[::1], f8, f8, i8, i8[::1])")
def grow_patches(points, normals, neighbours, order, cosine, tolerance, min_size, label):
    """Label points by the planar patch they belong to.

    A patch grows from a seed to neighbours that lie in its plane and face its way, while the plane follows its points.

    Parameters
    ----------
    points, normals
        Points (N, 3) and unit normals (N, 3) of either sign.
    neighbours
        Indices (N, k) of neighbouring points.
    order
        Seeds, the flattest first.
    cosine, tolerance
        How well a point's normal agrees with the plane's, and how far it may lie from it.
    min_size
        Points of the smallest patch.
    label
        Output (N,), initially -1, and afterwards for points of no patch.
    """
    stack = np.empty(len(points), np.int64)
    mean, total, normal = np.empty(3), np.empty(3), np.empty(3)
    patches = 0
    for seed in order:
        if label[seed] >= 0:
            continue
        for axis in range(3):
            normal[axis] = total[axis] = normals[seed, axis]
            mean[axis] = points[seed, axis]
        size, at = 1, 0
        stack[0] = seed
        label[seed] = patches
        while at < size:
            point = stack[at]
            at += 1
            for k in range(neighbours.shape[1]):
                neighbour = neighbours[point, k]
                if label[neighbour] >= 0:
                    continue
                facing, off = 0.0, 0.0
                for axis in range(3):
                    facing += normals[neighbour, axis] * normal[axis]
                    off += (points[neighbour, axis] - mean[axis]) * normal[axis]
                if abs(facing) < cosine or abs(off) > tolerance:
                    continue
                label[neighbour] = patches
                stack[size] = neighbour
                size += 1
                length = 0.0
                for axis in range(3):
                    total[axis] += normals[neighbour, axis] if facing > 0 else -normals[neighbour, axis]
                    mean[axis] += (points[neighbour, axis] - mean[axis]) / size
                    length += total[axis] * total[axis]
                for axis in range(3):
                    normal[axis] = total[axis] / np.sqrt(length)
        if size < min_size:
            for k in range(size):
                label[stack[k]] = -1
        else:
            patches += 1


@helper
def local(point, centre, frame, at):
    """Write where a point is along the columns of a frame."""
    for axis in range(3):
        at[axis] = 0.0
        for row in range(3):
            at[axis] += (point[row] - centre[row]) * frame[row, axis]


@helper
def about_axis(point, normal, centre, frame, at):
    """The same, and the distance of the point from the last column, and how far it faces away from it."""
    local(point, centre, frame, at)
    at[3], at[4] = np.sqrt(at[0] * at[0] + at[1] * at[1]), 0.0
    for row in range(3):
        at[4] += (point[row] - centre[row] - at[2] * frame[row, 2]) * normal[row]


@kernel("void(f8[:, ::1], f8[:, ::1], f8[::1], f8[:, ::1], f8, f8, f8, f8, b1[::1])")
def mark_rod(points, normals, centre, frame, radius, half, tolerance, cosine, inside):
    """Write which points (N, 3) with normals (N, 3) lie on a cylinder and face across its axis (N,)."""
    at = np.empty(5)
    for k in range(len(points)):
        about_axis(points[k], normals[k], centre, frame, at)
        inside[k] = abs(at[2]) <= half and abs(at[3] - radius) < tolerance and abs(at[4]) > cosine * at[3]


@kernel("void(f8[:, ::1], f8[:, ::1], f8[:, ::1], f8[:, :, ::1], f8[::1], f8, f8, f8[:, ::1])")
def count_rods(points, normals, centre, frame, radius, tolerance, cosine, counts):
    """Count the points on endless cylinders, along the stretch of their axes from the centre that has points.

    Parameters
    ----------
    points, normals
        Points (N, 3) with unit normals (N, 3) of either sign.
    centre, frame, radius
        Points on the axes (T, 3), frames (T, 3, 3) whose last columns are the axes, and radii (T,).
    tolerance, cosine
        How far a point may be from the cylinder, and how well its normal agrees with it.
    counts
        Output (T, 4): number of points, start and end of the stretch along the axis, share of sectors with points.
    """
    at = np.empty(5)
    stretch = np.empty(STRETCHES, np.int64)
    sector = np.empty((STRETCHES, BINS), np.bool_)
    middle = STRETCHES // 2
    for rod in range(len(radius)):
        stretch[:] = 0
        sector[:] = False
        for k in range(0, len(points), EVERY):
            about_axis(points[k], normals[k], centre[rod], frame[rod], at)
            if abs(at[3] - radius[rod]) < tolerance and abs(at[4]) > cosine * at[3]:
                place = int(np.floor(at[2] / REACH)) + middle
                if 0 <= place < STRETCHES:
                    stretch[place] += EVERY
                    turn = np.arctan2(at[1], at[0]) / (2 * np.pi) + 0.5
                    sector[place, min(int(turn * BINS), BINS - 1)] = True
        low, high = middle, middle
        while low > 0 and stretch[low - 1] > 0:
            low -= 1
        while high < STRETCHES and stretch[high] > 0:
            high += 1
        counts[rod, 0], counts[rod, 3] = 0.0, 0.0
        counts[rod, 1], counts[rod, 2] = REACH * (low - middle), REACH * (high - middle)
        for place in range(low, high):
            counts[rod, 0] += stretch[place]
        for b in range(BINS):
            counts[rod, 3] += sector[low:high, b].any() / BINS


@helper
def square_of(place, half, count):
    """Into which of the squares along a side a place falls."""
    return min(max(int(count * (place / half + 1) / 2), 0), count - 1) if half > 0 else 0


@kernel("void(f8[:, ::1], f8[:, ::1], f8[:, :, ::1], f8[:, ::1], f8, b1[:, ::1], f8[::1])")
def near_boxes(points, centre, rotation, half, tolerance, explained, fill):
    """Which points are near the surface of each box, and the share of the box's surface near which points lie.

    The surface is divided into squares of about two cells, at most eight along a side.

    Parameters
    ----------
    points
        Points (N, 3) of a surface.
    centre, rotation, half
        Boxes (B, 3), (B, 3, 3) with axes as columns, and (B, 3).
    tolerance
        Largest distance of a point from the surface that explains it.
    explained, fill
        Output (B, N) and (B,), initially false.
    """
    covered, at, count = np.empty((6, 8, 8), np.bool_), np.empty(3), np.empty(3, np.int64)
    for b in range(len(centre)):
        covered[:] = False
        for axis in range(3):
            count[axis] = min(max(int(np.ceil(half[b, axis])), 1), 8)
        size, far = half[b], half[b] + tolerance
        reach = 1.001 * (far[0] * far[0] + far[1] * far[1] + far[2] * far[2])
        for k in range(len(points)):
            x, y, z = points[k, 0] - centre[b, 0], points[k, 1] - centre[b, 1], points[k, 2] - centre[b, 2]
            if x * x + y * y + z * z > reach:  # most points are outside this ball
                continue
            local(points[k], centre[b], rotation[b], at)
            if abs(at[0]) > far[0] or abs(at[1]) > far[1] or abs(at[2]) > far[2]:
                continue
            for axis in range(3):
                if abs(abs(at[axis]) - size[axis]) <= tolerance:
                    explained[b, k] = True
                    i, j = (axis + 1) % 3, (axis + 2) % 3
                    u, v = square_of(at[i], size[i], count[i]), square_of(at[j], size[j], count[j])
                    covered[2 * axis + (1 if at[axis] > 0 else 0), u, v] = True
        total, filled = 0.0, 0.0
        for face in range(6):
            i, j = (face // 2 + 1) % 3, (face // 2 + 2) % 3
            square = size[i] * size[j] / (count[i] * count[j])
            for u in range(count[i]):
                for v in range(count[j]):
                    total += square
                    filled += square if covered[face, u, v] else 0.0
        fill[b] = filled / total if total > 0 else 0.0

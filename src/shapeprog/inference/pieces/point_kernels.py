"""Kernels over the points of a surface: planar patches, and points that boxes explain."""

from __future__ import annotations

import numpy as np

from shapeprog.kernels.compile import helper, kernel


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

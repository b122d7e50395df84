"""Kernels over the points of a surface: planar patches, and points that boxes explain."""

from __future__ import annotations

import numpy as np

from shapeprog.kernels.compile import kernel


@kernel("void(f8[:, ::1], f8[:, ::1], i4[:, ::1], i8[::1], f8, f8, i8, i8[::1])")
def grow_patches(points, normals, neighbours, order, cosine, tolerance, min_size, label):
    """Label points by the planar patch they belong to.

    A patch grows from a seed, of which the flattest are first in ``order``, to neighbours (N, k) within ``tolerance``
    of its plane, whose normals, of either sign, have at least this cosine with its own, while the plane follows its
    points.  The output ``label`` (N,) is initially -1, and stays so for points of patches smaller than ``min_size``.
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
            label[stack[:size]] = -1
        else:
            patches += 1


@kernel("void(f8[:, ::1], i8[::1], i8[::1], i8[::1], f8[:, ::1], f8[:, :, ::1], f8[:, ::1], f8, b1[:, ::1], f8[::1])")
def near_boxes(points, column, start, end, centre, rotation, half, tolerance, explained, fill):
    """Which points are near the surface of each box, and the share of the box's surface near which points lie.

    Points (N, 3) are near within ``tolerance``; those that may be near box b are from ``start[b]`` to ``end[b] - 1``.
    The surface is divided into squares of about two cells, at most eight along a side.  The outputs ``explained``
    (B, N), where point k has the column ``column[k]``, and ``fill`` (B,) are initially zero.
    """
    covered, at = np.empty((6, 8, 8), np.bool_), np.empty(3)
    count, square = np.empty(3, np.int64), np.empty(3, np.int64)
    for b in range(len(centre)):
        size = half[b]
        reach = 1.001 * ((size + tolerance) ** 2).sum()
        covered[:] = False
        for axis in range(3):
            count[axis] = min(max(int(np.ceil(size[axis])), 1), 8)
        for k in range(start[b], end[b]):
            x, y, z = points[k, 0] - centre[b, 0], points[k, 1] - centre[b, 1], points[k, 2] - centre[b, 2]
            if x * x + y * y + z * z > reach:  # most points are outside this ball
                continue
            for axis in range(3):
                at[axis] = x * rotation[b, 0, axis] + y * rotation[b, 1, axis] + z * rotation[b, 2, axis]
                if abs(at[axis]) > size[axis] + tolerance:
                    break
            else:
                for axis in range(3):
                    place = int(count[axis] * (at[axis] / size[axis] + 1) / 2)
                    square[axis] = min(max(place, 0), count[axis] - 1)
                for axis in range(3):
                    if size[axis] - abs(at[axis]) <= tolerance:
                        face = 2 * axis + (1 if at[axis] > 0 else 0)
                        explained[b, column[k]] = covered[face, square[(axis + 1) % 3], square[(axis + 2) % 3]] = True
        total, filled = 0.0, 0.0
        for face in range(6):
            i, j = (face // 2 + 1) % 3, (face // 2 + 2) % 3
            area = size[i] * size[j] / (count[i] * count[j])
            for flag in covered[face, : count[i], : count[j]].flat:
                total += area
                filled += area if flag else 0.0
        fill[b] = filled / total if total > 0 else 0.0

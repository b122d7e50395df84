"""Kernels that grow planar patches over points."""

from __future__ import annotations

import numpy as np

from shapeprog.kernels.compile import kernel


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

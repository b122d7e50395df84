"""Kernels over triangles and pixels: nearest triangle per pixel, depth seen from lights, light that arrives.

Serial and without the interpreter lock, so that threads can draw several views.
"""

from __future__ import annotations

import math

import numpy as np

from shapeprog.kernels.compile import helper, kernel

BACKGROUND = -1  # face index of a pixel that shows the ground


@helper
def narrow(low, high, weight, step):
    """The part of an interval of a row where a weight, given at pixel 0, is not negative."""
    weight += 1e-9
    if step > 1e-15:
        low = max(low, -weight / step)
    elif step < -1e-15:
        high = min(high, -weight / step)
    elif weight < 0:
        high = -1.0  # nowhere
    return low, high


@kernel("void(f8[:, ::1], i8[:, ::1], f8, i4[:, ::1], f8[:, ::1])")
def nearest_faces(points, faces, tolerance, face, depth):
    """The face of the largest depth at every pixel, and that depth; of faces in one place the first in the list shows.

    ``points`` (V, 3) are pixel coordinates and a depth that is linear across the screen.  ``face`` and ``depth``
    (H, W) come filled with ``BACKGROUND`` and the lowest depth.
    """
    height, width = face.shape
    for f in range(len(faces)):
        a, b, c = points[faces[f, 0]], points[faces[f, 1]], points[faces[f, 2]]
        area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
        if abs(area) < 1e-12:
            continue
        step_b, step_c = (c[1] - a[1]) / area, (a[1] - b[1]) / area
        slope = step_b * (b[2] - a[2]) + step_c * (c[2] - a[2])
        low = max(0, math.ceil(min(a[1], b[1], c[1]) - 0.5))
        high = min(height - 1, math.floor(max(a[1], b[1], c[1]) - 0.5))
        for y in range(low, high + 1):
            wb = ((0.5 - a[0]) * (c[1] - a[1]) - (y + 0.5 - a[1]) * (c[0] - a[0])) / area
            wc = ((b[0] - a[0]) * (y + 0.5 - a[1]) - (b[1] - a[1]) * (0.5 - a[0])) / area
            left, right = narrow(0.0, width - 1.0, wb, step_b)
            left, right = narrow(left, right, wc, step_c)
            left, right = narrow(left, right, 1 - wb - wc, -step_b - step_c)
            start = a[2] + wb * (b[2] - a[2]) + wc * (c[2] - a[2])
            for x in range(math.ceil(left), math.floor(right) + 1):
                value = start + x * slope
                if value > depth[y, x] * (1 + tolerance):
                    depth[y, x] = value
                    face[y, x] = f


@kernel("void(i4[:, ::1], f8[:, ::1], f8[:, ::1], i8[:, ::1], f8[:, :, ::1], f8[:, ::1], f4[:, :, ::1], f4[:, :, ::1])")
def surface(face, depth, points, faces, normals, view, position, normal):
    """Position and normal towards the eye (H, W, 3) of every pixel that shows a face.

    ``view`` holds as rows the eye and the corner, across and down of its rays: that of pixel (x, y) is
    ``corner + x * across + y * down``.  Depth is inverse, along the axis of view.
    """
    height, width = face.shape
    eye, corner, across, down = view[0], view[1], view[2], view[3]
    ray, direction = np.empty(3), np.empty(3)
    for y in range(height):
        for x in range(width):
            f = face[y, x]
            if f == BACKGROUND:
                continue
            px, py = x + 0.5, y + 0.5
            for axis in range(3):
                ray[axis] = corner[axis] + px * across[axis] + py * down[axis]
            a, b, c = points[faces[f, 0]], points[faces[f, 1]], points[faces[f, 2]]
            area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
            wb = ((px - a[0]) * (c[1] - a[1]) - (py - a[1]) * (c[0] - a[0])) / area * b[2]
            wc = ((b[0] - a[0]) * (py - a[1]) - (b[1] - a[1]) * (px - a[0])) / area * c[2]
            wa = depth[y, x] - wb - wc
            length, facing = 0.0, 0.0
            for axis in range(3):
                position[y, x, axis] = eye[axis] + ray[axis] / depth[y, x]
                direction[axis] = (
                    wa * normals[f, 0, axis] + wb * normals[f, 1, axis] + wc * normals[f, 2, axis]
                ) / depth[y, x]
                length += direction[axis] ** 2
                facing += direction[axis] * ray[axis]
            scale = (-1.0 if facing > 0 else 1.0) / max(math.sqrt(length), 1e-12)
            for axis in range(3):
                normal[y, x, axis] = direction[axis] * scale


@kernel("void(f4[:, :, ::1], f4[:, :, ::1], i4[:, ::1], f4[:, :, ::1], f8[:, :, ::1], f8[::1], f8, i8, f8, f4[:, ::1])")
def irradiance(position, normal, skip, maps, frames, weights, radius, samples, bias, lit):
    """Share of the light of the sky that arrives at every pixel that is not to be skipped.

    Each of the ``samples`` x ``samples`` pixels that are averaged later uses another share of the lights.  ``lit``
    (H, W) comes filled with 0.
    """
    height, width = lit.shape
    shares = samples * samples
    size = maps.shape[1]
    scale = size / (2 * radius)
    for y in range(height):
        for x in range(width):
            if skip[y, x] < 0:
                continue
            p, n = position[y, x], normal[y, x]
            arrived = 0.0
            for light in range((y % samples) * samples + x % samples, len(frames), shares):
                frame = frames[light]
                slope = frame[2, 0] * n[0] + frame[2, 1] * n[1] + frame[2, 2] * n[2]
                if slope <= 0:
                    continue
                shift = bias * (1.1 - slope)
                q0, q1, q2 = p[0] + shift * n[0], p[1] + shift * n[1], p[2] + shift * n[2]
                u = int((frame[0, 0] * q0 + frame[0, 1] * q1 + frame[0, 2] * q2 + radius) * scale)
                v = int((frame[1, 0] * q0 + frame[1, 1] * q1 + frame[1, 2] * q2 + radius) * scale)
                if 0 <= u < size and 0 <= v < size:
                    high = frame[2, 0] * q0 + frame[2, 1] * q1 + frame[2, 2] * q2
                    if maps[light, v, u] > high + bias:
                        continue
                arrived += weights[light] * slope
            lit[y, x] = arrived * shares


@kernel("void(i4[:, ::1], f4[:, ::1], f4[:, ::1], u1[:, ::1], f8[::1], f8, f4[:, ::1], i8, f4[:, :, ::1])")
def develop(face, colours, lit, lines, inks, ambient, ground, samples, picture):
    """Add up the linear colours of every square of samples; ``ground`` is the brightness where no face is.

    ``picture`` (H, W, 3) comes filled with 0.
    """
    height, width = ground.shape
    for y in range(height * samples):
        for x in range(width * samples):
            f, line = face[y, x], lines[y, x]
            row, column = y // samples, x // samples
            if f < 0:
                shade = ground[row, column] * (inks[3] if line == 2 else 1.0)
                for channel in range(3):
                    picture[row, column, channel] += shade
                continue
            shade = (ambient + (1 - ambient) * lit[y, x]) * inks[line]
            for channel in range(3):
                picture[row, column, channel] += colours[f, channel] * shade

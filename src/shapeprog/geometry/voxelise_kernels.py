"""The kernel of :mod:`shapeprog.geometry.voxelise`: triangles into cells.

Coordinates are in cells with the origin at the corner of the grid, so cell ``k`` covers ``[k, k + 1]``.
"""

from __future__ import annotations

import numpy as np

from shapeprog.kernels.compile import kernel


@kernel("void(f8[:, :, ::1], f8, b1[:, :, ::1])")
def mark_triangles(triangles, half, cells):
    """Mark every cell whose box of half side ``half`` about its centre meets a triangle.

    Separating axes (Akenine-Moller 2001): three box faces, the triangle's plane and nine edge products; the projections
    of a triangle are found once and compared with those of each cell in the triangle's own box.

    Parameters
    ----------
    triangles
        Corners (F, 3 corners, 3).
    half
        0.5 is the closed cell; a little less leaves out what merely touches its boundary.
    cells
        Output (R, R, R), only ever set.
    """
    size = cells.shape[0]
    low = np.empty(3, np.int64)
    high = np.empty(3, np.int64)
    normal = np.empty(3)
    edge = np.empty((3, 3))
    least = np.empty(9)
    most = np.empty(9)
    for face in range(triangles.shape[0]):
        corner = triangles[face]
        empty = False
        for axis in range(3):
            smallest = min(corner[0, axis], corner[1, axis], corner[2, axis])
            largest = max(corner[0, axis], corner[1, axis], corner[2, axis])
            low[axis] = max(int(np.ceil(smallest - half - 0.5)), 0)
            high[axis] = min(int(np.floor(largest + half - 0.5)), size - 1)
            empty |= low[axis] > high[axis]
        if empty:
            continue
        if low[0] == high[0] and low[1] == high[1] and low[2] == high[2] and half >= 0.5:
            cells[low[0], low[1], low[2]] = True  # its own box lies in one closed cell
            continue
        for side in range(3):
            for axis in range(3):
                edge[side, axis] = corner[(side + 1) % 3, axis] - corner[side, axis]
        normal[0] = edge[0, 1] * edge[1, 2] - edge[0, 2] * edge[1, 1]
        normal[1] = edge[0, 2] * edge[1, 0] - edge[0, 0] * edge[1, 2]
        normal[2] = edge[0, 0] * edge[1, 1] - edge[0, 1] * edge[1, 0]
        offset = normal[0] * corner[0, 0] + normal[1] * corner[0, 1] + normal[2] * corner[0, 2]
        reach = half * (abs(normal[0]) + abs(normal[1]) + abs(normal[2]))
        for side in range(3):
            for axis in range(3):
                second, third = (axis + 1) % 3, (axis + 2) % 3
                a = edge[side, second] * corner[0, third] - edge[side, third] * corner[0, second]
                b = edge[side, second] * corner[1, third] - edge[side, third] * corner[1, second]
                c = edge[side, second] * corner[2, third] - edge[side, third] * corner[2, second]
                radius = half * (abs(edge[side, second]) + abs(edge[side, third]))
                least[3 * side + axis] = min(a, b, c) - radius
                most[3 * side + axis] = max(a, b, c) + radius
        for i in range(low[0], high[0] + 1):
            x = i + 0.5
            for j in range(low[1], high[1] + 1):
                y = j + 0.5
                start, stop = low[2], high[2] + 1
                if stop - start > 4 and abs(normal[2]) > 1e-6 * reach:  # a large box is mostly far from the plane
                    middle = (offset - normal[0] * x - normal[1] * y) / normal[2] - 0.5
                    room = abs(reach / normal[2]) + 1
                    start = max(start, int(np.floor(max(middle - room, start))))
                    stop = min(stop, int(np.ceil(min(middle + room, stop))) + 1)
                for k in range(start, stop):
                    if cells[i, j, k]:
                        continue
                    z = k + 0.5
                    if abs(normal[0] * x + normal[1] * y + normal[2] * z - offset) > reach:
                        continue
                    separated = False
                    for side in range(3):
                        p = edge[side, 1] * z - edge[side, 2] * y
                        q = edge[side, 2] * x - edge[side, 0] * z
                        r = edge[side, 0] * y - edge[side, 1] * x
                        m = 3 * side
                        if (
                            (p < least[m] or p > most[m])
                            or (q < least[m + 1] or q > most[m + 1])
                            or (r < least[m + 2] or r > most[m + 2])
                        ):
                            separated = True
                            break
                    if not separated:
                        cells[i, j, k] = True

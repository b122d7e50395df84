"""The kernel for visibility: it counts the directions that lead out of the grid without obstacles."""

from __future__ import annotations

from shapeprog.kernels.compile import kernel


@kernel("void(b1[:, :, ::1], f8[:, ::1], f8[:, :, ::1], i8, b1[::1], i8, i8)")
def look_out(barrier, starts, directions, minimum, out, begin, end):
    """Mark the starts ``begin`` to ``end`` of (N, 3) from which at least ``minimum`` directions lead out of the grid.

    Starts are in cells from the corner of the grid, whose cells (R, R, R) of a ``barrier`` stop a ray; from inside it
    none leads out.  The largest coordinate of directions (W, D, 3) is 1 or -1: no ray slips through a wall of touched
    cells.  All W ways of a direction must be clear: one, or both back and forth.
    """
    size = len(barrier)
    for item in range(begin, end):
        count = 0
        for turn in range(directions.shape[1]):
            clear = True
            for way in range(len(directions)):
                dx, dy, dz = directions[way, turn, 0], directions[way, turn, 1], directions[way, turn, 2]
                x, y, z = starts[item, 0], starts[item, 1], starts[item, 2]
                while clear and 0 <= x < size and 0 <= y < size and 0 <= z < size:
                    clear = not barrier[int(x), int(y), int(z)]
                    x, y, z = x + dx, y + dy, z + dz
            count += clear
            if count >= minimum:
                break
        out[item] = count >= minimum

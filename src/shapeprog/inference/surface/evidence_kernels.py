"""The kernel for visibility: it counts the directions that lead out of the grid without obstacles."""

from __future__ import annotations

from shapeprog.kernels.compile import kernel


@kernel("void(b1[:, :, ::1], f8[:, ::1], f8[:, ::1], i8, b1, b1[::1], i8, i8)")
def look_out(barrier, starts, directions, minimum, through, out, begin, end):
    """Mark the starts ``begin`` to ``end`` of (N, 3) from which at least ``minimum`` directions lead out of the grid.

    Starts are in cells from the corner of the grid, whose cells (R, R, R) of a ``barrier`` stop a ray; from inside it
    none leads out.  The largest coordinate of directions (D, 3) is 1 or -1: no ray slips through a wall of touched
    cells.  With ``through``, the way back along a direction must be clear as well.
    """
    size = len(barrier)
    for item in range(begin, end):
        count = 0
        for turn in range(len(directions)):
            clear = True
            for sign in range(2 if through else 1):
                dx, dy, dz = directions[turn, 0], directions[turn, 1], directions[turn, 2]
                if sign == 1:
                    dx, dy, dz = -dx, -dy, -dz
                x, y, z = starts[item, 0], starts[item, 1], starts[item, 2]
                while clear and 0 <= x < size and 0 <= y < size and 0 <= z < size:
                    clear = not barrier[int(x), int(y), int(z)]
                    x, y, z = x + dx, y + dy, z + dz
            count += clear
            if count >= minimum:
                break
        out[item] = count >= minimum

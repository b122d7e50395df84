"""Primitives as rows of one table of numbers, which is how kernels get them; here its columns have their names."""

from __future__ import annotations

from shapeprog.kernels.compile import helper

KIND, SIZE, CENTRE, ROTATION, WIDTH = 0, 1, 5, 8, 17
"""Columns: kind (negative for padding), four sizes, the centre, the rotation row by row; and how many there are."""


@helper
def in_axes(table, row, x, y, z):
    """A direction of the grid frame in the local one."""
    return (
        table[row, ROTATION] * x + table[row, ROTATION + 3] * y + table[row, ROTATION + 6] * z,
        table[row, ROTATION + 1] * x + table[row, ROTATION + 4] * y + table[row, ROTATION + 7] * z,
        table[row, ROTATION + 2] * x + table[row, ROTATION + 5] * y + table[row, ROTATION + 8] * z,
    )


@helper
def local(table, row, x, y, z):
    """A point in the local frame of a row."""
    return in_axes(table, row, x - table[row, CENTRE], y - table[row, CENTRE + 1], z - table[row, CENTRE + 2])


@helper
def turned(table, row, a, b, c):
    """A local direction in the grid frame."""
    return (
        table[row, ROTATION] * a + table[row, ROTATION + 1] * b + table[row, ROTATION + 2] * c,
        table[row, ROTATION + 3] * a + table[row, ROTATION + 4] * b + table[row, ROTATION + 5] * c,
        table[row, ROTATION + 6] * a + table[row, ROTATION + 7] * b + table[row, ROTATION + 8] * c,
    )

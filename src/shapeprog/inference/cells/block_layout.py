"""Layout of the row of numbers in which the structure search stores a block.

A block is a row of 16 whole numbers (as float64): a form, its own numbers, and the loops around it.

=========  ============================================================================================
slots      hold
=========  ============================================================================================
0          FORM: ``BOX``, ``DISC`` or ``BACK``
1 to 7     FIRST and on, the numbers of the form in the order of its statement, in cells, others unused:
           BOX   low corner (up, depth, side), extents (up, depth, side)
           DISC  centre of the bottom (up, depth, side), thickness, radius
           BACK  low corner, extents, tilt
8          COUNT1: copies of the first translation loop, 1 for none
9 to 11    SHIFT1: its step (up, depth, side)
12         COUNT2: copies of the second translation loop, 1 for none
13 to 15   SHIFT2: its step
=========  ============================================================================================
"""

from __future__ import annotations

WIDTH = 16
"""Numbers of one block."""

BOX, DISC, BACK = 0, 1, 2

FORM, FIRST = 0, 1
EXTENT = FIRST + 3
"""Extents of a box or back; thickness of a disc."""

RADIUS = FIRST + 4
"""Radius of a disc."""

TILT = FIRST + 6
"""Tilt of a back."""

COUNT1, SHIFT1, COUNT2, SHIFT2 = 8, 9, 12, 13

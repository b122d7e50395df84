"""The ways of repeating a box that the search tries: mirrored pairs, even rows, and both at once."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

MIRROR, PERIOD = 1, 2


def families(size: Sequence[int], planes: int, max_copies: int) -> npt.NDArray[np.int64]:
    """Rows (axis1, kind1, a1, b1, axis2, kind2, a2, b2) of ways to repeat a box in a volume of this size.

    Kind ``MIRROR`` pairs a box with its image in plane a (see ``mirrors``), ``PERIOD`` repeats it a times at distance
    b; an axis of -1 means no repetition.  The first row is the single box.

    Parameters
    ----------
    size
        Cells along each axis.
    planes
        Mirror planes nearest the middle that may pair a second loop with a first.
    max_copies
        Largest number of copies in an even row.
    """
    single: list[tuple[int, int, int, int]] = []
    for axis, length in enumerate(map(int, size)):
        for plane in range(max(2, length // 2), min(2 * length - 1, 3 * length // 2 + 1)):
            single.append((axis, MIRROR, plane, 0))
        for count in range(3, max_copies + 1):
            for step in range(2, (length - 1) // (count - 1) + 1):
                single.append((axis, PERIOD, count, step))
    none = (-1, 0, 0, 0)
    rows = [none + none, *(first + none for first in single)]
    for axis, length in enumerate(map(int, size)):
        for number in range(planes):
            plane = length + (number + 1) // 2 * (1 if number % 2 else -1)
            if plane < 2 or plane > 2 * length - 2:
                continue
            for first in single:
                same = first[1] == MIRROR and first[0] > axis and first[2] == size[first[0]]  # found the other way
                if first[0] != axis and not same:
                    rows.append((*first, axis, MIRROR, plane, 0))
    return np.array(rows, np.int64)

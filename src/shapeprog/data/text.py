"""Numbers and polygons as mesh files in text hold them."""

from __future__ import annotations

import warnings

import numpy as np

from shapeprog.errors import InputError
from shapeprog.space import Array


def numbers(name: str, text: bytes, kind: type = np.float64) -> Array:
    """The numbers of a text, parted by blanks, as an array of one axis.

    Raises
    ------
    InputError
        If anything in it is no number.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # numpy only warns when it stops at a word
        try:
            values: Array = np.fromstring(text, kind, sep=" ")
        except (DeprecationWarning, ValueError) as error:
            raise InputError(f"{name} holds a word where a number is needed", "write the file again") from error
    return values


def fans(corners: Array, widths: Array) -> Array:
    """Triangles (F, 3) of polygons that follow one another in ``corners``; ``widths`` are their numbers of corners."""
    if (widths == 3).all():
        return corners.reshape(-1, 3)
    counts = np.maximum(widths - 2, 0)  # an edge or a point has none
    polygon = np.repeat(np.arange(len(widths)), counts)
    first = (np.cumsum(widths) - widths)[polygon]
    step = np.arange(len(polygon)) - (np.cumsum(counts) - counts)[polygon]
    return corners[np.stack([first, first + step + 1, first + step + 2], axis=1)]

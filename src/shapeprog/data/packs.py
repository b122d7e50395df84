"""Packs: many shapes in one NPZ file, cells as bits and points as 16-bit numbers.

==============  ====================  ==============================================================================
array           shape                 meaning
==============  ====================  ==============================================================================
``ids``         (N,)                  names
``voxels``      (N, 4096) uint8       ``numpy.unpackbits`` gives the 32^3 cells, touched or enclosed, of the grid
``points``      (N, P, 3) uint16      ``(points / 65535 - 0.5) * longest_side``: world frame, axes up, depth, left-right
``longest_side``  (N,)                of the bounding box, in the world
``split``       (N,)                  train, val or test
==============  ====================  ==============================================================================

The last three may be missing.
"""

from __future__ import annotations

import os
import zipfile
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from shapeprog.data.arrays import members, read_head, read_numpy
from shapeprog.data.reading import POINTS, check_count, few, in_words
from shapeprog.data.shape import Shape
from shapeprog.errors import InputError
from shapeprog.files import atomic_path, check_file
from shapeprog.space import LEAST_SIDE, MOST_SIDE, RESOLUTION, SPAN, Array, Frame

_BYTES = RESOLUTION**3 // 8
_LEVELS = 65535
_ARRAYS = ("ids", "voxels", "points", "longest_side", "split")
_CURE = "make packs with 'shapeprog prepare'; the module shapeprog.data.packs documents their content"


@dataclass(frozen=True)
class Pack:
    """The shapes of a pack, unpacked on access.

    Parameters
    ----------
    source
        The file.
    ids, voxels, points, longest_side, split
        Its arrays as in the table of the module; the last three may be None.
    """

    source: Path
    ids: Array
    voxels: Array
    points: Array | None = None
    longest_side: Array | None = None
    split: Array | None = None

    def __len__(self) -> int:
        return len(self.ids)

    def __getitem__(self, index: int) -> Shape:
        if not -len(self) <= index < len(self):
            raise IndexError(
                f"{self.source.name} holds {len(self)} shapes, numbered from 0; {index} is not one of them"
            )
        name, side = str(self.ids[index]), SPAN if self.longest_side is None else float(self.longest_side[index])
        if not self.voxels[index].any():
            raise InputError(f"{self.source.name}: {name} has no occupied cell", _CURE)
        if not _usable(side):
            raise InputError(
                f"{self.source.name}: the longest side of {name} is {side:g}, not between {LEAST_SIDE:g} and "
                f"{MOST_SIDE:g}", _CURE
            )  # fmt: skip
        cells = np.unpackbits(self.voxels[index]).reshape((RESOLUTION,) * 3).astype(np.bool_)
        points = None
        if self.points is not None:
            points = ((self.points[index].astype(np.float64) / _LEVELS - 0.5) * SPAN).astype(np.float32)
        return Shape(
            name=name,
            voxels=cells,
            points=points,
            frame=Frame(scale=side / SPAN),
            source=self.source,
            kind="voxels" if points is None else "mesh",
            split="" if self.split is None else str(self.split[index]),
        )

    def __iter__(self) -> Iterator[Shape]:
        return map(self.__getitem__, range(len(self)))


def is_pack(path: Path) -> bool:
    """Whether an NPZ file is a pack, by the shape of its ``voxels``; reads only the header of that array."""
    if path.suffix.lower() != ".npz" or not zipfile.is_zipfile(path):
        return False
    with zipfile.ZipFile(path) as archive:
        if not {"ids", "voxels"} <= set(members(archive)):
            return False
        try:
            with archive.open("voxels.npy") as stream:
                shape, dtype = read_head(stream)
        except Exception:
            return True  # a damaged pack: reading it raises the error
        return len(shape) == 2 and shape[1] == _BYTES and dtype == np.uint8


def read_pack(path: str | os.PathLike[str], *, whole: bool = True) -> Pack:
    """The shapes of a pack, in the order of the file.

    Parameters
    ----------
    path
        An NPZ file with the arrays listed at the head of this module.
    whole
        Whether a single shape without cells or of no usable size is an error; otherwise it is one on access.

    Raises
    ------
    InputError
        If the file cannot be read, is no pack, or its arrays do not fit together.
    """
    source = Path(path)
    if not source.exists():
        raise InputError(f"there is no pack {source}", "check the path, or make the pack with 'shapeprog prepare'")
    check_file(source)
    if source.suffix.lower() != ".npz" and not zipfile.is_zipfile(source):
        raise InputError(f"{source.name} is no pack", _CURE)
    arrays = read_numpy(source, _ARRAYS)
    missing = {"ids", "voxels"} - set(arrays)
    if missing:
        raise InputError(f"{source.name} is no pack: it has no {' and no '.join(sorted(missing))}", _CURE)
    with in_words(source, "a pack"):
        _check(source.name, arrays)
    pack = Pack(source, *(arrays.get(name) for name in _ARRAYS))  # type: ignore[arg-type]
    if whole:
        good = pack.voxels.any(1) & (True if pack.longest_side is None else _usable(pack.longest_side))
        for index in np.flatnonzero(~good)[:1]:
            pack[int(index)]  # raises the error
    return pack


def _check(name: str, arrays: dict[str, Array]) -> None:
    """Refuse arrays that do not fit together."""
    ids, voxels = arrays["ids"], arrays["voxels"]
    if ids.ndim != 1 or ids.dtype.kind != "U":
        raise InputError(f"{name}: ids are {few([ids.dtype])} {ids.shape}, not the text of N names", _CURE)
    "".join(ids.tolist()).encode()  # names that are no text end here
    count = len(ids)
    if voxels.dtype != np.uint8 or voxels.shape != (count, _BYTES):
        raise InputError(f"{name}: voxels are {voxels.dtype} {voxels.shape}, not uint8 ({count}, {_BYTES})", _CURE)
    points = arrays.get("points")
    if points is not None and (
        points.dtype != np.uint16 or points.ndim != 3 or points.shape[::2] != (count, 3) or 0 in points.shape[1:]
    ):
        raise InputError(f"{name}: points are {points.dtype} {points.shape}, not uint16 ({count}, P, 3)", _CURE)
    if points is not None:
        check_count(name, "points a shape", points.shape[1], POINTS)
    longest = arrays.get("longest_side")
    if longest is not None and (longest.dtype.kind not in "iuf" or longest.shape != (count,)):
        raise InputError(f"{name}: longest_side is {longest.dtype} {longest.shape}, not {count} numbers", _CURE)
    splits = arrays.get("split")
    if splits is not None and (splits.shape != (count,) or splits.dtype.kind != "U"):
        raise InputError(f"{name}: split is {few([splits.dtype])} {splits.shape}, not {count} names of splits", _CURE)


def _usable(side: Array | float) -> Any:
    """Whether longest sides are within the bounds; False for NaN."""
    exact = np.asarray(side, np.float64)  # the bounds are beyond float16
    return (exact > LEAST_SIDE) & (exact < MOST_SIDE)


def write_pack(path: str | os.PathLike[str], shapes: Iterable[Shape]) -> int:
    """Write shapes as a pack, whole or not at all, and return how many there were.

    Points are kept where every shape has the same number of them, splits where a shape names one.

    Raises
    ------
    InputError
        If the shapes are not of the grid's resolution.
    OutputError
        If the file cannot be written.
    """
    listed = list(shapes)
    for shape in listed:
        if shape.voxels.shape != (RESOLUTION,) * 3:
            raise InputError(
                f"{shape.name} has {shape.voxels.shape} cells", f"a pack holds grids of {RESOLUTION}^3 cells"
            )
    cells = [np.packbits(shape.voxels) for shape in listed]
    arrays: dict[str, Array] = {
        "ids": np.array([shape.name for shape in listed], dtype=np.str_),
        "voxels": np.stack(cells) if cells else np.zeros((0, _BYTES), np.uint8),
        "longest_side": np.array([shape.frame.scale * SPAN for shape in listed], np.float64),
    }
    points = [shape.points for shape in listed if shape.points is not None]
    if listed and len(points) == len(listed) and len({p.shape for p in points}) == 1:
        levels = np.rint((np.stack(points).astype(np.float64) / SPAN + 0.5) * _LEVELS)
        arrays["points"] = np.clip(levels, 0, _LEVELS).astype(np.uint16)
    if any(shape.split for shape in listed):
        arrays["split"] = np.array([shape.split for shape in listed], dtype=np.str_)
    with atomic_path(path) as temporary, temporary.open("wb") as stream:
        np.savez_compressed(stream, **arrays)  # type: ignore[arg-type]
    return len(listed)

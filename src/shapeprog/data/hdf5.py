"""Voxel grids out of the published HDF5 files, which unpack to gigabytes: each is read when asked for."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from shapeprog.data.arrays import SHAPES_OF_ARRAYS, check_shape
from shapeprog.data.reading import BYTES, check_count, few, in_words
from shapeprog.errors import InputError
from shapeprog.files import check_file
from shapeprog.space import Array

_CHUNK = 2**28
"""Most bytes that HDF5 unpacks at once, whatever little of them is wanted."""


class Hdf5Grids:
    """The voxel grids ``data`` of an HDF5 file, (N, R, R, R) or (R, R, R), each read when asked for.

    Everything must lie in the file itself: HDF5 would else open whatever other file it names.

    Raises
    ------
    InputError
        If the file cannot be read, or holds no such grids.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        check_file(path)
        self._shape, self._rows = self._read(self._checked)
        self._first, self._block = 0, np.zeros((0,), np.uint8)

    def __len__(self) -> int:
        return int(self._shape[0]) if len(self._shape) == 4 else 1

    def __getitem__(self, number: int) -> Array:
        """The grid (R, R, R) numbered ``number``."""
        if not self._first <= number < self._first + len(self._block):
            first = number // self._rows * self._rows
            is_stack = len(self._shape) == 4
            self._block = self._read(
                lambda data: data[first : first + self._rows] if is_stack else np.asarray(data)[None]
            )
            self._first = first
        grid: Array = self._block[number - self._first]
        return grid

    def _read(self, part: Callable[[Any], Any]) -> Any:
        try:
            import h5py
        except ImportError:
            raise InputError(
                f"{self.path.name} needs the library h5py, which is not installed", "pip install h5py"
            ) from None
        with in_words(self.path, "HDF5"), h5py.File(self.path, "r") as file:
            link = file.get("data", getlink=True)
            if link is None:
                raise InputError(f"{self.path.name} holds {few(file)}", "its voxels must be named 'data'")
            if not isinstance(link, h5py.HardLink):
                raise InputError(f"{self.path.name}: 'data' is a link to elsewhere", "copy the voxels into the file")
            data = file["data"]
            if not isinstance(data, h5py.Dataset):
                raise InputError(f"{self.path.name}: 'data' is no array", SHAPES_OF_ARRAYS)
            if data.is_virtual or data.external:
                raise InputError(
                    f"{self.path.name} keeps its voxels in other files, which are not opened", "copy them into the file"
                )
            return part(data)

    def _checked(self, data: Any) -> tuple[tuple[int, ...], int]:
        """The shape of the array, and how many of its grids are unpacked together."""
        name, shape = self.path.name, data.shape
        if shape is None or len(shape) < 3:
            raise InputError(f"{name} holds an array of shape {shape or 'nothing'}", SHAPES_OF_ARRAYS)
        check_shape(name, data.dtype, shape)
        grid = math.prod(shape[-3:]) * data.dtype.itemsize
        check_count(name, "bytes in a grid", grid, BYTES)
        if data.chunks is None:
            held, needed, rows = data.id.get_storage_size(), math.prod(shape) * data.dtype.itemsize, 1
        else:
            check_count(name, "bytes in a chunk", math.prod(data.chunks) * data.dtype.itemsize, _CHUNK)
            held = data.id.get_num_chunks()
            needed = math.prod(-(-side // chunk) for side, chunk in zip(shape, data.chunks, strict=True))
            rows = data.chunks[0] if len(shape) == 4 else 1
        if held < needed:
            raise InputError(f"{name} announces voxels of shape {shape} and holds fewer", "write the file again")
        return shape, max(1, min(rows, _CHUNK // grid))

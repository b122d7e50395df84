"""Points and voxels out of array files: XYZ text, NPY, NPZ and the published HDF5.  Pickles are never opened."""

from __future__ import annotations

import warnings
import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from shapeprog.errors import InputError
from shapeprog.space import Array

_SHAPES = "give points as (P, 3), voxels as (R, R, R), or many voxel grids as (N, R, R, R)"


def read_array(path: Path) -> Array:
    """The array of an XYZ, NPY or NPZ file: points (P, 3), or voxel grids (N, R, R, R) of booleans.

    An NPZ may hold ``points`` or ``voxels`` or a single array of any name.

    Raises
    ------
    InputError
        If the file cannot be read, holds objects, or an array of another shape or with other values.
    """
    return checked(_read_text(path) if path.suffix.lower() == ".xyz" else _chosen(path), path.name)


def checked(array: Array, name: str) -> Array:
    """``array`` as points (P, 3) or as boolean voxel grids (N, R, R, R).

    Raises
    ------
    InputError
        If it is neither.
    """
    if array.dtype.kind not in "biuf":
        raise InputError(f"{name} holds {array.dtype} where numbers are needed", _SHAPES)
    if array.ndim == 2 and array.shape[1] == 3:
        return array.astype(np.float64)
    grids = array[None] if array.ndim == 3 else array
    if grids.ndim != 4 or len(set(grids.shape[1:])) != 1 or 0 in grids.shape:
        raise InputError(f"{name} holds an array of shape {array.shape}", _SHAPES)
    if grids.dtype != np.bool_:
        odd = (grids != 0) & (grids != 1)
        if odd.any():
            raise InputError(
                f"{name} holds voxels with the value {grids[odd].flat[0]}; only 0 and 1 have a meaning",
                "compare with a threshold first, as in voxels > 0.5",
            )
    return grids.astype(np.bool_)


def _read_text(path: Path) -> Array:
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # that there are no points is told below, as an error
            rows = np.loadtxt(path, dtype=np.float64, comments=("#", "//"), ndmin=2, encoding="utf-8")
    except (ValueError, UnicodeDecodeError) as error:
        raise InputError(
            f"{path.name} cannot be read as points: {' '.join(str(error).split())[:160]}",
            "write one point a line: x y z, and whatever else behind, parted by blanks",
        ) from None
    if rows.shape[0] and rows.shape[1] < 3:
        raise InputError(f"{path.name} has {rows.shape[1]} numbers a line", "write one point a line: x y z")
    return rows[:, :3] if rows.size else np.zeros((0, 3))


def read_numpy(path: Path) -> dict[str, Array]:
    """Every array of an NPY (named ``""``) or NPZ file.

    Raises
    ------
    InputError
        If the file is damaged or holds Python objects.
    """
    try:
        with path.open("rb") as stream:
            loaded = np.load(stream, allow_pickle=False)
            if isinstance(loaded, np.ndarray):
                return {"": loaded}
            with loaded:
                return {name: loaded[name] for name in loaded.files}
    except (ValueError, EOFError, OSError, KeyError, zipfile.BadZipFile, zlib.error) as error:
        if isinstance(error, OSError) and error.errno:
            raise
        text = " ".join(str(error).split())
        if "pickle" in text.lower():
            raise InputError(
                f"{path.name} holds Python objects (a pickle), which are never opened, or is damaged",
                "save plain numbers: numpy.save(path, array.astype('float32'))",
            ) from None
        raise InputError(
            f"{path.name} cannot be read as {path.suffix[1:].upper()}: {text[:160] or type(error).__name__}",
            "the file is cut short or damaged; write it again",
        ) from None


def _chosen(path: Path) -> Array:
    arrays = read_numpy(path)
    for name in ("voxels", "points"):
        if name in arrays:
            return arrays[name]
    if len(arrays) != 1:
        held = ", ".join(arrays) or "nothing"
        raise InputError(f"{path.name} holds {held}", "name the array to be read 'points' or 'voxels'")
    return next(iter(arrays.values()))


class Hdf5Grids:
    """The voxel grids of an HDF5 file, each read when asked for: the published file unpacks to gigabytes.

    Raises
    ------
    InputError
        If the file cannot be read, or holds no ``data`` of shape (N, R, R, R).
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._shape = self._read(lambda data: tuple(data.shape))
        if len(self._shape) not in (3, 4) or len(set(self._shape[-3:])) != 1 or 0 in self._shape:
            raise InputError(f"{path.name} holds an array of shape {self._shape}", _SHAPES)

    def __len__(self) -> int:
        return int(self._shape[0]) if len(self._shape) == 4 else 1

    def __getitem__(self, number: int) -> Array:
        """The grid (R, R, R) numbered ``number``."""
        array = self._read(lambda data: np.asarray(data[number] if len(self._shape) == 4 else data))
        grid: Array = checked(array, f"{self.path.name}#{number}")[0]
        return grid

    def _read(self, part: Callable[[Any], Any]) -> Any:
        try:
            import h5py
        except ImportError:
            raise InputError(
                f"{self.path.name} needs the library h5py, which is not installed", "pip install 'shapeprog[hdf5]'"
            ) from None
        try:
            with h5py.File(self.path, "r") as file:
                if not isinstance(file.get("data"), h5py.Dataset):
                    held = ", ".join(file) or "nothing"
                    raise InputError(f"{self.path.name} holds {held}", "its voxels must be named 'data'")
                return part(file["data"])
        except (OSError, KeyError, RuntimeError) as error:
            raise InputError(
                f"{self.path.name} cannot be read as HDF5: {' '.join(str(error).split())[:160]}",
                "the file is cut short or damaged; write it again",
            ) from None

"""Points and voxels out of array files: XYZ text, NPY and NPZ.  Pickles are never opened.

The header of every array is checked before memory is allocated, and only the arrays asked for are unpacked.
"""

from __future__ import annotations

import io
import math
import warnings
import zipfile
from collections.abc import Collection
from pathlib import Path
from typing import IO, Any

import numpy as np

from shapeprog.data.reading import (
    ANY_NUMBERS,
    BYTES,
    CELLS,
    POINTS,
    SHAPES,
    check_count,
    few,
    in_words,
    read_whole,
)
from shapeprog.errors import InputError
from shapeprog.files import check_file
from shapeprog.space import Array

Stream = IO[bytes] | io.BufferedIOBase
"""An open file, or a member of an archive."""

SHAPES_OF_ARRAYS = "give points as (P, 3), voxels as (R, R, R), or many voxel grids as (N, R, R, R)"

_npy: Any = np.lib.format  # older versions of numpy do not annotate it
_HEADS = {(1, 0): _npy.read_array_header_1_0, (2, 0): _npy.read_array_header_2_0}
_AGAIN = "the file is cut short or damaged; write it again"
_AT_ONCE = 1 << 22
"""Cells compared at once."""


def read_array(path: Path) -> Array:
    """The array of an XYZ, NPY or NPZ file: points (P, 3), or voxel grids (N, R, R, R) of 0 and 1.

    An NPZ may hold ``points`` or ``voxels`` or a single array of any name.

    Raises
    ------
    InputError
        If the file cannot be read, holds objects, or an array of another shape.
    """
    return checked(_read_text(path) if path.suffix.lower() == ".xyz" else _chosen(path), path.name)


@ANY_NUMBERS
def checked(array: Array, name: str) -> Array:
    """``array`` as points (P, 3) in float64, or as voxel grids (N, R, R, R) whose values are not checked yet.

    Raises
    ------
    InputError
        If it is neither.
    """
    check_shape(name, array.dtype, array.shape)
    if array.ndim == 2:
        return array.astype(np.float64)
    return array[None] if array.ndim == 3 else array


def check_shape(name: str, dtype: np.dtype[Any], shape: tuple[int, ...]) -> None:
    """Refuse other arrays than points and voxels, or too large ones, by their header alone."""
    if dtype.kind not in "biuf":
        raise InputError(f"{name} holds {few([dtype])} where numbers are needed", SHAPES_OF_ARRAYS)
    if len(shape) == 2 and shape[1] == 3:
        check_count(name, "points", shape[0], POINTS)
        return
    sides = shape[-3:]
    if len(shape) not in (3, 4) or len(set(sides)) != 1 or 0 in shape:
        raise InputError(f"{name} holds an array of shape {shape}", SHAPES_OF_ARRAYS)
    check_count(name, "cells in a grid", math.prod(sides), CELLS)
    check_count(name, "shapes", math.prod(shape[:-3]), SHAPES)


def occupied(grid: Array, name: str) -> Array:
    """The cells (R, R, R) of a voxel grid as booleans, without a copy where each is a byte already.

    Raises
    ------
    InputError
        If it holds anything but 0 and 1.
    """
    bits = grid.view(np.uint8) if grid.dtype == np.bool_ else grid  # a damaged file may hold other bytes
    step = max(1, _AT_ONCE // max(1, math.prod(grid.shape[1:])))
    for start in range(0, len(bits), step):
        some = bits[start : start + step]
        odd = (some != 0) & (some != 1)
        if odd.any():
            raise InputError(
                f"{name} holds voxels with the value {some[odd].flat[0]}; only 0 and 1 have a meaning",
                "compare with a threshold first, as in voxels > 0.5",
            )
    return bits.view(np.bool_) if bits.dtype.itemsize == 1 else bits.astype(np.bool_)


def _read_text(path: Path) -> Array:
    content = read_whole(path)
    check_count(path.name, "lines", content.count(b"\n"), POINTS)
    text = content.decode("utf-8-sig", "replace")  # comments may be in any encoding
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # an empty file is an error later
        try:
            rows = np.loadtxt(io.StringIO(text), np.float64, comments=("#", "//"), ndmin=2, usecols=(0, 1, 2))
        except ValueError as error:
            raise InputError(
                f"{path.name} cannot be read as points: {_bad_line(text)}",
                "write one point a line: x y z, and whatever else behind, parted by blanks",
            ) from error
    return rows.reshape(-1, 3)


def _bad_line(text: str) -> str:
    for number, line in enumerate(text.splitlines(), 1):
        words = line.partition("#")[0].partition("//")[0].split()
        try:
            count = len([float(word) for word in words[:3]])
        except ValueError:
            return f"line {number} holds a word where a number is needed"
        if 0 < count < 3:
            return f"line {number} has {count} numbers, not three"
    return "its lines hold no numbers"


def read_numpy(path: Path, names: Collection[str]) -> dict[str, Array]:
    """The array of an NPY file (named ``""``), or those of an NPZ file that are in ``names``.

    Raises
    ------
    InputError
        If the file is damaged, or one of the arrays holds Python objects or is too large.
    """
    check_file(path)
    with in_words(path), path.open("rb") as stream:
        if not zipfile.is_zipfile(stream):
            stream.seek(0)
            return {"": _read_npy(stream, path.name, path.stat().st_size)}
        with zipfile.ZipFile(stream) as archive:
            arrays = {name: _member(archive, name, path.name) for name in members(archive) if name in names}
    return arrays


def members(archive: zipfile.ZipFile) -> list[str]:
    """The arrays of an NPZ file."""
    return [name.removesuffix(".npy") for name in archive.namelist()]


def _member(archive: zipfile.ZipFile, name: str, file: str) -> Array:
    member = f"{name}.npy" if f"{name}.npy" in archive.NameToInfo else name
    entry = archive.getinfo(member)
    if entry.flag_bits & 1:
        raise InputError(f"{file}: {name} is encrypted", "save it without a password")
    with archive.open(entry) as stream:
        return _read_npy(stream, f"{file}: {name}", entry.file_size)


def read_head(stream: Stream) -> tuple[tuple[int, ...], np.dtype[Any]]:
    """The shape and the type that an NPY stream announces.

    Raises
    ------
    ValueError
        If it is no NPY stream, or of a version that holds no plain numbers.
    """
    version = _npy.read_magic(stream)
    if version not in _HEADS:
        raise ValueError(f"NPY {version} is not read")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # about heads that an old Python wrote
        shape, _, dtype = _HEADS[version](stream)
    return shape, dtype


def _read_npy(stream: Stream, name: str, size: int) -> Array:
    """The array of a stream of ``size`` bytes."""
    shape, dtype = read_head(stream)
    if dtype.hasobject:
        raise InputError(
            f"{name} holds Python objects (a pickle), which are never opened",
            "save plain numbers: numpy.save(path, array.astype('float32'))",
        )
    announced = math.prod(shape) * dtype.itemsize
    if min(shape, default=0) < 0 or announced > size - stream.tell():
        raise InputError(f"{name} announces an array of shape {shape} and holds less", _AGAIN)
    check_count(name, "bytes", announced, BYTES)
    stream.seek(0)
    array: Array = _npy.read_array(stream, allow_pickle=False)
    return array


def _chosen(path: Path) -> Array:
    check_file(path)
    with in_words(path):
        if not zipfile.is_zipfile(path):
            return read_numpy(path, ())[""]
        with zipfile.ZipFile(path) as archive:
            held = members(archive)
    name = next((name for name in ("voxels", "points") if name in held), held[0] if len(held) == 1 else None)
    if name is None:
        raise InputError(f"{path.name} holds {few(held)}", "name the array to be read 'points' or 'voxels'")
    return read_numpy(path, (name,))[name]

"""Shapes of arrays in memory: checked, turned and placed as those of files are."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from shapeprog.arguments import MOST_SEED, check_number
from shapeprog.data import placement
from shapeprog.data.arrays import checked, occupied
from shapeprog.data.loading import placed
from shapeprog.data.meshes import check_faces
from shapeprog.data.reading import ANY_NUMBERS
from shapeprog.data.shape import Shape
from shapeprog.errors import InputError
from shapeprog.language.unit import metres
from shapeprog.space import Array


def shape_from_mesh(
    vertices: npt.ArrayLike, faces: npt.ArrayLike, *, up: str | None = None, front: str | None = None,
    name: str = "mesh", points: int = 5000, seed: int = 0, unit: str = "",
) -> Shape:  # fmt: skip
    """The shape of a triangle mesh.

    Parameters
    ----------
    vertices, faces
        Corners (V, 3), and triangles (F, 3) as indices of them.
    up, front
        Axes of the vertices such as ``+y`` and ``-z``; by default +y and +z.  ``auto`` up is estimated.
    name
        Name of the shape.
    points, seed
        How many points to draw from the surface, and the seed.
    unit
        Unit of the vertices, such as ``mm``, where it is known.

    Raises
    ------
    InputError
        If an array has another shape or type, a number that is not finite, or a face without its vertices; or if the
        mesh has no area.
    ShapeProgError
        If there is no such unit, or ``points`` or ``seed`` is out of range.
    """
    corners, triangles = _numbers("vertices", vertices, 2), _array("faces", faces)
    if triangles.ndim != 2 or triangles.shape[1] != 3 or not len(triangles) or triangles.dtype.kind not in "iu":
        cure = "give whole numbers (F, 3); a cloud is read by sp.shape_from_points, and polygons need to be triangles"
        raise InputError(f"faces is an array of {triangles.dtype} of shape {triangles.shape}", cure)
    triangles = triangles.astype(np.int64)
    check_faces(name, triangles, len(corners), "indices count from 0")
    make = partial(placement.shape_from_mesh, corners, triangles, points=points, seed=seed)
    return _made(make, name, up, front, points, seed, unit)


def shape_from_points(
    cloud: npt.ArrayLike, *, up: str | None = None, front: str | None = None, name: str = "points",
    points: int = 5000, seed: int = 0, unit: str = "",
) -> Shape:  # fmt: skip
    """The shape of a cloud of at least 100 points (P, 3) of a surface; inference estimates its normals.

    At most ``points`` are kept, besides the 20,000 that inference uses.  All else is as for
    :func:`shapeprog.shape_from_mesh`.
    """
    make = partial(placement.shape_from_points, _numbers("cloud", cloud, 2), points=points, seed=seed)
    return _made(make, name, up, front, points, seed, unit)


def shape_from_voxels(
    voxels: npt.ArrayLike, *, up: str | None = None, front: str | None = None, name: str = "voxels", unit: str = "",
    pitch: float = 1.0, origin: npt.ArrayLike = (0.0, 0.0, 0.0),
) -> Shape:  # fmt: skip
    """The shape of a voxel grid (R, R, R) of booleans, or of 0 and 1.

    Cells have the side ``pitch``, in ``unit`` where that is named, and the lowest corner of the first is at ``origin``:
    so exports have the right size, and programs in a unit.

    Other grids than 32 x 32 x 32 are resampled to that, where a part may be up to a cell of it thinner or thicker; a
    mesh, as marching cubes make one, keeps fine grids exact.

    By default the axes of the array are those of the grid: up, to the rear, left.  All else is as for
    :func:`shapeprog.shape_from_mesh`.
    """
    cells = occupied(_numbers("voxels", voxels, 3), "voxels").copy()  # the shape keeps them
    check_number("pitch", pitch, 0, above=True)
    corner = _array("origin", origin)
    if corner.shape != (3,) or corner.dtype.kind not in "iuf" or not np.isfinite(corner).all():
        raise InputError(f"origin is {origin!r}", "give three finite numbers")
    make = partial(placement.shape_from_voxels, cells, corner=corner, cell=float(pitch))
    return _made(make, name, up, front, 1, 0, unit, cloud=False)


def _made(
    make: Callable[..., Shape], name: str, up: str | None, front: str | None, points: int, seed: int, unit: str,
    cloud: bool = True,
) -> Shape:  # fmt: skip
    """The shape in its axes, which by default are those of an array in a file, and of a mesh those of a cloud."""
    check_number("points", points, 1, whole=True)
    check_number("seed", seed, 0, MOST_SEED, whole=True)
    if unit:
        metres(unit)
    return replace(placed(Path(f"{name}.npy"), up, front, partial(make, name=name), cloud), unit=unit)


def _array(name: str, value: Any) -> Array:
    try:
        return np.asarray(value)
    except Exception as error:  # ragged lists, tensors with gradients or on a GPU
        raise InputError(f"{name} is no array: {error}", "give an array of NumPy") from error


@ANY_NUMBERS
def _numbers(name: str, value: Any, dimensions: int) -> Array:
    """Points (P, 3) in float64, or a grid (R, R, R)."""
    array = _array(name, value)
    if array.ndim != dimensions:
        cure = f"give the shape {'(P, 3)' if dimensions == 2 else '(R, R, R)'}"
        cure = cure if array.ndim else "give an array; sp.load_shape reads files, and meshes have .vertices and .faces"
        raise InputError(f"{name} is {f'an array of shape {array.shape}' if array.ndim else repr(value)}", cure)
    numbers = checked(array, name)
    return numbers if dimensions == 2 else numbers[0]

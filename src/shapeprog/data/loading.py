"""Any file with a shape in it, into the grid: meshes, point clouds and voxels, one or many."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from shapeprog.arguments import MOST_SEED, check_number
from shapeprog.data.folders import Skipped, files_below
from shapeprog.data.meshes import COMMON, mesh_formats, read_mesh
from shapeprog.data.orientation import AUTO, axes_of, default_axes, in_shapenet_layout
from shapeprog.data.placement import shape_from_mesh, shape_from_points, shape_from_voxels
from shapeprog.data.reading import BYTES, POINTS, check_count, in_words
from shapeprog.data.shape import Shape
from shapeprog.data.uprightness import find_up
from shapeprog.errors import InputError, ShapeProgError
from shapeprog.files import check_file
from shapeprog.formats.format import suffixes
from shapeprog.formats.shape import read_text
from shapeprog.language.unit import metres
from shapeprog.space import Frame, axis_name

ARRAY_SUFFIXES = frozenset({".xyz", ".npy", ".npz", ".h5", ".hdf5"})
"""Suffixes of files that hold arrays of points or voxels."""


def load(
    path: str | os.PathLike[str],
    *,
    up: str | None = None,
    front: str | None = None,
    points: int = 5000,
    seed: int = 0,
    unit: str = "",
) -> Shape:
    """The shape in a file, centred in the grid with its longest side 24 cells, and the way back.

    Parameters
    ----------
    path
        A mesh (OBJ, OFF, PLY, STL, GLB, GLTF and what trimesh reads besides), a point cloud (PLY, XYZ, NPY or NPZ
        (P, 3)), or voxels (binvox, NPY or NPZ (R, R, R), HDF5, packs).  ``file.npz#12`` is the shape numbered 12, from
        0, of a file that holds many; ``file.npz#name`` the one of that name.
    up, front
        World axes such as ``+y`` and ``-z``; by default those of the format (:mod:`shapeprog.data.orientation`).  With
        ``auto`` up is estimated from the shape (:mod:`shapeprog.data.uprightness`); ``Shape.note`` names it.
    points
        How many points to draw from a mesh, or to keep of a cloud, at most.
    seed
        Seed of that choice.
    unit
        Unit of the coordinates of the file, such as ``mm``, where it is known.

    Raises
    ------
    InputError
        If there is no such file, or it cannot be read as a shape.
    ShapeProgError
        If there is no such unit, or ``points`` or ``seed`` is out of range.
    """
    if unit:
        metres(unit)
    check_number("points", points, 1, whole=True)
    check_number("seed", seed, 0, MOST_SEED, whole=True)
    file, index = _split_index(path)
    held = _open(file, up, front, points, seed)
    if index is None and len(held) != 1:
        cure = f"choose one, as in {file.name}#0, or read them all with sp.load_all"
        raise InputError(f"{file.name} holds {len(held)} shapes", cure)
    number = 0 if index is None else _number(file, index, held)
    return replace(held[number], unit=unit)


load_shape = load  # its name in ``shapeprog``, whose ``load`` reads programs


def loaded(shape: Shape | str | os.PathLike[str]) -> Shape:
    """A shape as it is, or the one in a file."""
    return shape if isinstance(shape, Shape) else load(shape)


def load_in_axes(path: str | os.PathLike[str], frame: Frame | None, *, points: int = 5000, seed: int = 0) -> Shape:
    """The shape in a file in the axes of a frame, such as that of a program inferred from it with ``up`` or ``front``.

    It is in its own axes without a frame, or if the frame is slanted, which turns no cells.
    """
    axes = np.eye(3) if frame is None else np.asarray(frame.axes)
    up, front = axis_name(axes[:, 0]), axis_name(-axes[:, 1])
    if frame is None or up[1] == front[1]:
        return load(path, points=points, seed=seed)
    return load(path, up=up, front=front, points=points, seed=seed)


def path_of(shape: Shape) -> str | None:
    """The file of a shape, and in a file of many the name of the shape, as :func:`load` finds it again."""
    if shape.source is None:
        return None
    path = str(shape.source.absolute())
    if shape.source.suffix.lower() not in ARRAY_SUFFIXES or shape.name == shape.source.stem:
        return path
    return f"{path}#{shape.name.removeprefix(f'{shape.source.stem}#')}"


def load_all(
    paths: str | os.PathLike[str] | Iterable[str | os.PathLike[str]],
    *,
    up: str | None = None,
    front: str | None = None,
    points: int = 5000,
    seed: int = 0,
) -> Iterator[tuple[Path, Shape | ShapeProgError]]:
    """Every shape of files, of folders with all within, and of files with many; a broken one as its error.

    The order is that of ``paths``, and within a folder that of the names.  A broken file never stops the others.
    Results of ``infer`` in a folder are left out: NAME.glb beside NAME.json and NAME.shape.

    Parameters
    ----------
    paths
        Files, folders, or ``file.npz#12``.
    up, front, points, seed
        As for :func:`load`.
    """
    for path in [paths] if isinstance(paths, str | os.PathLike) else paths:
        try:
            file, index = _split_index(path)
            files, skipped = _files_in(file) if os.path.isdir(file) else ([file], [])
        except ShapeProgError as error:
            yield Path(path), error
            continue
        for file_path in files:
            try:
                held = _open(file_path, up, front, points, seed)
                numbers = range(len(held)) if index is None else [_number(file_path, index, held)]
            except ShapeProgError as error:
                yield file_path, error
                continue
            for number in numbers:
                shape: Shape | ShapeProgError
                try:
                    shape = held[number]
                except ShapeProgError as error:
                    shape = error
                yield (file_path if len(held) == 1 else Path(f"{file_path}#{number}")), shape
        yield from skipped


def readable_suffixes() -> set[str]:
    """Every suffix, with its dot and in lower case, that :func:`load` understands."""
    return {f".{name}" for name in mesh_formats()} | ARRAY_SUFFIXES | {".binvox"}


class _Held:
    """The shapes of one file, made on access; all errors of readers become messages."""

    def __init__(self, path: Path, names: list[str], make: Callable[[int], Shape]) -> None:
        self.path, self.names, self._make = path, names, make

    def __len__(self) -> int:
        return len(self.names)

    def __getitem__(self, number: int) -> Shape:
        with in_words(self.path):
            return self._make(number)


def _open(path: Path, up: str | None, front: str | None, points: int, seed: int) -> _Held:
    suffix = path.suffix.lower()
    with in_words(path):
        check_file(path)
        if suffix.removeprefix(".") not in COMMON and suffix not in readable_suffixes():
            cures = dict.fromkeys(suffixes("program"), PROGRAM) | {".3mf": "pip install lxml networkx"}
            ending = f"that end in {suffix!r}" if suffix else "without a suffix"
            cure = cures.get(suffix, f"known: {', '.join(sorted(readable_suffixes()))}")
            raise InputError(f"{path.name}: no shapes are read from files {ending}", cure)
        axes_of(path, up, front)  # wrong axes are reported before the file is read
        make_shape, name = partial(placed, path, up, front), _name(path)
        if suffix in ARRAY_SUFFIXES:
            return _open_array(path, name, make_shape, points, seed)
        if suffix == ".binvox":
            from shapeprog.data.binvox import read_binvox

            check_count(path.name, "bytes", path.stat().st_size, BYTES)
            cells, corner, cell = read_binvox(path)
            shape = make_shape(partial(shape_from_voxels, cells, name=name, corner=corner, cell=cell, source=path))
        else:
            vertices, faces = read_mesh(path)
            if not len(faces):
                check_count(path.name, "points", len(vertices), POINTS)
            make = partial(shape_from_mesh, faces=faces) if len(faces) else shape_from_points
            shape = make_shape(partial(make, vertices, name=name, points=points, seed=seed, source=path))
    return _Held(path, [name], lambda _: shape)


PROGRAM = "this is a program already: 'shapeprog render' draws it, 'shapeprog export' writes a mesh of it"

CERTAIN = 0.7
"""Probability of an estimated up axis from which it needs no check."""

Place = Callable[..., Shape]
"""Makes a shape with the requested axes from a function of ``axes``; ``cloud=True`` for points in an array."""


def placed(path: Path, up: str | None, front: str | None, make: Callable[..., Shape], cloud: bool = False) -> Shape:
    """The shape that a function of ``axes`` makes, in the requested axes, or those of the path; with a note if up is
    estimated."""
    if str(up) != AUTO:
        return make(axes=axes_of(path, up, front, cloud))
    default_shape = make(axes=axes_of(path, None, front, cloud))
    estimate = find_up(
        default_shape.voxels, np.array(default_shape.frame.axes), usual=default_axes(path, cloud)[0], front=front
    )
    doubt = ": check it in a picture, or give --up" if estimate.probability < CERTAIN else ""
    note = f"Estimated up axis of the file: {estimate.up} (probability {estimate.probability:.0%}){doubt}."
    shape = make(axes=axes_of(path, estimate.up, front, cloud))
    return replace(shape, note=f"{note} {shape.note}".rstrip())


def _open_array(path: Path, name: str, make_shape: Place, points: int, seed: int) -> _Held:
    from shapeprog.data.arrays import occupied, read_array
    from shapeprog.data.hdf5 import Hdf5Grids
    from shapeprog.data.packs import is_pack, read_pack

    if is_pack(path):
        pack = read_pack(path, whole=False)
        return _Held(path, pack.ids.tolist(), pack.__getitem__)
    array = Hdf5Grids(path) if path.suffix.lower() in (".h5", ".hdf5") else read_array(path)
    if not isinstance(array, Hdf5Grids) and array.ndim == 2:
        make_cloud = partial(shape_from_points, array, name=name, points=points, seed=seed, source=path)
        cloud = make_shape(make_cloud, cloud=True)
        return _Held(path, [name], lambda _: cloud)
    names = [name] if len(array) == 1 else [f"{name}#{number}" for number in range(len(array))]

    def make(number: int) -> Shape:
        cells = occupied(array[number], names[number])
        return make_shape(partial(shape_from_voxels, cells, name=names[number], source=path))

    return _Held(path, names, make)


def _split_index(path: str | os.PathLike[str]) -> tuple[Path, str | None]:
    if not isinstance(path, str | os.PathLike):
        cure = "arrays become shapes by sp.shape_from_mesh, sp.shape_from_points or sp.shape_from_voxels"
        raise InputError(f"{type(path).__name__} is neither a shape nor the path of one", cure)
    whole_path = Path(path)
    text = os.fspath(path)
    if os.path.exists(whole_path) or "#" not in text:
        return whole_path, None
    file, _, index = text.rpartition("#")
    return Path(file), index


def _number(path: Path, index: str, held: _Held) -> int:
    if index.isdigit() and int(index) < len(held):
        return int(index)
    if index in held.names:
        return held.names.index(index)
    raise InputError(
        f"{path.name} has no shape {index!r}",
        f"it holds {len(held)}, numbered from 0 to {len(held) - 1}, or use a name",
    )


def _files_in(folder: Path) -> tuple[list[Path], Skipped]:
    """The files to read in a folder and below, and the folders that cannot be read."""
    skipped: Skipped = []
    files = files_below(folder, readable_suffixes(), skipped)
    # ShapeNet has voxels and mesh of an object in one folder: one shape, read from the mesh.
    meshes = {path.parent for path in files if path.suffix.lower() != ".binvox" and in_shapenet_layout(path)}
    files = [path for path in files if not (path.suffix.lower() == ".binvox" and path.parent in meshes)]
    inputs = [path for path in files if not _is_result(path)]
    if not inputs and not skipped:
        content = "results of infer alone, which are no inputs" if files else "no file that can be read as a shape"
        raise InputError(f"the folder {folder} holds {content}", "name another folder, or the file itself")
    return inputs, skipped


def _is_result(path: Path) -> bool:
    """Whether a mesh was written by ``shapeprog infer`` from another file, with the program beside it."""
    if path.suffix != ".glb" or not path.with_suffix(".shape").exists():
        return False
    try:
        return path.resolve() != Path(json.loads(read_text(path.with_suffix(".json")))["source"]).resolve()
    except Exception:  # no file, or somebody else's
        return False


def _name(path: Path) -> str:
    return path.absolute().parts[-3] if in_shapenet_layout(path) else path.stem

"""Packs with splits from a directory of models: ShapeNetCore v2 as distributed, or plain folders by category."""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import groupby
from pathlib import Path

import numpy as np

from shapeprog.data.folders import Skipped, entries, files_below, is_folder
from shapeprog.data.loading import load, readable_suffixes
from shapeprog.data.packs import write_pack
from shapeprog.data.shape import Shape
from shapeprog.errors import InputError, ShapeProgError
from shapeprog.files import make_folder
from shapeprog.space import SPAN, Frame

SPLITS = ("train", "val", "test")
"""Names of the splits, in the order of their shares."""
PACKS = tuple(f"_{split}.npz" for split in SPLITS)  # ends of the names of packs, which are no models

SYNSETS = {
    "02801938": "basket",
    "02818832": "bed",
    "02828884": "bench",
    "02871439": "bookshelf",
    "02933112": "cabinet",
    "03001627": "chair",
    "03211117": "display",
    "03636649": "lamp",
    "04256520": "sofa",
    "04379243": "table",
}
"""Plain names of the ShapeNet synsets that hold furniture; the others keep their number."""


@dataclass(frozen=True)
class Prepared:
    """The result of :func:`prepare` for one model, or for the whole directory.

    Parameters
    ----------
    done, total
        How many models have been read, of how many.
    path
        The model just read; in the last record the output folder.
    error
        Why it could not be read, if it could not.
    packs
        In the last record the packs written, with their number of shapes.
    failures
        In the last record every model or folder that could not be read, with its error.
    """

    done: int
    total: int
    path: Path
    error: ShapeProgError | None = None
    packs: tuple[tuple[Path, int], ...] = ()
    failures: tuple[tuple[Path, ShapeProgError], ...] = ()


def prepare(
    directory: str | os.PathLike[str],
    output: str | os.PathLike[str],
    *,
    shares: tuple[float, float, float] = (0.7, 0.1, 0.2),
    points: int = 5000,
    seed: int = 0,
    up: str | None = None,
    front: str | None = None,
) -> Iterator[Prepared]:
    """Read every model of ``directory`` and write packs ``{category}_{split}.npz``; yields one record per model.

    The directory holds a folder per category, or models of one category, which is named after it.  In the layout of
    ShapeNetCore v2 (``<synset>/<id>/models/...``) a model is an id; elsewhere it is a path without suffix in the
    category's folder.  Of several files of a model a mesh is read before voxels.  The split of a shape follows from its
    cells alone, so equal shapes never straddle a split, in whatever order, together or apart they are read.  Worlds
    are scaled to a bounding box of diagonal 1, centred, with axes up, depth, left-right.  A broken model, or a
    pack without points because some of its models are voxels, is a failure that stops nothing.  Files named as packs
    are no models.  The last record holds the packs and the failures.

    Parameters
    ----------
    directory
        Where the models are.
    output
        Folder for the packs; made if missing.
    shares
        Parts of the shapes that go to train, val and test.
    points, seed, up, front
        As for :func:`shapeprog.data.load`.

    Raises
    ------
    InputError
        If the directory holds no models.
    OutputError
        If the packs cannot be written.
    """
    if len(shares) != 3 or min(shares) < 0 or not abs(sum(shares) - 1) < 1e-6:
        raise InputError(f"shares {shares} are not three parts of a whole", "give three numbers that sum to 1")
    failures: Skipped = []
    models = find_models(Path(directory), failures)
    folder = make_folder(output)
    packs: list[tuple[Path, int]] = []
    done = 0
    # A category is written as soon as it is read: this limits memory, and a stop loses one category at most.
    for category, branch in groupby(models, key=lambda model: model[0]):
        groups: dict[str, list[Shape]] = {}
        for _, name, path in branch:
            done += 1
            problem: ShapeProgError | None = None
            try:
                shape = load(path, up=up, front=front, points=points, seed=seed)
            except ShapeProgError as error:
                problem = error
                failures.append((path, error))
            else:
                split = split_of(shape, shares)
                record = Shape(name, shape.voxels, shape.points, _unit_frame(shape), split=split)
                groups.setdefault(split, []).append(record)
            yield Prepared(done, len(models), path, problem)
        for split in SPLITS:
            target, shapes = folder / f"{category}_{split}.npz", groups.get(split, [])
            if shapes or target.exists():  # an old pack would let duplicates straddle
                packs.append((target, write_pack(target, sorted(shapes, key=lambda shape: shape.name))))
            voxels = [shape.name for shape in shapes if shape.points is None]
            if 0 < len(voxels) < len(shapes):
                message = (
                    f"{target.name} has no points: {len(voxels)} of its {len(shapes)} models are voxels, as {voxels[0]}"
                )
                failures.append((target, ShapeProgError(message, "prepare voxels in another category than meshes")))
    yield Prepared(done, len(models), folder, packs=tuple(packs), failures=tuple(failures))


def find_models(directory: Path, skipped: Skipped) -> list[tuple[str, str, Path]]:
    """Every model of a directory as (category, name, file), in the order of the names.

    Folders that may not be read are left out and added to ``skipped``.

    Raises
    ------
    InputError
        If there is no such directory, or it holds no models.
    """
    if not directory.is_dir():
        raise InputError(f"there is no folder {directory}", "give the folder of the models")
    suffixes, models = readable_suffixes(), dict[tuple[str, str], Path]()
    folders = [path for path in entries(directory, skipped) if is_folder(path, skipped)]
    for branch in [*folders, directory.resolve()]:
        if models and branch not in folders:
            files = [path for path in entries(branch, skipped) if path.suffix.lower() in suffixes and path.is_file()]
            error = InputError("it lies in no folder of a category, as other models do", "move it into one")
            skipped += [(path, error) for path in files if not path.name.endswith(PACKS)]
            break
        category = SYNSETS.get(branch.name, re.sub(r"[^\w-]+", "_", branch.name))
        closed: Skipped = []
        layout = [path for path in entries(branch, skipped) if is_folder(path / "models", closed)]
        for model_folder in layout:
            files = [path for path in entries(model_folder / "models", skipped) if path.suffix.lower() in suffixes]
            if files:
                models[category, model_folder.name] = min(files, key=_preference)
        if layout:
            skipped += closed
        else:
            for path in (file for file in files_below(branch, suffixes, skipped) if not file.name.endswith(PACKS)):
                model = category, path.relative_to(branch).with_suffix("").as_posix()
                models[model] = min(path, models.get(model, path), key=_preference)
    if not models:
        if skipped:
            raise skipped[0][1]
        raise InputError(
            f"the folder {directory} holds no models",
            "it needs meshes or voxels, in a folder per category or as <synset>/<id>/models",
        )
    return [(*model, path) for model, path in sorted(models.items())]


def split_of(shape: Shape, shares: tuple[float, float, float] = (0.7, 0.1, 0.2)) -> str:
    """train, val or test, drawn from the cells of a shape alone: equal cells, equal split."""
    digest = hashlib.sha256(np.packbits(shape.voxels).tobytes()).digest()
    number = int.from_bytes(digest[:8], "big") / 2**64
    return SPLITS[0] if number < shares[0] else SPLITS[1] if number < shares[0] + shares[1] else SPLITS[2]


def _preference(path: Path) -> tuple[bool, bool, str]:
    """A mesh before voxels, and the normalised model before others."""
    return path.suffix.lower() == ".binvox", not path.stem.startswith("model_normalized"), path.name


def _unit_frame(shape: Shape) -> Frame:
    """The frame of a world in which the bounding box of the shape has diagonal 1 and is centred."""
    extents = shape.extents
    longest = SPAN / float(np.linalg.norm(extents * (SPAN / extents.max())))
    return replace(Frame(), scale=longest / SPAN)

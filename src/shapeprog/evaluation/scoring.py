"""Predictions of any kind against targets of any kind: programs by themselves, everything else as a shape."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import torch

from shapeprog.arguments import MOST_SEED, check_number
from shapeprog.data import load_all
from shapeprog.data.loading import load_in_axes, path_of
from shapeprog.data.parts import read_parts
from shapeprog.data.placement import some
from shapeprog.data.reading import in_words
from shapeprog.data.sampling import sample_surface
from shapeprog.data.shape import Shape
from shapeprog.errors import InputError, ShapeProgError
from shapeprog.evaluation.likeness import Triangles
from shapeprog.evaluation.metrics import POINTS, Metrics, distances, evaluate_program, with_likeness
from shapeprog.evaluation.parts import part_scores
from shapeprog.formats.files import load, program_files
from shapeprog.formats.format import suffixes
from shapeprog.formats.frames import in_grid_of
from shapeprog.formats.json_form import SavedResult, read_result
from shapeprog.geometry.voxelise import voxelise_mesh, voxelise_points
from shapeprog.language.program import Program, program_of
from shapeprog.language.unroll import unroll
from shapeprog.space import Array, Frame

if TYPE_CHECKING:
    from shapeprog.inference.infer import Result

Prediction = SavedResult | Shape
"""The contents of a program file, or a shape."""


def evaluate(
    prediction: Program | Result | str | Path, target: Shape | str | Path, frame: Frame | None = None, *,
    points: int = POINTS, seed: int = 0,
) -> Metrics:  # fmt: skip
    """Measure how well a program rebuilds a shape, as the command ``shapeprog evaluate`` does.

    Parameters
    ----------
    prediction
        A program, the path of its file, or the result of :func:`shapeprog.infer`.
    target
        The shape that it should be, or its path.  A file is read in the axes of ``frame``.  Of a cloud ``2 * points``
        points are measured: of a file as by the command, of a loaded shape from the up to 20,000 that it keeps.
    frame
        Where the program lies; by default its own frame, which programs of inference and of files have.  Without any,
        or if its statements are in cells, it is in the grid of the target, as with ``target.frame``.
    points
        Points on each surface for CD and F1 at one cell.
    seed
        Seed of all samplings; the same seed gives the same figures.

    Raises
    ------
    InputError
        If a path is no readable file, or a shape without a file has other axes than the frame.
    ShapeProgError
        If another argument is of the wrong kind or out of range.
    """
    check_number("points", points, 2, whole=True)
    check_number("seed", seed, 0, MOST_SEED, whole=True)
    is_path = isinstance(prediction, str | os.PathLike) and "\n" not in str(prediction)  # else it is a text
    given: Any = _read(Path(prediction)) if is_path else prediction  # type: ignore[arg-type]
    program = program_of(given, frame)
    frame = program.frame
    shape = target if isinstance(target, Shape) else load_in_axes(target, frame, points=2 * points, seed=seed)
    shape = in_pose_of(program, shape, points, seed)
    if shape is target and shape.scan is not None:
        shape = replace(shape, points=some(shape.scan, 2 * points, seed))
    if frame is not None and not np.allclose(frame.axes, shape.frame.axes, atol=1e-6):
        raise InputError(
            "the program has other axes than the target",
            "load the target with the axes of the frame: up and front of sp.load_shape; or give its frame",
        )
    return measure(SavedResult(program, getattr(given, "snapped", None)), shape, points, seed)


def predictions(path: Path, points: int, seed: int) -> Iterator[tuple[Path, str, Prediction | ShapeProgError]]:
    """Files, names and predictions of a file, a pack or a folder; a folder that holds programs is read for those.

    Of a cloud as many ``points`` are kept as are drawn on other surfaces.
    """
    files = [path] if path.suffix.lower() in suffixes("program") else []
    if path.is_dir():
        with suppress(InputError):  # a folder of shapes
            files = program_files(path)
    for file in files:
        try:
            yield file, file.stem, _read(file)
        except ShapeProgError as error:
            yield file, file.stem, error
    if not files:
        for file, shape in load_all([path], points=points, seed=seed):
            yield file, (file.stem if isinstance(shape, ShapeProgError) else shape.name), shape


def _read(file: Path) -> SavedResult:
    """The contents of a program file."""
    with in_words(file, "a program"):
        return read_result(file) if file.suffix.lower() == ".json" else SavedResult(load(file))


def read_targets(
    paths: list[Path], up: str | None, front: str | None, points: int, seed: int
) -> tuple[dict[str, Shape], list[ShapeProgError]]:
    """The target shapes by name, and what cannot be read or has the name of another."""
    shapes: dict[str, Shape] = {}
    failures = []
    for path, shape in load_all(paths, up=up, front=front, points=2 * points, seed=seed):
        if isinstance(shape, ShapeProgError):
            failures.append(ShapeProgError(f"target {path}: {shape.message}", shape.hint))
        elif shape.name in shapes:
            sources = " and ".join(str(source) for source in (shapes[shape.name].source, shape.source) if source)
            cure = "rename one of them; until then the first is used"
            failures.append(ShapeProgError(f"duplicate target name {shape.name}: {sources or path}", cure))
        else:
            shapes[shape.name] = shape
    return shapes, failures


def in_pose_of(program: Program, target: Shape, points: int, seed: int) -> Shape:
    """The target, loaded again in the axes of the frame of a predicted program."""
    frame, path = program.frame, path_of(target)
    if frame is None or path is None or np.allclose(frame.axes, target.frame.axes, atol=1e-6):
        return target
    return load_in_axes(path, frame, points=2 * points, seed=seed)


def measure(prediction: Prediction | ShapeProgError, target: Shape | None, points: int, seed: int) -> Metrics:
    """The measures of one prediction; sizes are 0 for shapes.  Raises the error that stands for a prediction."""
    if isinstance(prediction, ShapeProgError):
        raise prediction
    if target is None:
        raise InputError("there is no target of this name", "give both the same name")
    if isinstance(prediction, Shape):
        return _measure_shape(prediction, target, points, seed)
    program = in_grid_of(prediction.program, target.frame)
    return evaluate_program(program, target, prediction.snapped, points, seed, looks=True)


def with_parts(row: Metrics, program: Program, target: Shape, files: list[Path], seed: int) -> Metrics:
    """The measures with recall and precision of the physical parts in ``files``, see :func:`read_parts`."""
    parts = [Triangles(target.frame.to_grid(vertices), faces) for vertices, faces in read_parts(files)]
    return replace(row, **part_scores(parts, unroll(in_grid_of(program, target.frame)), seed)._asdict())


def _measure_shape(prediction: Shape, target: Shape, points: int, seed: int) -> Metrics:
    """A predicted mesh or cloud is in the coordinates of the target; cells are in the grid."""
    cells, mesh = prediction.voxels, None
    sampled: Array | None = prediction.points
    if prediction.vertices is not None and prediction.faces is not None:
        mesh = Triangles(
            target.frame.to_grid(prediction.frame.to_world(prediction.vertices)), np.asarray(prediction.faces)
        )
        cells, sampled = voxelise_mesh(*mesh), sample_surface(*mesh, points, seed)
    elif prediction.kind == "points" and sampled is not None:
        sampled = target.frame.to_grid(prediction.frame.to_world(sampled))
        cells = voxelise_points(sampled)
    union = int((cells | target.voxels).sum())
    iou = float((cells & target.voxels).sum() / union) if union else 1.0
    forward = backward = floor = f1 = math.nan
    if sampled is not None and len(sampled):
        cloud = torch.from_numpy(np.asarray(sampled, np.float64))
        forward, backward, f1, floor = distances(cloud, target, points, seed)
    row = Metrics(target.name, forward + backward, forward, backward, floor, f1, iou, 0, 0, 0)
    return row if mesh is None else with_likeness(row, mesh, target, seed)

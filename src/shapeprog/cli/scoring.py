"""Predictions of any kind against targets of any kind: programs by themselves, everything else as a shape."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from shapeprog.cli.terminal import fault, read_program_file, warn
from shapeprog.cli.writing import program_files
from shapeprog.data import load_all
from shapeprog.data.reading import in_words
from shapeprog.data.shape import Shape
from shapeprog.data.voxelise import voxelise_mesh, voxelise_points
from shapeprog.errors import InputError, ShapeProgError
from shapeprog.evaluation.likeness import Triangles
from shapeprog.evaluation.metrics import (
    Metrics,
    cloud_distances,
    evaluate_program,
    noise_floor,
    target_samples,
    with_likeness,
    world_scale,
)
from shapeprog.formats.format import suffixes
from shapeprog.language.program import Program

if TYPE_CHECKING:
    from torch import Tensor

Prediction = tuple[Program, Program | None] | Shape
"""A program with its whole-numbered form where the file holds one, or a shape."""


def predictions(path: Path) -> Iterator[tuple[str, Prediction | ShapeProgError]]:
    """Names and predictions of a file, a pack or a folder; a folder that holds programs is read for those alone."""
    files = [path] if path.suffix.lower() in suffixes("program") else []
    if path.is_dir() and any(any(path.glob(f"*{suffix}")) for suffix in suffixes("program")):
        files = program_files(path)
    for file in files:
        try:
            with in_words(file, "a program"):
                prediction = _program(file)
        except ShapeProgError as error:
            yield file.stem, error
        else:
            yield file.stem, prediction
    if not files:
        for file, shape in load_all([path]):
            yield (file.stem if isinstance(shape, ShapeProgError) else shape.name), shape


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


def score(
    name: str,
    prediction: Prediction | ShapeProgError,
    target: Shape | None,
    part_files: dict[str, list[Path]],
    points: int,
    seed: int,
) -> tuple[Metrics | None, ShapeProgError | None]:
    """The measures of a prediction if it can be measured, and what failed; ``part_files`` are by name of target."""
    if isinstance(prediction, ShapeProgError):
        return None, ShapeProgError(f"prediction {name}: {prediction.message}", prediction.hint)
    if target is None:
        return None, ShapeProgError(f"prediction {name} has no target", "give both the same name")
    try:
        row = measure(prediction, target, points, seed)
    except ShapeProgError as refused:
        return None, ShapeProgError(f"prediction {name}: {refused.message}", refused.hint)
    except Exception as error:
        return None, fault(f"prediction {name} could not be measured", error)
    try:
        files = part_files.get(target.name)
        return (with_parts(row, prediction, target, files, seed) if files else row), None
    except InputError as mistake:
        return row, ShapeProgError(f"parts of {name}: {mistake.message}", mistake.hint)


def measure(prediction: Prediction, target: Shape, points: int, seed: int) -> Metrics:
    """The measures of one prediction; sizes are 0 for shapes."""
    if isinstance(prediction, Shape):
        return _measure_shape(prediction, target, points, seed)
    return evaluate_program(prediction[0], target, prediction[1], points, seed, looks=True)


def with_parts(row: Metrics, prediction: Prediction, target: Shape, files: list[Path], seed: int) -> Metrics:
    """The measures with recall and precision of the physical parts in ``files``; a shape has no parts to find.

    Raises
    ------
    InputError
        If a part cannot be read.
    """
    from shapeprog.data.parts import read_parts
    from shapeprog.evaluation.parts import part_scores
    from shapeprog.language.unroll import unroll

    if isinstance(prediction, Shape):
        return row
    parts = [Triangles(target.frame.to_grid(vertices), faces) for vertices, faces in read_parts(files)]
    return replace(row, **part_scores(parts, unroll(prediction[0]), seed)._asdict())


def _program(path: Path) -> tuple[Program, Program | None]:
    from shapeprog.formats.json_form import read_result

    if path.suffix.lower() != ".json":
        return read_program_file(path)[0], None
    result = read_result(path)
    warn(path, result.program)
    return result.program, result.snapped


def _measure_shape(prediction: Shape, target: Shape, points: int, seed: int) -> Metrics:
    """A predicted mesh or cloud is in the coordinates of the target; cells are in the grid."""
    import torch

    cells, mesh = prediction.voxels, None
    sampled = None if prediction.points is None else torch.from_numpy(prediction.points.astype(np.float64))
    if prediction.vertices is not None and prediction.faces is not None:
        from shapeprog.data.sampling import sample_surface

        placed = target.frame.to_grid(prediction.frame.to_world(prediction.vertices))
        cells, mesh = voxelise_mesh(placed, prediction.faces), Triangles(placed, prediction.faces)
        sampled = torch.from_numpy(np.asarray(sample_surface(placed, prediction.faces, points, seed), np.float64))
    elif prediction.kind == "points" and prediction.points is not None:
        placed = target.frame.to_grid(prediction.frame.to_world(prediction.points))
        cells, sampled = voxelise_points(placed), torch.from_numpy(placed)
    union = int((cells | target.voxels).sum())
    iou = float((cells & target.voxels).sum() / union) if union else 1.0
    distances = _distances(sampled, target, points, seed)
    row = Metrics(target.name, *distances, iou=iou, blocks=0, statements=0, primitives=0)
    return row if mesh is None else with_likeness(row, mesh, target, seed)


def _distances(
    sampled: Tensor | None, target: Shape, points: int, seed: int
) -> tuple[float, float, float, float, float]:
    """CD, its two halves, the noise floor, and F1, as :mod:`shapeprog.evaluation.metrics` measures programs."""
    samples = target_samples(target, points, seed)
    if samples is None or sampled is None or not len(sampled):
        return math.nan, math.nan, math.nan, math.nan, math.nan
    square = world_scale(target) ** 2
    forward, backward, f1 = cloud_distances(sampled, samples[0], square)
    return forward + backward, forward, backward, noise_floor(samples, square), f1

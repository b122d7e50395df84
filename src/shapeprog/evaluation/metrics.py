"""How well a program rebuilds a shape: chamfer distance, F-score, IoU and size, with every convention fixed.

World frame
    The bounding box of the target has its centre at the origin and diagonal 1.
CD
    Mean squared distance to the nearest neighbour, prediction to target plus target to prediction, between points
    drawn uniformly by area from the surface of the predicted union and from the target; numbers are not rounded.
F1 at one cell
    F-score of the same points at a distance of one grid cell.
IoU
    Cells of the program, see :mod:`shapeprog.formats.samples`, against the touched cells of the target, at 32^3.
Likeness
    F1@.5 %, F1@1 %, normals and silhouette: see :mod:`shapeprog.evaluation.likeness`.  Normals and silhouette need a
    mesh as target; F1 needs points at least.
Floors
    CD and likeness between two independent samplings of the target itself, or two halves of its points: about the best
    value that a program reaches.  Halves have fewer points: their CD is too high, their F1 too low.
Structure
    Whether the union is one piece, slivers: see :mod:`shapeprog.evaluation.structure`; and continuous numbers, those
    that are free where others follow from names.
Size
    Blocks, statements (loops count one each) and primitives after unrolling.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, fields, replace

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from shapeprog.data.shape import Shape
from shapeprog.errors import ShapeProgError
from shapeprog.evaluation import likeness, structure
from shapeprog.evaluation.likeness import Samples, Triangles
from shapeprog.formats.samples import occupied
from shapeprog.geometry import cells
from shapeprog.geometry.mesh import union_mesh
from shapeprog.geometry.nearest import squared_distance
from shapeprog.geometry.surface import sample_surface
from shapeprog.language.free import numbers
from shapeprog.language.program import Program
from shapeprog.language.unroll import unroll
from shapeprog.space import Array

POINTS = 5000
"""Points drawn on each of the two surfaces."""

CELL = 1.0
"""Distance in cells within which a point counts as found."""

Cloud = Float[Tensor, "P 3"]


@dataclass(frozen=True)
class Metrics:
    """The measures of one program against one target; see the module for the conventions.

    Parameters
    ----------
    name
        Name of the target.
    cd, to_target, from_target, cd_floor
        Squared world lengths, for a bounding box with diagonal 1.
    f1_cell
        F-score at a distance of one cell, between 0 and 1; that of the shares of the diagonal is ``f1_percent``.
    iou
        Share between 0 and 1, of the cells of the program, see :func:`shapeprog.formats.samples.occupied`.
    blocks, statements, primitives
        Size of the program.
    numbers
        How many continuous numbers are written, or free.
    f1_half_percent, f1_percent, normals, silhouette
        Likeness, between 0 and 1; these and all that follow are not a number where they were not measured.
    one_piece
        1 where the union is one connected solid, else 0.
    slivers
        Share of the primitives that are too thin to be a part.
    f1_half_percent_floor, f1_percent_floor, normals_floor
        The same between two samplings of the target.
    part_recall, part_precision
        Parts that one primitive covers, over parts and over primitives: see :mod:`shapeprog.evaluation.parts`.
    """

    name: str
    cd: float
    to_target: float
    from_target: float
    cd_floor: float
    f1_cell: float
    iou: float
    blocks: int
    statements: int
    primitives: int
    numbers: int = 0
    f1_half_percent: float = math.nan
    f1_percent: float = math.nan
    normals: float = math.nan
    silhouette: float = math.nan
    one_piece: float = math.nan
    slivers: float = math.nan
    f1_half_percent_floor: float = math.nan
    f1_percent_floor: float = math.nan
    normals_floor: float = math.nan
    part_recall: float = math.nan
    part_precision: float = math.nan


@dataclass(frozen=True)
class Summary:
    """One measure over many shapes: mean with its standard error, median, and how many have it."""

    mean: float
    error: float
    median: float
    count: int


def evaluate_program(
    program: Program,
    target: Shape,
    snapped: Program | None = None,
    points: int = POINTS,
    seed: int = 0,
    *,
    iou: float | None = None,
    looks: bool = False,
) -> Metrics:
    """Measure a program against a target.

    Parameters
    ----------
    program
        The program, whose CD and F1 are measured without rounding.  An empty one has an infinite CD and F1 0.
    target
        The shape it should be.
    snapped
        The whole-numbered program whose IoU is measured; by default see
        :func:`shapeprog.formats.samples.occupied`.
    points
        Points on each surface.
    seed
        Seed of all samplings; the same seed gives the same figures.
    iou
        The IoU where it has been measured already, as inference has.
    looks
        Whether to measure likeness and structure, too; they take most of a second.
    """
    scene = unroll(program)
    if iou is None:
        iou = 0.0
        with suppress(ShapeProgError):  # parts too far away, or too many, to have cells
            iou = float(cells.iou(occupied(program, scene, snapped), cells.pack(target.voxels)))
    sampled = None
    with suppress(ShapeProgError):  # no primitive has a surface
        sampled = sample_surface(scene, points, torch.Generator().manual_seed(seed)).points.double()
    to_target, from_target, f1, floor = distances(sampled, target, points, seed)
    row = Metrics(
        name=target.name, cd=to_target + from_target, to_target=to_target, from_target=from_target,
        cd_floor=floor, f1_cell=f1, iou=iou, blocks=program.blocks, statements=program.statements,
        primitives=int(scene.mask.sum()), numbers=numbers(program),
    )  # fmt: skip
    if not looks:
        return row
    try:
        mesh = Triangles(*union_mesh(scene))
    except ShapeProgError:  # nothing in it has a volume
        mesh = None
    return replace(
        with_likeness(row, mesh, target, seed), one_piece=structure.one_piece(mesh), slivers=structure.slivers(scene)
    )


def with_likeness(row: Metrics, predicted: Triangles | None, target: Shape, seed: int = 0) -> Metrics:
    """The measures with the likeness of a predicted mesh, ``None`` where it has no surface, to the target."""
    mesh, prediction_seed = _mesh(target), seed
    if mesh is not None:
        *seeds, prediction_seed = np.random.SeedSequence((seed, 1)).generate_state(3).tolist()
        first, second = (likeness.sampled(mesh, sample_seed) for sample_seed in seeds)
        surface = first
    elif (halves := _halves(target, seed)) is not None:
        first, second, surface = map(Samples, (*halves, np.concatenate(halves)))
    else:
        return row
    diagonal = _diagonal(target)
    floor = likeness.likeness(first, second, diagonal)
    scores, outlines = likeness.NOTHING, 0.0
    if predicted is not None:
        scores = likeness.likeness(likeness.sampled(predicted, prediction_seed), surface, diagonal)
        outlines = math.nan if mesh is None else likeness.silhouette(predicted, mesh)
    if mesh is None:
        outlines, scores = math.nan, scores._replace(normals=math.nan)
    return replace(
        row, f1_half_percent=scores.f1_half_percent, f1_percent=scores.f1_percent, normals=scores.normals,
        silhouette=outlines, f1_half_percent_floor=floor.f1_half_percent, f1_percent_floor=floor.f1_percent,
        normals_floor=floor.normals,
    )  # fmt: skip


def summarise(rows: Sequence[Metrics]) -> dict[str, Summary]:
    """Mean, standard error and median of every measure over shapes; those that are not a number are left out."""
    summary = {}
    for column in fields(Metrics)[1:] if rows else ():  # the first is the name
        numbers = np.array([getattr(row, column.name) for row in rows], np.float64)
        numbers = numbers[~np.isnan(numbers)]
        count = len(numbers)
        mean, median = (float(numbers.mean()), float(np.median(numbers))) if count else (math.nan, math.nan)
        known = count > 1 and np.isfinite(numbers).all()
        error = float(numbers.std(ddof=1) / np.sqrt(count)) if known else math.nan
        summary[column.name] = Summary(mean, error, median, count)
    return summary


def world_scale(target: Shape) -> float:
    """World units per cell of a target whose bounding box has diagonal 1."""
    return 1 / _diagonal(target)


def _diagonal(target: Shape) -> float:
    """The diagonal in cells of the bounding box of a target."""
    return float(np.linalg.norm(target.extents)) or 1.0


def _mesh(target: Shape) -> Triangles | None:
    if target.vertices is None or target.faces is None or not len(target.faces):
        return None
    return Triangles(target.vertices, target.faces)


def _halves(target: Shape, seed: int) -> tuple[Array, Array] | None:
    """The points of a target in two random halves; ``None`` where it has none."""
    if target.points is None or len(target.points) < 2:
        return None
    mixed = np.asarray(target.points, np.float64)[np.random.default_rng(seed).permutation(len(target.points))]
    return mixed[: len(mixed) // 2], mixed[len(mixed) // 2 :]


def target_samples(target: Shape, points: int, seed: int) -> tuple[Cloud, Cloud] | None:
    """Two independent samplings of the surface of a target, or None where it is known as cells only.

    From a mesh both have ``points`` points.  Otherwise they are two halves of the points at hand, each of at most
    ``points``: with fewer than twice as many at hand the floor of the CD is too high.
    """
    mesh = _mesh(target)
    if mesh is not None:
        seeds = np.random.SeedSequence(seed).generate_state(2).tolist()
        first, second = (likeness.sampled(mesh, sample_seed, points).points for sample_seed in seeds)
    elif (halves := _halves(target, seed)) is not None:
        first, second = (half[:points] for half in halves)
    else:
        return None
    return torch.from_numpy(first), torch.from_numpy(second)


def distances(sampled: Cloud | None, target: Shape, points: int, seed: int) -> tuple[float, float, float, float]:
    """Prediction to target, target to prediction, F1 at one cell, and the floor of the CD.

    All are not a number for a target of cells alone.  ``sampled`` are points on the surface of the prediction, ``None``
    if it has no surface.
    """
    samples = target_samples(target, points, seed)
    if samples is None:
        return math.nan, math.nan, math.nan, math.nan
    square = world_scale(target) ** 2
    floor = float(squared_distance(*samples).mean() + squared_distance(*reversed(samples)).mean()) * square
    if sampled is None:
        return math.inf, math.inf, 0.0, floor
    surface = samples[0]
    if _mesh(target) is None:  # all points of a cloud, undivided
        assert target.points is not None
        mixed = np.random.default_rng(0).permutation(len(target.points))[:points]  # files list them place after place
        surface = torch.from_numpy(np.asarray(target.points[np.sort(mixed)], np.float64))
    to_target, from_target = squared_distance(sampled, surface), squared_distance(surface, sampled)
    precision, recall = float((to_target <= CELL**2).double().mean()), float((from_target <= CELL**2).double().mean())
    f1 = 2 * precision * recall / (precision + recall) if precision + recall > 0 else 0.0
    return float(to_target.mean()) * square, float(from_target.mean()) * square, f1, floor

"""Inference: a shape in, a program out, with its scores and the reason why the search stopped.

A mesh or a point cloud is searched on its surface (:func:`~shapeprog.inference.assembly.assemble`).  Voxels, shapes
with ``statements="paper"``, and shapes whose surface gives no program are searched on cells
(:func:`~shapeprog.inference.cells.reconstruct.reconstruct`).  Unless ``statements="paper"``, blocks move onto calls of
library functions, parts are placed from the sides of the whole, and numbers are tied.
"""

from __future__ import annotations

import importlib
import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import Literal

from shapeprog.arguments import MOST_SEED, check_number
from shapeprog.data import Shape, loaded
from shapeprog.data.remarks import doubt_of_furniture, remark_on_pieces, remark_on_size
from shapeprog.data.shape import check_unit, unit_of_result
from shapeprog.errors import ShapeProgError
from shapeprog.formats.samples import occupied
from shapeprog.geometry.arrays import one_thread
from shapeprog.geometry.cells import iou, pack
from shapeprog.inference.assembly import assemble
from shapeprog.inference.budget import BUDGET, Deadline, Progress
from shapeprog.inference.calls import with_calls
from shapeprog.inference.candidates.drawings import between_ends
from shapeprog.inference.cells.reconstruct import description_length, reconstruct
from shapeprog.inference.cells.settings import Settings
from shapeprog.inference.choice.coverage import Coverage, Prices
from shapeprog.inference.fit.tunable import Tunable
from shapeprog.inference.roles.roles import named_anew, note_on_front
from shapeprog.inference.surface.evidence import evidence_of
from shapeprog.inference.ties.tying import tie
from shapeprog.kernels.compile import modules_of, prepare
from shapeprog.language.convert import placed_if_possible
from shapeprog.language.free import numbers
from shapeprog.language.merging import merged
from shapeprog.language.program import Program
from shapeprog.language.readable import in_readable_unit
from shapeprog.language.unroll import unroll
from shapeprog.library import Library, joined, with_library

SEARCH_SHARE = 0.65  # share of the time budget after which the search on cells hands over to fitting

SURFACE_PATHS = "geometry/distance", "geometry/surface", "inference/choice/", "inference/pieces/", "inference/surface/"
CELL_PATHS = "geometry/cell", "inference/cells/"
"""Where the kernels of the search on the surface and of that on cells are; those with the same helpers together."""


@dataclass(frozen=True)
class Result:
    """The result of inference.

    Parameters
    ----------
    program
        The program with continuous numbers.
    snapped
        Of a program in the statements of the paper, the same with whole numbers, each within one of the rounded number
        of ``program``: with ``statements="paper"``, and of voxels where that is the shorter description.
    scores
        ``blocks``, ``statements``, ``primitives``; ``numbers``, those that are free; ``explained``, the share of the
        surface, of meshes and point clouds, before calls, ties and rounding; ``iou`` at 32^3 of voxels and of programs
        with a ``snapped`` form.
    reason
        Why the search stopped, what the time budget cut short, and what to try next.
    cut
        Steps that the time budget cut short, and their progress; if none, the same seed gives an equal result.
    seconds
        How long it took after loading; comparisons of results ignore it.
    """

    program: Program
    snapped: Program | None
    scores: dict[str, float]
    reason: str = field(repr=False)
    cut: tuple[str, ...]
    seconds: float = field(compare=False)

    def __str__(self) -> str:
        """A short report: the size of the program, how well it fits, and why the search stopped."""
        program = self.program
        size = f"{program.blocks} blocks, {program.statements} statements, {program.size} solids"
        words = {"numbers": "{:.0f} free numbers", "explained": "{:.1%} of the surface explained", "iou": "IoU {:.3f}"}
        shown = [text.format(self.scores[name]) for name, text in words.items() if name in self.scores]
        return f"{', '.join([size, *shown])}\n{self.reason}\n{self.seconds:.1f} s; its program is .program"

    def _repr_png_(self) -> bytes:
        """A picture of the program, which notebooks show."""
        return importlib.import_module("shapeprog.view.page").png(self.program, self.scores)


@one_thread()
def infer(
    shape: Shape | str | Path,
    *,
    blocks: int = 10,
    budget: float = BUDGET,
    seed: int = 0,
    settings: Settings | None = None,
    statements: Literal["all", "paper"] = "all",
    detail: float = 1.0,
    ties: bool = True,
    libraries: Sequence[Library] = (),
    unit: str = "",
    progress: Progress | None = None,
) -> Result:
    """A short program of at most ``blocks`` blocks, drawing statements with loops around them, that rebuilds a shape.

    The result is the same for the same seed unless the time budget ends a step early, which ``cut`` reports.

    Parameters
    ----------
    shape
        A loaded shape, or the path of a mesh, point cloud or voxel file.
    blocks
        Most blocks of the program.
    budget
        Seconds after which neither the second choice nor a further step of the search on cells or of fitting starts.
    seed
        Of the searches.  Samples of meshes and point clouds are the same for all seeds.
    settings
        Settings of the search on cells; the search on the surface does not use them.  ``blocks`` and ``detail``
        overrule theirs.
    statements
        All statements in force, or those of the paper alone.
    detail
        Factor by which the prices of blocks and numbers are divided: above 1 the program is finer.
    ties
        Whether numbers that hold together are tied: those used several times have names, and what follows from others
        is an expression.
    libraries
        Functions that the program is written with wherever that is shorter, unless it has the paper's statements alone.
        Parts that are nearly a call of a function move to where the call draws them.
    unit
        Unit of the lengths of the program: ``mm``, ``cm``, ``m``, ``in`` or ``cells``; by default that of the file, and
        cells for voxels.  The numbers of up to 256 primitives are rounded, by which nothing moves farther than .015
        cells.
    progress
        Called with the name of the current step and the share of it that is done.

    Raises
    ------
    InputError
        If the path is no readable shape.
    ShapeProgError
        If there is no such unit, or another argument has no meaning.
    """
    check_unit(unit)
    check_number("blocks", blocks, 1, whole=True)
    check_number("detail", detail, 0, above=True)
    check_number("seed", seed, 0, MOST_SEED, whole=True)
    check_number("budget", budget, 0, endless=True)
    if not isinstance(settings, Settings | None):
        raise ShapeProgError(f"settings is {settings!r}", "give shapeprog.inference.Settings(), or nothing")
    if not (progress is None or callable(progress)):
        raise ShapeProgError(f"progress is {progress!r}", "give a function of a step and a share, or nothing")
    library = joined(libraries)
    if statements not in ("all", "paper"):
        raise ShapeProgError(f"unknown statements {statements!r}", "choose all or paper")
    target = loaded(shape)
    prepare_kernels(cells=statements == "paper" or target.points is None)
    started = time.monotonic()
    searching, refining = (Deadline(started + share * budget) for share in (SEARCH_SHARE, 1.0))
    scores: dict[str, float] = {}
    program, snapped, reason = Program(), None, ""
    evidence, usual = evidence_of(target), Prices()
    floor = None if target.points is None or not len(evidence.surface) else float(evidence.surface[:, 0].min())
    prices = {name: getattr(usual, name) / detail for name in ("statement", "loop", "number")}
    coverage = Coverage(evidence, replace(usual, **prices))
    if statements == "all" and target.points is not None:
        program, scores["explained"], reason = assemble(
            coverage, blocks=blocks, seed=seed, deadline=refining, progress=progress
        )
    if not program.body:  # voxels, the statements of the paper, or a surface that gave no program
        prepare_kernels(cells=True)
        scores.clear()
        limits = settings or Settings()
        program, snapped, reason = reconstruct(
            target, evidence, settings=replace(limits, blocks=blocks, price=limits.price / detail),
            tied=statements == "all", seed=seed, searching=searching, refining=refining, progress=progress,
        )  # fmt: skip
    if statements == "all":
        final = program if snapped is None else named_anew(program)
        held = frozenset[int]()
        if libraries:
            final, held = with_calls(final, library, coverage)
        if ties:
            if progress:
                progress("tying numbers", 0.0)
            final = tie(final if held else between_ends(final), evidence, floor=floor, held=held)
        cells = target.voxels
        if snapped is None or description_length(final, cells) <= description_length(program, cells, snapped):
            program, snapped = final, None
    if snapped is None:
        program = placed_if_possible(merged(program), floor)
        if program.scale is None and program.size:  # a statement without a placed form
            tunable = Tunable(program)
            program = tunable.settled(tunable.values)
        if libraries:
            program = with_library(program, library)
    program = replace(in_readable_unit(program, unit_of_result(target, program, unit)), frame=target.frame)
    front = note_on_front(program, target.frame) if target.points is not None and statements == "all" else ""
    size = remark_on_size(unroll(program), evidence.surface) if target.points is not None else ""
    doubt = doubt_of_furniture(evidence.surface, evidence.surface_normals)
    reason = " ".join(filter(None, (reason, doubt, size, front, remark_on_pieces(target.voxels), target.note)))
    cut = tuple(deadline.cut for deadline in (searching, refining) if deadline.cut)
    if cut:
        reason += f" The time limit of {budget:g} s ended {' and '.join(cut)}: "
        reason += "with a larger --budget the result depends on the seed alone."
    if snapped is not None or target.points is None:
        scores["iou"] = float(iou(occupied(program, unroll(program), snapped), pack(target.voxels)))
    sizes = program.blocks, program.statements, program.size, numbers(program)
    scores |= zip(("blocks", "statements", "primitives", "numbers"), map(float, sizes), strict=True)
    return Result(program, snapped, scores, reason, cut, time.monotonic() - started)


@cache
def prepare_kernels(*, cells: bool = False) -> None:
    """Compile, or load from the cache, the kernels of inference, with ``cells`` also those of the search on cells.

    It does not count against the time budget, except for kernels of cells where a surface gave no program.  The first
    call on a machine takes seconds, the first in a process a fraction of one.
    """
    prepare(modules_of(*SURFACE_PATHS, *(CELL_PATHS if cells else ())))

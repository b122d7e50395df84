"""Inference: a shape in, a program out, with its scores and a sentence that says why the search stopped.

A program of the paper's statements is searched on cells.  Its blocks then compete with those found on the surface of
the shape, from every statement there is; cells have a surface as well, if a coarse one.
"""

from __future__ import annotations

import importlib
import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cache, partial
from pathlib import Path
from typing import Literal

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from shapeprog.data.shape import Shape
from shapeprog.data.touched import occupied
from shapeprog.geometry.arrays import one_tensor_thread
from shapeprog.geometry.cells import iou, pack
from shapeprog.geometry.distance import nearest_primitive
from shapeprog.inference.assembly import TradeOff, assemble
from shapeprog.inference.budget import BUDGET, Deadline, Progress
from shapeprog.inference.candidates.calls import recognised
from shapeprog.inference.cells.blocks import to_program
from shapeprog.inference.cells.refine import REACH, Schedule, refine
from shapeprog.inference.cells.structure import Settings, search_structure
from shapeprog.inference.choice.cell_coverage import cost_on_cells
from shapeprog.inference.readable import CELLS, in_readable_unit, unit_of_result
from shapeprog.inference.roles.roles import named_anew
from shapeprog.inference.surface.cells import points_of_cells
from shapeprog.inference.ties.tying import tie
from shapeprog.language.convert import placed_if_possible
from shapeprog.language.free import numbers
from shapeprog.language.merging import merged
from shapeprog.language.program import Program
from shapeprog.language.unit import metres
from shapeprog.language.unroll import unroll
from shapeprog.library import Library, with_library

SEARCH_SHARE = 0.65
"""Share of the time budget after which the structure search hands over to refinement."""

EXPLAINED = 0.5
"""Share of the surface that blocks must explain; else what has a surface is no furniture, and its cells are rebuilt."""

DEEP = 2.5
"""Depth in cells below the surface of the snapped program beyond which points are inner faces; chosen on val."""


@dataclass(frozen=True)
class Result:
    """What inference found.

    Parameters
    ----------
    program
        The program with continuous parameters.
    snapped
        Of a program of the paper's statements, the same with whole numbers, each within one of the rounded parameter of
        ``program``; others have no such form.
    scores
        ``blocks``, ``statements``, ``primitives``; ``numbers``, those that are free; ``explained``, the share of the
        surface, where that was looked at; ``iou`` at 32^3 of programs found on cells, and of all for targets that are
        cells.
    reason
        Why the search stopped, where the program came from, what the time budget cut short, and what to try next.
    cut
        What the time budget cut short, and how far that had come; if nothing, the same seed gives an equal result.
    seconds
        How long it took, which counts for nothing when results are compared.
    trade_off
        For every number of blocks the best program that was seen: numbers written, and share of the surface explained.
    """

    program: Program
    snapped: Program | None
    scores: dict[str, float]
    reason: str
    cut: tuple[str, ...]
    seconds: float = field(compare=False)
    trade_off: tuple[TradeOff, ...] = ()

    def __str__(self) -> str:
        """A short report: the size of the program, how well it fits, and why the search stopped."""
        program = self.program
        size = f"{program.blocks} blocks, {program.statements} statements, {program.size} solids"
        words = {"numbers": "{:.0f} free numbers", "explained": "{:.1%} of the surface explained", "iou": "IoU {:.3f}"}
        shown = [text.format(self.scores[name]) for name, text in words.items() if name in self.scores]
        return f"{', '.join([size, *shown])}\n{self.reason}\n{self.seconds:.1f} s; its program is .program"

    def _repr_png_(self) -> bytes:
        """A picture of the program, which notebooks show."""
        picture: bytes = importlib.import_module("shapeprog.view.page").png(self.program, self.scores)
        return picture


@one_tensor_thread()
def infer(
    shape: Shape | str | Path,
    *,
    blocks: int = 10,
    budget: float = BUDGET,
    seed: int = 0,
    settings: Settings | None = None,
    schedule: Schedule | None = None,
    statements: Literal["all", "paper"] = "all",
    detail: float = 1.0,
    ties: bool = True,
    libraries: Sequence[Library] = (),
    unit: str = "",
    progress: Progress | None = None,
) -> Result:
    """A short program of at most ``blocks`` blocks that rebuilds a shape.

    Structure is searched on the touched cells, with whole numbers; then all parameters are refined together on surface
    points through the renderer.  These blocks and those that the surface itself suggests are candidates of one choice,
    whose parameters are adjusted and whose parts are named.  Of a shape that is known by its cells the shorter
    description is kept: share of cells wrong, and price of what is written.  The result is the same for the same seed
    unless the time budget cuts in, which ``cut`` and ``reason`` tell.

    Parameters
    ----------
    shape
        A loaded shape, or the path of a mesh, point cloud or voxel file.
    blocks
        Most blocks of the program.
    budget
        Seconds after which neither search nor refinement starts another step: a safety net.  What they may spend in
        the common case is up to ``settings`` and ``schedule``.
    settings, schedule
        Rounds of the search and steps of refinement, and more; the defaults were chosen on validation shapes.
    statements
        All statements in force, or those of the paper alone.
    detail
        How much finer than usual the program may be where the surface is known: prices of what is written are divided
        by it.
    ties
        Whether numbers that hold together are tied: the program then has names for the few that are free, and
        expressions for all others.  Of cells alone only where the description gets no longer by it.
    libraries
        Functions that the program is written with wherever that is shorter, unless it has the paper's statements alone.
        What they draw competes with single blocks, at the price of a call, and a call counts as one block.
    unit
        Unit of the lengths of the program: ``mm``, ``cm``, ``m``, ``in`` or ``cells``; by default that of the file, and
        cells for voxels.  The numbers are rounded as a person would, by which nothing moves farther than .015 cells.
    progress
        Called with what is being done and the share of it that is done.

    Raises
    ------
    InputError
        If the path is no readable shape.
    ShapeProgError
        If there is no such unit.
    """
    if unit not in ("", CELLS):
        metres(unit)
    prepare_kernels()
    started = time.monotonic()
    searching, refining = (Deadline(started + share * budget) for share in (SEARCH_SHARE, 1.0))
    target = _load(shape)
    scores: dict[str, float] = {}
    structure = search_structure(
        target.voxels, replace(settings or Settings(), blocks=blocks), seed=seed, deadline=searching, progress=progress
    )
    on_cells = to_program(structure.blocks)
    snapped: Program | None = on_cells
    reason = f"The search ended after {structure.reason}"
    reason += "." if searching.cut else _advice(on_cells.blocks, blocks)
    program = refine(
        on_cells, outer_points(target, on_cells, seed),
        voxels=target.voxels if target.points is None else None, schedule=schedule, reach=REACH, seed=seed,
        deadline=refining, progress=progress,
    )  # fmt: skip
    trade_off: tuple[TradeOff, ...] = ()
    costs = partial(cost_on_cells, voxels=target.voxels, detail=detail)
    if statements == "all":
        functions = [pattern for library in libraries for pattern in library.patterns if pattern.shortens]
        found = assemble(
            target, blocks=blocks, more=program.flat().body, functions=functions, detail=detail, seed=seed,
            deadline=refining, progress=progress,
        )  # fmt: skip
        if target.points is not None:
            better = found.explained >= EXPLAINED
        else:
            better = costs(found.program) < costs(program, snapped=snapped)
        if better:
            program, snapped, trade_off = found.program, None, found.trade_off
            scores["explained"] = found.explained
            reason = found.reason[0].upper() + found.reason[1:]
            if ties:
                held = {index for call in recognised(program, libraries) for index in call.places}
                tied = tie(program, found.evidence, held=held, seed=seed, progress=progress).program
                fits = target.points is not None or costs(tied) <= costs(program)
                program = tied if fits else program
        elif ties and target.points is None:
            tied = tie(named_anew(program), found.evidence, seed=seed, progress=progress).program
            if costs(tied) <= costs(program, snapped=snapped):
                program, snapped = tied, None
    if snapped is None:
        program = placed_if_possible(merged(program))
        for library in libraries:
            program = with_library(program, library)
    program = in_readable_unit(program, unit_of_result(target, program, unit), seed)
    if target.note:
        reason += f" {target.note}"
    cut = tuple(each.cut for each in (searching, refining) if each.cut)
    if cut:
        reason += f" The time limit of {budget:g} s ended {' and '.join(cut)}: "
        reason += "with a larger --budget the result depends on the seed alone."
    if snapped is not None or target.points is None:
        scores["iou"] = float(iou(occupied(program, unroll(program), snapped), pack(target.voxels)))
    scores |= {
        "blocks": float(program.blocks),
        "statements": float(program.statements),
        "primitives": float(program.size),
        "numbers": float(numbers(program)),
    }
    return Result(program, snapped, scores, reason, cut, time.monotonic() - started, trade_off)


@cache
def prepare_kernels() -> None:
    """Compile, or load from the cache, all kernels that inference runs, so that no time budget pays for it.

    The first call on a machine takes some seconds, the first in a process a fraction of one.
    """
    from shapeprog.kernels.compile import modules_of, prepare

    prepare(modules_of("inference", "geometry"))


def _load(shape: Shape | str | Path) -> Shape:
    if isinstance(shape, Shape):
        return shape
    from shapeprog.data import load

    return load(shape)


def outer_points(target: Shape, snapped: Program, seed: int) -> Float[Tensor, "P 3"]:
    """Points that the surface of the program should meet.

    Points deep inside the solid lie on inner faces of the mesh, such as the back of a drawer.  The surface of a union
    cannot reach them; trying to would pull its outer faces inwards.
    """
    if target.points is None:
        return torch.from_numpy(points_of_cells(target.voxels, seed=seed))
    points = torch.from_numpy(np.asarray(target.points, np.float32))
    outer = points[nearest_primitive(unroll(snapped), points)[1] > -DEEP] if snapped.size else points
    return outer if len(outer) else points


def _advice(used: int, allowed: int) -> str:
    if used >= allowed:
        return f"; the limit of --blocks {allowed} is reached, raise it for more."
    return f"; {used} of {allowed} drawing statements are in use, another would improve the fit too little."

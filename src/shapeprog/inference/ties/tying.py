"""Ties: the numbers of a program that hold together are written with one name.

Parts are placed from the sides of the whole; every face gets an anchor.  Relations between numbers that nearly hold are
priced by their cost in fit, those cheaper than a number are imposed, and the numbers that stay free are refitted.
Where a change of a shared number would separate parts, another is measured from it.  Shared numbers are then named.
"""

from __future__ import annotations

import math
from collections.abc import Collection

import numpy as np
import torch
from scipy.spatial import cKDTree

from shapeprog.errors import ShapeProgError
from shapeprog.geometry.arrays import one_thread
from shapeprog.geometry.mesh import pieces_of_parts
from shapeprog.geometry.surface import hidden_groups
from shapeprog.inference.fit.joints import find_joints
from shapeprog.inference.fit.residuals import closeness
from shapeprog.inference.fit.tunable import CELLS, DEGREES
from shapeprog.inference.surface.evidence import Evidence, off_parts
from shapeprog.inference.ties.anchors import anchors_of
from shapeprog.inference.ties.expressions import Solution, carried, solved
from shapeprog.inference.ties.layout import Layout
from shapeprog.inference.ties.misfit import Misfit
from shapeprog.inference.ties.relations import Relation, relations, worthwhile
from shapeprog.inference.ties.settings import TIES
from shapeprog.inference.ties.text import written
from shapeprog.language.ast import Fault, Source
from shapeprog.language.convert import placed
from shapeprog.language.evaluate import evaluated
from shapeprog.language.merging import merged
from shapeprog.language.parameters import to_float32
from shapeprog.language.program import Program, nest
from shapeprog.language.unroll import unroll
from shapeprog.space import FloatArray


def tie(
    program: Program,
    evidence: Evidence,
    *,
    price: float = 1.0,
    known: bool = False,
    floor: float | None = None,
    held: Collection[int] = (),
    seed: int = 0,
) -> Program:
    """The same program placed from the sides, with names for shared numbers; the same for the same seed.

    Numbers are tied at lower prices where more than ``TIES.lost`` of the closeness of the surfaces is lost.  Parts that
    are hidden inside others once tied are left out.  The same program comes back if a statement has no placed form.

    Parameters
    ----------
    program
        A program of statements in cells, or a placed one; only the numbers that it evaluates to are read, and, if they
        are ``known``, the ``width``, ``depth`` and ``height`` of a placed one.
    evidence
        The target, which limits how far relations may move its parts.
    price
        Price of a free number, as a multiple of ``TIES.price``, or of ``TIES.known_price`` where numbers are known, or
        exact.
    known
        Whether somebody wrote the numbers: they are then known, and not only where the surface is.
    floor
        Height of the floor in the grid, as of :func:`~shapeprog.language.convert.placed`.
    held
        Indices of the nodes of its body whose numbers stay fixed: calls of functions draw them.
    """
    if not program.size:
        return program
    whole = program.source if known else None
    corners = None if known or evidence.mesh is None else evidence.mesh.vertices
    box = None if corners is None else (corners.min(0), corners.max(0))
    plain = Program(program.body)
    try:
        tied = placed(plain if held else merged(plain), merge=not held, rows=False, floor=floor, whole=whole, box=box)
    except ShapeProgError:  # a statement without a placed form
        return program
    assert tied.source is not None
    with one_thread(kernels=1):
        ties = _Ties(tied.source, evidence, seed, known=known, held=held)
        surface = cKDTree(evidence.surface, balanced_tree=False)  # faster to build
        before, least = 0.0 if known else closeness(unroll(program), surface, seed), math.inf
        for attempt in range(TIES.attempts):
            try:
                offered = ties.tied(price * ties.price / TIES.cheaper**attempt)
            except Fault:  # relations left a part without length
                continue
            lost = 0.0 if known else before - closeness(unroll(offered), surface, seed)
            if lost < least:
                tied, least = offered, lost
            if lost <= TIES.lost:
                break
    scene = unroll(tied)
    if not (known or held) and (hidden := hidden_groups(scene, scene.block)):
        visible = [nest(chain) for index, chain in enumerate(tied.chains) if index != max(hidden)]
        return tie(Program(tuple(visible)), evidence, price=price, floor=floor, seed=seed)
    return tied


class _Ties:
    """Everything about a program that does not depend on the price of a number."""

    def __init__(self, source: Source, evidence: Evidence, seed: int, *, known: bool, held: Collection[int]) -> None:
        flat = Layout(source, divide=not held)  # lines are held by their numbers, which divisions change
        scene = flat.scene(flat.numbers)
        joints = find_joints(scene, floor=-1e6)  # that no part touches: on the floor, clearances are zero
        blocks = scene.block[joints.pairs]
        division = torch.tensor([flat.lines[line].kind == "divide" for line in flat.parts])[blocks[:, 0]]
        apart = ~(division & (blocks[:, 0] == blocks[:, 1]))  # the gap of a division is a number of its own
        joints = joints._replace(pairs=joints.pairs[apart], normalized=joints.normalized[apart])
        self.layout = layout = Layout(source, anchors_of(flat), divide=not held)
        top = [index for index, line in enumerate(layout.body) for _ in Source((line,)).walk()]
        self.fixed = np.array([slot.line >= 0 and top[slot.line] in held for slot in layout.slots])
        self.joined = np.sort(np.array(layout.parts)[blocks[apart]], 1)  # the lines (C, 2) of each joint
        self.touching = set(map(tuple, self.joined.tolist()))
        self.related = relations(layout, layout.numbers, self.touching)  # at the start
        exact = not known and self._is_exact(evidence)
        self.price = TIES.known_price if known or exact else TIES.price
        weight = TIES.known if known else TIES.exact if exact else 0.0
        minimum = np.where(self.fixed, 1e6, weight)
        if evidence.mesh is not None and not known:  # the size of a mesh is exact
            minimum[:3] = np.maximum(minimum[:3], TIES.extent)
        self.misfit = Misfit(layout, evidence, joints, minimum, seed)
        self.decimals = CELLS if known else CELLS + 1  # what is inferred is rounded again
        self.zero = 0.0 if known else TIES.zero  # a number that somebody wrote stays

    def _is_exact(self, evidence: Evidence) -> bool:
        """Whether relations that nearly hold mostly hold exactly, as in a drawing by CAD, and parts are components; in
        other models, and where numbers are fitted, deviations are random."""
        numbers, scene = self.layout.numbers, self.layout.scene(self.layout.numbers)
        on = off_parts(scene, evidence).min(-1, initial=np.inf) <= TIES.component
        off = np.array([abs(each.row @ numbers) / np.abs(each.row).max() for each in self.related])
        exactly, nearly = (np.count_nonzero(off < limit) for limit in (TIES.exactly, TIES.nearly))
        return bool(exactly > TIES.exact_share * nearly and on.mean() > TIES.component_share)

    def tied(self, price: float) -> Program:
        """The program tied at a price of a number, in the unit of the misfit.

        Where ties separate lines from the others, the joints of these weigh more, and its numbers are tied again, up to
        ``TIES.repeats`` times.  Numbers of at most ``TIES.zero`` become zero, unless somebody wrote them.
        """
        self.misfit.together[:] = TIES.together
        for _ in range(TIES.repeats):
            solution, offsets = self._solved(price)
            digits = (DEGREES if self.layout.slots[k].kind == "angle" else self.decimals for k in solution.free)
            free = np.array([to_float32(number) for number in map(round, offsets.tolist(), digits)])
            free[(np.abs(free) <= self.zero) & ~self.fixed[solution.free]] = 0.0
            loose = self._loose(solution.factors @ solution.chained() @ free)
            loose = loose and loose - self._loose(self.layout.numbers)  # those that were so before do not count
            if not loose:
                break
            self.misfit.together *= np.where(np.isin(self.joined, [*loose]).any(1), TIES.heavier, 1.0)
        return evaluated(written(self.layout, solution, free))

    def _loose(self, numbers: FloatArray) -> set[int]:
        """The lines with parts outside the largest connected solid."""
        scene = self.layout.scene(numbers)
        return {self.layout.parts[block] for block in scene.block[pieces_of_parts(scene) > 0].tolist()}

    def _solved(self, price: float) -> tuple[Solution, FloatArray]:
        """The free numbers at a price of a number, and their offsets (Z,)."""
        layout, numbers, rows = self.layout, self.layout.numbers, self.layout.fixed()
        for step in range(TIES.rounds):
            candidates, before = [Relation(row, math.inf) for row in rows], len(rows)
            for relation in relations(layout, numbers, self.touching) if step else self.related:
                early = relation.trust in (TIES.contact, TIES.floor)
                if (step or early) and not relation.row[self.fixed].any():
                    candidates.append(relation)
            _, curvature = self.misfit.at(numbers, TIES.draws)
            rows, optimum = worthwhile(candidates, numbers, curvature, price, layout.bounded, layout.low)
            if step and len(rows) == before:
                break
            numbers = self.misfit.refitted(optimum, rows)
        return carried(solved(layout.slots, rows), layout, numbers)

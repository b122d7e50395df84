"""Ties: the numbers of a program that hold together are written with one name.

Parts are placed from the sides of the whole; every face gets an anchor.  Relations between the numbers that nearly
hold are priced by their cost in fit, those cheaper than a number are imposed, and the numbers that stay free are
refitted.  Where a change of a shared number would separate parts, others are measured from it.  Shared numbers are
then named.
"""

from __future__ import annotations

from collections.abc import Collection

import numpy as np
import numpy.typing as npt
import torch

from shapeprog.errors import ShapeProgError
from shapeprog.geometry.arrays import one_tensor_thread
from shapeprog.geometry.mesh import pieces_of_parts
from shapeprog.inference.budget import Progress
from shapeprog.inference.fit.joints import find_joints
from shapeprog.inference.fit.tunable import CELLS
from shapeprog.inference.surface.evidence import Evidence
from shapeprog.inference.ties.anchored import Anchored
from shapeprog.inference.ties.anchors import anchors_of
from shapeprog.inference.ties.carrying import carried
from shapeprog.inference.ties.closeness import Closeness
from shapeprog.inference.ties.expressions import Solution, solved
from shapeprog.inference.ties.layout import LOW, Anchors, Layout
from shapeprog.inference.ties.leaning import between_ends
from shapeprog.inference.ties.model import Misfit, Model
from shapeprog.inference.ties.pricing import worthwhile
from shapeprog.inference.ties.relations import Relation, relations
from shapeprog.inference.ties.settings import TIES
from shapeprog.inference.ties.text import written
from shapeprog.language.ast import Fault, Part
from shapeprog.language.convert import placed
from shapeprog.language.evaluate import evaluated
from shapeprog.language.merging import merged
from shapeprog.language.program import Program
from shapeprog.language.unroll import unroll
from shapeprog.space import FloatArray


def tie(
    program: Program,
    evidence: Evidence,
    *,
    price: float = 1.0,
    known: bool = False,
    held: Collection[int] = (),
    seed: int = 0,
    progress: Progress | None = None,
) -> Program:
    """The same program placed from the sides, with names for shared numbers; the same for the same seed.

    Parameters
    ----------
    program
        A program of statements in cells, or a placed one; only the numbers that it evaluates to are read.
    evidence
        The target, which limits how far relations may move its parts.
    price
        Price of a free number, as a multiple of ``price``, or ``known_price`` if the numbers are known.
    known
        Whether somebody wrote the numbers: they are then known, and not only where the surface is.
    held
        Indices of the nodes of its body whose numbers stay fixed: calls of functions draw them.
    """
    plain = Program(program.body) if known or held else between_ends(Program(program.body))
    if not plain.size:
        return program
    with one_tensor_thread(kernels=1):
        try:
            source = placed(plain if held else merged(plain), merge=not held, rows=False).source
        except ShapeProgError:  # a statement without a placed form
            return program
        assert source is not None
        ties = _Ties(Layout(source), evidence, seed, known=known, held=held)
        price *= TIES.known_price if known else TIES.price
        closeness = None if known else Closeness(evidence, seed)
        before = closeness.of(unroll(plain)) if closeness else 0.0
        tied = evaluated(source)
        for attempt in range(TIES.attempts):
            try:
                tied = ties.tied(price / TIES.cheaper**attempt)
            except Fault:  # relations left a part without length
                continue
            if closeness is None or before - closeness.of(unroll(tied)) <= TIES.lost:
                break
        if progress:
            progress("tying numbers", 1.0)
    return tied


class _Ties:
    """Everything about a program that does not depend on the price of a number."""

    def __init__(self, layout: Layout, evidence: Evidence, seed: int, *, known: bool, held: Collection[int]) -> None:
        flat = Model(Anchored(layout, _from_low(layout)))
        scene = flat.scene(flat.numbers)
        self.joints = find_joints(scene, floor=-1e6)  # that no part touches: on the floor, clearances are zero
        self.anchored = Anchored(layout, anchors_of(flat))
        self.model = Model(self.anchored)
        lines = layout.lines_of(held)
        fixed = np.array([slot.line in lines for slot in self.anchored.slots])
        self.misfit = Misfit(self.model, evidence, seed, np.where(fixed, np.inf, TIES.known if known else 0.0))
        self.fixed, self.decimals = fixed, CELLS if known else CELLS + 1  # what is inferred is rounded again
        self.parts = parts = [k for k, line in enumerate(layout.lines) if isinstance(line, Part)]
        pairs = scene.block[torch.stack([self.joints.first, self.joints.second], 1)].tolist()
        self.touching = {(parts[min(pair)], parts[max(pair)]) for pair in pairs}
        self.loose = self._loose(self.model.numbers)

    def tied(self, price: float) -> Program:
        """The program tied at a price of a number, in the unit of the misfit.

        Lines that ties separate from the others stay untied, and if this is not enough, those that they touched.
        """
        slots, untied = self.anchored.slots, set[int]()
        for _ in range(TIES.attempts):
            solution, numbers = self._solved(price, self.fixed | np.array([slot.line in untied for slot in slots]))
            free = solution.rounded(slots, numbers, self.decimals)
            loose = self._loose(solution.factors @ free) - self.loose
            if not loose:
                break
            touched = {line for pair in self.touching if not loose.isdisjoint(pair) for line in pair}
            untied |= touched if loose <= untied else loose
        return evaluated(written(self.anchored, solution, free, group=not self.fixed.any()))

    def _loose(self, numbers: FloatArray) -> set[int]:
        """The lines with parts outside the largest connected solid."""
        scene = self.model.scene(numbers)
        return {self.parts[block] for block in scene.block[pieces_of_parts(scene) > 0].tolist()}

    def _solved(self, price: float, fixed: npt.NDArray[np.bool_]) -> tuple[Solution, FloatArray]:
        """The free numbers at a price of a number, and all numbers (P,); some (P,) are in no relation."""
        numbers, rows = self.model.numbers, self.anchored.fixed()
        for step in range(TIES.rounds):
            offered = relations(self.anchored, numbers, self.touching)
            offered = [relation for relation in offered if not (relation.row != 0)[fixed].any()]
            if step == 0:
                offered = [relation for relation in offered if relation.trust in (TIES.contact, TIES.floor)]
            before = len(rows)
            rows, optimum = self._imposed(offered, numbers, rows, price)
            if step and len(rows) == before:
                break
            numbers = self.misfit.refitted(optimum, self._free(rows), self.joints)
        return carried(solved(self.anchored.slots, rows), self.model, numbers), numbers

    def _imposed(
        self, offered: Collection[Relation], numbers: FloatArray, rows: FloatArray, price: float
    ) -> tuple[FloatArray, FloatArray]:
        curvature = self.misfit.at(numbers)[1]
        far = TIES.far / np.maximum(self.misfit.scale, 1.0)
        return worthwhile([*offered], numbers, curvature, price, fixed=rows, low=self.model.low, far=far)

    def _free(self, rows: FloatArray) -> FloatArray:
        """Orthonormal directions (P, Z) in which relations (M, P) hold."""
        if not len(rows):
            return np.eye(len(self.model.numbers))
        axes, _ = np.linalg.qr(rows.T, mode="complete")
        return axes[:, len(rows) :]


def _from_low(layout: Layout) -> dict[tuple[int, str, int], Anchors]:
    return {key: (LOW, LOW) if element.kind == "interval" else (LOW,) for key, element in layout.elements.items()}

"""Ties: the numbers of a program that hold together are written with one name.

Parts are placed from the sides of the whole; every face gets an anchor.  Relations between the numbers that nearly
hold are priced by their cost in fit, those cheaper than a number are imposed, and the numbers that stay free are
refitted.  Where a change of a shared number would separate parts, others are measured from it.  Shared numbers are
then named.
"""

from __future__ import annotations

from collections.abc import Collection
from typing import NamedTuple

import numpy as np
import torch

from shapeprog.errors import ShapeProgError
from shapeprog.geometry.arrays import one_tensor_thread
from shapeprog.inference.budget import Progress
from shapeprog.inference.choice.connecting import afloat
from shapeprog.inference.fit.joints import find_joints
from shapeprog.inference.surface.evidence import Evidence
from shapeprog.inference.ties.anchored import Anchored
from shapeprog.inference.ties.anchors import AnchorSettings, anchors_of
from shapeprog.inference.ties.carrying import carried
from shapeprog.inference.ties.closeness import Closeness
from shapeprog.inference.ties.expressions import solved
from shapeprog.inference.ties.layout import LOW, Anchors, Layout
from shapeprog.inference.ties.leaning import between_ends
from shapeprog.inference.ties.model import Misfit, Model
from shapeprog.inference.ties.pricing import worthwhile
from shapeprog.inference.ties.relations import Relation, Trust, relations
from shapeprog.inference.ties.text import written
from shapeprog.language.ast import Fault, Part
from shapeprog.language.convert import placed
from shapeprog.language.evaluate import evaluated
from shapeprog.language.free import free_numbers
from shapeprog.language.merging import merged
from shapeprog.language.program import Program
from shapeprog.language.unroll import unroll
from shapeprog.space import FloatArray

PRICE = 3e-4
"""Price of a free number, as a mean squared distance in cells; chosen on validation shapes."""

FAR = 2.0
"""Farthest that relations may move a number at once, in cells."""

KNOWN_PRICE = 1.2e-3
"""Price of a free number in a program that somebody wrote; chosen on planted programs."""

KNOWN = 0.1
"""Weight of a squared move of a number that somebody wrote."""

LOST, CHEAPER, ATTEMPTS = 0.03, 3.0, 3
"""Largest decrease of closeness when numbers are tied; beyond that, or where parts are separated, the price of a number
is divided by this factor, in so many attempts.  The last attempt is kept in any case."""

APART = 0.005
"""Gap in cells from which parts are separated."""

NOWHERE = -1e6
"""A floor that no part touches: parts on the floor have a clearance of zero."""

ROUNDS = 3
"""Most times that relations are looked for: first contacts, then all."""


class Tied(NamedTuple):
    """A program whose numbers hold together, and how many of them are free."""

    program: Program
    free: int


def tie(
    program: Program,
    evidence: Evidence,
    *,
    price: float = 1.0,
    known: bool = False,
    held: Collection[int] = (),
    seed: int = 0,
    progress: Progress | None = None,
) -> Tied:
    """The same program placed from the sides, with names for shared numbers; the same for the same seed.

    Parameters
    ----------
    program
        A program of statements in cells, or a placed one; only the numbers that it evaluates to are read.
    evidence
        The target, which limits how far relations may move its parts.
    price
        Price of a free number, as a multiple of ``PRICE``, or ``KNOWN_PRICE`` if the numbers are known.
    known
        Whether somebody wrote the numbers: they are then known, and not only where the surface is.
    held
        Indices of the nodes of its body whose numbers stay fixed: calls of functions draw them.
    """
    plain = Program(program.body) if known or held else between_ends(Program(program.body))
    if not plain.size:
        return Tied(program, 0)
    with one_tensor_thread(kernels=1):
        try:
            source = placed(plain if held else merged(plain), merge=not held, rows=False).source
        except ShapeProgError:  # a statement without a placed form
            return Tied(program, free_numbers(program))
        assert source is not None
        ties = _Ties(Layout(source), evidence, seed, known=known, held=held)
        price *= KNOWN_PRICE if known else PRICE
        closeness = None if known else Closeness(evidence, seed)
        before, floating = (closeness.of(unroll(plain)), afloat(plain, APART)) if closeness else (0.0, 0)
        tied = evaluated(source)
        for attempt in range(ATTEMPTS):
            try:
                tied = ties.tied(price / CHEAPER**attempt)
            except Fault:  # relations left a part without length
                continue
            if closeness is None:
                break
            if before - closeness.of(unroll(tied)) <= LOST and afloat(tied, APART) <= floating:
                break
        if progress:
            progress("tying numbers", 1.0)
    return Tied(tied, free_numbers(tied))


class _Ties:
    """Everything about a program that does not depend on the price of a number."""

    def __init__(self, layout: Layout, evidence: Evidence, seed: int, *, known: bool, held: Collection[int]) -> None:
        flat = Model(Anchored(layout, _from_low(layout)))
        self.trust = Trust()
        scene = flat.scene(flat.numbers)
        self.joints = find_joints(scene, NOWHERE)
        self.anchored = Anchored(layout, anchors_of(flat, AnchorSettings()))
        self.model = Model(self.anchored)
        lines = layout.lines_of(held)
        fixed = np.array([slot.line in lines for slot in self.anchored.slots])
        self.misfit = Misfit(self.model, evidence, seed, np.where(fixed, np.inf, KNOWN if known else 0.0))
        self.fixed = fixed
        parts = [k for k, line in enumerate(layout.lines) if isinstance(line, Part)]
        pairs = scene.block[torch.stack([self.joints.first, self.joints.second], 1)].tolist()
        self.touching = {(parts[min(pair)], parts[max(pair)]) for pair in pairs}

    def tied(self, price: float) -> Program:
        """The program tied at a price of a number, in the unit of the misfit."""
        numbers, rows = self.model.numbers, self.anchored.fixed()
        for step in range(ROUNDS):
            offered = relations(self.anchored, numbers, self.touching, self.trust)
            offered = [relation for relation in offered if not (relation.row != 0)[self.fixed].any()]
            if step == 0:
                offered = [relation for relation in offered if relation.trust == self.trust.contact]
            before = len(rows)
            rows, optimum = self._imposed(offered, numbers, rows, price)
            if step and len(rows) == before:
                break
            numbers = self.misfit.refitted(optimum, self._free(rows), self.joints)
        solution = carried(solved(self.anchored.slots, rows), self.model, numbers)
        return evaluated(written(self.anchored, solution, numbers, group=not self.fixed.any()))

    def _imposed(
        self, offered: Collection[Relation], numbers: FloatArray, rows: FloatArray, price: float
    ) -> tuple[FloatArray, FloatArray]:
        curvature = self.misfit.at(numbers)[1]
        far = FAR / np.maximum(self.misfit.scale, 1.0)
        return worthwhile([*offered], numbers, curvature, price, fixed=rows, low=self.model.low, far=far)

    def _free(self, rows: FloatArray) -> FloatArray:
        """Orthonormal directions (P, Z) in which relations (M, P) hold."""
        if not len(rows):
            return np.eye(len(self.model.numbers))
        axes, _ = np.linalg.qr(rows.T, mode="complete")
        return axes[:, len(rows) :]


def _from_low(layout: Layout) -> dict[tuple[int, str, int], Anchors]:
    return {key: (LOW, LOW) if element.kind == "interval" else (LOW,) for key, element in layout.elements.items()}

"""Ties: numbers of a program that hold together are written as expressions of few named ones.

Relations that nearly hold are priced by what they cost in fit, those worth more than a number are imposed, the numbers
that stay free are refitted, and so on until no further number is saved.  What is free is then named.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import torch

from shapeprog.errors import ShapeProgError
from shapeprog.geometry.arrays import one_tensor_thread
from shapeprog.geometry.scene import Scene
from shapeprog.inference.budget import Progress
from shapeprog.inference.connecting import afloat
from shapeprog.inference.evidence import Evidence
from shapeprog.inference.joints import Joints, find_joints
from shapeprog.inference.ties.alike import alike
from shapeprog.inference.ties.basis import Basis, simplest
from shapeprog.inference.ties.closeness import Closeness
from shapeprog.inference.ties.contacts import Contacts
from shapeprog.inference.ties.features import Feature, features
from shapeprog.inference.ties.fitting import CLOSED, Misfit, refitted, ways_free
from shapeprog.inference.ties.following import Following
from shapeprog.inference.ties.leaning import between_ends
from shapeprog.inference.ties.naming import written
from shapeprog.inference.ties.pricing import worthwhile
from shapeprog.inference.ties.relations import INFERRED, WRITTEN, Relation, relations
from shapeprog.inference.tunable import CELLS, DEGREES, Tunable
from shapeprog.language.free import free_numbers
from shapeprog.language.program import Draw, Program
from shapeprog.language.unroll import unroll
from shapeprog.space import FloatArray

PRICE = 2e-4
"""What a number is worth: mean squared distance in cells; chosen on val."""

WRITTEN_PRICE = 1.2e-3
"""The same in a program that somebody wrote, whose numbers are known; chosen on planted programs."""

LOST, CHEAPER, CHEAPEST = 0.03, 3.0, 0.3
"""How much less of the surface may be near that of the target when numbers are tied; beyond that a number is worth so
many times less, as long as it is worth more than this share of the usual; the same where parts come apart."""

APART = 0.005
"""Gap in cells from which parts are apart."""

ROUNDS = 3
"""Most times that relations are looked for."""

NOWHERE = -1e6
"""A floor that no part stands on: standing is found by its own relation."""


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
    held: FloatArray | None = None,
    seed: int = 0,
    progress: Progress | None = None,
) -> Tied:
    """The same program with names for its free numbers and expressions for all others; the same for the same seed.

    Parameters
    ----------
    evidence
        What it should fit: how far relations may move its parts.
    price
        What a number is worth, times the usual ``PRICE`` or ``WRITTEN_PRICE``.
    known
        Whether somebody wrote the numbers: each is then known, and not only the surface that they come to.
    held
        Relations that hold in any case, as rows (R, F) of factors of the numbers that move.
    """
    plain = Program(program.body) if held is not None else between_ends(program)
    if not plain.size:
        return Tied(plain, 0)
    closeness = Closeness(evidence, seed)
    with one_tensor_thread(kernels=1):
        ties = _Ties(plain, Misfit(Tunable(plain), evidence, seed, known=known), closeness, held, seed)
        worth, trusted = price * (WRITTEN_PRICE if known else PRICE), WRITTEN if known else INFERRED
        for round_ in range(ROUNDS):
            imposed = ties.impose(relations(ties.measured(), ties.numbers, ties.touching, trusted), worth)
            if progress:
                progress("tying numbers", (round_ + 1) / ROUNDS)
            if not imposed:
                break
        basis, following = ties.simplest()
        more = [] if known else list(alike(basis, following, trusted))
        if more and ties.impose(more, worth):
            basis, _ = ties.simplest()
        named = written(ties.tunable, _rounded(basis))
    found = Tied(named, free_numbers(named))
    if held is None and not known and price > CHEAPEST:
        lost = closeness.of(unroll(plain)) - closeness.of(unroll(named))
        if lost > LOST or afloat(named, seed, APART) > afloat(plain, seed, APART):
            return tie(program, evidence, price=price / CHEAPER, seed=seed, progress=progress)
    return found


class _Ties:
    """The relations of a program that hold so far.

    Attributes
    ----------
    numbers, rows
        Where its numbers and the extents of the whole are (V,), and the relations (M, V) that hold for them.
    joints, touching
        Where its parts touch, and the pairs of nodes that do.
    """

    def __init__(
        self, program: Program, misfit: Misfit, closeness: Closeness, held: FloatArray | None, seed: int
    ) -> None:
        self.tunable, self.misfit, self.closeness = misfit.tunable, misfit, closeness
        self.numbers = misfit.numbers
        values = self.tunable.values
        straight = np.flatnonzero((self.numbers[: len(values)] == 0) & self.tunable.are("angle").numpy())
        self.rows = np.eye(len(self.numbers))[straight] if held is None else np.pad(held, ((0, 0), (0, 3)))
        scene = self.tunable.scene(values)
        self.joints = _joints(scene, seed)
        self.touching = touching(self.tunable, scene, self.joints) if self.joints else set()
        self._contacts = Contacts(self.tunable, self.joints) if self.joints else None

    def measured(self) -> list[Feature]:
        """What can be measured of the program."""
        return features(self.tunable, self.tunable.poses(self._own(self.numbers)))

    def impose(self, offered: list[Relation], worth: float) -> bool:
        """Impose the relations that pay at a price per number; returns whether any were added."""
        before, curvature = len(self.rows), self.misfit.at(self.numbers)[1]
        self.rows, optimum = worthwhile(
            offered, self.numbers, curvature, worth, fixed=self.rows, low=self.misfit.low, far=self.misfit.far
        )
        if self._contacts:
            self.rows, optimum = self._contacts.kept(self.rows, before, self.numbers, curvature, worth)
        self.numbers = self._closest(optimum)
        return len(self.rows) > before

    def simplest(self) -> tuple[Basis, Following | None]:
        """The measures that all numbers follow from, and what changes of them part."""
        ways = ways_free(self.rows, len(self.numbers))
        lengths = np.append(self.tunable.are("length").numpy(), [False] * 3)
        following = Following(self.tunable, self.joints, self.numbers) if self.joints else None
        return simplest(self.measured(), self.numbers, ways, lengths, self.touching, following), following

    def _closest(self, numbers: FloatArray) -> FloatArray:
        """The numbers (V,) for which the relations hold: as they fit best, as they are, or half-way.

        Where parts come apart as they fit best, what holds them weighs more.
        """
        ways = ways_free(self.rows, len(numbers))
        start = ways @ (ways.T @ numbers)  # all but rounding of what is there
        fitting = refitted(self.misfit, start, self.rows, self.joints)
        if self._contacts and not self._contacts.hold(fitting, numbers):
            fitting = refitted(self.misfit, start, self.rows, self.joints, CLOSED)
        offered = [fitting, (start + fitting) / 2, start]
        holding = [each for each in offered if not self._contacts or self._contacts.hold(each, numbers)]
        return max(holding, key=lambda each: self.closeness.of(self.tunable.scene(self._own(each))), default=numbers)

    def _own(self, numbers: FloatArray) -> torch.Tensor:
        """Those of numbers and extents that the program writes."""
        return torch.from_numpy(numbers[: len(self.tunable.values)])


def touching(tunable: Tunable, scene: Scene, joints: Joints) -> set[tuple[int, int]]:
    """Pairs of nodes whose parts touch or nearly do, the smaller number first."""
    drawn = [n for n, node in enumerate(tunable.nodes) if isinstance(node, Draw)]
    pairs = zip(scene.block[joints.first].tolist(), scene.block[joints.second].tolist(), strict=True)
    return {(min(drawn[a], drawn[b]), max(drawn[a], drawn[b])) for a, b in pairs}


def _joints(scene: Scene, seed: int) -> Joints | None:
    try:
        return find_joints(scene, NOWHERE, torch.Generator().manual_seed(seed))
    except ShapeProgError:  # a part without a surface touches nothing
        return None


def _rounded(basis: Basis) -> Basis:
    """The measures with as many decimals as numbers keep."""
    digits = [DEGREES if group[0].word == "angle" else CELLS for group in basis.chosen]
    values: FloatArray = np.array([round(value, places) for value, places in zip(basis.values, digits, strict=True)])
    return Basis(basis.chosen, basis.factors, values)

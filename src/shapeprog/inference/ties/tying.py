"""Ties: numbers of a program that hold together are written as expressions of few named ones.

Relations that nearly hold are priced by what they cost in fit, those worth more than a number are imposed, the numbers
that stay free are refitted, and so on until no further number is saved.  What is free is then named.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import torch

from shapeprog.errors import ShapeProgError
from shapeprog.geometry.scene import Scene
from shapeprog.inference.budget import Progress
from shapeprog.inference.evidence import Evidence
from shapeprog.inference.joints import Joints, find_joints
from shapeprog.inference.refine import single_threaded
from shapeprog.inference.roles import named_anew
from shapeprog.inference.ties.basis import Basis, simplest
from shapeprog.inference.ties.buried import buried
from shapeprog.inference.ties.contacts import Contacts
from shapeprog.inference.ties.features import Feature, features
from shapeprog.inference.ties.fitting import CLOSED, Misfit, refitted, ways_free
from shapeprog.inference.ties.following import Following
from shapeprog.inference.ties.leaning import between_ends
from shapeprog.inference.ties.naming import written
from shapeprog.inference.ties.opposite import as_images
from shapeprog.inference.ties.pricing import worthwhile
from shapeprog.inference.ties.relations import INFERRED, WRITTEN, relations
from shapeprog.inference.ties.runs import runs
from shapeprog.inference.tunable import CELLS, DEGREES, Tunable
from shapeprog.language.free import free_numbers
from shapeprog.language.program import Draw, Program, nest
from shapeprog.space import FloatArray

PRICE = 1e-4
"""What a number is worth: mean squared distance in cells; chosen on val."""

WRITTEN_PRICE = 1.2e-3
"""The same in a program that somebody wrote, whose numbers are known; chosen on planted programs."""

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

    Parts that lie wholly inside of others once the relations hold are left out, unless somebody wrote them.

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
    plain = Program(program.body) if held is not None else restated(program)
    if not plain.size:
        return Tied(plain, 0)
    with single_threaded():
        tunable = Tunable(plain)
        misfit = Misfit(tunable, evidence, seed, known=known)
        worth = price * (WRITTEN_PRICE if known else PRICE)
        numbers = misfit.numbers
        straight = np.flatnonzero((numbers[: len(tunable.values)] == 0) & tunable.are("angle").numpy())
        rows = np.eye(len(numbers))[straight] if held is None else np.pad(held, ((0, 0), (0, 3)))
        measured: list[Feature] = []
        scene = tunable.scene(tunable.values)
        joints = _joints(scene, seed)
        pairs = touching(tunable, scene, joints) if joints else set()
        contacts = Contacts(tunable, joints) if joints else None
        for round_ in range(ROUNDS):
            poses = tunable.poses(torch.from_numpy(numbers[: len(tunable.values)]))
            measured = features(tunable, poses)
            before = len(rows)
            offered = relations(measured, numbers, pairs, WRITTEN if known else INFERRED)
            curvature = misfit.at(numbers)[1]
            rows, optimum = worthwhile(offered, numbers, curvature, worth, fixed=rows, low=misfit.low, far=misfit.far)
            if contacts:
                rows, optimum = contacts.kept(rows, before, numbers, curvature, worth)
            numbers = _together(misfit, optimum, rows, joints, contacts)
            if progress:
                progress("tying numbers", (round_ + 1) / ROUNDS)
            if len(rows) == before:
                break
        ways = ways_free(rows, len(numbers))
        repeated = list(runs(tunable, ways))
        lengths = np.append(tunable.are("length").numpy(), [False] * 3)
        following = Following(tunable, joints, numbers) if joints else None
        basis = _rounded(simplest(measured, numbers, ways, lengths, repeated, pairs, following))
        named = written(tunable, basis, repeated)
    if held is None and not known and (gone := buried(named)):
        rest = [nest(chain) for block, chain in enumerate(plain.chains) if block not in gone]
        return tie(named_anew(Program(tuple(rest))), evidence, price=price, seed=seed, progress=progress)
    return Tied(named, free_numbers(named))


def restated(program: Program) -> Program:
    """The same parts, said so that what should hold together can be tied: see the modules of these two functions."""
    return as_images(between_ends(program))


def _together(
    misfit: Misfit, numbers: FloatArray, rows: FloatArray, joints: Joints | None, contacts: Contacts | None
) -> FloatArray:
    """The numbers (V,) refitted as they best fit; where parts come apart so, with what holds them weighing more; and
    where even that parts them, as they are."""
    fitting = refitted(misfit, numbers, rows, joints)
    if contacts is None or contacts.hold(fitting, numbers):
        return fitting
    closer = refitted(misfit, numbers, rows, joints, CLOSED)
    return closer if contacts.hold(closer, numbers) else numbers


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

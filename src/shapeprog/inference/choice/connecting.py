"""Connecting: floating parts are extended to nearly touching parts, or removed where they add little value.

Furniture is one piece.  The share explained is hardly affected by a gap of one cell between a leg and its seat.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator

import numpy as np

from shapeprog.geometry.contacts import contact_groups
from shapeprog.geometry.mesh import pieces_of_parts
from shapeprog.inference.candidates.drawings import solid_boxes
from shapeprog.inference.candidates.neighbours import centred, met, redrawn
from shapeprog.inference.choice.choice import value
from shapeprog.inference.choice.coverage import Coverage
from shapeprog.inference.choice.settings import SETTINGS
from shapeprog.language.hints import Box
from shapeprog.language.program import Chain, Node, Program
from shapeprog.language.statement import remembered
from shapeprog.language.unroll import unroll


def connected(program: Program, coverage: Coverage) -> Program:
    """A program of one block per node, of which one after another is extended or removed, where little value is lost:
    each time to the most valuable program with fewer floating parts."""
    while count := sum(lone for _, lone in _loose_parts(program)):
        every = [program, *_options(program)]
        nodes = dict.fromkeys(node for option in every for node in option.body)
        table, index = coverage.table([*nodes]), {node: number for number, node in enumerate(nodes)}
        start, *values = (value(table, tuple(index[node] for node in option.body)) for option in every)
        order = np.argsort(np.negative(values), kind="stable")[: SETTINGS.ways].tolist()
        limits = [SETTINGS.floating if option.blocks == program.blocks else SETTINGS.removed for option in every[1:]]
        likely = [every[1 + number] for number in order if values[number] >= start - limits[number]]
        before, *groups = contact_groups(unroll([program, *likely]))  # in less time than unions take
        fewer = (option for option, number in zip(likely, groups, strict=True) if number < before or before == 1)
        better = next((option for option in fewer if sum(lone for _, lone in _loose_parts(option)) < count), None)
        if better is None:
            break
        program = better
    return program


def floating(program: Program) -> list[int]:
    """Which blocks have a part outside the largest connected solid of the program."""
    return sorted({block for block, lone in _loose_parts(program) if lone})


@remembered(64)
def _loose_parts(program: Program) -> list[tuple[int, bool]]:
    """The block of every part, and whether that is outside the largest connected solid."""
    scene = unroll(program)
    return list(zip(scene.block.tolist(), (pieces_of_parts(scene) != 0).tolist(), strict=True))


def _options(program: Program) -> list[Program]:
    """Programs without one floating block, and programs with one block extended to join floating and other parts."""
    body, chains, options, loose = program.body, program.chains, list[Program](), floating(program)
    originals = solid_boxes([chain[-1] for chain in chains])
    parts = list(zip(itertools.chain(*solid_boxes(body)), _loose_parts(program), strict=True))
    for index, chain in enumerate(chains):
        ways: list[tuple[Node, ...]] = [()] if index in loose else []
        for side in (True, False) if len(originals[index]) == 1 else ():
            copies = [box for box, (owner, lone) in parts if owner == index and lone is side]
            others = [box for box, (owner, lone) in parts if owner != index and lone is not side]
            longer = _reaching(chain, originals[index][0], copies, others)
            ways += [(node,) for node in longer if node not in body]
        options += [Program((*body[:index], *way, *body[index + 1 :])) for way in dict.fromkeys(ways)]
    return options


def _reaching(chain: Chain, original: Box, copies: list[Box], parts: list[Box]) -> Iterator[Node]:
    """A block, whose statement draws the ``original`` box, extended so that one of its copies reaches a part; also at
    both ends alike, where it then lies in the middle."""
    for copy in copies:
        for longer in met(copy, parts, SETTINGS.lines, longer=True):
            along = (longer.centre - copy.centre) @ copy.rotation
            for moved in (along, -along):  # at a mirrored copy the other end may be extended
                box = Box(original.centre + original.rotation @ moved, original.rotation, longer.half)
                for candidate in (box, *centred(box)):
                    yield from redrawn(chain, candidate)

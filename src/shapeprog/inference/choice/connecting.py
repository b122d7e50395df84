"""Connecting: floating parts are extended to nearly touching parts, or removed where they add little value.

Furniture is one piece.  The share explained is hardly affected by a gap of one cell between a leg and its seat.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache

import numpy as np

from shapeprog.geometry.contacts import contact_groups
from shapeprog.geometry.mesh import pieces_of_parts
from shapeprog.inference.candidates.drawings import solid_boxes
from shapeprog.inference.candidates.neighbours import met, redrawn
from shapeprog.inference.choice.choice import value
from shapeprog.inference.choice.coverage import Coverage
from shapeprog.inference.choice.settings import SETTINGS
from shapeprog.language.hints import Box
from shapeprog.language.program import Chain, Node, Program
from shapeprog.language.unroll import unroll


def connected(program: Program, coverage: Coverage) -> Program:
    """A program of one block per node, with floating parts extended to others or removed where little value is lost."""
    while (better := _better_connected(program, coverage)) is not None:
        program = better
    return program


def _better_connected(program: Program, coverage: Coverage) -> Program | None:
    """The most valuable program with one block changed or removed and fewer floating parts, if the loss is small."""
    loose = _loose_parts(program)
    count = sum(map(sum, loose))
    if not count:
        return None
    every = [program, *_options(program, loose)]
    nodes = dict.fromkeys(node for option in every for node in option.body)
    index = {node: number for number, node in enumerate(nodes)}
    table = coverage.table([Program((node,)) for node in nodes])
    start, *values = (value(table, tuple(index[node] for node in option.body)) for option in every)
    order = np.argsort(np.negative(values), kind="stable")[: SETTINGS.ways].tolist()
    limits = [SETTINGS.floating if option.blocks == program.blocks else SETTINGS.removed for option in every[1:]]
    likely = [every[1 + number] for number in order if values[number] >= start - limits[number]]
    groups = contact_groups(unroll([program, *likely]))  # in less time than unions take
    fewer = (option for option, number in zip(likely, groups[1:], strict=True) if number < groups[0] or groups[0] == 1)
    return next((option for option in fewer if sum(map(sum, _loose_parts(option))) < count), None)


def floating(program: Program) -> list[int]:
    """Which blocks have a part outside the largest connected solid of the program."""
    return [block for block, parts in enumerate(_loose_parts(program)) if any(parts)]


@lru_cache(maxsize=64)
def _loose_parts(program: Program) -> list[list[bool]]:
    """For every part of every block, whether it is outside the largest connected solid."""
    loose: list[list[bool]] = [[] for _ in range(program.blocks)]
    scene = unroll(program)
    for block, piece in zip(scene.block.tolist(), pieces_of_parts(scene).tolist(), strict=True):
        loose[block].append(piece != 0)
    return loose


def _options(program: Program, loose: list[list[bool]]) -> list[Program]:
    """Programs without one floating block, and programs with one block extended to join floating and other parts."""
    body, chains, options = program.body, program.chains, list[Program]()
    originals = solid_boxes([chain[-1] for chain in chains])
    parts = [
        (owner, box, lone)
        for owner, (boxes, floats) in enumerate(zip(solid_boxes(body), loose, strict=True))
        for box, lone in zip(boxes, floats, strict=True)
    ]
    for index, chain in enumerate(chains):
        ways: list[tuple[Node, ...]] = [()] if any(loose[index]) else []
        for side in (True, False) if len(originals[index]) == 1 else ():
            copies = [box for owner, box, lone in parts if owner == index and lone is side]
            others = [box for owner, box, lone in parts if owner != index and lone is not side]
            longer = _reaching(chain, originals[index][0], copies, others)
            ways += [(node,) for node in longer if node not in body]
        options += [Program((*body[:index], *way, *body[index + 1 :])) for way in dict.fromkeys(ways)]
    return options


def _reaching(chain: Chain, original: Box, copies: list[Box], parts: list[Box]) -> Iterator[Node]:
    """A block, whose statement draws the ``original`` box, extended so that one of its copies reaches a part."""
    for copy in copies:
        for longer in met(copy, parts, SETTINGS.lines, longer=True):
            along = (longer.centre - copy.centre) @ copy.rotation
            for moved in (along, -along):  # at a mirrored copy the other end may be extended
                centre = original.centre + original.rotation @ moved
                yield from redrawn(chain, Box(centre, original.rotation, longer.half))

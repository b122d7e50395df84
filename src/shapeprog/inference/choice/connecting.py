"""Connecting: parts that float are extended to what they nearly touch, or left out where they say little.

Furniture is one piece.  A choice by what is explained does not see a gap of a cell between a leg and its seat.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator

import numpy as np
import torch

from shapeprog.geometry.mesh import gaps
from shapeprog.inference.candidates.drawings import redrawn, solid_boxes
from shapeprog.inference.candidates.neighbours import drawing_of, met, with_drawing
from shapeprog.inference.choice.choice import value
from shapeprog.inference.choice.coverage import Coverage
from shapeprog.inference.fit.tunable import bounds
from shapeprog.inference.surface.components import linked
from shapeprog.language.hints import Box
from shapeprog.language.program import Chain, Node, Program
from shapeprog.language.tensors import encode
from shapeprog.language.unroll import unroll

FLOATING = 0.02
"""What it may cost to connect a part, or to leave it out, as a share of the target."""

TRIED = 24
"""Most ways to connect a part that are looked at, the most valuable first."""

LINES = (0.8, 0.98)
"""Shares of a face within which lines say what it reaches when it is extended: boards may meet at their rims."""

FLUSH = 1e-4
"""Gap in cells up to which parts touch: faces that lie on each other do."""


def connected(program: Program, coverage: Coverage, fixed: Collection[Node] = ()) -> Program:
    """The program with parts that float extended to others, as far as that costs little of its value; each of its nodes
    is one block, and those that are ``fixed`` stay as they are."""
    while (better := _less_apart(program, coverage, fixed)) is not None:
        program = better
    return program


def _less_apart(program: Program, coverage: Coverage, fixed: Collection[Node]) -> Program | None:
    """The most valuable program with one block changed or left out and fewer parts afloat, if there is one worth it."""
    apart = _apart(program)
    many = sum(map(sum, apart))
    if not many:
        return None
    every = [program, *_options(program, apart, fixed)]
    nodes = list(dict.fromkeys(node for each in every for node in each.body))
    place = {node: number for number, node in enumerate(nodes)}
    table = coverage.table([Program((node,)) for node in nodes])
    start, *worth = (value(table, tuple(place[node] for node in each.body)) for each in every)
    order = np.argsort(np.negative(worth), kind="stable")[:TRIED].tolist()
    likely = (every[1 + number] for number in order if worth[number] >= start - FLOATING)
    return next((each for each in likely if sum(map(sum, _apart(each))) < many), None)


def floating(program: Program, flush: float = FLUSH) -> list[int]:
    """Which blocks have a part that no chain of touching parts joins to the largest such group.

    Parts touch across a gap of ``flush`` cells.
    """
    return [place for place, parts in enumerate(_apart(program, flush)) if any(parts)]


def afloat(program: Program, seed: int = 0, flush: float = FLUSH) -> int:
    """How many blocks are ``floating``."""
    return len(floating(program, flush))


def _apart(program: Program, flush: float = FLUSH) -> list[list[bool]]:
    """For every part of every block, whether it is outside of the largest group of parts that touch."""
    found: list[list[bool]] = [[] for _ in range(program.blocks)]
    if not program.size:
        return found
    scene = unroll(encode(program, dtype=torch.float64))
    group = linked(np.array(list(gaps(scene, flush)), np.int64).reshape(-1, 2), len(scene.mask))
    half = bounds(scene)
    sizes = np.bincount(group, weights=(half * half.roll(1, -1)).sum(-1).numpy())
    for block, each in zip(scene.block.tolist(), group, strict=True):
        found[block].append(bool(each != sizes.argmax()))
    return found


def _options(program: Program, apart: list[list[bool]], fixed: Collection[Node]) -> list[Program]:
    """The program without one of the blocks that float, and with one that reaches others, or one that others reach."""
    body, chains, found = program.body, program.chains, list[Program]()
    boxes, drawn = solid_boxes(body), solid_boxes([chain[-1] for chain in chains])
    for place, (copies, floats) in enumerate(zip(boxes, apart, strict=True)):
        if body[place] in fixed:
            continue
        ways: list[tuple[Node, ...]] = [()] if any(floats) else []
        for side in (True, False):
            mine = [copy for copy, lone in zip(copies, floats, strict=True) if lone is side]
            parts = [
                part
                for other in range(len(body))
                for part, lone in zip(boxes[other], apart[other], strict=True)
                if other != place and lone is not side
            ]
            if len(drawn[place]) == 1 and mine and parts:
                longer = _reaching(chains[place], drawn[place][0], mine, parts)
                ways += [(node,) for node in longer if node not in body]
        found += [Program((*body[:place], *way, *body[place + 1 :])) for way in dict.fromkeys(ways)]
    return found


def _reaching(chain: Chain, own: Box, copies: list[Box], parts: list[Box]) -> Iterator[Node]:
    """A block, whose statement draws its ``own`` box, extended so that one of its copies reaches one of some parts."""
    for copy in copies:
        for longer in met(copy, parts, LINES, longer=True):
            for box in _as_copied(own, copy, longer):
                yield from (with_drawing(chain, drawn) for drawn in redrawn(drawing_of(chain), box))


def _as_copied(own: Box, copy: Box, longer: Box) -> Iterator[Box]:
    """A box extended as one of its copies is; a mirrored copy may have the other end in its place."""
    along = (longer.centre - copy.centre) @ copy.rotation
    for moved in (along, -along):
        yield Box(own.centre + own.rotation @ moved, own.rotation, longer.half)

"""Connecting: parts that float are extended to what they nearly touch, or left out where they say little.

Furniture is one piece.  A choice by what is explained does not see a gap of a cell between a leg and its seat.
"""

from __future__ import annotations

from collections.abc import Collection

import numpy as np
import torch

from shapeprog.inference.candidates import solid_boxes
from shapeprog.inference.choice import value
from shapeprog.inference.coverage import Prices, covers
from shapeprog.inference.evidence import Evidence
from shapeprog.inference.joints import gaps
from shapeprog.inference.neighbours import alike, met, with_drawing
from shapeprog.inference.tunable import bounds
from shapeprog.language.program import Node, Program
from shapeprog.language.tensors import encode
from shapeprog.language.unroll import unroll

FLOATING = 0.01
"""What it may cost to connect a part, or to leave it out, as a share of the target."""

TRIED = 8
"""Most ways to connect a part that are looked at, the most valuable first."""

FLUSH = 1e-4
"""Gap in cells up to which parts touch: faces that lie on each other do."""


def connected(
    program: Program, evidence: Evidence, prices: Prices, seed: int = 0, fixed: Collection[Node] = ()
) -> Program:
    """The program with parts that float extended to others, as far as that costs little of its value; each of its nodes
    is one block, and those that are ``fixed`` stay as they are."""
    while (better := _less_apart(program, evidence, prices, seed, fixed)) is not None:
        program = better
    return program


def _less_apart(
    program: Program, evidence: Evidence, prices: Prices, seed: int, fixed: Collection[Node]
) -> Program | None:
    """The most valuable program with one block changed or left out and fewer that float, if there is one worth it."""
    apart = floating(program, seed)
    if not apart:
        return None
    places = [place for place in apart if program.body[place] not in fixed]
    every = [program, *(option for place in places for option in _options(program, place, apart))]
    nodes = list(dict.fromkeys(node for each in every for node in each.body))
    place = {node: number for number, node in enumerate(nodes)}
    made = covers([Program((node,)) for node in nodes], evidence, prices, seed)
    start, *worth = (value(made, tuple(place[node] for node in each.body)) for each in every)
    order = np.argsort(np.negative(worth), kind="stable")[:TRIED].tolist()
    likely = (every[1 + number] for number in order if worth[number] >= start - FLOATING)
    return next((each for each in likely if len(floating(each, seed)) < len(apart)), None)


def floating(program: Program, seed: int = 0) -> list[int]:
    """Which blocks have a part that no chain of touching parts joins to the largest such group."""
    if not program.size:
        return []
    scene = unroll(encode(program, dtype=torch.float64))
    group = list(range(len(scene.mask)))
    near = gaps(scene, torch.Generator().manual_seed(seed))
    for one, other in torch.stack([near.first, near.second], 1)[near.width <= FLUSH].tolist():
        group = [group[one] if each == group[other] else each for each in group]
    half = bounds(scene)
    sizes = np.bincount(group, weights=(half * half.roll(1, -1)).sum(-1).numpy())
    return sorted({int(block) for block, each in zip(scene.block, group, strict=True) if each != sizes.argmax()})


def _options(program: Program, place: int, apart: list[int]) -> list[Program]:
    """The program without a block, and with one that reaches others that do not float."""
    body, chain = program.body, program.chains[place]
    (own,) = solid_boxes([chain[-1]])
    others = solid_boxes([node for other, node in enumerate(body) if other not in apart])
    instead: list[Node] = []
    if len(own) == 1:
        parts = [part for each in others for part in each]
        instead = [with_drawing(chain, drawn) for box in met(own[0], parts) for drawn in alike(chain, box)]
    ways = [(), *((node,) for node in instead if node not in body)]
    return [Program((*body[:place], *way, *body[place + 1 :])) for way in ways]

"""Thickness where there is no evidence of any: meshes draw panels as single sheets, programs draw solids.

A part whose two broad faces the same sheet explains is as thick as the part of the program that is most like it, as far
as both faces still lie on the sheet: farther apart, they would be surfaces that nobody has seen.
"""

from __future__ import annotations

from collections.abc import Collection
from typing import NamedTuple

import numpy as np

from shapeprog.inference.candidates import redrawn, solid_boxes
from shapeprog.inference.evidence import TOLERANCE, Evidence
from shapeprog.inference.neighbours import drawing_of, with_drawing
from shapeprog.language.hints import Box
from shapeprog.language.program import Node, Program

THICKEST = 0.15
"""Most that a sheet is thickened to, in cells: about .5 % of the longest side."""

ONE = 0.03
"""Spread in cells of points about the plane of a single sheet, at most."""

LEAST = 24
"""Points from which it can be told."""

WITHIN = 0.9
"""Share of the broad face of a part, along each side, on which points are looked at: not at its rims."""

FACING = 0.9
"""Least cosine between their normals and its own."""

BROAD = 2.0
"""How much longer than thick a part with broad faces is, both ways."""


class Board(NamedTuple):
    """The drawing of one box with two broad faces: the box, which of its axes is the thin one, and how thick it is."""

    box: Box
    thin: int

    @property
    def thickness(self) -> float:
        """Between the broad faces, in cells."""
        return 2 * float(self.box.half[self.thin])

    @property
    def area(self) -> float:
        """Of one broad face."""
        return 4 * float(np.delete(self.box.half, self.thin).prod())


def thickened(program: Program, evidence: Evidence, fixed: Collection[Node] = ()) -> Program:
    """The program with single sheets as thick as their likes; each of its nodes is one block, and those that are
    ``fixed`` stay as they are."""
    if evidence.tolerance > TOLERANCE or not program.body:  # noise and cells hide whether there are two faces
        return program
    chains = program.chains
    boards = [_board(boxes) for boxes in solid_boxes([chain[-1] for chain in chains])]
    single = [board is not None and is_sheet(board, evidence) for board in boards]
    likes = [board for board, alone in zip(boards, single, strict=True) if board is not None and not alone]
    nodes = list[Node](program.body)
    for place, (chain, board, alone) in enumerate(zip(chains, boards, single, strict=True)):
        if board is not None and alone and program.body[place] not in fixed:
            box = _as_thick(board, likes, evidence)
            same = redrawn(drawing_of(chain), box)
            nodes[place] = with_drawing(chain, same[0]) if same else nodes[place]
    return Program(tuple(nodes))


def _board(boxes: list[Box]) -> Board | None:
    """What a statement draws, if it is one box with two broad faces."""
    if len(boxes) != 1:
        return None
    thin, middle, _ = np.argsort(boxes[0].half, kind="stable")
    return Board(boxes[0], int(thin)) if boxes[0].half[middle] >= BROAD * boxes[0].half[thin] else None


def is_sheet(board: Board, evidence: Evidence) -> bool:
    """Whether all that is seen of the two faces of a board lies in one plane between them."""
    box, thin = board
    at = (evidence.surface - box.centre) @ box.rotation
    beside = np.arange(3) != thin
    near = (np.abs(at[:, beside]) <= WITHIN * box.half[beside]).all(1)
    near &= np.abs(at[:, thin]) <= box.half[thin] + evidence.tolerance
    near &= np.abs(evidence.surface_normals @ box.rotation[:, thin]) >= FACING
    heights = at[near, thin]
    return len(heights) >= LEAST and board.thickness < THICKEST and float(heights.std()) <= ONE


def _as_thick(board: Board, likes: list[Board], evidence: Evidence) -> Box:
    """The box of a sheet as thick as the board whose faces are most like it in size, in the place of the sheet, but not
    below what is seen."""
    like = min(likes, key=lambda each: abs(np.log(each.area / board.area)), default=None)
    wanted = min(THICKEST, like.thickness) if like is not None else THICKEST
    half = board.box.half.copy()
    half[board.thin] = max(wanted, board.thickness) / 2
    box = board.box._replace(half=half)
    lowest = float(box.centre[0] - np.abs(box.rotation[0]) @ half)
    below = max(float(evidence.surface[:, 0].min()) - lowest, 0.0)
    return box._replace(centre=box.centre + np.array([below, 0.0, 0.0]))

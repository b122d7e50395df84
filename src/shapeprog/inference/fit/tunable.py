"""The continuous parameters of a program as one vector, and the effect of each on every primitive."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from shapeprog.geometry.scene import Scene
from shapeprog.language.ast import changed_lines
from shapeprog.language.parameters import Kind, Quantity, to_float32
from shapeprog.language.program import Loop, Node, Program
from shapeprog.language.statement import language
from shapeprog.language.tensors import Code, encode
from shapeprog.language.unroll import Plan
from shapeprog.space import HALF

THINNEST = 0.1  # least thickness in cells of any part; the eye takes thinner ones for slivers
STEP = 1e-4
"""Step of differences in cells and degrees: primitives are linear or trigonometric in it, with errors below 1e-10."""

DEGREES, CELLS = 1, 2
"""Decimals that tidy numbers keep: tenths of degrees, hundredths of cells."""


class Poses(NamedTuple):
    """The primitives (N,) of a program, without gradient, and the slopes (N, 16, F) of the sizes, the centre and the
    rotation of each by the numbers of the vector."""

    scene: Scene
    slopes: Float[Tensor, "N 16 F"]


class Tunable:
    """The numbers of a program that may move, as a vector (F,), and the way from such a vector to its primitives.

    Counts, turns and axes stay, and so do steps of a full turn and exact zeros of loops: a run keeps to its axis, and a
    mirror to the middle.  A loop around several statements has its numbers once.
    """

    def __init__(self, program: Program) -> None:
        self.program = program
        nodes = list(program.walk())
        self._code = code = encode(program, dtype=torch.float64)
        # Of every number (F) the index of its node in the order of the text, and its slot there.
        self.moving = [(n, slot) for n, node in enumerate(nodes) for slot in _moving(node)]
        # Of every value its place in the vector, or -1, from two programs that differ in the moving numbers alone.
        places = torch.arange(1, len(self.moving) + 1)
        bare, numbered = (encode(self.with_values(row), dtype=torch.float64).parameters for row in (0 * places, places))
        self._index: Int[Tensor, "K J slots"] = (numbered - bare).long() - 1
        quantities = [language()[nodes[n].name].quantities[slot] for n, slot in self.moving]
        self.kinds: list[Kind] = [quantity.kind for quantity in quantities]
        self.values = torch.tensor([nodes[n].values[slot] for n, slot in self.moving], dtype=torch.float64)
        self.low = torch.tensor([least(quantity) for quantity in quantities], dtype=torch.float64)
        self._once = Plan(code)
        self._plan = self._plan_of(2 * len(self.moving) + 1)
        self.scale = self._scales(nodes, self._once.scene(code.parameters))

    def scene(self, values: Float[Tensor, " F"]) -> Scene:
        """The primitives (N,) where the numbers are these."""
        return self._once.scene(self._filled(values))

    def scenes(self, values: Float[Tensor, "S F"]) -> Scene:
        """The primitives (S, N) where the numbers are each of these."""
        return self._plan_of(len(values)).scene(self._filled(values))

    def poses(self, values: Float[Tensor, " F"]) -> Poses:
        """Primitives and slopes where the numbers are these, by central differences in one batch of programs."""
        count, steps = len(values), STEP * torch.eye(len(values), dtype=values.dtype)
        scenes = self._plan.scene(self._filled(torch.cat([values + steps, values - steps, values[None]])))
        rows = torch.cat([scenes.size, scenes.centre, scenes.rotation.flatten(-2)], -1)
        slopes = (rows[:count] - rows[count:-1]) / (2 * STEP)
        return Poses(scenes[-1], slopes.permute(1, 2, 0).contiguous())

    def settled(self, values: Float[Tensor, " F"]) -> Program:
        """The program with these numbers, rounded."""
        return self.with_values(self.rounded(values))

    def with_values(self, values: Float[Tensor, " F"]) -> Program:
        """The program with these numbers."""
        assert len(values) == len(self.moving)
        new = map(to_float32, values.tolist())

        def changed(node: Node) -> Node:
            moving = {*_moving(node)}
            return replace(node, values=tuple(next(new) if k in moving else v for k, v in enumerate(node.values)))

        return Program(changed_lines(self.program.body, changed), frame=self.program.frame)

    def rounded(self, values: Float[Tensor, " F"]) -> Float[Tensor, " F"]:
        """The numbers with as many decimals as their kind keeps."""
        decimals = (DEGREES if kind == "angle" else CELLS for kind in self.kinds)
        return torch.tensor(list(map(round, values.tolist(), decimals)), dtype=torch.float64)

    def are(self, kind: str) -> Bool[Tensor, " F"]:
        """Which numbers are of a kind."""
        return torch.tensor([item == kind for item in self.kinds], dtype=torch.bool)

    def _plan_of(self, count: int) -> Plan:
        """The plan of so many such programs in one batch."""
        return Plan(Code(*(part.expand(count, *part.shape) for part in (self._code.ids, self._code.parameters))))

    def _filled(self, values: Float[Tensor, "*batch F"]) -> Float[Tensor, "*batch K J slots"]:
        padded = torch.nn.functional.pad(values, (0, 1))  # at index -1
        return torch.where(self._index >= 0, padded[..., self._index], self._code.parameters)

    def _scales(self, nodes: Sequence[Node], scene: Scene) -> Float[Tensor, " F"]:
        """How many cells the surface moves for one unit of each number, at most: 1 for places and lengths, more for
        shifts of many copies, a lever for angles."""
        reach = scene.bounds.norm(dim=-1)
        scale = torch.ones(len(self.moving), dtype=torch.float64)
        for f, (n, _) in enumerate(self.moving):
            node = nodes[n]
            if self.kinds[f] == "shift" and isinstance(node, Loop):
                scale[f] = max(node.count - 1, 1)
            if self.kinds[f] == "angle":
                touched = (self._index == f).flatten(1).any(1)
                scale[f] = float(reach[touched[scene.block]].max()) * np.pi / 180
        return scale


def least(quantity: Quantity) -> float:
    """Lower bound of the numbers of a quantity: a thickness of ``THINNEST`` for lengths."""
    if quantity.kind != "length":
        return -math.inf
    return THINNEST / 2 if quantity.high == HALF else THINNEST


def _moving(node: Node) -> Iterator[int]:
    """The slots of a node that may move."""
    declared = language()[node.name]
    for slot, quantity in enumerate(declared.quantities):
        even = quantity.kind == "angle" and abs(node.values[slot] * node.values[0] - 360) < 0.01
        fixed = declared.is_loop and (node.values[slot] == 0 or even)
        if not quantity.discrete and not fixed:
            yield slot

"""Program generators: the interface that networks implement, their vocabulary, and teacher forcing.

A generator reads the target and the canvas (what earlier blocks drew) and writes one block of up to J = 3 steps
(section 4.1 of the paper).  Networks differ in how they encode the two grids and in how they predict numbers.

Shapes: B programs of K blocks, M live blocks of a batch in row order, J steps, V ids, 7 slots for numbers, F features.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache, reduce
from itertools import accumulate
from operator import or_
from typing import Any, ClassVar, NamedTuple, TypeAlias

import torch
from jaxtyping import Bool, Float, Int, UInt8
from torch import Tensor, nn
from torch.nn.functional import pad

from shapeprog.language.program import PUBLISHED_DEPTH
from shapeprog.language.statement import EMPTY, END, SLOTS, language
from shapeprog.language.tensors import Code
from shapeprog.liang2022.settings import Order

STEPS = PUBLISHED_DEPTH  # steps J of a block: up to two loops and one drawing statement
IDS = END + 1  # number of statement ids V

Ids = Int[Tensor, "*batch"]
Slots = Float[Tensor, "*batch 7"]
Grid = Float[Tensor, "B 32 32 32"]
State: TypeAlias = tuple[Tensor, ...]  # of a network, a row for each program or block; empty before the first
Step: TypeAlias = tuple[Float[Tensor, "M V"], Tensor, State]  # log-probabilities of ids, features of numbers, state


class Vocabulary(NamedTuple):
    """Tables of the 22 statements of the paper."""

    used: Bool[Tensor, "V 7"]  # slots that each id uses
    discrete: Bool[Tensor, "V 7"]  # those that take whole numbers only: counts, quarter turns
    low: Float[Tensor, "V 7"]  # declared range of each slot; zero where it is not used
    high: Float[Tensor, "V 7"]
    legal: Bool[Tensor, "J V+1 V"]  # ids that are legal at a step after a previous id; last row: at the first step


@lru_cache(1)
def vocabulary() -> Vocabulary:
    """The tables of the built-in statements.

    A block is empty, or up to two translations and one drawing statement, or a rotation and a statement with an axis
    of rotation: the legal blocks of Tian et al. 2019.
    """
    statements = [statement for statement in language() if 0 < statement.id < END]
    used, discrete = (torch.zeros(IDS, SLOTS, dtype=torch.bool) for _ in range(2))
    low, high = (torch.zeros(IDS, SLOTS) for _ in range(2))
    for statement in statements:
        for slot, quantity in enumerate(statement.quantities):
            used[statement.id, slot], discrete[statement.id, slot] = True, quantity.discrete
            low[statement.id, slot], high[statement.id, slot] = quantity.low, quantity.high
    draws = [statement.id for statement in statements if not statement.is_loop]
    turning = [statement.id for statement in statements if not statement.is_loop and statement.pivot is not None]
    translate, rotate = (language()[name].id for name in ("translate", "rotate"))
    legal = torch.zeros(STEPS, IDS + 1, IDS, dtype=torch.bool)
    legal[0, IDS, [EMPTY, *(statement.id for statement in statements)]] = True
    legal[1:, [EMPTY, *draws], EMPTY] = True
    legal[1:, translate, draws] = True
    legal[1:-1, translate, translate] = True
    legal[1:, rotate, turning] = True
    return Vocabulary(used, discrete, low, high, legal)


@dataclass(frozen=True)
class TeacherForcingBatch:
    """Targets, canvases and the block to write on each canvas."""

    target: UInt8[Tensor, "B 32 32 32"]  # cells, 1 or 0
    canvases: Int[Tensor, "B K 32 32"]  # packed cells drawn before each block
    previous: Code  # the block written before each canvas; empty before the first
    code: Code  # the block to write; an empty one ends the program
    live: Bool[Tensor, "B K"]  # the canvases to learn from

    def subset(self, canvases_per_shape: int, rng: torch.Generator) -> TeacherForcingBatch:
        """The same with at most so many live canvases of each shape, drawn at random."""
        scores = torch.rand(self.live.shape, generator=rng, device=rng.device).to(self.live.device)
        rank = scores.masked_fill(~self.live, 2.0).argsort(-1).argsort(-1)
        return replace(self, live=self.live & (rank < canvases_per_shape))

    def to(self, device: torch.device) -> TeacherForcingBatch:
        """The same on a device."""
        previous, code = (Code(code.ids.to(device), code.parameters.to(device)) for code in (self.previous, self.code))
        target, canvases, live = (part.to(device) for part in (self.target, self.canvases, self.live))
        return TeacherForcingBatch(target, canvases, previous, code, live)


@dataclass(frozen=True)
class Prediction:
    """Teacher-forced output for the live blocks of a batch: log-probabilities, and features of numbers and blocks."""

    generator: Generator
    batch: TeacherForcingBatch
    ids: Int[Tensor, "M J"]  # of the live blocks
    inputs: Float[Tensor, "M J 7"]  # their numbers in the input, without gradient
    logits: Float[Tensor, "M J V"]
    hidden: Tensor
    feature: Float[Tensor, "M F"]

    @cached_property
    def numbers(self) -> Float[Tensor, "M J 7"]:
        """Numbers that the network predicts for the ids of the input, with gradient to all its weights."""
        return self.generator.numbers(self.hidden, self.ids, self.inputs)

    @cached_property
    def offsets(self) -> Float[Tensor, "M J 7"]:
        """Sub-cell offsets of the surface from these numbers, with gradient; zero for designs without them."""
        return self.generator.offsets(self.hidden, self.ids, self.inputs)

    def scatter(self, rows: Float[Tensor, "M ..."]) -> Float[Tensor, "B K ..."]:
        """Values of live blocks at their positions in the batch, zero elsewhere."""
        live = self.batch.live
        full = rows.new_zeros(*live.shape, *rows.shape[1:])
        return full.masked_scatter(live.reshape(*live.shape, *[1] * (rows.dim() - 1)), rows)

    def log_prob(self) -> Float[Tensor, "B K"]:
        """Log-probability of the ids of each block, zero where it is not live."""
        return self.scatter(self.logits.gather(-1, self.ids[..., None])[..., 0].sum(-1))


class Generator(nn.Module, ABC):
    """A network that writes programs block by block; its settings are a frozen dataclass of JSON values."""

    design: ClassVar[str]
    order: ClassVar[Order] = "coverage"  # of the blocks that it rehearses in adaptation
    Settings: ClassVar[Any]
    feature_width: int
    used: Tensor
    discrete: Tensor
    low: Tensor
    high: Tensor
    legal: Tensor

    def __init__(self, settings: Any) -> None:
        super().__init__()
        self.settings = settings
        self.offset_head: nn.Module | None = None  # of designs that predict offsets
        for name, table in vocabulary()._asdict().items():
            self.register_buffer(name, table.clone(), persistent=False)

    @abstractmethod
    def encode(self, target: Grid, canvas: Grid, previous: Code, state: State) -> tuple[Float[Tensor, "B F"], State]:
        """The feature of the next block and the state after it, from the block (B, J) before, empty for the first."""

    @abstractmethod
    def encode_all(self, batch: TeacherForcingBatch) -> Float[Tensor, "M F"]:
        """Features of all live blocks at once."""

    @abstractmethod
    def step(self, feature: Float[Tensor, "M F"], previous: Code | None, index: int, state: State) -> Step:
        """Step ``index`` of each block after the step before it (ids (M,), numbers (M, 7)); ``None`` at the first."""

    @abstractmethod
    def numbers(self, hidden: Tensor, ids: Ids, inputs: Slots | None, rng: torch.Generator | None = None) -> Slots:
        """Numbers for the ids, with gradient; of designs that predict distributions, given those before, or sampled."""

    @abstractmethod
    def number_loss(self, hidden: Tensor, ids: Ids, values: Slots) -> Slots:
        """Supervised loss of each number: negative log-likelihood, or a squared error."""

    def offsets(self, hidden: Tensor, ids: Ids, inputs: Slots) -> Slots:
        """Offsets of the surface from the numbers, with gradient; the canvas is drawn without them."""
        return torch.zeros_like(inputs)

    def legal_logits(self, scores: Float[Tensor, "M V"], previous: Code | None, index: int) -> Float[Tensor, "M V"]:
        """Log-probabilities over the ids that are legal at a step after the previous one."""
        allowed = self.legal[index, -1:] if previous is None else self.legal[index, previous.ids]
        return scores.float().masked_fill(~allowed, -torch.inf).log_softmax(-1)

    def predict(self, batch: TeacherForcingBatch) -> Prediction:
        """Teacher forcing: the output for given canvases and programs, with gradient."""
        feature, ids = self.encode_all(batch), batch.code.ids[batch.live]
        inputs = batch.code.parameters[batch.live].detach()
        return Prediction(self, batch, ids, inputs, *self.steps(feature, Code(ids, inputs)), feature)

    def steps(self, feature: Float[Tensor, "M F"], block: Code) -> tuple[Float[Tensor, "M J V"], Tensor]:
        """Log-probabilities and hidden features of all steps, each after the steps of the block before it."""
        state: State = ()
        outputs = []
        for j in range(STEPS):
            *output, state = self.step(feature, block[:, j - 1] if j else None, j, state)
            outputs.append(output)
        logits, hidden = (torch.stack(part, 1) for part in zip(*outputs, strict=True))
        return logits, hidden

    def losses(self, prediction: Prediction) -> dict[str, Float[Tensor, ""]]:
        """Cross-entropy of the ids and loss of the numbers in use, as means over live steps."""
        nll = -prediction.logits.gather(-1, prediction.ids[..., None])[..., 0]
        off = self.number_loss(prediction.hidden, prediction.ids, prediction.inputs) * self.used[prediction.ids]
        return {"ids": nll.mean(), "numbers": off.sum(-1).mean()}


def live_blocks(ids: Int[Tensor, "B K J"]) -> Bool[Tensor, "B K"]:
    """Blocks up to and including the first empty one, which ends the program."""
    empty = (ids == EMPTY).all(-1)
    return empty.long().cumsum(-1) - empty.long() == 0


def preceding_blocks(code: Code) -> Code:
    """The block before each block (B, K, J); an empty one before the first."""
    return Code(pad(code.ids[:, :-1], (0, 0, 1, 0)), pad(code.parameters[:, :-1], (0, 0, 0, 0, 1, 0)))


def take(code: Code, block: Int[Tensor, "B L"], keep: Bool[Tensor, "B L"]) -> Code:
    """Blocks of programs in another order, emptied where not kept."""
    row = torch.arange(len(block), device=block.device)[:, None]
    return Code(code.ids[row, block] * keep[..., None], code.parameters[row, block] * keep[..., None, None])


def union(parts: Int[Tensor, "*batch K words R"]) -> Int[Tensor, "*batch words R"]:
    """The packed cells of all parts together."""
    return reduce(or_, parts.unbind(-3))


def preceding(parts: Int[Tensor, "*batch K words R"]) -> Int[Tensor, "*batch K words R"]:
    """For each part, the cells of all parts before it."""
    nothing = torch.zeros_like(parts[..., 0, :, :])
    return torch.stack([*accumulate(parts[..., :-1, :, :].unbind(-3), or_, initial=nothing)], -3)

"""``fast``: a generator for few cores.

Against the published network: the encoder halves the grid at once and keeps positions by reading all cells of its last
layer.  The memory from block to block is a sum over the blocks before, so that all canvases of a batch are encoded at
once, and arg-max decoding does not stand still on a block that draws nothing new.  A number is a distribution over
whole values, autoregressive within a block (as in NADE, Larochelle and Murray, AISTATS 2011), plus a sub-cell offset:
the gradient of a number passes through the mean of the distribution around its mode, that of an offset through a plain
regression; both reach all layers.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor, nn

from shapeprog.errors import ShapeProgError
from shapeprog.geometry.cells import unpack
from shapeprog.language.statement import SLOTS
from shapeprog.language.tensors import Code
from shapeprog.liang2022.generator import IDS, Generator, Grid, Ids, Slots, State, Step, TeacherForcingBatch

WINDOW = 2  # values on either side of the mode over which the mean is taken
LEAST_SMOOTHING = 0.1  # cells; a whole label is as good as not smoothed
LARGEST_OFFSET = 0.95  # cells; below one, so that surface and canvas agree within a cell
LARGEST_SIZE = 1024  # bound of all sizes, so that a damaged file cannot ask for more memory than there is


@dataclass(frozen=True)
class FastSettings:
    """Sizes of the network, and the smoothing of its labels, without which adaptation moves offsets and no numbers."""

    widths: tuple[int, int, int] = (16, 32, 64)  # channels at 16^3, 8^3 and 4^3 cells
    squeeze: int = 48  # channels of the last 4^3 cells, which are read one by one
    feature: int = 256  # width of the block feature, of the step LSTM and of its heads
    low: int = -24  # smallest and largest whole value of a number
    high: int = 40
    smoothing: float = 0.75  # standard deviation of a label in cells

    def __post_init__(self) -> None:
        sizes = (*self.widths, self.squeeze, self.feature, self.high - self.low)
        integers = all(type(size) is int and 0 < size <= LARGEST_SIZE for size in sizes) and type(self.low) is int
        if not integers or abs(self.low) > LARGEST_SIZE or not 0 <= self.smoothing <= LARGEST_SIZE:
            raise ShapeProgError("sizes of the network fast are out of range", f"use numbers up to {LARGEST_SIZE}")


class Fast(Generator):
    """The network; see the module."""

    design = "fast"
    Settings = FastSettings
    offset_head: nn.Sequential
    bins: Tensor
    in_range: Tensor

    def __init__(self, settings: FastSettings) -> None:
        super().__init__(settings)
        fine, middle, coarse = settings.widths
        self.feature_width = width = settings.feature
        bins = settings.high - settings.low + 1
        self.encoder = nn.Sequential(
            _convolution(2, fine, 4, 2), _convolution(fine, middle, 3, 2), _convolution(middle, middle, 3, 1),
            _convolution(middle, coarse, 3, 2), _convolution(coarse, coarse, 3, 1),
            _convolution(coarse, settings.squeeze, 1, 1),
        )  # fmt: skip
        self.summary = nn.Sequential(*_perceptron(settings.squeeze * 64, width, width), nn.ReLU())
        self.id_embedding = nn.Embedding(IDS, width)
        self.number_embedding = nn.Embedding(SLOTS * bins, width)
        self.block_memory = nn.Linear(width, width)
        self.step_lstm = nn.LSTMCell(width, width)
        self.id_head = _perceptron(2 * width, width, IDS)
        self.number_input = nn.Linear(2 * width, width)
        self.number_id = nn.Embedding(IDS, width)
        self.number_slot = nn.Parameter(torch.zeros(SLOTS, width))
        self.number_link = nn.Embedding(SLOTS * bins, width)
        self.number_head, self.offset_head = _perceptron(width, width, bins), _perceptron(width, width, 1)
        for weight in (*self.offset_head[-1].parameters(), *self.block_memory.parameters()):
            nn.init.zeros_(weight)
        for table in (self.number_embedding, self.number_link):
            nn.init.normal_(table.weight, std=0.05)  # up to seven rows are added
        self.register_buffer("bins", torch.arange(settings.low, settings.high + 1.0), persistent=False)
        in_range = (self.bins >= self.low[..., None]) & (self.bins <= self.high[..., None])
        self.register_buffer("in_range", in_range | ~in_range.any(-1, keepdim=True), persistent=False)

    def encode(self, target: Grid, canvas: Grid, previous: Code, state: State) -> tuple[Float[Tensor, "B F"], State]:
        """The block feature; the state is the memory."""
        memory = self._remember(previous) + (state[0] if state else 0)
        return self._encode(torch.stack([target, canvas], 1), memory), (memory,)

    def encode_all(self, batch: TeacherForcingBatch) -> Float[Tensor, "M F"]:
        """Features of the live blocks."""
        target = batch.target[batch.live.nonzero()[:, 0]]
        grids = torch.stack([target, unpack(batch.canvases[batch.live])], 1).to(self.bins.dtype)
        return self._encode(grids, self._remember(batch.previous).cumsum(1)[batch.live])

    def _encode(self, grids: Float[Tensor, "M 2 32 32 32"], memory: Float[Tensor, "M F"]) -> Float[Tensor, "M F"]:
        cells = self.encoder(grids.contiguous(memory_format=torch.channels_last_3d))
        feature: Tensor = self.summary(cells.flatten(1)).float()
        return feature + self.block_memory(memory)

    def _remember(self, block: Code) -> Float[Tensor, "*batch F"]:
        """What a block adds to the memory; an empty one adds nothing."""
        return (self._embed(block) * (block.ids != 0)[..., None]).sum(-2).relu()

    def _embed(self, step: Code) -> Float[Tensor, "*batch F"]:
        """Embedding of steps: their ids and numbers."""
        numbers = self.number_embedding(self._row(step.parameters)) * self.used[step.ids][..., None]
        return self.id_embedding(step.ids) + numbers.sum(-2)

    def step(self, feature: Float[Tensor, "M F"], previous: Code | None, index: int, state: State) -> Step:
        """One step; its hidden features join the LSTM output and the block feature."""
        state = self.step_lstm(feature if previous is None else self._embed(previous), state or None)
        hidden = torch.cat([state[0], feature], -1)
        return self.legal_logits(self.id_head(hidden), previous, index), hidden, state

    def numbers(self, hidden: Tensor, ids: Ids, inputs: Slots | None, rng: torch.Generator | None = None) -> Slots:
        """The mean of the distribution around its mode, the mode of counts and quarter turns, or whole samples."""
        if inputs is None:
            return self._autoregressive(hidden, ids, rng)
        scores = self._scores(self._mixed(hidden, ids, inputs), self.in_range[ids])
        return self._mode(scores, self.discrete[ids]) * self.used[ids]

    def offsets(self, hidden: Tensor, ids: Ids, inputs: Slots) -> Slots:
        """Offsets below one cell that keep numbers in their range; none of counts and quarter turns."""
        free = self.used[ids] & ~self.discrete[ids]
        offset = LARGEST_OFFSET * self.offset_head(self._mixed(hidden, ids, inputs))[..., 0].tanh() * free
        low, high = (self.low[ids] - inputs).clamp(max=0), (self.high[ids] - inputs).clamp(min=0)
        return torch.minimum(torch.maximum(offset, low), high)

    def number_loss(self, hidden: Tensor, ids: Ids, values: Slots) -> Slots:
        """Cross-entropy to a label smoothed over neighbouring whole values, given the numbers before."""
        log_probs = self._scores(self._mixed(hidden, ids, values), self.in_range[ids]).log_softmax(-1)
        inside = torch.minimum(torch.maximum(values, self.low[ids]), self.high[ids])
        width = torch.where(self.discrete[ids], 0.0, self.settings.smoothing).clamp(min=LEAST_SMOOTHING)[..., None]
        label = (-0.5 * ((self.bins - inside[..., None]) / width) ** 2).masked_fill(~self.in_range[ids], -torch.inf)
        return -(label.softmax(-1) * log_probs.clamp(min=-1e4)).sum(-1)

    def _mixed(self, hidden: Tensor, ids: Ids, inputs: Slots) -> Float[Tensor, "*batch 7 F"]:
        """Features of each slot given the numbers of the slots before it."""
        links = self.number_link(self._row(inputs)) * self.used[ids][..., None]
        start = self.number_input(hidden) + self.number_id(ids)
        return (start[..., None, :] + self.number_slot + links.cumsum(-2) - links).relu()

    def _scores(self, mixed: Tensor, in_range: Bool[Tensor, "*batch bins"]) -> Float[Tensor, "*batch bins"]:
        return self.number_head(mixed).float().masked_fill(~in_range, -torch.inf)

    def _mode(self, scores: Float[Tensor, "*batch bins"], discrete: Bool[Tensor, "*batch"]) -> Float[Tensor, "*batch"]:
        """The mean within the window around the mode, or the mode where the value is discrete."""
        mode = scores.argmax(-1, keepdim=True)
        in_window = (torch.arange(scores.shape[-1], device=scores.device) - mode).abs() <= WINDOW
        mean = (scores.masked_fill(~in_window, -torch.inf).softmax(-1) * self.bins).sum(-1)
        return torch.where(discrete, self.bins[mode[..., 0]], mean)

    def _autoregressive(self, hidden: Tensor, ids: Ids, rng: torch.Generator | None) -> Slots:
        """Numbers slot by slot: the mode, or sampled."""
        features = self.number_input(hidden) + self.number_id(ids)
        in_range, used, discrete = self.in_range[ids], self.used[ids], self.discrete[ids]
        values: list[Tensor] = []
        for slot in range(SLOTS):
            if not bool(used[..., slot].any()):  # slots in use come first
                values.append(torch.zeros_like(ids, dtype=self.bins.dtype))
                continue
            scores = self._scores((features + self.number_slot[slot]).relu(), in_range[..., slot, :])
            if rng is None:
                value = self._mode(scores, discrete[..., slot])
            else:
                sample = torch.multinomial(scores.softmax(-1).flatten(0, -2), 1, generator=rng)
                value = self.bins[sample.reshape(scores.shape[:-1])]
            values.append(value * used[..., slot])
            features = features + self.number_link(self._row(values[-1], slot)) * used[..., slot, None]
        return torch.stack(values, -1)

    def _row(self, values: Tensor, slot: int | None = None) -> Int[Tensor, ...]:
        """Row of the embeddings for values (..., 7), or for values (...) of one slot."""
        bins = len(self.bins)
        index = (values.detach().round() - self.settings.low).clamp(0, bins - 1).long()
        return index + bins * (torch.arange(SLOTS, device=values.device) if slot is None else slot)


def _perceptron(inputs: int, width: int, outputs: int) -> nn.Sequential:
    return nn.Sequential(nn.Linear(inputs, width), nn.ReLU(), nn.Linear(width, outputs))


def _convolution(inputs: int, outputs: int, kernel: int, stride: int) -> nn.Sequential:
    """Convolution, batch norm with running statistics, ReLU."""
    convolution = nn.Conv3d(inputs, outputs, kernel, stride, 1 if kernel > 1 else 0, bias=False)
    return nn.Sequential(convolution, nn.BatchNorm3d(outputs, momentum=0.02), nn.ReLU(inplace=True))

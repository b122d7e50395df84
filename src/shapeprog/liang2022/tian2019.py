"""``tian2019``: the program generator of Tian et al. (ICLR 2019), which the paper uses unchanged; 1,417,404 weights.

A 3D convolutional encoder reads target and canvas, a block LSTM runs from block to block and a step LSTM from step to
step; heads on the latter give the ids and, for each id, a row of numbers.  Layers and weight names are those of the
published network, so its checkpoints load.  For departures see :class:`Tian2019Settings`.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
import torch.nn.functional as F
from jaxtyping import Float
from torch import Tensor, nn

from shapeprog.geometry.cells import unpack
from shapeprog.language.statement import SLOTS
from shapeprog.language.tensors import Code
from shapeprog.liang2022.generator import IDS, Generator, Grid, Ids, Prediction, Slots, State, Step, TeacherForcingBatch

WIDTH = 64  # width of the feature, of both LSTMs and of the heads

LAYERS = ((2, 16, 5, 1), (16, 32, 3, 2), (32, 32, 3, 1), (32, 64, 3, 2), (64, 64, 3, 1), (64, 128, 3, 2),
          (128, 128, 3, 1), (128, 128, 3, 1))  # fmt: skip
"""Channels in and out, kernel and stride of each convolution; the padding is half the kernel."""

INITIAL_RANGE = 0.1  # heads and embedding are initialised uniformly between minus and plus this, as published
MOMENTUM = 0.02  # weight of a batch in the running statistics


@dataclass(frozen=True)
class Tian2019Settings:
    """Whether to normalise by the statistics of the batch in evaluation too, and to allow illegal blocks."""

    published: bool = False


PUBLISHED = Tian2019Settings(published=True)


class LSTM(nn.LSTM):
    """An LSTM that stays in training mode, which only dropout tells apart: cuDNN has no backward pass in the other."""

    def train(self, mode: bool = True) -> LSTM:
        """Stay in training mode."""
        return super().train()


class ShapeEncoder(nn.Module):
    """Eight convolutions with batch norm and ReLU, the mean over the last 4^3 cells, and a linear layer."""

    def __init__(self, running_statistics: bool) -> None:
        super().__init__()
        for n, (inputs, outputs, kernel, stride) in enumerate(LAYERS, 1):
            convolution = nn.Conv3d(inputs, outputs, kernel, stride, kernel // 2)
            assert convolution.bias is not None
            convolution.bias.requires_grad_(False)  # cancelled by the normalisation; kept for the published names
            self.add_module(f"conv{n}", convolution)
            norm = nn.BatchNorm3d(outputs, momentum=MOMENTUM, track_running_stats=running_statistics)
            self.add_module(f"BN{n}", norm)
        self.fc = nn.Linear(LAYERS[-1][1], WIDTH)

    def convolve_grid(self, grid: Float[Tensor, "M 32 32 32"], channel: int) -> Float[Tensor, "M 16 32 32 32"]:
        """The first convolution of target or canvas alone: that of the target is the same for all canvases."""
        # A single channel must be last in memory, or torch takes the grids and all that follows for channels first.
        return self._convolve(1, grid[..., None].movedim(-1, 1), slice(channel, channel + 1))

    def _convolve(self, n: int, value: Tensor, channels: slice = slice(None)) -> Tensor:
        convolution = self.get_submodule(f"conv{n}")
        assert isinstance(convolution, nn.Conv3d)
        value = value.contiguous(memory_format=torch.channels_last_3d)
        return F.conv3d(value, convolution.weight[:, channels], None, convolution.stride, convolution.padding)

    def features(self, value: Float[Tensor, "M 16 32 32 32"]) -> Float[Tensor, "M 64"]:
        """Features from the output of the first convolution."""
        for n in range(1, len(LAYERS) + 1):
            value = F.relu(self.get_submodule(f"BN{n}")(value if n == 1 else self._convolve(n, value)), inplace=True)
        return F.relu(self.fc(value.mean((2, 3, 4))))


class StepNet(nn.Module):
    """The step LSTM and its heads."""

    def __init__(self) -> None:
        super().__init__()
        self.pgm_embed = nn.Embedding(IDS, WIDTH)
        self.core = nn.LSTM(WIDTH, WIDTH, bias=False)
        self.logit1 = nn.Linear(WIDTH, WIDTH)
        self.logit2 = nn.Linear(WIDTH, IDS)
        self.regress1 = nn.Linear(WIDTH, WIDTH)
        self.regress2 = nn.Linear(WIDTH + IDS, IDS * SLOTS)
        nn.init.uniform_(self.pgm_embed.weight, -INITIAL_RANGE, INITIAL_RANGE)
        for head in (self.logit1, self.logit2, self.regress1, self.regress2):
            nn.init.uniform_(head.weight, -INITIAL_RANGE, INITIAL_RANGE)
            nn.init.zeros_(head.bias)


def lstm_step(lstm: nn.LSTM, value: Tensor, state: State) -> State:
    """One step of a single-layer LSTM without biases; the state is output and cell, each (M, width)."""
    return torch.lstm_cell(value, state or [value.new_zeros(len(value), lstm.hidden_size)] * 2, *lstm.all_weights[0])


class Tian2019(Generator):
    """The published network; see the module."""

    design, order = "tian2019", "written"
    Settings = Tian2019Settings
    feature_width = WIDTH

    def __init__(self, settings: Tian2019Settings) -> None:
        super().__init__(settings)
        self.shape_feat = ShapeEncoder(running_statistics=not settings.published)
        self.core = LSTM(WIDTH, WIDTH, bias=False, batch_first=True)
        self.inner_net = StepNet()

    def encode(self, target: Grid, canvas: Grid, previous: Code, state: State) -> tuple[Float[Tensor, "B 64"], State]:
        """The block feature; the state holds the first convolution of the target and that of the block LSTM."""
        encoder = self.shape_feat
        of_target = state[0] if state else encoder.convolve_grid(target, 0)
        feature = encoder.features(encoder.convolve_grid(canvas, 1) + of_target)
        lstm = lstm_step(self.core, feature, state[1:])
        return lstm[0].relu(), (of_target, *lstm)

    def encode_all(self, batch: TeacherForcingBatch) -> Float[Tensor, "M 64"]:
        """Features of the live blocks; all canvases before the last live one are encoded, as the LSTM needs them."""
        needed = batch.live.flip(-1).cummax(-1).values.flip(-1)
        shape, dtype = needed.nonzero()[:, 0], self.shape_feat.fc.weight.dtype
        of_target = self.shape_feat.convolve_grid(batch.target.to(dtype), 0)
        of_canvas = self.shape_feat.convolve_grid(unpack(batch.canvases[needed]).to(dtype), 1)
        rows = self.shape_feat.features(of_canvas + of_target[shape])
        features = rows.new_zeros(*needed.shape, WIDTH).masked_scatter(needed[..., None], rows)
        return self.core(features)[0][batch.live].relu()

    def step(self, feature: Float[Tensor, "M 64"], previous: Code | None, index: int, state: State) -> Step:
        """One step; its hidden features are the numbers of every id (M, V, 7), read from the ids without gradient."""
        net = self.inner_net
        state = lstm_step(net.core, feature if previous is None else net.pgm_embed(previous.ids), state)
        scores = net.logit2(net.logit1(state[0]).relu())
        inputs = torch.cat([scores.detach().softmax(-1), net.regress1(state[0]).relu()], -1)
        rows = net.regress2(inputs).unflatten(-1, (IDS, SLOTS))
        logits = scores.log_softmax(-1) if self.settings.published else self.legal_logits(scores, previous, index)
        return logits, rows, state

    def numbers(self, hidden: Tensor, ids: Ids, inputs: Slots | None, rng: torch.Generator | None = None) -> Slots:
        """The row of each id, which is no distribution."""
        return hidden.gather(-2, ids[..., None, None].expand(*ids.shape, 1, SLOTS))[..., 0, :]

    def number_loss(self, hidden: Tensor, ids: Ids, values: Slots) -> Slots:
        """Half the squared error; the target of an unused slot is zero."""
        return 0.5 * (self.numbers(hidden, ids, None) - values * self.used[ids]) ** 2

    def losses(self, prediction: Prediction) -> dict[str, Float[Tensor, ""]]:
        """The published losses, as means over steps and over the numbers in use."""
        used = self.used[prediction.ids]
        off = self.number_loss(prediction.hidden, prediction.ids, prediction.inputs) * used
        return super().losses(prediction) | {"numbers": off.sum() / used.sum().clamp(min=1)}

"""``tian2019``: the program generator of Tian et al. (ICLR 2019), which Liang 2022 uses unchanged.

A 3D convolutional encoder sees target and canvas, an LSTM goes from block to block, another from step to step; heads
on the latter give the ids, and one row of parameters for each id.  Layers and names of the weights are those of the
published network, so its checkpoints load as they are.

*Normalisation.*  The published network normalises by the statistics of the batch, in evaluation too: a prediction
depends on the other shapes of its batch, and a batch of one means little.  Here running statistics are kept in
training and used in evaluation, unless ``statistics="batch"`` asks for the published behaviour.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any, Literal

import torch
import torch.nn.functional as F
from jaxtyping import Bool, Float, Int, UInt8
from torch import Tensor, nn

from shapeprog.errors import ShapeProgError
from shapeprog.geometry.cells import unpack
from shapeprog.language.statement import EMPTY, SLOTS
from shapeprog.language.tensors import Code
from shapeprog.models.generator import Generator, Memory, Prediction, Said, Step, stacked
from shapeprog.models.vocabulary import Vocabulary

WIDTH = 64
"""Width of the feature, of both LSTMs and of the heads."""

LAYERS = ((2, 16, 5, 1), (16, 32, 3, 2), (32, 32, 3, 1), (32, 64, 3, 2), (64, 64, 3, 1), (64, 128, 3, 2),
          (128, 128, 3, 1), (128, 128, 3, 1))  # fmt: skip
"""Channels in and out, kernel and stride of each convolution; the padding is half the kernel."""

SPREAD = 0.1
"""Heads and embedding begin uniform between minus and plus this, as published."""

MOMENTUM = 0.02
"""Share of a batch in the running statistics: a mean over about 50 batches."""


@dataclass(frozen=True)
class Tian2019Settings:
    """What may differ from the published network; ``PUBLISHED`` is that.

    Parameters
    ----------
    statistics
        Whether evaluation normalises by ``running`` statistics or by those of the ``batch`` at each block.
    legal
        Whether ids that no block may have at a step get no probability.
    padding
        Weight of empty steps in the loss of the ids.
    unused
        Weight of parameters that the statement does not use, whose right value is zero.
    """

    statistics: Literal["running", "batch"] = "running"
    legal: bool = True
    padding: float = 1.0
    unused: float = 0.0

    def __post_init__(self) -> None:
        if self.statistics not in ("running", "batch"):
            raise ShapeProgError(f"there are no statistics {self.statistics!r}", "they are 'running' or 'batch'")
        if type(self.legal) is not bool or not all(type(each) in (int, float) for each in (self.padding, self.unused)):
            raise ShapeProgError("legal is true or false, padding and unused are weights", "write numbers such as 0.1")


PUBLISHED = Tian2019Settings(statistics="batch", legal=False, padding=0.1, unused=0.1)
"""The network and the loss as published."""


class ShapeEncoder(nn.Module):
    """Eight convolutions, mean over the remaining 4^3 cells, and a linear layer: target and canvas to 64 features.

    The biases of the convolutions are kept for the sake of the published names only: normalisation takes them out
    again, so they are neither added nor trained.

    Parameters
    ----------
    running
        Whether to keep running statistics and evaluate with them.
    """

    def __init__(self, running: bool) -> None:
        super().__init__()
        for n, (inside, outside, kernel, stride) in enumerate(LAYERS, 1):
            convolution = nn.Conv3d(inside, outside, kernel, stride, kernel // 2)
            assert convolution.bias is not None
            convolution.bias.requires_grad_(False)
            self.add_module(f"conv{n}", convolution)
            self.add_module(f"BN{n}", nn.BatchNorm3d(outside, momentum=MOMENTUM, track_running_stats=running))
        self.fc = nn.Linear(LAYERS[-1][1], WIDTH)

    def forward(self, cells: Float[Tensor, "B 2 32 32 32"]) -> Float[Tensor, "B 64"]:
        """Features of target and canvas, which are the two channels."""
        return self._features(self._convolved(1, cells))

    def of_target(self, target: Float[Tensor, "B 32 32 32"]) -> Float[Tensor, "B 16 32 32 32"]:
        """What the target adds to the first convolution, the same for every canvas."""
        return self._convolved(1, target[..., None].movedim(-1, 1), slice(0, 1))

    def of_canvas(
        self, canvas: Float[Tensor, "B 32 32 32"], known: Float[Tensor, "B 16 32 32 32"]
    ) -> Float[Tensor, "B 64"]:
        """Features of a canvas, given what :meth:`of_target` says of the target."""
        # The new axis last in memory: a single channel is else taken for channels first, and so is what follows.
        first = self._convolved(1, canvas[..., None].movedim(-1, 1), slice(1, 2), shifted=False)
        return self._features(first.add_(known))

    def _features(self, value: Float[Tensor, "B 16 32 32 32"]) -> Float[Tensor, "B 64"]:
        value = self._normalised(1, value)
        for n in range(2, len(LAYERS) + 1):
            value = self._normalised(n, self._convolved(n, value))
        return F.relu(self.fc(value.mean((2, 3, 4)))).to(self.fc.weight.dtype)

    def _convolved(self, n: int, value: Tensor, channels: slice = slice(None), *, shifted: bool = True) -> Tensor:
        """Convolution ``n``; running statistics are folded into its kernel and bias where they are used."""
        convolution, norm = self.get_submodule(f"conv{n}"), self.get_submodule(f"BN{n}")
        assert isinstance(convolution, nn.Conv3d)
        assert isinstance(norm, nn.BatchNorm3d)
        kernel, bias = convolution.weight[:, channels], None
        if self._folds(norm):
            assert norm.running_mean is not None
            assert norm.running_var is not None
            scale = norm.weight * (norm.running_var + norm.eps).rsqrt()
            kernel = kernel * scale[:, None, None, None, None]
            bias = norm.bias - norm.running_mean * scale if shifted else None
        value = value.contiguous(memory_format=torch.channels_last_3d)
        return F.conv3d(value, kernel, bias, convolution.stride, convolution.padding)

    def _normalised(self, n: int, value: Tensor) -> Tensor:
        norm = self.get_submodule(f"BN{n}")
        return F.relu(value if self._folds(norm) else norm(value), inplace=True)

    def _folds(self, norm: nn.Module) -> bool:
        return not self.training and norm.running_mean is not None


class StepNet(nn.Module):
    """The step LSTM and its heads: ids, and for each id a row of parameters.

    Parameters
    ----------
    ids
        Number of ids V.
    """

    def __init__(self, ids: int) -> None:
        super().__init__()
        self.pgm_embed = nn.Embedding(ids, WIDTH)
        self.core = nn.LSTM(WIDTH, WIDTH, bias=False)
        self.logit1 = nn.Linear(WIDTH, WIDTH)
        self.logit2 = nn.Linear(WIDTH, ids)
        self.regress1 = nn.Linear(WIDTH, WIDTH)
        self.regress2 = nn.Linear(WIDTH + ids, ids * SLOTS)
        nn.init.uniform_(self.pgm_embed.weight, -SPREAD, SPREAD)
        for head in (self.logit1, self.logit2, self.regress1, self.regress2):
            nn.init.uniform_(head.weight, -SPREAD, SPREAD)
            nn.init.zeros_(head.bias)

    def forward(
        self, feature: Float[Tensor, "M 64"], previous: Int[Tensor, " M"] | None, state: tuple[Tensor, Tensor] | None
    ) -> tuple[Float[Tensor, "M V"], Float[Tensor, "M V 7"], tuple[Tensor, Tensor]]:
        """Scores of the ids, parameters for every id, and the state after the step.

        The first step hears the feature of the block, later ones the id before; the parameters are told the
        probabilities of the ids, without gradient.
        """
        heard = feature if previous is None else self.pgm_embed(previous)
        state = advance(self.core, heard, state)
        scores = self.logit2(self.logit1(state[0]).relu())
        mixed = torch.cat([scores.detach().softmax(-1), self.regress1(state[0]).relu()], -1)
        return scores, self.regress2(mixed).unflatten(-1, (-1, SLOTS)), state


def advance(core: nn.LSTM, heard: Tensor, state: tuple[Tensor, Tensor] | None) -> tuple[Tensor, Tensor]:
    """One step of an LSTM of one layer; its state is the output and the cell, each (M, width)."""
    if state is None:
        zero = heard.new_zeros(len(heard), core.hidden_size)
        state = (zero, zero)
    of_input, of_output = core.all_weights[0]
    return torch.lstm_cell(heard, state, of_input, of_output)


class Tian2019(Generator):
    """The network; see the module.  1,417,404 parameters for the built-in statements."""

    design = "tian2019"
    Settings = Tian2019Settings

    def __init__(self, settings: Tian2019Settings, vocabulary: Vocabulary) -> None:
        super().__init__(settings, vocabulary)
        self.by_batch = settings.statistics == "batch"
        self.shape_feat = ShapeEncoder(running=not self.by_batch)
        self.core = nn.LSTM(WIDTH, WIDTH, bias=False, batch_first=True)
        self.inner_net = StepNet(vocabulary.size)
        self.used: Tensor
        self.register_buffer("used", vocabulary.used, persistent=False)

    def perceive(
        self, target: Float[Tensor, "B 32 32 32"], canvas: Float[Tensor, "B 32 32 32"], memory: Memory
    ) -> tuple[Float[Tensor, "B F"], Memory]:
        """The memory is what the first layer makes of the target, and the state of the block LSTM."""
        dtype = self.shape_feat.fc.weight.dtype
        known = self.shape_feat.of_target(target.to(dtype)) if memory is None else memory[0]
        feature = self.shape_feat.of_canvas(canvas.to(dtype), known)
        with torch.autocast(feature.device.type, enabled=False):
            state = advance(self.core, feature, None if memory is None else memory[1:])
        return state[0].relu(), (known, *state)

    def perceive_all(
        self, target: UInt8[Tensor, "B 32 32 32"], canvases: Int[Tensor, "B K 32 32"], live: Bool[Tensor, "B K"]
    ) -> Float[Tensor, "M F"]:
        """Features of the live blocks: encoded together, or block by block where statistics are those of the batch."""
        # The LSTM needs every block before a live one.
        needed = live.flip(-1).cummax(-1).values.flip(-1)
        dtype = self.shape_feat.fc.weight.dtype
        if self.by_batch:
            pairs = ([target, unpack(canvas)] for canvas in canvases.unbind(1))
            features = torch.stack([self.shape_feat(torch.stack(pair, 1).to(dtype)) for pair in pairs], 1)
        else:
            each = self.shape_feat(stacked(target, canvases, needed, dtype))
            features = each.new_zeros(*needed.shape, WIDTH).masked_scatter(needed[..., None], each)
        with torch.autocast(features.device.type, enabled=False):
            return self.core(features)[0][live].relu()

    def step(self, feature: Float[Tensor, "M F"], previous: Said | None, step: int, state: Any) -> Step:
        """One step; the heads are the parameters for every id (M, V, 7)."""
        before = None if previous is None else previous.ids
        with torch.autocast(feature.device.type, enabled=False):
            scores, heads, state = self.inner_net(feature, before, state)
            logits = self.masked(scores, step, before) if self.settings.legal else scores.log_softmax(-1)
        return Step(logits, heads, state)

    def values(
        self, heads: Tensor, ids: Int[Tensor, "*batch"], told: Float[Tensor, "*batch 7"] | None = None
    ) -> Float[Tensor, "*batch 7"]:
        """The row of each id."""
        row = ids[..., None, None].expand(*ids.shape, 1, SLOTS)
        return heads.gather(-2, row)[..., 0, :]

    def parameter_loss(
        self, heads: Tensor, ids: Int[Tensor, "*batch"], values: Float[Tensor, "*batch 7"]
    ) -> Float[Tensor, "*batch 7"]:
        """Half the squared error; the right value of a slot that is not used is zero."""
        return 0.5 * (self.values(heads, ids) - values * self.used[ids]) ** 2

    def predict(
        self,
        target: UInt8[Tensor, "B 32 32 32"],
        canvases: Int[Tensor, "B K 32 32"],
        code: Code,
        live: Bool[Tensor, "B K"] | None = None,
    ) -> Prediction:
        """As for every generator; all blocks are live by default where statistics are those of the batch."""
        if live is None and self.by_batch:
            live = torch.ones(code.ids.shape[:2], dtype=torch.bool, device=code.ids.device)
        return super().predict(target, canvases, code, live)

    def losses(
        self, prediction: Prediction, code: Code, weights: Float[Tensor, "B K"] | None = None
    ) -> dict[str, Float[Tensor, ""]]:
        """The published losses: weighted means over steps, and over parameters."""
        ids, values = code.ids[prediction.live], code.parameters[prediction.live]
        share = prediction.live.float() if weights is None else weights
        share = share[prediction.live][:, None]
        surprise = -prediction.logits.gather(-1, ids[..., None])[..., 0]
        counts = torch.where(ids == EMPTY, self.settings.padding, 1.0) * share
        off = self.parameter_loss(prediction.heads, ids, values)
        slots = torch.where(self.used[ids], 1.0, self.settings.unused) * share[..., None]
        return {
            "ids": (surprise * counts).sum() / counts.sum().clamp(min=1e-6),
            "parameters": (off * slots).sum() / slots.sum().clamp(min=1e-6),
        }


Told = tuple[UInt8[Tensor, "B 32 32 32"], Int[Tensor, "B K 32 32"], Bool[Tensor, "B K"]]
"""Targets, packed canvases, and which blocks count."""


@torch.no_grad()
def calibrated(generator: Tian2019, batches: Iterable[Told]) -> Tian2019:
    """The same weights with running statistics: the mean of those of the batches, as after training.

    Published weights have none, and every prediction depends on its batch; with those of many shapes it does not.
    """
    settings = replace(generator.settings, statistics="running")
    made = Tian2019(settings, generator.vocabulary)
    made.load_state_dict(generator.state_dict(), strict=False)  # all but the statistics
    norms = [each for each in made.modules() if isinstance(each, nn.BatchNorm3d)]
    for norm in norms:
        norm.momentum = None  # a plain mean
    made.train()
    for target, canvases, live in batches:
        made.perceive_all(target, canvases, live)
    for norm in norms:
        norm.momentum = MOMENTUM
    return made.eval()

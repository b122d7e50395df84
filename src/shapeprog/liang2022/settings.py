"""Settings of training, saved with every run so that it can be resumed; command line options are made from them.

Nothing heavy is imported here.  Shapes are counted each time they are seen.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from typing import Any, ClassVar, Literal, get_args, get_origin, get_type_hints

from shapeprog.errors import ShapeProgError

NEURAL = "neural"
"""Reserved name of the loss through the neural executor, which compares predictions and not scenes."""


@dataclass(frozen=True, kw_only=True)
class TrainingSettings:
    """Settings of every kind of training.

    Parameters
    ----------
    num_shapes
        Shapes to learn from.
    batch_size
        Shapes of one step in each process.
    learning_rate
        Largest learning rate of Adam.
    schedule
        cosine: to zero at the end; constant.
    warm_up
        Shapes over which the learning rate rises from zero.
    weight_decay
        Decoupled weight decay.
    beta1
        Decay rate of the first moment of Adam; that of the second is 0.999.
    clip_norm
        Bound of the norm of the gradient; 0 for none.
    clip_value
        Bound of each element of the gradient; 0 for none.
    precision
        float32, or bf16 for convolutions and matrix products.
    seed
        Seed of the initial weights, the data and every sample.
    validate_every
        Shapes between validations; 0 for one at the end.
    """

    num_shapes: int = 100_000
    batch_size: int = 32
    learning_rate: float = 1e-3
    schedule: Literal["cosine", "constant"] = "cosine"
    warm_up: int = 0
    weight_decay: float = 0.0
    beta1: float = 0.9
    clip_norm: float = 0.0
    clip_value: float = 0.0
    precision: Literal["float32", "bf16"] = "float32"
    seed: int = 0
    validate_every: int = 0

    MAY_CHANGE: ClassVar[frozenset[str]] = frozenset({"num_shapes", "validate_every"})
    """Settings that a resumed run may change."""

    def __post_init__(self) -> None:
        hints = get_type_hints(type(self))
        for field in fields(self):
            value = getattr(self, field.name)
            if get_origin(hints[field.name]) is Literal and value not in get_args(hints[field.name]):
                choices = ", ".join(get_args(hints[field.name]))
                raise ShapeProgError(f"unknown {field.name} {value!r}", f"choose one of {choices}")
            if isinstance(value, (int, float)) and not (math.isfinite(value) and value >= 0):
                raise ShapeProgError(f"{field.name} is {value}", "give a number that is not negative")
        for name in ("num_shapes", "batch_size"):
            if getattr(self, name) < 1:
                raise ShapeProgError(f"{name} is {getattr(self, name)}", "give 1 or more")

    def learning_rate_at(self, samples_seen: int) -> float:
        """Learning rate after so many shapes."""
        if samples_seen < self.warm_up:
            return self.learning_rate * (samples_seen + 1) / self.warm_up
        if self.schedule == "constant":
            return self.learning_rate
        progress = min(1.0, (samples_seen - self.warm_up) / max(1, self.num_shapes - self.warm_up))
        return self.learning_rate * 0.5 * (1 + math.cos(math.pi * progress))

    def to_json(self) -> dict[str, Any]:
        """All settings as JSON."""
        return {name: list(value) if isinstance(value, tuple) else value for name, value in asdict(self).items()}

    def check_resumable(self, saved: Mapping[str, Any], folder: str) -> None:
        """Raise a ``ShapeProgError`` that names the settings which differ from those of a saved run."""
        current = self.to_json()
        changed = [name for name in current if name not in self.MAY_CHANGE and saved.get(name) != current[name]]
        if changed:
            detail = "; ".join(f"{name} was {saved.get(name)!r}, is now {current[name]!r}" for name in changed)
            raise ShapeProgError(
                f"the run in {folder} has other settings: {detail}",
                "give the same settings, choose another folder, or start over with --restart",
            )


@dataclass(frozen=True, kw_only=True)
class PretrainSettings(TrainingSettings):
    """Settings of supervised pretraining on synthetic shapes.

    Parameters
    ----------
    design
        Network: fast or tian2019.
    prior
        Synthetic shapes: narrow (the published ones) or wide.
    initial
        Weights to start from; random ones by default.
    order
        Order of the blocks: coverage or written.
    canvases_per_shape
        Canvases learned from in each shape, drawn at random; 0 for all.
    scheduled_sampling
        Probability of canvases that the generator draws itself, reached halfway.
    number_weight
        Weight of the loss of numbers against that of ids.
    val
        Packs of real shapes to validate on.
    """

    batch_size: int = 48
    learning_rate: float = 2e-3
    warm_up: int = 4800
    weight_decay: float = 0.01
    clip_norm: float = 1.0
    validate_every: int = 20_000
    design: Literal["fast", "tian2019"] = "fast"
    prior: Literal["narrow", "wide"] = "narrow"
    initial: str = ""
    order: Literal["coverage", "written"] = "coverage"
    canvases_per_shape: int = 3
    scheduled_sampling: float = 0.3
    number_weight: float = 1.0
    val: tuple[str, ...] = ()

    MAY_CHANGE = TrainingSettings.MAY_CHANGE | {"val"}


@dataclass(frozen=True, kw_only=True)
class ExecutorSettings(TrainingSettings):
    """Settings of the neural executor's training; a shape is one block.

    Parameters
    ----------
    prior
        Synthetic shapes whose blocks are drawn.
    widened
        Share of the blocks whose numbers are moved at random.
    """

    num_shapes: int = 120_000
    batch_size: int = 16
    learning_rate: float = 3e-3
    warm_up: int = 3200
    beta1: float = 0.5
    validate_every: int = 20_000
    prior: Literal["narrow", "wide"] = "narrow"
    widened: float = 0.5


@dataclass(frozen=True, kw_only=True)
class AdaptSettings(TrainingSettings):
    """Settings of adaptation to real shapes.

    Parameters
    ----------
    train
        Packs of the shapes to adapt to.
    val
        Packs to validate on.
    initial
        Weights to start from: a file or the name of weights that ship.
    loss
        Losses and weights, such as chamfer=1,occupancy=0.3.
    executor
        Weights of the neural executor, for the loss neural.
    learn
        all weights; offsets: the sub-cell offsets alone, a shortcut that is not the paper's.
    decoder
        How programs are written in training: argmax, novel or select.
    decoded_ids
        Weight of the cross-entropy to the ids of the decoded programs, as in self-training.
    kl
        Weight of the KL divergence of the ids from those of the initial weights.
    rehearsal
        Synthetic shapes in every step, so that pretraining is not forgotten.
    prior
        Where these come from.
    estimator
        Gradient estimator of the ids: none, nvil or rloo.
    estimator_weight
        Weight of its loss.
    num_samples
        Programs that rloo samples for each shape.
    points
        Points on each surface in one step.
    select_by
        What the best weights have on the validation packs: cd or iou.
    val_decoder
        How programs are written in validation.
    """

    num_shapes: int = 1_600
    batch_size: int = 16
    learning_rate: float = 3e-4
    warm_up: int = 160
    clip_norm: float = 1.0
    train: tuple[str, ...] = ()
    val: tuple[str, ...] = ()
    initial: str = "fast-wide"
    loss: str = "chamfer"
    executor: str = "executor"
    learn: Literal["all", "offsets"] = "all"
    decoder: Literal["argmax", "novel", "select"] = "select"
    decoded_ids: float = 1.0
    kl: float = 0.0
    rehearsal: int = 8
    prior: Literal["narrow", "wide"] = "wide"
    estimator: Literal["none", "nvil", "rloo"] = "none"
    estimator_weight: float = 1.0
    num_samples: int = 4
    points: int = 1000
    select_by: Literal["cd", "iou"] = "cd"
    val_decoder: Literal["argmax", "novel", "select"] = "novel"

    MAY_CHANGE = TrainingSettings.MAY_CHANGE | {"val", "select_by", "val_decoder"}

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.train:
            raise ShapeProgError("there are no shapes to adapt to", "give a pack: --train bench_train.npz")
        if self.estimator == "rloo" and self.num_samples < 2:
            raise ShapeProgError("rloo needs two samples or more", "give --num-samples 4")
        if self.learn == "offsets" and self.estimator != "none":
            raise ShapeProgError("ids cannot learn where offsets alone do", "use --learn all")


METHODS: Mapping[str, Mapping[str, Any]] = {
    "direct": {},
    "guided": {"loss": f"{NEURAL}=30"},
    "hybrid": {"loss": f"chamfer=1,{NEURAL}=10"},
}
"""Settings of each method; others are the defaults of :class:`AdaptSettings`."""

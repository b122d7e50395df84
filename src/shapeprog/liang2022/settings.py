"""Settings of training, saved with every run and made into options; shapes are counted each time they are seen."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any, ClassVar, Literal, get_args, get_origin, get_type_hints

from shapeprog.arguments import check_number
from shapeprog.errors import ShapeProgError

NEURAL = "neural"  # reserved name of the loss through the neural executor, which compares predictions and not scenes
METHODS = {"direct": "chamfer", "guided": f"{NEURAL}=30", "hybrid": f"chamfer=1,{NEURAL}=10"}  # their losses
STATE, WEIGHTS, BEST, LOG = "state.pt", "weights.safetensors", "best.safetensors", "log.jsonl"  # files of a run
Decoder = Literal["argmax", "novel", "select"]  # how programs are written; see decode.py
AT_LEAST_ONE, SHARES = ("num_shapes", "batch_size", "points"), ("beta1", "scheduled_sampling", "widened")
Order = Literal["coverage", "written"]  # of the blocks in teacher forcing; see pretrain.py


def option(default: Any, meaning: str) -> Any:
    """A field of settings with its meaning, the help of its option, which a class keeps that changes the default."""
    return field(default=default, metadata={"help": meaning})


@dataclass(frozen=True, kw_only=True)
class TrainingSettings:
    """Settings of every kind of training."""

    num_shapes: int = option(100_000, "Shapes to learn from.")
    batch_size: int = option(32, "Shapes of one step in each process.")
    learning_rate: float = option(1e-3, "Largest learning rate of Adam; it falls to zero by half a cosine.")
    warm_up: int = option(0, "Shapes over which the learning rate rises from zero.")
    weight_decay: float = option(0.0, "Decoupled weight decay.")
    beta1: float = option(0.9, "Decay rate of the first moment of Adam; that of the second is 0.999.")
    clip_norm: float = option(0.0, "Bound of the norm of the gradient; 0 for none.")
    seed: int = option(0, "Seed of the initial weights, the data and every sample.")
    validate_every: int = option(0, "Shapes between validations; 0 for one at the end.")

    MAY_CHANGE: ClassVar[frozenset[str]] = frozenset({"num_shapes", "validate_every", "val"})  # by a resumed run

    def __post_init__(self) -> None:
        hints = get_type_hints(type(self))
        for name, value in asdict(self).items():
            if get_origin(hints[name]) is Literal and value not in get_args(hints[name]):
                raise ShapeProgError(f"unknown {name} {value!r}", f"choose one of {', '.join(get_args(hints[name]))}")
            if hints[name] in (int, float, float | None):
                low, high = name in AT_LEAST_ONE, 1 if name in SHARES else math.inf
                check_number(name, value, low, high, whole=hints[name] is int)
            else:
                items = value if isinstance(value, list | tuple) else (value,)
                is_tuple = get_origin(hints[name]) is tuple
                texts = tuple(os.fspath(item) if isinstance(item, os.PathLike) else item for item in items)
                if is_tuple == (items is not value) or not all(isinstance(item, str) for item in texts):
                    expected = "tuple of paths, such as ('x.npz',)" if is_tuple else "text"
                    raise ShapeProgError(f"{name} is {value!r}", f"give a {expected}")
                object.__setattr__(self, name, texts if is_tuple else texts[0])
        if self.beta1 == 1:
            raise ShapeProgError("beta1 is 1", "give a number of 0 or more, below 1")

    def learning_rate_at(self, samples_seen: int) -> float:
        """Learning rate after so many shapes."""
        if samples_seen < self.warm_up:
            return self.learning_rate * (samples_seen + 1) / self.warm_up
        progress = min(1.0, (samples_seen - self.warm_up) / max(1, self.num_shapes - self.warm_up))
        return self.learning_rate * 0.5 * (1 + math.cos(math.pi * progress))

    def check_resumable(self, saved: Mapping[str, Any], folder: str) -> None:
        """Raise a ``ShapeProgError`` that names the settings which differ from those of a saved run."""
        current = {name: value for name, value in asdict(self).items() if name not in self.MAY_CHANGE}
        changed = [f"{k} was {saved.get(k)!r}, is now {v!r}" for k, v in current.items() if saved.get(k) != v]
        if changed:
            cure = "give the same settings, choose another folder, or start over with --restart"
            raise ShapeProgError(f"the run in {folder} has other settings: {'; '.join(changed)}", cure)


@dataclass(frozen=True, kw_only=True)
class PretrainSettings(TrainingSettings):
    """Settings of supervised pretraining on synthetic shapes."""

    num_shapes: int = 45_000
    batch_size: int = 24
    learning_rate: float = 2e-3
    warm_up: int = 2400
    weight_decay: float = 0.01
    clip_norm: float = 1.0
    validate_every: int = 15_000
    design: Literal["fast", "tian2019"] = option("fast", "Network: fast or tian2019.")
    prior: Literal["narrow", "wide"] = option("narrow", "Synthetic shapes: narrow (the published ones) or wide.")
    initial: str = option("", "Weights to start from; random ones by default.")
    order: Order = option("coverage", "Order of the blocks: coverage or written.")  # noqa: RUF009  # it is a field
    canvases_per_shape: int = option(3, "Canvases learned from in each shape, drawn at random; 0 for all.")
    scheduled_sampling: float = option(0.3, "Probability of canvases that the generator draws, reached halfway.")
    number_weight: float = option(1.0, "Weight of the loss of numbers against that of ids.")


@dataclass(frozen=True, kw_only=True)
class ExecutorSettings(TrainingSettings):
    """Settings of the neural executor's training; a shape is one block."""

    num_shapes: int = 200_000
    batch_size: int = 16
    learning_rate: float = 3e-3
    warm_up: int = 3200
    beta1: float = 0.5
    validate_every: int = 20_000
    prior: Literal["narrow", "wide"] = option("narrow", "Synthetic shapes whose blocks are drawn.")
    widened: float = option(0.5, "Share of the blocks whose numbers are moved at random.")


@dataclass(frozen=True, kw_only=True)
class AdaptSettings(TrainingSettings):
    """Settings of adaptation to real shapes."""

    num_shapes: int = 1_600
    batch_size: int = 16
    learning_rate: float = 3e-4
    warm_up: int = 160
    clip_norm: float = 1.0
    train: tuple[str, ...] = option((), "Packs of the shapes to adapt to.")
    val: tuple[str, ...] = option((), "Packs to validate on; the best weights have the least CD there.")
    initial: str = option("fast-wide", "Weights to start from: a file or the name of weights that ship.")
    method: Literal["direct", "guided", "hybrid"] = option(
        "direct", "Adaptation by losses of the scene (direct), neural (guided) or both (hybrid)."
    )
    loss: str = option(
        "", "Losses and their weights, such as chamfer=1,soft_iou=3; they must suit --method, which sets the default."
    )
    executor: str = option("executor", "Weights of the neural executor, for the loss neural.")
    learn: Literal["all", "offsets"] = option("all", "all weights, or offsets alone, which is not the paper's way.")
    decoder: Decoder = option("select", "Decoder: argmax, novel or select; with an estimator in validation alone.")  # noqa: RUF009
    decoded_ids: float | None = option(
        None, "Weight of the cross-entropy to decoded ids (self-training) [1.0; 0.0 with an estimator]"
    )
    kl: float = option(0.0, "Weight of the KL divergence of the ids from those of the initial weights.")
    rehearsal: int = option(8, "Synthetic shapes in every step, so that pretraining is not forgotten.")
    prior: Literal["narrow", "wide"] = option("wide", "Synthetic shapes to rehearse: narrow or wide.")
    estimator: Literal["none", "nvil", "rloo"] = option("none", "Gradient estimator of the ids: none, nvil or rloo.")
    points: int = option(1000, "Points on each surface in one step.")

    def __post_init__(self) -> None:
        if self.decoded_ids is None:
            object.__setattr__(self, "decoded_ids", 1.0 if self.estimator == "none" else 0.0)
        super().__post_init__()
        if self.decoded_ids and self.estimator != "none":
            raise ShapeProgError("an estimator samples ids, so that none are decoded", "leave --decoded-ids out")
        if not self.train:
            raise ShapeProgError("there are no shapes to adapt to", "give a pack: --train bench_train.npz")
        if self.learn == "offsets" and self.estimator != "none":
            raise ShapeProgError("ids cannot learn where offsets alone do", "use --learn all")

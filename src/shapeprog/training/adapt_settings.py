"""What adaptation is told, and the methods as settings."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, Literal

from shapeprog.errors import ShapeProgError
from shapeprog.training.settings import Settings
from shapeprog.training.terms import NEURAL, parse_terms


@dataclass(frozen=True, kw_only=True)
class AdaptSettings(Settings):
    """What adaptation is told, besides what every training is.

    Parameters
    ----------
    packs
        Files of the shapes to adapt to.
    loss
        Terms and weights, as ``chamfer=1,occupancy=0.3``; empty to learn from labels alone.
    executor
        Weights of the neural executor, for the term ``neural``.
    ids
        How ids learn from the terms: ``none``, or an estimator of :mod:`shapeprog.training.choices`.
    cost
        What ids are judged by: ``loss``, the logarithm of the terms; or ``iou``, one minus the IoU of the cells.
    ids_weight
        How much the estimator counts.
    tries
        Programs that ``rloo`` samples for each shape; blocks that ``expected`` looks at in each place.
    learn
        ``all`` weights, or those of the ``offsets`` alone: programs stay as they are but for their last fraction of a
        cell.
    choose
        How programs are written where ids are not sampled: of the likeliest blocks the one that helps most
        (``drawn``), or the likeliest (``argmax``).
    points
        Points of the target, points on the prediction, and cells, that one step looks at in each shape.
    mirror
        Share of the shapes that are mirrored left to right.
    blocks
        Most blocks of a program.
    select
        What the best weights have on the validation packs: the highest ``iou`` or the lowest ``cd``.
    labels
        Files or folders of programs for the shapes.
    labels_weight
        How much they count beside the terms.
    form
        The ``snapped`` programs or the ``program`` as it is.
    taught
        Programs that are taught in one step.
    synthetic, prior
        Share of these that are synthetic, so that nothing is forgotten, and where they come from.
    perturbed, jitter
        Share of the labels whose parameters are moved by a cell, each with the chance ``jitter``, and drawn anew.
    sampled
        Share of the steps that teach on canvases which the generator draws itself, reached halfway.
    rows
        Canvases that are learned from in each program, drawn at random; 0 for all.
    statistics
        Whether normalisation keeps its statistics ``frozen`` while labels are taught, or ``moving``.
    """

    rate: float = 1e-4
    clip: float = 1.0
    precision: Literal["bf16", "float32"] = "bf16"
    packs: tuple[str, ...] = ()
    loss: str = ""
    executor: str = ""
    ids: Literal["none", "nvil", "rloo", "expected"] = "none"
    cost: Literal["loss", "iou"] = "loss"
    ids_weight: float = 1.0
    tries: int = 4
    learn: Literal["all", "offsets"] = "all"
    choose: Literal["drawn", "argmax"] = "drawn"
    points: int = 1000
    mirror: float = 0.0
    blocks: int = 10
    select: Literal["iou", "cd"] = "iou"
    labels: tuple[str, ...] = ()
    labels_weight: float = 1.0
    form: Literal["snapped", "program"] = "snapped"
    taught: int = 32
    synthetic: float = 0.25
    prior: str = "wide"
    perturbed: float = 0.3
    jitter: float = 0.3
    sampled: float = 0.25
    rows: int = 0
    statistics: Literal["frozen", "moving"] = "moving"

    CHOICES: ClassVar[Mapping[str, tuple[str, ...]]] = {
        **Settings.CHOICES, "ids": ("none", "nvil", "rloo", "expected"), "cost": ("loss", "iou"),
        "select": ("iou", "cd"), "form": ("snapped", "program"), "choose": ("drawn", "argmax"),
        "learn": ("all", "offsets"),
        "statistics": ("frozen", "moving"),
    }  # fmt: skip
    MAY_CHANGE: ClassVar[frozenset[str]] = Settings.MAY_CHANGE | {"select"}

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("mirror", "synthetic", "perturbed", "jitter", "sampled"):
            if not 0 <= getattr(self, name) <= 1:
                raise ShapeProgError(f"{name} is {getattr(self, name)}", "give a share between 0 and 1")
        for name, least in (("points", 1), ("blocks", 1), ("taught", 1), ("tries", 2), ("rows", 0)):
            if getattr(self, name) < least:
                raise ShapeProgError(f"{name} is {getattr(self, name)}", f"give {least} or more")
        if NEURAL in self.terms and not self.executor:
            raise ShapeProgError(
                f"the loss {NEURAL} needs a neural executor", "give weights made by 'shapeprog train-executor'"
            )
        if not self.terms and not self.labels:
            raise ShapeProgError("there is nothing to learn from", "give a loss, or labels, or both")
        if self.learn == "offsets" and (self.ids != "none" or self.labels):
            raise ShapeProgError(
                "ids and labels cannot be learned where offsets alone learn", "let all weights learn: --learn all"
            )
        if self.ids != "none" and not self.terms:
            raise ShapeProgError("ids are judged by a loss, and there is none", "give one, such as --loss chamfer")

    @property
    def terms(self) -> dict[str, float]:
        """The terms of the loss and their weights."""
        return parse_terms(self.loss) if self.loss else {}


OFFSETS = {"learn": "offsets", "rate": 1e-3, "warm_up": 320, "select": "cd"}
"""Settings with which offsets are learned."""

METHODS: Mapping[str, Mapping[str, object]] = {
    "guided": {
        "loss": NEURAL, "rate": 2e-5, "decay": 1e-5, "clip": 0.1, "clip_by": "value", "schedule": "constant",
        "precision": "float32", "select": "cd", "choose": "argmax",
    },
    "direct": {"loss": "chamfer", **OFFSETS},
    "hybrid": {"loss": f"chamfer=1,{NEURAL}=10", **OFFSETS},
    "distill": {"loss": "", "rate": 1e-3, "optimiser": "adamw", "decay": 0.01, "warm_up": 1600},
}  # fmt: skip
"""Settings of each method: those of guided adaptation as published by Tian et al. 2019, the others ours."""

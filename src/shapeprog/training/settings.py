"""What a training run is told; kept with its state, so that it goes on as it was begun."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import MISSING, asdict, dataclass, fields
from typing import Any, ClassVar, Literal

import torch
from torch import Tensor, nn

from shapeprog.errors import ShapeProgError


@dataclass(frozen=True, kw_only=True)
class Settings:
    """What every kind of training has in common.

    Parameters
    ----------
    visits
        Shapes to learn from, the same one counted each time it is seen.
    batch
        Shapes of one step in each process.
    rate
        Largest rate of learning.
    schedule
        ``cosine``: up over ``warm_up``, then along a cosine to zero at the end; ``constant``: up, then level;
        ``steps``: up, then a fifth of it after 2/3 and a fifth of that after 5/6 of the visits.
    warm_up
        Visits over which the rate rises from zero.
    optimiser
        ``adam`` adds the decay to the gradient, ``adamw`` takes it off the weights.
    betas
        Decay of the optimiser's two averages.
    decay
        Weight decay.
    clip
        Bound of the gradient; 0 for none.
    clip_by
        ``norm``: of the whole gradient; ``value``: of each element.
    precision
        ``bf16``: convolutions and matrix products in 16 bits, everything else and the weights in 32; or ``float32``.
    seed
        Of the first weights, the data and every choice.
    validate_every
        Visits between validations; there is one at the end in any case, and 0 asks for no other.
    """

    visits: int = 200_000
    batch: int = 32
    rate: float = 1e-3
    schedule: Literal["cosine", "constant", "steps"] = "cosine"
    warm_up: int = 0
    optimiser: Literal["adam", "adamw"] = "adam"
    betas: tuple[float, float] = (0.9, 0.999)
    decay: float = 0.0
    clip: float = 0.0
    clip_by: Literal["norm", "value"] = "norm"
    precision: Literal["bf16", "float32"] = "float32"
    seed: int = 0
    validate_every: int = 0

    CHOICES: ClassVar[Mapping[str, tuple[str, ...]]] = {
        "schedule": ("cosine", "constant", "steps"),
        "optimiser": ("adam", "adamw"),
        "clip_by": ("norm", "value"),
        "precision": ("bf16", "float32"),
    }
    """The words that a setting takes."""

    MAY_CHANGE: ClassVar[frozenset[str]] = frozenset({"visits", "validate_every"})
    """Settings that a run which is taken up again may change."""

    def __post_init__(self) -> None:
        for name, choices in self.CHOICES.items():
            if getattr(self, name) not in choices:
                told = ", ".join(repr(choice) for choice in choices)
                raise ShapeProgError(f"{name} is {getattr(self, name)!r}, which is not known", f"choose one of {told}")
        for name, least in (("visits", 1), ("batch", 1), ("rate", 0), ("warm_up", 0), ("decay", 0), ("clip", 0)):
            value = getattr(self, name)
            if not (math.isfinite(value) and value >= least):
                raise ShapeProgError(f"{name} is {value}", f"give a number of at least {least}")

    def steps(self, processes: int) -> int:
        """Steps of the run for that many processes."""
        return math.ceil(self.visits / (self.batch * processes))

    def rate_at(self, visits: int) -> float:
        """The rate of learning after that many visits."""
        if visits < self.warm_up:
            return self.rate * (visits + 1) / self.warm_up
        if self.schedule == "constant":
            return self.rate
        share = min(1.0, visits / self.visits)
        if self.schedule == "steps":
            return self.rate * (1.0 if share < 2 / 3 else 0.2 if share < 5 / 6 else 0.04)
        share = min(1.0, (visits - self.warm_up) / max(1, self.visits - self.warm_up))
        return self.rate * 0.5 * (1 + math.cos(math.pi * share))

    def make_optimiser(self, module: nn.Module) -> torch.optim.Optimizer:
        """The optimiser of the weights that learn."""
        weights = [each for each in module.parameters() if each.requires_grad]
        kind = torch.optim.Adam if self.optimiser == "adam" else torch.optim.AdamW
        return kind(weights, lr=self.rate, betas=self.betas, weight_decay=self.decay)

    def limit(self, gradients: Iterable[Tensor]) -> Tensor:
        """Clip gradients in place; the norm (,) they had before."""
        listed = list(gradients)
        norm = torch.nn.utils.get_total_norm(listed)
        if self.clip and self.clip_by == "value":
            for each in listed:
                each.clamp_(-self.clip, self.clip)
        elif self.clip:
            scale = (self.clip / (norm + 1e-6)).clamp(max=1.0)
            for each in listed:
                each.mul_(scale)
        return norm

    def record(self) -> dict[str, Any]:
        """All settings as JSON."""
        return {name: list(value) if isinstance(value, tuple) else value for name, value in asdict(self).items()}

    def check(self, begun: Mapping[str, Any], now: Mapping[str, Any], where: str) -> None:
        """Refuse to go on with other settings than a run was begun with; one it did not know yet was as by default.

        Parameters
        ----------
        begun, now
            Records of both.
        where
            What the run is called in the error.

        Raises
        ------
        ShapeProgError
            Naming each setting that differs, with both values.
        """
        begun = {**{each.name: each.default for each in fields(self) if each.default is not MISSING}, **begun}
        names = [name for name in {**begun, **now} if name not in self.MAY_CHANGE]
        other = [name for name in names if begun.get(name) != now.get(name)]
        if other:
            told = "; ".join(f"{name} was {begun.get(name)!r}, is now {now.get(name)!r}" for name in other)
            raise ShapeProgError(
                f"the run in {where} was begun with other settings: {told}",
                "give the settings it was begun with, choose another folder, or begin anew with --restart",
            )

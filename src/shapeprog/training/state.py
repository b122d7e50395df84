"""The state of a run as bytes: weights, optimiser, step and settings, from which it goes on exactly.

Randomness and data need no place in it: both are functions of the seed and the step.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from hashlib import sha256
from typing import Any

import torch
from torch import Tensor, nn

from shapeprog.errors import InputError

_MODULE, _OPTIMISER = "module/", "optimiser/"

_UNSIGNED = "0" * 64
"""What stands in a state for its digest while that is computed."""


def capture(
    module: nn.Module, optimiser: torch.optim.Optimizer, step: int, settings: dict[str, Any], best: float
) -> bytes:
    """Everything a run needs to go on after ``step`` steps, as the bytes of a safetensors file.

    Parameters
    ----------
    settings
        Record of what the run was told.
    best
        The best score of its validations so far.
    """
    from safetensors.torch import save

    tensors = {_MODULE + name: value for name, value in module.state_dict().items()}
    for place, weight in enumerate(_weights(optimiser)):
        for name, value in optimiser.state.get(weight, {}).items():
            tensors[f"{_OPTIMISER}{place}/{name}"] = value
    whole = {name: value.detach().cpu().contiguous().clone() for name, value in tensors.items()}
    card = {"digest": _UNSIGNED, "step": step, "settings": settings, "best": best}
    content = save(whole, {"run": json.dumps(card, allow_nan=True)})
    return content.replace(_UNSIGNED.encode(), sha256(content).hexdigest().encode(), 1)


def restore(content: bytes, module: nn.Module, optimiser: torch.optim.Optimizer) -> None:
    """Put module and optimiser into a captured state.

    Raises
    ------
    InputError
        If the state is of another network.
    """
    from safetensors.torch import load

    tensors = load(content)
    weights = {name.removeprefix(_MODULE): each for name, each in tensors.items() if name.startswith(_MODULE)}
    own = module.state_dict()
    odd = sorted(name for name in weights.keys() | own.keys() if _shape(weights, name) != _shape(own, name))
    if odd:
        raise InputError(f"the saved run has another network: {odd[0]} differs", "begin anew with --restart")
    module.load_state_dict(weights)
    for place, weight in enumerate(_weights(optimiser)):
        start = f"{_OPTIMISER}{place}/"
        for name, value in tensors.items():
            if name.startswith(start):
                key = name.removeprefix(start)
                optimiser.state[weight][key] = value if key == "step" else _placed(value, weight)


def card_of(content: bytes, where: str) -> dict[str, Any]:
    """Step, settings and best score of a captured state, every byte of which is checked.

    Raises
    ------
    InputError
        If it is none, or damaged.
    """
    try:
        size = int.from_bytes(content[:8], "little")
        card = dict(json.loads(json.loads(content[8 : 8 + size])["__metadata__"]["run"]))
        digest = str(card.pop("digest"))
        good = digest == sha256(content.replace(digest.encode(), _UNSIGNED.encode(), 1)).hexdigest()
    except (ValueError, KeyError, TypeError, RecursionError):
        good = False
    if not good:
        problem = "is damaged, or no state of a training run" if content else "is empty"
        raise InputError(f"{where} {problem}", "begin anew with --restart")
    return card


def _weights(optimiser: torch.optim.Optimizer) -> Iterator[Tensor]:
    return (weight for group in optimiser.param_groups for weight in group["params"])


def _shape(tensors: dict[str, Tensor], name: str) -> tuple[torch.Size, torch.dtype] | None:
    return (tensors[name].shape, tensors[name].dtype) if name in tensors else None


def _placed(value: Tensor, weight: Tensor) -> Tensor:
    """A tensor of the optimiser where it belongs: like its weight in memory too, for sums to round alike."""
    return torch.empty_like(weight, dtype=value.dtype).copy_(value)

"""The state of a run as bytes: weights, optimiser, step and settings, from which it goes on exactly.

Randomness and data need no place in it: both are functions of the seed and the step.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

import torch
from torch import Tensor, nn

from shapeprog.errors import InputError

_MODULE, _OPTIMISER = "module/", "optimiser/"


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
    card = {"step": step, "settings": settings, "best": best}
    return save(whole, {"run": json.dumps(card, allow_nan=True)})


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
    """Step, settings and best score of a captured state.

    Raises
    ------
    InputError
        If it is none, or damaged.
    """
    try:
        size = int.from_bytes(content[:8], "little")
        header = json.loads(content[8 : 8 + size])
        card = json.loads(header["__metadata__"]["run"])
        last = max([0, *(each["data_offsets"][1] for name, each in header.items() if name != "__metadata__")])
        if len(content) != 8 + size + last or not isinstance(card["step"], int):
            raise ValueError
    except (ValueError, KeyError, TypeError) as error:
        raise InputError(f"{where} is no state of a training run, or damaged", "begin anew with --restart") from error
    return dict(card)


def _weights(optimiser: torch.optim.Optimizer) -> Iterator[Tensor]:
    return (weight for group in optimiser.param_groups for weight in group["params"])


def _shape(tensors: dict[str, Tensor], name: str) -> tuple[torch.Size, torch.dtype] | None:
    return (tensors[name].shape, tensors[name].dtype) if name in tensors else None


def _placed(value: Tensor, weight: Tensor) -> Tensor:
    """A tensor of the optimiser where it belongs: like its weight in memory too, for sums to round alike."""
    return torch.empty_like(weight, dtype=value.dtype).copy_(value)

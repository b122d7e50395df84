"""Weights as Tian et al. (ICLR 2019) published them, read without running anything that their files hold.

A published file is a pickle of a dictionary: the weights under ``model``, the settings of the run under ``opt``, an
``argparse.Namespace``.  It is unpickled by torch's restricted reader, which knows tensors and, here, that one class;
a file that asks for anything else is refused.
"""

from __future__ import annotations

import argparse
import os
import pickle
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import torch
from torch import Tensor, nn

from shapeprog.errors import InputError
from shapeprog.language.statement import END, language
from shapeprog.models.executor import NeuralExecutor
from shapeprog.models.tian2019 import PUBLISHED, Tian2019
from shapeprog.models.vocabulary import Vocabulary

PARALLEL = "module."
"""Prefix of all names where the network was trained on several devices."""

COUNTER = "num_batches_tracked"
"""End of the names that older versions of torch did not write."""


def read_published(path: str | os.PathLike[str]) -> nn.Module:
    """The network of a published file, a generator or a neural executor, in evaluation mode.

    A generator normalises by the statistics of the batch, as published; running ones are not in the file, see
    :func:`shapeprog.models.tian2019.calibrated`.

    Raises
    ------
    InputError
        If the file cannot be read, holds more than weights, or its weights fit neither network.
    """
    state = _weights(Path(path))
    vocabulary = Vocabulary(tuple(each for each in language() if each.id <= END))
    problems = []
    for what, module in (
        ("generator", Tian2019(PUBLISHED, vocabulary)),
        ("neural executor", NeuralExecutor(vocabulary)),
    ):
        fitted = _fitted(state, module.state_dict())
        if isinstance(fitted, dict):
            module.load_state_dict(fitted)
            return module.eval()
        problems.append((len(fitted), f"as a {what} {_few(fitted)}"))
    raise InputError(
        f"the weights in {path} fit neither network of Tian et al.: {min(problems)[1]}",
        "give a checkpoint of their program generator or program executor",
    )


def _weights(path: Path) -> dict[str, Tensor]:
    """The tensors of a file by name, without the prefix of parallel training."""
    try:
        with torch.serialization.safe_globals([argparse.Namespace]):
            content = torch.load(path, map_location="cpu", weights_only=True)
    except FileNotFoundError as error:
        raise InputError(f"there is no file {path}", "check the path") from error
    except (IsADirectoryError, PermissionError) as error:
        raise InputError(f"cannot read {path}: {error.strerror}", "check the path") from error
    except pickle.UnpicklingError as error:
        raise InputError(
            f"{path} is no file of weights, or holds more than weights and settings; nothing in it was run",
            "only weights and an argparse.Namespace are read; get the file again from where it was published",
        ) from error
    except Exception as error:  # what a torn or foreign file makes torch raise is not said anywhere
        told = (str(error) or type(error).__name__).splitlines()[0]
        raise InputError(f"{path} is no file of weights, or is cut short: {told}", "get it again") from error
    state: Any = content.get("model", content) if isinstance(content, Mapping) else None
    if not isinstance(state, Mapping) or not state or not all(isinstance(each, Tensor) for each in state.values()):
        raise InputError(f"{path} holds no weights under 'model'", "give a checkpoint of Tian et al.")
    broken = [name for name, each in state.items() if not each.isfinite().all()]
    if broken:
        raise InputError(f"{path}: not all values of {broken[0]} are finite", "get the file again")
    return {str(name).removeprefix(PARALLEL): each for name, each in state.items()}


def _fitted(state: dict[str, Tensor], wanted: dict[str, Tensor]) -> dict[str, Tensor] | list[str]:
    """The weights under the names of the network, or what does not fit: by names, else by their order and shapes."""
    found = {name: each for name, each in state.items() if not name.endswith(COUNTER)}
    places = {name: each for name, each in wanted.items() if not name.endswith(COUNTER)}
    counters = {name: each for name, each in wanted.items() if name.endswith(COUNTER)}
    lacking = [f"{name} is missing" for name in places if name not in found]
    lacking += [f"{name} is not known" for name in found if name not in places]
    lacking += [
        f"{name} has the shape {tuple(found[name].shape)}, not {tuple(each.shape)}"
        for name, each in places.items()
        if name in found and found[name].shape != each.shape
    ]
    if not lacking:
        return {**found, **counters}
    if [each.shape for each in found.values()] == [each.shape for each in places.values()]:
        return {**dict(zip(places, found.values(), strict=True)), **counters}
    return lacking


def _few(lacking: list[str]) -> str:
    return ", ".join(lacking[:3]) + (f" and {len(lacking) - 3} more" if len(lacking) > 3 else "")

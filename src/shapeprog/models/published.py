"""Weights as Tian et al. (ICLR 2019) published them, read without running anything that their files hold.

A published file is a pickle of a dictionary: the weights under ``model``, the settings of the run under ``opt``, an
``argparse.Namespace``.  It is unpickled by torch's restricted reader, which knows tensors and, here, that one class;
a file that asks for anything else is refused.
"""

from __future__ import annotations

import argparse
import io
import os
import pickle
import warnings
import zipfile
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


LARGEST = 256 << 20
"""Bytes of the largest file that is read, many times those of the published ones."""


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
            broken = [name for name, each in fitted.items() if not each.isfinite().all()]
            if broken:
                raise InputError(f"{path}: not all values of {broken[0]} are finite", "get the file again")
            module.load_state_dict(fitted)
            return module.eval()
        problems.append((len(fitted), f"as a {what} {_few(fitted)}"))
    raise InputError(
        f"the weights in {path} fit neither network of Tian et al.: {min(problems)[1]}",
        "give a checkpoint of their program generator or program executor",
    )


def _weights(path: Path) -> dict[str, Tensor]:
    """The weights of a file by name, without the prefix of parallel training and without counters."""
    content = _content(path)
    try:
        with torch.serialization.safe_globals([argparse.Namespace]), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            told = torch.load(io.BytesIO(content), map_location="cpu", weights_only=True)
    except pickle.UnpicklingError as error:
        raise InputError(
            f"{path} is no file of weights, or holds more than weights and settings; nothing in it was run",
            "only weights and an argparse.Namespace are read; get the file again from where it was published",
        ) from error
    except Exception as error:  # what a torn or foreign file makes torch raise is not said anywhere
        raise InputError(f"{path} is no file of weights, or is damaged", "get it again") from error
    state: Any = told.get("model", told) if isinstance(told, Mapping) else None
    if not isinstance(state, Mapping) or not state or not all(isinstance(each, Tensor) for each in state.values()):
        raise InputError(f"{path} holds no weights under 'model'", "give a checkpoint of Tian et al.")
    weights = {
        str(name).removeprefix(PARALLEL): each for name, each in state.items() if not str(name).endswith(COUNTER)
    }
    odd = [name[:80] for name, each in weights.items() if not _plain(each)]
    if odd:
        raise InputError(f"{path}: {odd[0]} is no plain tensor of real numbers", "give a checkpoint of Tian et al.")
    return weights


def _content(path: Path) -> bytes:
    """The bytes of a file; torch packs nothing, so archives that unpack to more are refused unread."""
    if path.exists() and not path.is_file():
        raise InputError(f"{path} is no regular file", "name a published checkpoint")
    try:
        if path.stat().st_size > LARGEST:
            raise InputError(f"{path} is larger than {LARGEST >> 20} MB", "published checkpoints have about 6 MB")
        content = path.read_bytes()
    except FileNotFoundError as error:
        raise InputError(f"there is no file {path}", "check the path") from error
    except OSError as error:
        raise InputError(f"cannot read {path}: {error.strerror}", "check the path") from error
    if content.startswith(b"PK"):
        try:
            sizes = [each.file_size for each in zipfile.ZipFile(io.BytesIO(content)).infolist()]
        except Exception as error:  # nor is it said what a damaged archive makes zipfile raise
            raise InputError(f"{path} is no file of weights, or is damaged", "get it again") from error
        if sum(sizes) > len(content):
            raise InputError(f"{path} is a packed archive, which torch does not write", "unpack it, or get it again")
    return content


def _plain(tensor: Tensor) -> bool:
    """Whether a tensor is dense, in memory, and holds a real number of its own for each of its places."""
    dense = tensor.layout == torch.strided and not tensor.is_nested and not tensor.is_quantized
    if not dense or tensor.device.type != "cpu" or not tensor.is_floating_point():
        return False
    return tensor.untyped_storage().nbytes() >= tensor.numel() * tensor.element_size()


def _fitted(state: dict[str, Tensor], wanted: dict[str, Tensor]) -> dict[str, Tensor] | list[str]:
    """The weights under the names of the network, or what does not fit: by names, else by their order and shapes."""
    places = {name: each for name, each in wanted.items() if not name.endswith(COUNTER)}
    counters = {name: each for name, each in wanted.items() if name.endswith(COUNTER)}
    lacking = [f"{name} is missing" for name in places if name not in state]
    lacking += [f"{name} is not known" for name in state if name not in places]
    lacking += [
        f"{name} has the shape {tuple(state[name].shape)}, not {tuple(each.shape)}"
        for name, each in places.items()
        if name in state and state[name].shape != each.shape
    ]
    if not lacking:
        fitting = state
    elif [each.shape for each in state.values()] == [each.shape for each in places.values()]:
        fitting = dict(zip(places, state.values(), strict=True))
    else:
        return lacking
    return {name: each.to(wanted[name].dtype) for name, each in fitting.items()} | counters


def _few(lacking: list[str]) -> str:
    return ", ".join(each[:200] for each in lacking[:3]) + (f" and {len(lacking) - 3} more" if len(lacking) > 3 else "")

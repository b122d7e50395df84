"""Weights in safetensors files whose header holds a card: network, data, command.

No pickle is executed.  Weights that ship with the package have bare names; published ``.t7`` files of Tian et al. are
read by torch's restricted reader, which accepts tensors and one class of settings.
"""

from __future__ import annotations

import argparse
import json
import os
import warnings
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path
from typing import Any

import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save
from torch import Tensor, nn

from shapeprog.errors import InputError, OutputError, ShapeProgError, did_you_mean
from shapeprog.files import write_bytes
from shapeprog.liang2022.executor import NeuralExecutor
from shapeprog.liang2022.fast import Fast
from shapeprog.liang2022.generator import Generator
from shapeprog.liang2022.loop import STATE, WEIGHTS
from shapeprog.liang2022.tian2019 import PUBLISHED, Tian2019

SUFFIX = ".safetensors"
SHIPPED = Path(__file__).with_name("weights")
DESIGNS: dict[str, type[Generator]] = {kind.design: kind for kind in (Fast, Tian2019)}
LARGEST_FILE = 256 << 20
"""Bytes of the largest file that is read."""


@dataclass(frozen=True)
class Card:
    """A description of weights.

    Parameters
    ----------
    design, settings
        The network: ``fast``, ``tian2019`` or ``executor``, and its settings.
    data, seed, samples_seen
        Training data.
    version, command
        Version of the package, and the command that makes the weights.
    scores
        Measures by name.
    """

    design: str
    settings: dict[str, Any] = field(default_factory=dict)
    data: str = ""
    seed: int = 0
    samples_seen: int = 0
    version: str = ""
    command: str = ""
    scores: dict[str, float] = field(default_factory=dict)


def build_generator(design: str, settings: Mapping[str, Any] | None = None) -> Generator:
    """A generator of a design with fresh weights."""
    if design not in DESIGNS:
        raise ShapeProgError(f"unknown design {design!r}", did_you_mean(design, DESIGNS))
    kind = DESIGNS[design]
    values = {name: tuple(value) if isinstance(value, list) else value for name, value in (settings or {}).items()}
    try:
        return kind(kind.Settings(**values))
    except (TypeError, ValueError) as error:
        raise ShapeProgError(f"the settings of {design} do not fit: {error}", "use weights of this version") from error


def save_weights(path: str | os.PathLike[str], module: nn.Module, *, half: bool = False, **card_fields: Any) -> None:
    """Write weights and card, whole or not at all.

    Parameters
    ----------
    half
        Store matrices and kernels as float16; they are float32 again when loaded.
    card_fields
        Fields of :class:`Card` besides design, settings and version.

    Raises
    ------
    OutputError
        If the file cannot be written, or a weight is not finite.
    """
    from shapeprog import __version__

    network: dict[str, Any] = {"design": "executor"}
    if isinstance(module, Generator):
        network = {"design": module.design, "settings": asdict(module.settings)}
    card = Card(**network, version=__version__, **card_fields)
    tensors = {}
    for name, value in module.state_dict().items():
        shrink = half and value.is_floating_point() and value.ndim > 1
        tensors[name] = value.detach().to("cpu", torch.float16 if shrink else value.dtype).contiguous()
        if not tensors[name].isfinite().all():
            raise OutputError(f"cannot write {path}: {name} is not finite", "lower the learning rate")
    write_bytes(path, save(tensors, {"card": json.dumps(asdict(card), allow_nan=False)}))


def read_card(path: str | os.PathLike[str]) -> Card:
    """The card of a file; only its header is read."""
    try:
        with safe_open(path, "pt") as file:
            content = json.loads((file.metadata() or {})["card"])
        types = {"settings": dict, "scores": dict, "seed": int, "samples_seen": int}
        card_fields = {item.name: content[item.name] for item in fields(Card) if item.name in content}
        if not all(isinstance(value, types.get(name, str)) for name, value in card_fields.items()):
            raise ValueError("wrong types")
        return Card(**card_fields)
    except FileNotFoundError as error:
        raise InputError(
            f"there is no file {path}", "check the path; list weights with: shapeprog paper models"
        ) from error
    except (SafetensorError, KeyError, ValueError, TypeError, RecursionError, OSError) as error:
        raise InputError(f"{path} holds no weights of this package, or is damaged", "copy it again") from error


def load_weights(name: str | os.PathLike[str]) -> tuple[nn.Module, Card]:
    """The network of a file or of a bare name that ships, in evaluation mode, and its card.

    Raises
    ------
    InputError
        If there is no such file, or it is damaged or of another network.
    """
    path = _path(name)
    card = read_card(path)
    try:
        with safe_open(path, "pt") as file:
            tensors = {key: file.get_tensor(key) for key in file.keys()}  # noqa: SIM118  # not a mapping
    except (SafetensorError, OSError) as error:
        raise InputError(f"{path} is damaged", "copy it again") from error
    module = NeuralExecutor() if card.design == "executor" else build_generator(card.design, card.settings)
    _load(module, tensors, str(path))
    return module.eval(), card


def load_generator(name: str | os.PathLike[str] = "fast-wide") -> Generator:
    """A generator by file or by name, in evaluation mode."""
    module, card = load_weights(name)
    if not isinstance(module, Generator):
        raise InputError(f"{name} holds weights of the {card.design}, not of a generator", "give those of a generator")
    return module


def load_executor(name: str | os.PathLike[str] = "executor") -> NeuralExecutor:
    """The neural executor by file or by name, in evaluation mode."""
    module, card = load_weights(name)
    if not isinstance(module, NeuralExecutor):
        raise InputError(
            f"{name} holds weights of the generator {card.design}, not of the neural executor",
            "make some with: shapeprog paper train-executor",
        )
    return module


def read_published(path: str | os.PathLike[str]) -> nn.Module:
    """The generator or executor of a published ``.t7`` file, without running anything in it.

    A published generator normalises by the statistics of the batch.

    Raises
    ------
    InputError
        If the file cannot be read, holds more than weights, or fits neither network.
    """
    if not Path(path).is_file() or Path(path).stat().st_size > LARGEST_FILE:
        raise InputError(f"{path} is no file of published weights", "give a checkpoint of Tian et al. (about 6 MB)")
    try:
        with torch.serialization.safe_globals([argparse.Namespace]), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            content = torch.load(path, map_location="cpu", weights_only=True)
        state = {str(name).removeprefix("module."): value for name, value in content["model"].items()}
    except Exception as error:  # no list of what torch raises for a damaged or foreign file
        raise InputError(
            f"{path} is damaged, or holds more than weights; nothing in it was run", "get it again"
        ) from error
    module = Tian2019(PUBLISHED) if "core.weight_ih_l0" in state else NeuralExecutor()
    for key, value in module.state_dict().items():
        if key.endswith("num_batches_tracked"):
            state.setdefault(key, value)  # older versions of torch did not write them
    _load(module, {key: value for key, value in state.items() if isinstance(value, Tensor)}, str(path))
    return module.eval()


def _load(module: nn.Module, tensors: Mapping[str, Tensor], path: str) -> None:
    """Copy tensors into a network; an error names the first that does not fit."""
    expected = module.state_dict()
    for key in sorted({*tensors, *expected}):
        if key not in tensors or key not in expected or tensors[key].shape != expected[key].shape:
            raise InputError(f"{path} does not fit its network: {key[:80]}", "use weights of this version")
        if not _is_plain(tensors[key], expected[key].dtype):
            raise InputError(f"{path}: {key[:80]} is no plain tensor of numbers", "use other weights")
        if not tensors[key].to(expected[key].dtype).isfinite().all():
            raise InputError(f"{path}: {key[:80]} holds values that are not finite", "use other weights")
    module.load_state_dict(dict(tensors))


def _is_plain(tensor: Tensor, expected: torch.dtype) -> bool:
    """Whether a tensor is dense, in memory, and convertible to a type."""
    floats = (torch.float16, torch.bfloat16, torch.float32, torch.float64)
    dense = tensor.layout == torch.strided and tensor.device.type == "cpu"
    return dense and tensor.dtype in (floats if expected.is_floating_point else (expected,))


def _path(name: str | os.PathLike[str]) -> Path:
    path, shipped = Path(name), sorted(file.stem for file in SHIPPED.glob(f"*{SUFFIX}"))
    if str(name) in shipped and not path.is_file():
        return SHIPPED / f"{name}{SUFFIX}"
    if path.is_dir():
        path /= WEIGHTS
        if path.is_file():
            raise InputError(f"{name} is a folder", f"give a file in it, such as {path}")
    run = path.parent
    if path.suffix and not path.is_file() and not (run / WEIGHTS).is_file() and (run / STATE).is_file():
        cure = "they come with its first validation: let it go on, or validate earlier with --validate-every"
        raise InputError(f"the run in {run} has no weights yet", cure)
    if not (path.is_file() or path.suffix or len(path.parts) != 1):
        cure = did_you_mean(
            str(name), shipped, f"there are {', '.join(shipped) or 'none'}; or give a path", quoted=True
        )
        raise InputError(f"no weights called {str(name)!r} ship with shapeprog", cure)
    return path

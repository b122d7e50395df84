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
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, get_origin, get_type_hints

import torch
from safetensors import safe_open
from safetensors.torch import save
from torch import Tensor, nn

from shapeprog.data.reading import check_count, in_words
from shapeprog.errors import InputError, OutputError, ShapeProgError, did_you_mean
from shapeprog.files import check_file, write_bytes
from shapeprog.liang2022.executor import NeuralExecutor
from shapeprog.liang2022.fast import Fast
from shapeprog.liang2022.generator import Generator
from shapeprog.liang2022.settings import STATE, WEIGHTS
from shapeprog.liang2022.tian2019 import PUBLISHED, Tian2019

SUFFIX = ".safetensors"
SHIPPED = Path(__file__).with_name("weights")
DESIGNS: dict[str, type[Generator]] = {kind.design: kind for kind in (Fast, Tian2019)}
LARGEST_PUBLISHED = 256 << 20  # bytes


@dataclass(frozen=True)
class Card:
    """A description of weights: the network (a design or ``executor``), its training data, what made it, its scores."""

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
    return kind(kind.Settings(**values))


def save_weights(path: str | os.PathLike[str], module: nn.Module, *, half: bool = False, **card_fields: Any) -> None:
    """Write weights and a card with these fields, besides network and version, whole or not at all.

    With ``half``, matrices and kernels are stored as float16; they are float32 again when loaded.  Raises an
    ``OutputError`` if the file cannot be written or a weight is not finite.
    """
    from shapeprog import __version__

    design, settings = (module.design, asdict(module.settings)) if isinstance(module, Generator) else ("executor", {})
    card = Card(design, settings, version=__version__, **card_fields)
    tensors = {}
    for name, value in module.state_dict().items():
        shrink = half and value.is_floating_point() and value.ndim > 1
        tensors[name] = value.detach().to("cpu", torch.float16 if shrink else value.dtype).contiguous()
        if not tensors[name].isfinite().all():
            raise OutputError(f"cannot write {path}: {name} is not finite", "lower the learning rate")
    write_bytes(path, save(tensors, {"card": json.dumps(asdict(card), allow_nan=False)}))


def read_card(path: str | os.PathLike[str]) -> Card:
    """The card of a file; only its header is read."""
    with in_words(Path(path), "weights"):
        check_file(Path(path))
        with safe_open(path, "pt") as file:
            content = json.loads(file.metadata()["card"])
        types = {name: get_origin(hint) or hint for name, hint in get_type_hints(Card).items()}
        card = Card(**{name: content[name] for name in types if name in content})
        typed = all(isinstance(getattr(card, name), kind) for name, kind in types.items())
        if not typed or not all(isinstance(score, float | int) for score in card.scores.values()):
            raise TypeError("a field of the card has another type")
    return card


def load_weights(name: str | os.PathLike[str]) -> tuple[nn.Module, Card]:
    """The network of a file or of a bare name, in evaluation mode, and its card; an ``InputError`` if it is damaged."""
    path = _path(name)
    card = read_card(path)
    with in_words(path, "weights"), safe_open(path, "pt") as file:
        module = NeuralExecutor() if card.design == "executor" else build_generator(card.design, card.settings)
        _copy({key: file.get_tensor(key) for key in file.keys()}, module, path)  # noqa: SIM118  # not a mapping
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
        cause = f"{name} holds weights of the generator {card.design}, not of the neural executor"
        raise InputError(cause, "make some with: shapeprog paper train-executor")
    return module


def read_published(path: str | os.PathLike[str]) -> nn.Module:
    """The generator or executor of a published ``.t7`` file, in which nothing is run; else an ``InputError``."""
    path = Path(path)
    check_file(path)
    check_count(path.name, "bytes", path.stat().st_size, LARGEST_PUBLISHED)
    try:
        with torch.serialization.safe_globals([argparse.Namespace]), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            content = torch.load(path, map_location="cpu", weights_only=True)
        state = {str(name).removeprefix("module."): value for name, value in content["model"].items()}
    except Exception as error:  # no list of what torch raises for a damaged or foreign file
        cause = f"{path} is damaged, or holds more than weights; nothing in it was run"
        raise InputError(cause, "get it again") from error
    module = Tian2019(PUBLISHED) if "core.weight_ih_l0" in state else NeuralExecutor()
    counters = {key: value for key, value in module.state_dict().items() if key.endswith("num_batches_tracked")}
    _copy(counters | state, module, path)  # older versions of torch did not write the counters
    return module.eval()


def _copy(tensors: Mapping[str, Any], module: nn.Module, path: Path) -> None:
    """Copy tensors into a network if all fit it and are dense, in memory and finite; an error names the first other."""
    expected, floats = module.state_dict(), (torch.float16, torch.bfloat16, torch.float32, torch.float64)
    for key in sorted({*tensors, *expected}):
        tensor, weight = tensors.get(key), expected.get(key)
        if not isinstance(tensor, Tensor) or weight is None or tensor.shape != weight.shape:
            raise InputError(f"{path} does not fit its network: {key[:80]}", "use weights of this version")
        plain = tensor.layout == torch.strided and tensor.device.type == "cpu"
        plain &= tensor.dtype in (floats if weight.is_floating_point() else (weight.dtype,))
        if not plain or not tensor.to(weight.dtype).isfinite().all():
            raise InputError(f"{path}: {key[:80]} is no plain tensor of finite numbers", "use other weights")
    module.load_state_dict(tensors)


def _path(name: str | os.PathLike[str]) -> Path:
    """The path of a file, or of weights that ship."""
    path, shipped = Path(name), sorted(file.stem for file in SHIPPED.glob(f"*{SUFFIX}"))
    if str(name) in shipped and not path.is_file():
        return SHIPPED / f"{name}{SUFFIX}"
    if not (path.exists() or path.suffix or len(path.parts) != 1):
        cure = did_you_mean(str(name), shipped, f"there are {', '.join(shipped)}; or give a path", quoted=True)
        raise InputError(f"no weights called {str(name)!r} ship with shapeprog", cure)
    run = path if path.is_dir() else path.parent
    if not path.is_file() and (run / STATE).is_file() and not (run / WEIGHTS).is_file():
        cure = "they come with its first validation: let it go on, or validate earlier with --validate-every"
        raise InputError(f"the run in {run} has no weights yet", cure)
    return path

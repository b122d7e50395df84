"""Weights in files: one NAME.safetensors each, whose header carries a card of how they came about.

No pickle is read.  Weights that ship with the package are found by their bare name.
"""

from __future__ import annotations

import json
import math
import os
from collections.abc import Iterator, Sequence
from dataclasses import MISSING, asdict, dataclass, field, fields
from pathlib import Path
from typing import Any, get_origin, get_type_hints

import torch
from torch import Tensor, nn

from shapeprog.errors import InputError, OutputError, ShapeProgError, did_you_mean
from shapeprog.files import write_bytes
from shapeprog.language.parameters import LARGEST
from shapeprog.models.designs import build_generator
from shapeprog.models.executor import NeuralExecutor
from shapeprog.models.generator import Generator
from shapeprog.models.tensor_file import Header, file_bytes, read_header, read_tensors, same_kind
from shapeprog.models.vocabulary import Vocabulary

SUFFIX = ".safetensors"
SHIPPED = Path(__file__).with_name("weights")
"""Folder of the weights that ship with the package."""

_CALLED = {str: "text", int: "whole number", dict: "set of entries"}


@dataclass(frozen=True)
class Card:
    """What is known of a set of weights.

    Parameters
    ----------
    kind
        ``generator`` or ``executor``.
    design, settings
        What rebuilds the network.
    vocabulary
        Record of the statements it was trained with.
    data, seed
        What it was trained on.
    version
        Version of the package that wrote it.
    command
        How to make it again.
    visits
        Shapes, or blocks of an executor, seen in training.
    scores
        Measures by name.
    """

    kind: str
    design: str
    settings: dict[str, Any]
    vocabulary: dict[str, Any]
    data: str = ""
    seed: int = 0
    version: str = ""
    command: str = ""
    visits: int = 0
    scores: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Listed:
    """A set of weights as its header tells it.

    Parameters
    ----------
    name, path
        What it is called, and where it is.
    card
        What is known of it.
    parameters
        Numbers that were trained.
    size
        Bytes on disk.
    """

    name: str
    path: Path
    card: Card
    parameters: int
    size: int


def card_of(module: nn.Module, **known: Any) -> Card:
    """The card of a network: kind, design, settings, vocabulary and version are read from it, the rest is given.

    Parameters
    ----------
    known
        Fields of :class:`Card`, such as ``data``, ``seed``, ``command``, ``visits`` and ``scores``.
    """
    from shapeprog import __version__

    if isinstance(module, Generator):
        built: dict[str, Any] = {"kind": "generator", "design": module.design, "settings": asdict(module.settings)}
    elif isinstance(module, NeuralExecutor):
        built = {"kind": "executor", "design": "tian2019", "settings": {}}
    else:
        raise TypeError(f"{type(module).__name__} is neither a generator nor an executor")
    return Card(**built | {"vocabulary": module.vocabulary.record(), "version": __version__} | known)


def save_checkpoint(path: str | os.PathLike[str], module: nn.Module, card: Card, *, half: bool = False) -> None:
    """Write weights and card to ``path``, whole or not at all.

    Parameters
    ----------
    half
        Keep matrices and kernels as float16: half the size on disk, float32 again when loaded.

    Raises
    ------
    OutputError
        If the file cannot be written, or a weight is not finite (as after training that diverged).
    """
    tensors = {}
    for name, value in module.state_dict().items():
        stored = value.detach().to(
            "cpu", torch.float16 if half and value.is_floating_point() and value.ndim > 1 else None
        )
        if not stored.isfinite().all():
            raise OutputError(f"cannot write {path}: {_bad(stored)} of {name} are not finite", "lower the rate")
        tensors[name] = stored.contiguous()
    parameters = sum(each.numel() for each in module.parameters())
    metadata = {"card": json.dumps(asdict(card), allow_nan=False), "parameters": str(parameters)}
    write_bytes(path, file_bytes(tensors, metadata))  # safetensors' own files are for their owner alone


def load_checkpoint(name: str | os.PathLike[str], *, device: torch.device | str = "cpu") -> tuple[nn.Module, Card]:
    """The network of a file, in evaluation mode, and its card.

    Parameters
    ----------
    name
        Path of a file, or the bare name of weights that ship with the package.

    Raises
    ------
    InputError
        If there is no such file, or it does not hold weights of this package, or they are broken.
    ShapeProgError
        If the design is not known, or a statement it was trained with has changed.
    """
    path = _found(name)
    header = read_header(path)
    card = _listed(path, header).card
    module = _build(path, card)
    _check_fit(path, header, module.state_dict())
    stored = read_tensors(path)
    for key, value in stored.items():
        if not value.isfinite().all():
            raise InputError(f"{path}: {_bad(value)} of {key} are not finite", "use weights of an earlier step")
    module.load_state_dict(stored)
    return module.to(device).eval(), card


def load_generator(name: str | os.PathLike[str], *, device: torch.device | str = "cpu") -> tuple[Generator, Card]:
    """As :func:`load_checkpoint`, where only a generator will do."""
    module, card = load_checkpoint(name, device=device)
    if not isinstance(module, Generator):
        raise InputError(f"{name} holds a neural executor, not a generator", "give weights of a generator")
    return module, card


def load_executor(name: str | os.PathLike[str], *, device: torch.device | str = "cpu") -> tuple[NeuralExecutor, Card]:
    """As :func:`load_checkpoint`, where only a neural executor will do."""
    module, card = load_checkpoint(name, device=device)
    if not isinstance(module, NeuralExecutor):
        raise InputError(f"{name} holds a generator, not a neural executor", "give weights made by train-executor")
    return module, card


def list_checkpoints(
    folders: Sequence[str | os.PathLike[str]] = (), *, shipped: bool = True
) -> Iterator[tuple[Path, Listed | ShapeProgError]]:
    """Weights that ship, those in folders and one level below, and what is wrong with files that cannot be used.

    Only headers are read.
    """
    for folder in [*([SHIPPED] if shipped and SHIPPED.is_dir() else []), *(Path(each) for each in folders)]:
        for path in sorted([*folder.glob(f"*{SUFFIX}"), *folder.glob(f"*/*{SUFFIX}")]) if folder.is_dir() else [folder]:
            try:
                header = read_header(path)
                if folder.is_dir() and "card" not in header.metadata:
                    continue  # something else, such as the state of a run
                yield path, _listed(path, header)
            except ShapeProgError as error:
                yield path, error


def read_card(path: str | os.PathLike[str]) -> Listed:
    """What the header of a file tells of its weights.

    Raises
    ------
    InputError
        If it is no file of weights of this package, or is damaged.
    """
    path = Path(path)
    return _listed(path, read_header(path))


def _listed(path: Path, header: Header) -> Listed:
    metadata = header.metadata
    if "card" not in metadata:
        raise InputError(
            f"{path} holds weights without a card, so nothing tells which network they are for",
            "use weights written by this package, or turn published ones into them: shapeprog import-weights",
        )
    try:
        told = json.loads(metadata["card"])
        json.dumps(told, allow_nan=False)  # numbers that are not finite are no JSON, whatever Python reads
        parameters = int(metadata["parameters"])
    except (ValueError, KeyError, RecursionError) as error:
        raise _unreadable(path, "it is no JSON, or the number of parameters is missing") from error
    if not isinstance(told, dict):
        raise _unreadable(path, "it holds no entries")
    kinds = get_type_hints(Card)
    for each in fields(Card):
        kind = get_origin(kinds[each.name]) or kinds[each.name]
        if each.name in told and type(told[each.name]) is not kind:
            raise _unreadable(path, f"its {each.name} is no {_CALLED[kind]}")
        if each.name not in told and each.default is each.default_factory is MISSING:
            raise _unreadable(path, f"it tells no {each.name}")
    scores = told.get("scores", {}).values()
    if not all(type(score) in (int, float) and abs(score) <= LARGEST for score in scores):
        raise _unreadable(path, "its scores are no numbers")
    card = Card(**{each.name: told[each.name] for each in fields(Card) if each.name in told})
    return Listed(path.stem, path, card, parameters, header.size)


def _unreadable(path: Path, why: str) -> InputError:
    return InputError(
        f"the card of {path} cannot be read: {why}", "copy the file again, or use weights of this version"
    )


def _found(name: str | os.PathLike[str]) -> Path:
    path = Path(name)
    bare = str(name) == path.name and not path.suffix
    if bare and not path.is_file():
        known = sorted(each.stem for each in SHIPPED.glob(f"*{SUFFIX}"))
        if path.name in known:
            return SHIPPED / f"{path.name}{SUFFIX}"
        cure = did_you_mean(path.name, known, f"there are: {', '.join(known) or 'none'}; or give a path", quoted=True)
        raise InputError(f"no weights called {path.name!r} ship with shapeprog", cure)
    return path


def _build(path: Path, card: Card) -> nn.Module:
    """A fresh network as the card tells it."""
    if card.kind not in ("generator", "executor"):
        raise InputError(f"{path} is for a {card.kind[:80]!r}", "it was written by a newer version; update shapeprog")
    settings = {key: tuple(value) if isinstance(value, list) else value for key, value in card.settings.items()}
    try:
        vocabulary = Vocabulary.check(card.vocabulary)
        if card.kind == "executor":
            return NeuralExecutor(vocabulary)
        return build_generator(card.design, settings, vocabulary)
    except ShapeProgError as error:
        raise ShapeProgError(f"{path}: {error.message}", error.hint) from error


def _check_fit(path: Path, header: Header, wanted: dict[str, Tensor]) -> None:
    """Refuse tensors that the network does not have, lacks, or has with another shape or type."""
    for key in sorted(header.tensors.keys() | wanted.keys()):
        dtype, one = header.tensors.get(key, ("", None))
        two = tuple(wanted[key].shape) if key in wanted else None
        if one != two:
            told = [f"has the shape {shape}" if shape is not None else "is missing" for shape in (one, two)]
            raise InputError(
                f"{path} does not fit its network: {key[:80]!r} {told[0]} in the file and {told[1]} in the network",
                "it was written by another version; make it again",
            )
        if not same_kind(dtype, wanted[key].dtype):
            raise InputError(
                f"{path} does not fit its network: the numbers of {key} are {dtype}, which it cannot use",
                "make it again",
            )


def _bad(values: Tensor) -> str:
    return f"{math.prod(values.shape) - int(values.isfinite().sum())} of {values.numel()} values"

"""Good files of weights, and safetensors files in parts."""

from __future__ import annotations

import argparse
import functools
import io
import json
import tempfile
import warnings
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import torch
from torch import Tensor, nn

from shapeprog.models.checkpoint import card_of, save_checkpoint
from shapeprog.models.designs import build_generator
from shapeprog.models.executor import NeuralExecutor
from shapeprog.models.vocabulary import Vocabulary

SMALL = {"widths": (1, 1, 1), "squeeze": 1, "feature": 2, "low": 0, "high": 3}
"""Settings of the smallest network."""


@functools.cache
def generator() -> nn.Module:
    """A small generator, always the same."""
    with torch.random.fork_rng():
        torch.manual_seed(0)
        return build_generator("swift", SMALL)


@functools.cache
def checkpoint(*, half: bool = False) -> bytes:
    """A good file of the generator."""
    card = card_of(generator(), data="wide", seed=3, visits=640, scores={"iou": 0.5})
    with tempfile.TemporaryDirectory() as folder:
        save_checkpoint(Path(folder, "x.safetensors"), generator(), card, half=half)
        return Path(folder, "x.safetensors").read_bytes()


@functools.cache
def executor() -> dict[str, Tensor]:
    """The weights of a published network, which has one size, all zero."""
    with torch.random.fork_rng():
        module = NeuralExecutor(Vocabulary.current())
    return {name: torch.zeros_like(each) for name, each in module.state_dict().items()}


def published(change: Callable[[Tensor], Any] | None = None, *, legacy: bool = False) -> bytes:
    """A good checkpoint of the published form, or one with a tensor that is ``changed``."""
    weights: dict[str, Any] = dict(executor())
    if change is not None:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # that kinds of tensors are new
            weights["pgm_embed.weight"] = change(weights["pgm_embed.weight"])
    return saved(weights, legacy=legacy)


def saved(weights: Mapping[Any, Any], *, legacy: bool = False) -> bytes:
    """What torch writes of a checkpoint of the published form."""
    return pickled({"model": weights, "opt": argparse.Namespace(rnn_size=64)}, legacy=legacy)


def pickled(content: object, *, legacy: bool = False) -> bytes:
    """What torch writes of anything, as an archive or in its older form."""
    stream = io.BytesIO()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        torch.save(content, stream, _use_new_zipfile_serialization=not legacy)
    return stream.getvalue()


def parted(content: bytes) -> tuple[dict[str, Any], bytes]:
    """Header and body of a safetensors file."""
    length = int.from_bytes(content[:8], "little")
    return json.loads(content[8 : 8 + length]), content[8 + length :]


def joined(header: object, body: bytes) -> bytes:
    """The safetensors file of a header and a body."""
    text = json.dumps(header).encode()
    return len(text).to_bytes(8, "little") + text + body

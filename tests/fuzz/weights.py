"""Files of weights: ours as safetensors, a state of a run, published ones as pickles of torch; and broken ones."""

from __future__ import annotations

import argparse
import functools
import io
import itertools
import json
import struct
from collections.abc import Iterator
from random import Random
from types import SimpleNamespace
from typing import Any

from .containers import change_json, change_zip
from .mutations import BYTES, Mutation, mutated

SMALL = {"widths": (2, 2, 2), "squeeze": 2, "feature": 4}
"""Settings of the smallest network."""

LARGE = 1 << 20
"""Bytes from which on a file is seldom chosen."""


def change_header(random: Random, content: bytes) -> bytes:
    """The JSON header of a safetensors file, or the card within, with the lengths put right again or nearly."""
    size = int.from_bytes(content[:8], "little")
    head, body = content[8 : 8 + size], content[8 + size :]
    try:
        whole = json.loads(head)
        card = random.choice(("card", "run"))
        if random.random() < 0.5:
            whole["__metadata__"][card] = change_json(random, whole["__metadata__"][card].encode()).decode()
            head = json.dumps(whole).encode()
        else:
            head = change_json(random, head)
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        head = change_json(random, head)
    if random.random() < 0.1:
        body += bytes(random.choice((1, 8, 4096)))
    return struct.pack("<Q", len(head) + random.choice((0,) * 12 + (1, -1, 2**40))) + head + body


WAYS: dict[str, tuple[Mutation, ...]] = {
    ".safetensors": (*BYTES, *12 * (change_header,)),
    ".pt": (*BYTES, *6 * (change_zip,)),
    ".t7": BYTES,
    ".state": (*BYTES, *12 * (change_header,)),
}


def cases(seed: int) -> Iterator[tuple[str, bytes]]:
    """Names and contents of broken files of weights without an end."""
    valid = list(seeds().items())
    odd = list(_odd().items())
    often = [1 if len(content) < LARGE else 0.1 for _, content in valid]
    for index in itertools.count():
        random = Random(f"{seed}/{index}")
        name, content = random.choice(odd) if random.random() < 0.03 else random.choices(valid, often)[0]
        stem, _, suffix = name.rpartition(".")
        others = [each for other, each in valid if other.endswith(suffix)]
        broken = content if (name, content) in odd else mutated(random, content, WAYS[f".{suffix}"], others)
        yield f"{stem}-{index}.{suffix}", broken


@functools.cache
def seeds() -> dict[str, bytes]:
    """Valid files by name; the networks are small, but for the published one, which has one size."""
    import tempfile
    from pathlib import Path

    import torch

    from shapeprog.models.checkpoint import card_of, save_checkpoint
    from shapeprog.models.designs import build_generator
    from shapeprog.models.executor import NeuralExecutor
    from shapeprog.models.vocabulary import Vocabulary
    from shapeprog.training.state import capture

    found = {}
    with torch.random.fork_rng():
        torch.manual_seed(0)
        network, executor = build_generator("swift", SMALL), NeuralExecutor(Vocabulary.current())
    with tempfile.TemporaryDirectory() as folder:
        for name, half in (("swift.safetensors", False), ("half.safetensors", True)):
            save_checkpoint(Path(folder, name), network, card_of(network, scores={"iou": 0.5}), half=half)
            found[name] = Path(folder, name).read_bytes()
    optimiser: Any = SimpleNamespace(param_groups=[], state={})  # torch's own take seconds to import
    found["run.state"] = capture(network, optimiser, 3, {"seed": 0}, 0.5)
    state = executor.state_dict()
    options = argparse.Namespace(rnn_size=64)
    found["executor.pt"] = _saved({"model": state, "opt": options}, zipped=True)
    small = {name: each[:1].clone() for name, each in state.items() if each.ndim}
    found["small.pt"] = _saved({"model": small, "opt": options}, zipped=True)
    found["small.t7"] = _saved({"model": small, "opt": options}, zipped=False)
    return found


@functools.cache
def _odd() -> dict[str, bytes]:
    """What torch can save and no network is made of."""
    import torch

    one = torch.ones(2, 3)
    values: dict[str, Any] = {
        "sparse": one.to_sparse(), "meta": one.to("meta"), "wide": torch.ones(1).expand(1 << 40), "complex": one * 1j,
        "nan": one * float("nan"), "none": None, "list": [one], "empty": torch.zeros(0), "scalar": torch.tensor(1.0),
        "bool": one > 0, "number": 3,
    }  # fmt: skip
    found = {f"{name}.pt": _saved({"model": {"weight": value}}, zipped=True) for name, value in values.items()}
    return found | {"bare.pt": _saved(one, zipped=True), "names.pt": _saved({1: one, (2,): one}, zipped=True)}


def _saved(content: object, *, zipped: bool) -> bytes:
    import torch

    stream = io.BytesIO()
    torch.save(content, stream, _use_new_zipfile_serialization=zipped)
    return stream.getvalue()

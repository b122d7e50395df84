"""Mutated files of weights, safetensors and published checkpoints: a name that tells the mutation, and the bytes.

The end of the name is the suffix that the file is to have.  The same seed gives the same files on every machine.
"""

from __future__ import annotations

import argparse
import io
import itertools
import json
import pickle
import random
import warnings
import zipfile
from collections import OrderedDict
from collections.abc import Callable, Iterator
from dataclasses import asdict
from functools import cache
from typing import Any

import torch
from torch import Tensor

from shapeprog.models.checkpoint import card_of
from shapeprog.models.designs import build_generator
from shapeprog.models.executor import NeuralExecutor
from shapeprog.models.swift import SwiftSettings
from shapeprog.models.tensor_file import METADATA, file_bytes
from shapeprog.models.vocabulary import Vocabulary

VALUES: tuple[Any, ...] = (
    None, True, -1, 0, 10**9, 10**400, 1e308, float("nan"), "", "leg", "F32", "F64", "I64", "BF16", "F8_E4M3", "F4",
    "\ud800", "\x1b[2J", [], {}, [0], [-1], [0, 0], [0, 10**12], [1.5, 2], [[]], {"a": None}, ["leg"] * 3,
)  # fmt: skip
"""What stands in the place of an entry of a header or a card."""


def cases(seed: int) -> Iterator[tuple[str, bytes]]:
    """Names and bytes of files without end: first those that are crafted, then mutations of good ones."""
    dice = random.Random(seed)
    yield from crafted()
    for number in itertools.count():
        if dice.random() < 0.6:
            name, mutate = dice.choice(_OF_SAFETENSORS)
            yield f"{number}-{name}.safetensors", mutate(safetensors(), dice)
        else:
            name, mutate = dice.choice(_OF_BYTES)
            yield f"{number}-{name}.t7", mutate(published(legacy=dice.random() < 0.5), dice)


@cache
def safetensors() -> bytes:
    """A good file of a small generator, whose weights are all zero."""
    settings = SwiftSettings(widths=(1, 1, 1), squeeze=1, feature=2, low=0, high=3)
    with torch.random.fork_rng():
        module = build_generator("swift", asdict(settings))
    weights = {name: torch.zeros_like(each) for name, each in module.state_dict().items()}
    card = card_of(module, data="wide", seed=3, visits=640, scores={"iou": 0.5})
    parameters = sum(each.numel() for each in module.parameters())
    return file_bytes(weights, {"card": json.dumps(asdict(card)), "parameters": str(parameters)})


@cache
def published(*, legacy: bool = False, change: str = "") -> bytes:
    """A good checkpoint of the published form, whose weights are all zero, or one with an odd tensor."""
    with torch.random.fork_rng():
        module = NeuralExecutor(Vocabulary.current())
    state: OrderedDict[str, Any] = OrderedDict((name, torch.zeros_like(t)) for name, t in module.state_dict().items())
    name = "pgm_embed.weight"
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        if change:
            state[name] = ODD[change](state[name])
        file = io.BytesIO()
        content = {"model": state, "opt": argparse.Namespace(rnn_size=64)}
        torch.save(content, file, _use_new_zipfile_serialization=not legacy)
    return file.getvalue()


def crafted() -> Iterator[tuple[str, bytes]]:
    """Files made for one weakness each: kinds of tensors, bombs, depth, and pickles that ask for more."""
    for change in ODD:
        yield f"{change}.t7", published(change=change)
    yield "model-list.t7", _saved({"model": [1, 2]})
    yield "model-empty.t7", _saved({"model": {}})
    yield "model-tensor.t7", _saved(torch.zeros(3))
    yield "names-odd.t7", _saved({"model": {3: torch.zeros(3), ("a", "b"): torch.zeros(1), None: torch.zeros(2)}})
    yield "card-nested.t7", _saved({"model": {"module.module.": torch.zeros(1), "module.": torch.zeros(1)}})
    yield "bytes-many.t7", pickle.dumps({"model": bytearray(8)}, 2).replace(b"K\x08", b"J\xff\xff\xff\x7f")
    yield "code.t7", pickle.dumps({"model": print}, 2)
    yield "deep-pickle.t7", b"\x80\x02" + b"]" * 100_000 + b"a" * 99_999 + b"."
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("archive/data.pkl", b"\0" * 50_000_000)
    yield "packed.t7", packed.getvalue()
    yield "packed.safetensors", packed.getvalue()
    good = safetensors()
    header, body = _parted(good)
    for name, text in (
        ("empty", b""), ("no-header", b"{}"), ("deep", b'{"a":' + b"[" * 100_000), ("closed", b"[" * 990 + b"]" * 990),
        ("long-number", b'{"a":{"dtype":"F32","shape":[' + b"9" * 5000 + b'],"data_offsets":[0,4]}}'),
        ("wide", '{"a": 1}'.encode("utf-16")), ("list", b"[]"), ("twice", b'{"a":1,"a":2}'),
    ):  # fmt: skip
        yield f"header-{name}.safetensors", len(text).to_bytes(8, "little") + text + body
    yield "header-endless.safetensors", b"\xff" * 8 + good[8:]
    yield "trailing.safetensors", good + b"\0" * 8
    yield "short.safetensors", good[:-1]
    for name, told in (
        ("null", "null"), ("list", "[]"), ("deep", "[" * 100_000), ("number", "9" * 5000), ("half", '"\\ud800"'),
    ):  # fmt: skip
        yield f"card-{name}.safetensors", _joined({**header, METADATA: {**header[METADATA], "card": told}}, body)
    card = json.loads(header[METADATA]["card"])
    for key in card:
        for value in (None, [], {}, "text", 7, {"iou": None}, {"leg": None}, {"widths": 10**9}, {"feature": 10**9}):
            told = json.dumps({**card, key: value})
            yield f"card-{key}.safetensors", _joined({**header, METADATA: {**header[METADATA], "card": told}}, body)
    for name, settings in (
        ("large", {"widths": [10**6] * 3, "squeeze": 10**6, "feature": 10**6}), ("text", {"widths": "abc"}),
        ("negative", {"feature": -1}), ("none", {"low": None}), ("turned", {"low": 5, "high": -5}),
        ("endless", {"low": -(10**12), "high": 10**12}), ("nested", {"widths": [[1], [2], [3]]}),
    ):  # fmt: skip
        told = json.dumps({**card, "settings": {**card["settings"], **settings}})
        yield f"settings-{name}.safetensors", _joined({**header, METADATA: {**header[METADATA], "card": told}}, body)


ODD: dict[str, Callable[[Tensor], Any]] = {
    "sparse": lambda each: each.to_sparse(),
    "sparse-rows": lambda each: each.to_sparse_csr(),
    "meta": lambda each: each.to("meta"),
    "quantised": lambda each: torch.quantize_per_tensor(each, 0.1, 0, torch.qint8),
    "expanded": lambda each: torch.zeros(1, 1).expand(each.shape),
    "expanded-far": lambda each: torch.zeros(1).expand(10**12),
    "nested": lambda each: torch.nested.nested_tensor([each, each[:1]]),
    "complex": lambda each: each.to(torch.complex64),
    "whole": lambda each: each.long(),
    "truth": lambda each: each.bool(),
    "double": lambda each: torch.full_like(each, 1e300, dtype=torch.float64),
    "eight-bits": lambda each: each.to(torch.float8_e4m3fn),
    "not-finite": lambda each: torch.full_like(each, torch.inf),
    "turned": lambda each: each.t().contiguous().t(),
    "parameter": lambda each: torch.nn.Parameter(each),
    "scalar": lambda each: each.sum(),
    "none": lambda each: None,
    "number": lambda each: 3,
}
"""Kinds of tensors that a checkpoint may hold in the place of a plain one."""


def _saved(content: Any) -> bytes:
    file = io.BytesIO()
    torch.save(content, file)
    return file.getvalue()


def _parted(content: bytes) -> tuple[dict[str, Any], bytes]:
    length = int.from_bytes(content[:8], "little")
    return json.loads(content[8 : 8 + length]), content[8 + length :]


def _joined(header: Any, body: bytes) -> bytes:
    text = json.dumps(header).encode()
    return len(text).to_bytes(8, "little") + text + body


def _entry(content: bytes, dice: random.Random) -> bytes:
    """Another type, shape or place of a tensor, or an entry that is missing."""
    header, body = _parted(content)
    name = dice.choice(list(header))
    if dice.random() < 0.2:
        header[name] = dice.choice(VALUES)
    elif dice.random() < 0.2:
        header[dice.choice(("", "more", METADATA, "\ud800"))] = header.pop(name)
    elif name != METADATA:
        key = dice.choice(("dtype", "shape", "data_offsets", "dtype", "more"))
        header[name][key] = dice.choice(VALUES)
        if dice.random() < 0.1:
            del header[name][key]
    return _joined(header, body)


def _place(content: bytes, dice: random.Random) -> bytes:
    """A tensor somewhere else, longer, shorter, over another or turned round."""
    header, body = _parted(content)
    entry = header[dice.choice([name for name in header if name != METADATA])]
    start, stop = entry["data_offsets"]
    shift = dice.choice((-4, -1, 1, 4, 8, 1 << 32, 1 << 64))
    places = ([start + shift, stop], [start, stop + shift], [start + shift, stop + shift], [stop, start])
    entry["data_offsets"] = dice.choice(places)
    if dice.random() < 0.3:
        entry["shape"] = [*entry["shape"], dice.choice((0, 1, 2, 1 << 62))]
    return _joined(header, body)


def _card(content: bytes, dice: random.Random) -> bytes:
    """Another value somewhere in the card, however deep."""
    header, body = _parted(content)
    card = json.loads(header[METADATA]["card"])
    place: Any = card
    while True:
        key = dice.choice(list(place) if isinstance(place, dict) else list(range(len(place))))
        if dice.random() < 0.4 or not isinstance(place[key], dict | list) or not place[key]:
            break
        place = place[key]
    if isinstance(place, dict) and dice.random() < 0.2:
        del place[key]
    else:
        place[key] = dice.choice(VALUES)
    header[METADATA]["card"] = json.dumps(card)
    return _joined(header, body)


def _flipped(content: bytes, dice: random.Random) -> bytes:
    """Some bits turned, most of them where the header or the pickle is."""
    changed = bytearray(content)
    for _ in range(dice.randint(1, 6)):
        changed[dice.randrange(len(changed) if dice.random() < 0.3 else min(len(changed), 4000))] ^= (
            1 << dice.randrange(8)
        )
    return bytes(changed)


def _end_flipped(content: bytes, dice: random.Random) -> bytes:
    """Some bits turned at the end, where an archive keeps its table."""
    changed = bytearray(content)
    for _ in range(dice.randint(1, 6)):
        changed[-dice.randint(1, min(len(changed), 3000))] ^= 1 << dice.randrange(8)
    return bytes(changed)


def _cut(content: bytes, dice: random.Random) -> bytes:
    return content[: dice.choice((dice.randrange(len(content)), dice.randrange(min(len(content), 3000))))]


def _longer(content: bytes, dice: random.Random) -> bytes:
    return content + bytes(dice.choice((1, 8, 4096)))


def _moved(content: bytes, dice: random.Random) -> bytes:
    """A piece taken out or doubled."""
    start = dice.randrange(min(len(content), 4000))
    end = min(len(content), start + dice.randint(1, 300))
    return content[:start] + dice.choice((b"", 2 * content[start:end])) + content[end:]


_OF_BYTES = (("flip", _flipped), ("end", _end_flipped), ("cut", _cut), ("longer", _longer), ("move", _moved))
_OF_SAFETENSORS = (*_OF_BYTES, *2 * (("entry", _entry), ("place", _place), ("card", _card)))

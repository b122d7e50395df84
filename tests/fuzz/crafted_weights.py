"""Files of weights made for one weakness each: kinds of tensors, bombs, depth, and pickles that ask for more."""

from __future__ import annotations

import io
import json
import pickle
import zipfile
from collections.abc import Callable, Iterator
from typing import Any

import torch
from torch import Tensor

from shapeprog.models.tensor_file import METADATA

from .weight_files import checkpoint, joined, parted, pickled, published


def crafted() -> Iterator[tuple[str, bytes]]:
    """Names and contents of such files."""
    for change in ODD:
        yield f"{change}.t7", published(ODD[change])
    yield "model-list.t7", pickled({"model": [1, 2]})
    yield "model-empty.t7", pickled({"model": {}})
    yield "model-tensor.t7", pickled(torch.zeros(3))
    yield "names-odd.t7", pickled({"model": {3: torch.zeros(3), ("a", "b"): torch.zeros(1), None: torch.zeros(2)}})
    yield "card-nested.t7", pickled({"model": {"module.module.": torch.zeros(1), "module.": torch.zeros(1)}})
    yield "bytes-many.t7", pickle.dumps({"model": bytearray(8)}, 2).replace(b"K\x08", b"J\xff\xff\xff\x7f")
    yield "code.t7", pickle.dumps({"model": print}, 2)
    yield "deep-pickle.t7", b"\x80\x02" + b"]" * 100_000 + b"a" * 99_999 + b"."
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("archive/data.pkl", b"\0" * 50_000_000)
    yield "packed.t7", packed.getvalue()
    yield "packed.safetensors", packed.getvalue()
    good = checkpoint()
    header, body = parted(good)
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
        yield f"card-{name}.safetensors", joined({**header, METADATA: {**header[METADATA], "card": told}}, body)
    card = json.loads(header[METADATA]["card"])
    for key in card:
        for value in (None, [], {}, "text", 7, {"iou": None}, {"leg": None}, {"widths": 10**9}, {"feature": 10**9}):
            told = json.dumps({**card, key: value})
            yield f"card-{key}.safetensors", joined({**header, METADATA: {**header[METADATA], "card": told}}, body)
    for name, settings in (
        ("large", {"widths": [10**6] * 3, "squeeze": 10**6, "feature": 10**6}), ("text", {"widths": "abc"}),
        ("negative", {"feature": -1}), ("none", {"low": None}), ("turned", {"low": 5, "high": -5}),
        ("endless", {"low": -(10**12), "high": 10**12}), ("nested", {"widths": [[1], [2], [3]]}),
    ):  # fmt: skip
        told = json.dumps({**card, "settings": {**card["settings"], **settings}})
        yield f"settings-{name}.safetensors", joined({**header, METADATA: {**header[METADATA], "card": told}}, body)


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
    "empty": lambda each: each[:0],
    "list": lambda each: [each],
    "scalar": lambda each: each.sum(),
    "none": lambda each: None,
    "number": lambda each: 3,
}
"""Kinds of tensors that a checkpoint may hold in the place of a plain one."""

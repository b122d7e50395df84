"""Files of weights: ours as safetensors, a state of a run, published ones as pickles of torch; and broken ones."""

from __future__ import annotations

import functools
import itertools
import json
from collections.abc import Iterator
from random import Random
from types import SimpleNamespace
from typing import Any

from .containers import change_json, change_zip
from .mutations import BYTES, Mutation, mutants_of

DTYPES = ("F32", "F64", "F16", "BF16", "F8_E4M3", "F4", "I64", "BOOL", "C64", "", "f32", None, 4)
"""What is said to be the type of a tensor."""


def change_header(random: Random, content: bytes) -> bytes:
    """The JSON header of a safetensors file, or the card within, with the lengths put right again or nearly."""
    size = int.from_bytes(content[:8], "little")
    head, body = content[8 : 8 + size], content[8 + size :]
    try:
        whole = json.loads(head)
        how = random.randrange(4)
        if how < 2:
            card = random.choice(("card", "run"))
            whole["__metadata__"][card] = change_json(random, whole["__metadata__"][card].encode()).decode()
        elif how == 2:
            _displace(random, whole[random.choice([name for name in whole if name != "__metadata__"])])
        head = json.dumps(whole).encode() if how < 3 else change_json(random, head)
    except (ValueError, KeyError, TypeError, AttributeError, IndexError, RecursionError):  # broken before
        head = change_json(random, head)
    if random.random() < 0.1:
        body += bytes(random.choice((1, 8, 4096)))
    return (len(head) + random.choice((0,) * 12 + (1, -1, 2**40))).to_bytes(8, "little") + head + body


def _displace(random: Random, entry: dict[str, Any]) -> None:
    """Say that a tensor is somewhere else, longer, shorter, over another, turned round, or of another type."""
    start, stop = entry["data_offsets"]
    shift = random.choice((-4, -1, 1, 4, 8, 1 << 32, 1 << 64))
    how = random.randrange(6)
    if how < 4:
        places = ([start + shift, stop], [start, stop + shift], [start + shift, stop + shift], [stop, start])
        entry["data_offsets"] = places[how]
    elif how == 4:
        entry["dtype"] = random.choice(DTYPES)
    if how == 5 or random.random() < 0.3:
        entry["shape"] = [*entry["shape"], random.choice((0, 1, 2, 1 << 62))]


WAYS: dict[str, tuple[Mutation, ...]] = {
    ".safetensors": (*BYTES, *12 * (change_header,)),
    ".pt": (*BYTES, *6 * (change_zip,)),
    ".t7": BYTES,
    ".state": (*BYTES, *12 * (change_header,)),
}


def cases(seed: int) -> Iterator[tuple[str, bytes]]:
    """Names and contents without an end: first those that are crafted, then broken ones."""
    return itertools.chain(crafted(), mutants(seed))


def crafted() -> Iterator[tuple[str, bytes]]:
    """Names and contents of files made for one weakness each, the same for every seed."""
    from . import crafted_weights  # which needs torch

    return crafted_weights.crafted()


def mutants(seed: int) -> Iterator[tuple[str, bytes]]:
    """Names and contents of broken files of weights without an end."""
    return mutants_of(seeds(), WAYS, seed)


@functools.cache
def seeds() -> dict[str, bytes]:
    """Valid files by name; the networks are small, but for the published one, which has one size."""
    from shapeprog.training.state import capture

    from .weight_files import checkpoint, executor, generator, published, saved

    optimiser: Any = SimpleNamespace(param_groups=[], state={})  # torch's own take seconds to import
    small = {name: each[:1].clone() for name, each in executor().items() if each.ndim}
    return {
        "swift.safetensors": checkpoint(),
        "half.safetensors": checkpoint(half=True),
        "run.state": capture(generator(), optimiser, 3, {"seed": 0}, 0.5),
        "executor.pt": published(),
        "executor.t7": published(legacy=True),
        "small.pt": saved(small),
        "small.t7": saved(small, legacy=True),
    }

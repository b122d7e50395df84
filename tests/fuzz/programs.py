"""Programs as text, JSON and in the notation of the paper: valid ones, and broken or extreme ones."""

from __future__ import annotations

import functools
import itertools
from collections.abc import Iterator
from random import Random

from .containers import change_json
from .mutations import BYTES, TEXT, Mutation, change_words, count_otherwise, mutated, write_number

NUMBERS: tuple[Mutation, ...] = (*4 * (write_number,), *4 * (count_otherwise,), change_words)
WAYS: dict[str, tuple[Mutation, ...]] = {
    ".shape": (*BYTES, *TEXT, *2 * NUMBERS),
    ".notation": (*BYTES, *TEXT, *2 * NUMBERS),
    ".json": (*BYTES, *TEXT, *NUMBERS, *10 * (change_json,)),
}

TABLE = """# frame: {"scale": 0.04, "centre": [0, 0.5, 0], "axes": [[0, 0, 1], [1, 0, 0], [0, 1, 0]]}
top_rectangle(at=(4, 0, 0), thickness=2, half=(9, 11))
for i in translate(2, by=(0, 0, 18)):
    for j in translate(2, by=(0, 14, 0)):
        leg(at=(-12, -8, -10), size=(16, 2, 2))
for i in rotate(4, step=0):
    line(start=(-6, -10, -8), end=(-6, 9, -8), radius=0.75)
"""

LOOPS = "for i in translate({0}, by=({1}, {2}, 0)):\n    leg(at=(0, 0, {2}), size=({1}, 2, 2))\n"
DEPTHS = (1, 3, 30, 64, 65, 300, 3000)
COUNTS = ("0", "2", "1000", "100000", "1048576", "1e12", "3e38")


def cases(seed: int) -> Iterator[tuple[str, bytes]]:
    """Names and contents of programs without an end, most of them broken."""
    valid = list(seeds().items())
    for index in itertools.count():
        random = Random(f"{seed}/{index}")
        if random.random() < 0.01:
            yield f"extreme-{index}.shape", _extreme(random).encode()
            continue
        name, content = random.choice(valid)
        stem, _, suffix = name.rpartition(".")
        others = [each for other, each in valid if other.endswith(suffix)]
        yield f"{stem}-{index}.{suffix}", mutated(random, content, WAYS[f".{suffix}"], others)


@functools.cache
def seeds() -> dict[str, bytes]:
    """Valid programs by name: a table with all that text may hold, and one with every statement, in each form."""
    import torch

    import shapeprog as sp
    from shapeprog.data.random import random_program
    from shapeprog.formats.frames import frame_comment
    from shapeprog.formats.json_form import result_json
    from shapeprog.language.program import Program

    found, frame = {}, sp.Frame(0.04, (0.0, 0.5, 0.0))
    random = torch.Generator().manual_seed(0)
    some = {f"drawn{number}": random_program(random, blocks=3) for number in range(6)}
    every = {declared: each for number in range(40) for each in random_program(random).body for declared in [each.name]}
    for name, program in {"table": sp.parse(TABLE), "every": Program(tuple(every.values())), **some}.items():
        more = {"snapped": [], "scores": {"iou": 0.5}, "reason": "done", "source": "stool.obj"}
        found[f"{name}.json"] = result_json(program, frame, **more).encode()
        found[f"{name}.shape"] = (frame_comment(frame) + sp.format_program(program)).encode()
        found[f"{name}.notation"] = sp.format_notation(program).encode()
    return found


def _extreme(random: Random) -> str:
    """Many copies, deep nests, wide or many lines."""
    how = random.randrange(4)
    if how == 0:
        return LOOPS.format(
            random.choice(COUNTS), random.choice(("0", "0.01", "7", "1e19")), random.choice(("0", "3", "3e38"))
        )
    if how == 1:
        depth = random.choice(DEPTHS)
        rows = ["    " * level + f"for i{level} in translate(1, by=(0, 0, 1)):" for level in range(depth)]
        return "\n".join([*rows, "    " * depth + "leg(at=(0, 0, 0), size=(1, 1, 1))\n"])
    if how == 2:
        return random.choice(
            ("(" * 5000, "-" * 50000, "leg(at=" + "[" * 200, " " * 100000 + "x", "leg(" + "a=1, " * 20000)
        )
    return "leg(at=(0, 0, 0), size=(1, 1, 1))\n" * random.choice((100, 2000))

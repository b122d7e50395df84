"""Programs as text and JSON: valid ones, and broken or extreme ones."""

from __future__ import annotations

import functools
import itertools
import re
from collections.abc import Iterator
from dataclasses import replace
from random import Random

from . import crafted_parts, crafted_programs
from .containers import change_json
from .mutations import BYTES, TEXT, Mutation, change_words, count_otherwise, mutants_of, replaced, write_number

NAMES = (
    "leg", "legg", "translate", "rotate", "at", "size", "by", "count", "step", "pass", "end", "for", "draw",
    "import os", "__import__('os')", "lambda: 0", "\U0001f600", "e\u0301", "\u202e", "\x1b[2J", "\x00", "\ufeff",
    "'Leg', 'Cub'", "P", "G", "theta*i", "axis", "# placed:", "# placed: up y, ", "1 unit = 1",
    "statement", "body",
    "box", "taper", "bent_rod", "cushion", "mirror", "seat", "seat(box", "leg(leg", "through", "edge", "side", "role",
    "null", "true", "\t", "\\", ";", ":", "(", ")", "[", "]", "{", "}", "'", '"', "\r", "\x0c", "\u2028", "=", "==",
    "*", "**", "...", "async ", "$",
    "def", "def legs(", "width", "legs", "shelves", "# unit:", "# unit: cm, 0 per cell", "+", "-", "/",
    " / (shelves - 1)", "legs(", "=width",
)  # fmt: skip
"""What is written in the place of a name or behind it."""


def write_name(random: Random, content: bytes) -> bytes:
    """A name becomes another, or something that is none, or comes behind it."""
    word, behind = random.choice(NAMES).encode(), random.random() < 0.5
    return replaced(random, content, re.compile(rb"[A-Za-z_']+"), lambda found: found + word if behind else word)


NUMBERS: tuple[Mutation, ...] = (*4 * (write_number,), *4 * (count_otherwise,), *2 * (write_name,), change_words)
WAYS: dict[str, tuple[Mutation, ...]] = {
    ".shape": (*BYTES, *TEXT, *2 * NUMBERS),
    ".json": (*BYTES, *TEXT, *NUMBERS, *10 * (change_json,)),
}

TABLE = """# placed: up y, front z, origin 0 0.5 0, 1 unit = 0.04
top_rectangle(at=(4, 0, 0), thickness=2, half=(9, 11))
for i in translate(2, by=(0, 0, 18)):
    for j in translate(2, by=(0, 14, 0)):
        leg(at=(-12, -8, -10), size=(16, 2, 2))
for i in rotate(4, step=0):
    line(start=(-6, -10, -8), end=(-6, 9, -8), radius=0.75)
"""
CHAIR = """seat(cushion(at=(-2, -9, -9), size=(3, 18, 18), edge=1.2))
back(board(at=(1, 7, -9), size=(11, 1.5, 18), tilt=12.5))
for i in mirror(side):
    for j in mirror(depth, at=-0.5):
        leg(taper(start=(-12, -8, -8), end=(-2, -7, -7), radius=(0.6, 1.1)))
    arm(bent_rod(start=(1, -8, 9), through=(5.5, -6, 10), end=(4, 8, 9), radius=0.5))
    arm_post(rod(start=(1, -7, 9), end=(5, -6.5, 9.7), radius=0.4))
    stretcher(bar(start=(-9, -7.5, 7.5), end=(-8, 7, 7.5), section=(1, 0.8), turn=30))
    foot(cylinder(at=(-12, 8, 8), height=1, radius=1.3))
for i in translate(4, by=(0, 0, 5)):
    slat(box(at=(2, 9, -8), size=(9, 0.5, 1)))
"""
NAMED = """# unit: cm
# a bookcase on legs that are said once
width, depth, height = 60, 36.5, 90
shelves, leg_height, thick = 4, 10, 2.5  # as many as there shall be


def legs(inset, thick=2):
    for _ in mirror(x=0):
        leg(left=inset, width=thick, depth=thick)


def pair(out):
    legs(inset=0, rear=out, depth=3)
    legs(inset=out - 3, front=out, depth=3, thick=3)


with inside(bottom=leg_height):
    for _ in row(shelves, last=at(top=0)):
        shelf(left=thick, right=thick, height=thick)
    for _ in mirror(x=0):
        side(left=0, width=thick)
    for _ in divide(shelves - 1, z, gap=thick, front=0, depth=thick / 2):
        door(left=thick, right=thick)
foot(pair(height=leg_height, out=depth / 8))
post(bar(start=at(), end=at(x=(width + depth) * 0.1, bottom=10), width=thick, depth=thick / 2, turn=-30))
"""


def cases(seed: int) -> Iterator[tuple[str, bytes]]:
    """Names and contents without an end: first those that are crafted, then broken ones."""
    return itertools.chain(crafted(), mutants(seed))


def crafted() -> Iterator[tuple[str, bytes]]:
    """Names and contents of programs made for one weakness each, the same for every seed."""
    return itertools.chain(crafted_programs.crafted(), crafted_parts.crafted())


def mutants(seed: int) -> Iterator[tuple[str, bytes]]:
    """Names and contents of broken programs without an end."""
    return mutants_of(seeds(), WAYS, seed)


@functools.cache
def seeds() -> dict[str, bytes]:
    """Valid programs by name: furniture with all that text may hold, every statement, and random ones; in each form."""
    import torch

    import shapeprog as sp
    from shapeprog.data.random import random_program
    from shapeprog.formats.shape import program_text
    from shapeprog.language.program import Program

    found, frame = {}, sp.Frame(0.04, (0.0, 0.5, 0.0))
    random = torch.Generator().manual_seed(0)
    some = {f"drawn{number}": random_program(random, blocks=3) for number in range(6)}
    every = {part.name: part for part in random_program(random, blocks=300, depth=1).body}
    furniture = {
        "table": sp.parse(TABLE),
        "chair": sp.parse(CHAIR),
        "named": sp.parse(NAMED),
        "every": Program(tuple(every.values())),
    }
    for name, program in {**furniture, **some}.items():
        more = {"snapped": "", "scores": {"iou": 0.5}, "reason": "done", "source": "stool.obj"}
        found[f"{name}.json"] = sp.program_to_json(program, frame, **more).encode()
        found[f"{name}.shape"] = program_text(replace(program, frame=frame)).encode()
    return found

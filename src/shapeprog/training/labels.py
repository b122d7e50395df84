"""Labels: programs found for real shapes, by search or by hand, from which a generator learns.

They come as lines of JSON (``shapeprog label``, or ``shapeprog infer --json``) with a ``name`` and a ``program``, and
perhaps a ``snapped`` one, each as text or in the JSON form; or as a folder of NAME.shape files.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import torch
from jaxtyping import Bool, Int, UInt8
from torch import Tensor

from shapeprog.errors import InputError
from shapeprog.geometry.cells import union, unpack
from shapeprog.language.program import Program
from shapeprog.language.statement import SLOTS
from shapeprog.language.tensors import Code, encode
from shapeprog.language.unroll import draw_blocks
from shapeprog.models.vocabulary import Vocabulary

Form = Literal["snapped", "program"]

MOST_NAMED = 3
"""Shapes that an error names."""


@dataclass(frozen=True)
class Labels:
    """Programs of the shapes of packs.

    Parameters
    ----------
    code
        Programs (N, K, J), one for each shape.
    known
        Which shapes have one.
    dropped
        Blocks that the vocabulary cannot say, or that are more than K, left out of all programs together.
    """

    code: Code
    known: Bool[Tensor, " N"]
    dropped: int


def read_labels(
    sources: Sequence[Path], names: Sequence[str], vocabulary: Vocabulary, blocks: int, form: Form = "snapped"
) -> Labels:
    """The labels of shapes by their names; a later source replaces what an earlier one says of the same shape.

    Parameters
    ----------
    names
        The shapes.
    form
        Which form of a program to learn, where a file has both: ``snapped`` to whole numbers or as it is.

    Raises
    ------
    InputError
        If a source cannot be read, or none of its programs is for one of the shapes.
    """
    places = {name: place for place, name in enumerate(names)}
    found: dict[int, Program] = {}
    for source in sources:
        told = {name: program for name, program in _read(Path(source), form) if name in places}
        if not told:
            shown = ", ".join(list(names)[:MOST_NAMED])
            raise InputError(f"{source} has no program for any of the shapes", f"they are called {shown}, ...")
        found |= {places[name]: program for name, program in told.items()}
    ids = torch.zeros(len(names), blocks, vocabulary.steps, dtype=torch.long)
    parameters = torch.zeros(*ids.shape, SLOTS)
    dropped = 0
    for place, program in found.items():
        whole = encode(program)
        kept = sayable(whole.ids, vocabulary).nonzero()[:blocks, 0]
        dropped += len(whole.ids) - len(kept)
        few = slice(0, vocabulary.steps)
        ids[place, : len(kept)] = whole.ids[kept, few]
        parameters[place, : len(kept)] = whole.parameters[kept, few, :SLOTS]
    known = torch.zeros(len(names), dtype=torch.bool)
    known[list(found)] = True
    return Labels(Code(ids, parameters), known, dropped)


def sayable(ids: Int[Tensor, "K J"], vocabulary: Vocabulary) -> Bool[Tensor, " K"]:
    """Which blocks are legal in a vocabulary and draw something."""
    steps = vocabulary.steps
    few = torch.nn.functional.pad(ids, (0, max(0, steps - ids.shape[1])))
    fits = (few[:, steps:] == 0).all(-1) & (few[:, 0] > 0) & (few < vocabulary.size).all(-1)
    few = few[:, :steps].clamp(max=vocabulary.size - 1)
    previous: Tensor | None = None
    for step in range(steps):
        allowed = vocabulary.allowed(step, previous).expand(len(few), -1)
        fits = fits & allowed.gather(1, few[:, step : step + 1])[:, 0]
        previous = few[:, step]
    return fits


def perturbed(
    code: Code, vocabulary: Vocabulary, share: float, random: torch.Generator
) -> tuple[Code, UInt8[Tensor, "B 32 32 32"]]:
    """Programs some of whose parameters are moved by one cell, and the cells that these draw: new shapes, right labels.

    Counts and turns stay, and everything stays within its declared range.

    Parameters
    ----------
    share
        Chance of each parameter to move.
    """
    shape, device = code.parameters.shape, code.parameters.device
    jump = torch.randint(0, 2, shape, generator=random, device=device) * 2 - 1
    jump = jump * (torch.rand(shape, generator=random, device=device) < share)
    low, high = vocabulary.ranges.to(device)[code.ids].unbind(-1)
    free = (vocabulary.used & ~vocabulary.discrete).to(device)[code.ids]
    inside = torch.minimum(torch.maximum(code.parameters.round() + jump, low), high)
    moved = Code(code.ids, torch.where(free, inside, code.parameters))
    return moved, rendered(moved)


def rendered(code: Code) -> UInt8[Tensor, "B 32 32 32"]:
    """The cells that programs draw."""
    return unpack(union(draw_blocks(code)))


def _read(source: Path, form: Form) -> Iterator[tuple[str, Program]]:
    """Names and programs of a file of JSON lines or of a folder."""
    from shapeprog.formats.shape import read_text
    from shapeprog.language.text import parse

    if source.is_dir():
        for path in sorted(source.glob("*.shape")):
            yield path.stem, parse(read_text(path), str(path))
        return
    for number, line in enumerate(read_text(source).split("\n"), 1):
        if line.strip():
            yield _entry(line, form, f"line {number} of {source.name}")


def _entry(line: str, form: Form, where: str) -> tuple[str, Program]:
    from shapeprog.formats.json_form import Result
    from shapeprog.formats.json_lines import program_from_entries
    from shapeprog.language.text import parse

    try:
        told: dict[str, Any] = json.loads(line)
        name, program = str(told["name"]), told.get(form, told["program"])
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise InputError(
            f"{where} is no label", "each line is a JSON object with a name and a program, as 'shapeprog label' writes"
        ) from error
    if isinstance(program, str):
        return name, parse(program, where)
    unit = None if form == "snapped" and form in told else Result(where, told).unit
    return name, program_from_entries(program, where, "program", unit)

"""The common part of the scripts for CAD: the placed tree of a program with names that are free in a language."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from shapeprog.formats.colours import hexadecimal
from shapeprog.formats.frames import frame_of_text
from shapeprog.formats.parts import Part as Mesh
from shapeprog.formats.parts import parts
from shapeprog.language.ast import (
    Assignment,
    Call,
    Comment,
    Function,
    Group,
    Line,
    Part,
    Source,
    body_of,
    changed_values,
    names_of,
    without_double_blanks,
)
from shapeprog.language.convert import placed_if_possible
from shapeprog.language.expression import Name, value_at
from shapeprog.language.named import Named, names
from shapeprog.language.placement import SIZES
from shapeprog.language.program import Program
from shapeprog.space import SPAN, FloatArray, Frame

_DEFINED = re.compile(r"^(?:module|function|def|class) (\w+)", re.MULTILINE)
_CALLED = re.compile(r"(?:@(?=\w+$)|\b(?=\w+\s*\())(\w+)", re.MULTILINE)


@dataclass(frozen=True)
class Script:
    """A program as a script prints it.

    Parameters
    ----------
    unit
        Unit of the numbers in it; empty if it is not known.
    numbers
        Its named numbers, an assignment for each, and comments between them.
    named
        What is known of those numbers by name, such as the range of each.
    lines
        Its functions, parts and groups, with free names.
    world
        The map from its coordinates to those of the file, (4, 4).
    colours
        Colours by role.
    meshes
        Its parts, if its statements cannot be written with placed parts; then there are no numbers and lines.
    """

    unit: str
    numbers: tuple[Assignment | Comment, ...]
    named: Mapping[str, Named]
    lines: tuple[Line, ...]
    world: FloatArray
    colours: dict[str, str]
    meshes: tuple[Mesh, ...] = ()

    @property
    def scale(self) -> float:
        """Units of the file in a unit of the script."""
        return float(f"{np.linalg.norm(self.world[:3, 0]):.9g}")

    @property
    def moved(self) -> bool:
        """Whether the script is more than scaled."""
        return bool(np.abs(self.world[:3, :3] / self.scale - np.eye(3)).max() > 1e-9 or self.world[:3, 3].any())


def script(program: Program, frame: Frame, reserved: Collection[str], inner: str) -> Script:
    """A program as a script prints it, in the coordinates of a file.

    Parameters
    ----------
    program
        A program in either notation.
    frame
        From the grid to the coordinates of the file.
    reserved
        Words of the script that are no names.
    inner
        The prefix of ``width``, ``depth`` and ``height`` of a box inside of the whole.
    """
    program = placed_if_possible(program)
    source = program.source
    if source is None:
        meshes = tuple(parts(program, frame))
        return Script("", (), {}, (), np.eye(4), _colours({mesh.word for mesh in meshes}), meshes)
    assert source.unit is not None
    words = _free_names([*sorted(names_of(source)), *source.functions], reserved)
    lines = tuple(_renamed(line, words, inner, False) for line in source.lines)
    roles = {line.role for line in source.walk() if isinstance(line, Part | Call)} - {""}
    kinds = {line.kind for line in source.walk() if isinstance(line, Part)}
    first = next((k for k, line in enumerate(lines) if not isinstance(line, Assignment | Comment)), len(lines))
    body = tuple(line for line in lines[first:] if not isinstance(line, Assignment))
    named = {words[number.name]: number for number in names(program)}
    world = world_of(source, frame)
    return Script(source.unit.name, _numbers(lines, first), named, body, world, _colours(roles | kinds))


def world_of(source: Source, frame: Frame) -> FloatArray:
    """The map (4, 4) from the coordinates of placed text to those of a file; rounded to nine digits of its scale."""
    assert source.scale is not None
    text = frame_of_text(frame, source.scale)
    world = text.matrix()
    world[:3, :3] = np.round(text.axes, 9) * float(f"{text.scale:.7g}")
    nothing = 1e-6 * text.scale * SPAN / source.scale.cells_per_unit
    world[:3, 3] = np.where(np.abs(world[:3, 3]) < nothing, 0, world[:3, 3])
    return world + 0.0


def number(value: float) -> str:
    """A number with at most 12 digits and no trailing point."""
    return f"{value + 0.0:.12g}"


def prelude(name: str) -> str:
    """A file of this folder, with the definitions that scripts of one language use."""
    return Path(__file__).with_name(name).read_text(encoding="utf-8")


def needed(pieces: Sequence[str], text: str) -> list[str]:
    """The pieces of a prelude, in order, that a text needs; pieces without a definition are kept."""
    named = [(match[1] if (match := _DEFINED.search(piece)) else "", piece) for piece in pieces]
    used: set[str] = {""}
    waiting = [text, *(piece for name, piece in named if not name)]
    while waiting:
        called = set(_CALLED.findall(waiting.pop())) - used
        waiting += [piece for name, piece in named if name in called]
        used |= called
    return [piece for name, piece in named if name in used]


def _numbers(lines: Sequence[Line], first: int) -> tuple[Assignment | Comment, ...]:
    """The named numbers at the top of a script: all assignments, and the comments above the first part."""
    result: list[Line] = []
    for index, line in enumerate(lines):
        if isinstance(line, Comment) and index < first:
            result.append(line)
        elif isinstance(line, Assignment):
            notes = [line.note] + [""] * len(line.numbers)
            result += [Assignment((pair,), note) for pair, note in zip(line.numbers, notes, strict=False)]
    return without_double_blanks(tuple(result))  # type: ignore[return-value]


def _renamed(line: Line, words: dict[str, str], inner: str, boxed: bool) -> Line:
    """A line with free names; ``boxed`` if it is in a box inside of the whole, whose sizes have other names."""
    scope = {name: Name(word) for name, word in words.items()}
    scope |= {size: Name(inner + size if boxed else size) for size in SIZES}
    line = changed_values(line, lambda value: value_at(value, scope))
    if body := body_of(line):
        below = boxed or isinstance(line, Function) or (isinstance(line, Group) and line.kind in ("inside", "divide"))
        line = replace(line, body=tuple(_renamed(inner_line, words, inner, below) for inner_line in body))  # type: ignore[arg-type]
    match line:
        case Assignment(numbers):
            return replace(line, numbers=tuple((words.get(name, name), value) for name, value in numbers))
        case Function(name, parameters):
            new_parameters = tuple((words[word], value) for word, value in parameters)
            return replace(line, name=words[name], parameters=new_parameters)
        case Call(name, arguments):
            return replace(line, name=words[name], arguments=tuple((words.get(w, w), v) for w, v in arguments))
    return line


def _free_names(names: Sequence[str], reserved: Collection[str]) -> dict[str, str]:
    """Names of letters, digits and underscores that are no reserved words, all different."""
    unavailable, words = {*reserved, "_"}, dict[str, str]()
    for name in dict.fromkeys(names):
        word = name if name in SIZES else re.sub(r"[^A-Za-z0-9_]", "_", name)
        while name not in SIZES and (word in unavailable or word in words.values()):
            word += "_"
        words[name] = word
    return words


def _colours(words: Collection[str]) -> dict[str, str]:
    return {word: hexadecimal(word) for word in sorted(words)}

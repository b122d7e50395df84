"""OpenSCAD: parts are placed from the sides of a box, as in the program; named numbers are those of the customizer."""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Iterable, Iterator, Mapping
from decimal import Decimal

import numpy as np

from shapeprog.formats.scripts import Script, needed, number, prelude, script
from shapeprog.geometry.primitives.frustum import SEGMENTS
from shapeprog.language.ast import (
    Argument,
    Assignment,
    Call,
    Comment,
    Function,
    Group,
    Keywords,
    Line,
    Part,
    Point,
    note_of,
)
from shapeprog.language.expression import Expression, text_of
from shapeprog.language.named import MOST, Named
from shapeprog.language.parameters import shortest
from shapeprog.language.placement import BOX, ROUND, SIZES
from shapeprog.language.program import Program
from shapeprog.space import Frame

PRELUDE = prelude("prelude.scad")

_KEYWORDS = """
module function if else for let true false undef include use each assert echo PI segments colours unit
abs sign sin cos tan acos asin atan atan2 floor round ceil ln len log pow sqrt exp rands min max norm cross concat
lookup str chr ord search version version_num parent_module is_undef is_bool is_num is_string is_list is_function
cube sphere cylinder polyhedron square circle polygon text import projection surface render group
union difference intersection hull minkowski translate rotate scale resize mirror multmatrix color offset
linear_extrude rotate_extrude children intersection_for assign child echo roof
"""

SLACK = 1e-3  # of a step, within which an end is at a whole step: ends are float32

_GROUPS = {"mirror": "mirrored", "rotate": "rotated", "translate": "translated"}
"""Names of groups that OpenSCAD has for other modules."""


def scad_text(program: Program, frame: Frame, unit: str = "") -> str:
    """The OpenSCAD model of a program: x to the right, y to the rear, z up, in the unit of the program.

    Parameters
    ----------
    program
        What to write.
    frame
        From the grid to the coordinates of the file.
    unit
        Unit of the coordinates of the file; empty if it is not known.
    """
    made = script(program, frame, {*_KEYWORDS.split(), *re.findall(r"(?:module|function) (\w+)", PRELUDE)}, "$")
    lines = ["// Made by shapeprog. Change the numbers below, or use the customizer."]
    if made.unit:
        lines += [f"// Numbers are in {made.unit}{f', the model is in {unit}' if unit else ''}."]
    lines += ["", f"/* [Numbers{f', in {made.unit}' if made.unit else ''}] */"] if made.numbers else []
    lines += [text for entry in made.numbers for text in _number(entry, made.named, program.size <= MOST)]
    body = list(_model(made))
    if "segments" in (tools := "\n\n".join(needed(PRELUDE.strip().split("\n\n"), "\n".join(body)))):
        lines += ["", "/* [Quality] */", f"segments = {SEGMENTS}; // [12:4:128]"]
    table = ", ".join(f'["{word}", "{shade}"]' for word, shade in made.colours.items())
    lines += ["", "/* [Hidden] */", f"colours = [{table}];", '$role = "";', ""]
    return "\n".join([*lines, *body, "", tools, ""])


def _model(made: Script) -> Iterator[str]:
    """The functions and the model itself."""
    for line in made.lines:
        if isinstance(line, Function):
            yield from _lines([line], 0)
            yield ""
    if made.meshes:
        for mesh in made.meshes:
            points = ", ".join(_vector(np.round(vertex, 6)) for vertex in mesh.vertices)
            # OpenSCAD wants faces clockwise from outside.
            faces = ", ".join(f"[{a}, {c}, {b}]" for a, b, c in mesh.faces.tolist())
            yield f'painted("{mesh.word}") polyhedron(points = [{points}], faces = [{faces}], convexity = 10);'
        return
    rows = ", ".join(map(_vector, made.world))
    around = f"multmatrix([{rows}]) " if made.moved else f"scale({number(made.scale)}) " if made.scale != 1 else ""
    yield f"{around}whole(width, depth, height) {{"
    yield from _lines([line for line in made.lines if not isinstance(line, Function)], 1)
    yield "}"


def _number(entry: Assignment | Comment, named: Mapping[str, Named], ranged: bool) -> Iterator[str]:
    """A named number, with the range of its slider if it is no expression; or a comment.

    If ``ranged``, the program holds together within the range, in steps of the last digit of the number or less.
    """
    note = entry.text if isinstance(entry, Comment) else entry.note
    if note or isinstance(entry, Comment):
        yield f"// {note}" if note else ""
    for name, value in entry.numbers if isinstance(entry, Assignment) else ():
        slider = ""
        if not isinstance(value, Expression):
            size, whole = abs(value), named[name].whole and value == round(value)
            step = 1.0 if whole else 10.0 ** math.floor(math.log10(max(size, 1e-6) / 20))
            far = 10 * step * math.ceil(max(size, step) / (5 * step))
            low, high = (-far, 0.0) if value < 0 else (min(value, 1.0) if whole else 0.0, far)
            step = min(step, 10.0 ** int(Decimal(shortest(value)).as_tuple().exponent))
            ends = named[name].range if ranged else None
            if ends and ends[0] < ends[1]:  # a slider takes its start and whole steps from there
                low, high = step * math.ceil(ends[0] / step - SLACK), step * math.floor(ends[1] / step + SLACK)
            slider = f" // [{':'.join(map(number, (low, step, high)))}]"
        yield f"{name} = {text_of(value)};{slider}"


def _lines(lines: list[Line] | tuple[Line, ...], depth: int) -> Iterator[str]:
    indent = "  " * depth
    for line in lines:
        if isinstance(line, Comment):
            yield f"{indent}// {line.text}" if line.text else ""
            continue
        note = f" // {text}" if (text := note_of(line)) else ""
        match line:
            case Assignment(numbers):
                for name, value in numbers:
                    yield f"{indent}{name} = {text_of(value)};{note}"
                    note = ""
            case Part():
                role = f'part("{line.role}") ' if line.role and line.role != line.kind else ""
                upright = line.kind in ROUND and "start" not in dict(line.keywords)
                kind = f'upright("{line.kind}", ' if upright else f"{line.kind}("
                yield f"{indent}{role}{kind}{_keywords(line.keywords)});{note}"
            case Call():
                yield f"{indent}{_call(line)};{note}"
            case Function(name, parameters, body):
                declared = ", ".join(w if v is None else f"{w} = {text_of(v)}" for w, v in parameters)
                yield f"{indent}module {name}({declared}) {{{note}"
                yield from _lines(body, depth + 1)
                yield f"{indent}}}"
            case Group():
                yield f"{indent}{_group(line)} {{{note}"
                yield from _lines(line.body, depth + 1)
                yield f"{indent}}}"


def _call(line: Call) -> str:
    """A call in the box of its keywords; sizes of the box around in its arguments are evaluated outside of that."""
    box = tuple(pair for pair in line.arguments if pair[0] in (*BOX, "tilt"))
    arguments = [(word, text_of(value)) for word, value in line.arguments if (word, value) not in box]
    outside = [(word, text) for word, text in arguments if box and "$" in text]
    words = [f'part("{line.role}")'] if line.role else []
    if outside:
        words.append(f"let ({', '.join(f'$given_{word} = {text}' for word, text in outside)})")
    words += [f"inside({_keywords(box)})"] if box else []
    texts = (f"{word} = {f'$given_{word}' if (word, text) in outside else text}" for word, text in arguments)
    return " ".join([*words, f"{line.name}({', '.join(texts)})"])


def _group(line: Group) -> str:
    words = [] if line.count is None else [text_of(line.count)]
    words += [f'"{line.axis}"'] if line.axis else []
    keywords = line.keywords
    if line.kind == "row":
        words.append(_first(line.body) or "in_box()")
        keywords = dict(keywords)["last"].keywords  # type: ignore[union-attr]
    words += [_keywords(keywords)] if keywords else []
    return f"{_GROUPS.get(line.kind, line.kind)}({', '.join(words)})"


def _first(body: tuple[Line, ...]) -> str:
    """The box to which a row refers: that of the first part, call or group in its body; empty if there is none."""
    for line in body:
        match line:
            case Group(kind="inside" | "divide", keywords=keywords) | Call(arguments=keywords):
                return _box("in_box", keywords, BOX)
            case Part(kind=kind, keywords=keywords):
                start = dict(keywords).get("start")
                if isinstance(start, Point):  # a box without size
                    return _box("in_box", (*start.keywords, *((size, 0.0) for size in SIZES)), BOX)
                return _box("round_box", keywords, (*BOX, "radius")) if kind in ROUND else _box("in_box", keywords, BOX)
            case Group() if box := _first(line.body):
                return box
    return ""


def _box(function: str, keywords: Keywords, words: Collection[str]) -> str:
    """The intervals of a box by some of its keywords."""
    return f"{function}({_keywords([pair for pair in keywords if pair[0] in words])})"


def _keywords(keywords: Iterable[tuple[str, Argument]]) -> str:
    return ", ".join(f"{word} = {_argument(argument)}" for word, argument in keywords)


def _argument(argument: Argument) -> str:
    if isinstance(argument, Point):
        return f"at({_keywords(argument.keywords)})"
    return f"[{', '.join(map(text_of, argument))}]" if isinstance(argument, tuple) else text_of(argument)


def _vector(values: object) -> str:
    return f"[{', '.join(number(float(value)) for value in values)}]"  # type: ignore[attr-defined]

"""build123d out: a Python script with the loops kept, and STEP files made by running that same script."""

from __future__ import annotations

import ast
import builtins
import importlib.util
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from shapeprog.errors import OutputError
from shapeprog.files import atomic_path, write_text
from shapeprog.formats.colours import colour
from shapeprog.formats.parts import drawn_parts
from shapeprog.formats.plan import Definition, Invocation, Module, Repetition, Step, Variable
from shapeprog.formats.preamble import needed
from shapeprog.formats.symbolic import number
from shapeprog.formats.written_plan import script_plan
from shapeprog.language.program import Program
from shapeprog.space import Frame

_HEAD = '''"""Made by shapeprog. Change the numbers, then run this file to write {stem}.step (pip install build123d)."""

from math import atan2, degrees, dist, hypot

from build123d import Axis, Color, Compound, Face, Location, Plane, Shell, Solid, Vector, Wire, export_step
'''

_TOOLS = '''
parts = []
numbers = {}


def scaled(values):
    """Numbers of the program as units of the world."""
    return tuple(scale * value for value in values)


def cuboid(low, size, lean=0):
    """A box from its low corner and its extents; its top is shifted by lean along y (a shear, not a turn)."""
    if min(size) <= 0:
        return None
    (x, y, z), (a, b, c), lean = scaled(low), scaled(size), scale * lean
    corners = [(x, y, z), (x + a, y + lean, z), (x + a, y + lean + b, z), (x, y + b, z)]
    return Solid.extrude(Face(Wire.make_polygon([Vector(*corner) for corner in corners])), Vector(0, 0, c))


def cylinder_between(start, end, radius, end_radius=None):
    """A round bar between two points, which may be tapered."""
    height, last = dist(start, end), radius if end_radius is None else end_radius
    if height <= 0 or min(radius, last) < 0 or max(radius, last) == 0:
        return None
    plane = Plane(origin=scaled(start), z_dir=tuple(b - a for a, b in zip(start, end)))
    if radius == last:
        return Solid.make_cylinder(scale * radius, scale * height, plane)
    return Solid.make_cone(scale * radius, scale * last, scale * height, plane)


def tilted_box(at, size, tilt):
    """A box from its low corner, turned to the rear by tilt degrees about its bottom front edge."""
    return Location(scaled(at), (0, 0, tilt)) * Solid.make_box(*scaled(size)) if min(size) > 0 else None


def bar_between(start, end, section, turn):
    """A bar between two points, turned about them by turn degrees: the sides of its section lie along the axes that it
    runs along least, in their order, and are leaned with it."""
    along = [b - a for a, b in zip(start, end)]
    main = max(range(3), key=lambda k: abs(along[k]))
    size = [*section[:main], dist(start, end), *section[main:]]
    if min(size) <= 0:
        return None
    axis = Vector(*(float(k == main) for k in range(3)))
    leaned = Vector(*along) * (-1 if along[main] < 0 else 1)
    across = axis.cross(leaned)
    box = Solid.make_box(*scaled(size), Plane(scaled(-s / 2 for s in size))).rotate(Axis((0, 0, 0), axis), turn)
    if across.length > 0:
        box = box.rotate(Axis((0, 0, 0), across), degrees(atan2(across.length, axis.dot(leaned))))
    return Location(scaled((a + b) / 2 for a, b in zip(start, end))) * box


def arc_through(start, through, end, radius):
    """A round bar along the circle from one point through a second to a third, at most as thick as fills the ring."""
    half = dist(start, end) / 2
    if min(half, radius) <= 0:
        return None
    middle = (Vector(*start) + Vector(*end)) / 2
    unit, beside = (Vector(*end) - middle) / half, Vector(*through) - middle
    away = beside - unit * beside.dot(unit)
    rest = half**2 - beside.length**2
    # How high the circle rises over its chord.
    rise = 2 * away.length * half**2 / max(hypot(2 * away.length * half, rest) + rest, 1e-9)
    if rise <= half / 100000:
        return cylinder_between(start, end, radius)
    ring, bulge = (half**2 + rise**2) / (2 * rise), away.normalized()
    centre = middle + bulge * (rise - ring)
    plane = Plane(scaled(centre), x_dir=Vector(*start) - centre, z_dir=bulge.cross(unit))
    angle = degrees(4 * atan2(rise, half))
    return Solid.make_torus(scale * ring, scale * min(radius, 0.9999 * ring), plane, major_angle=angle)


def rounded_box(at, size, edge):
    """A box from its low corner, with rounded edges."""
    if min(size) <= 0:
        return None
    box, radius = Solid.make_box(*scaled(size), Plane(scaled(at))), min(edge, 0.9999 * min(size) / 2)
    return box.fillet(scale * radius, box.edges()) if radius > 0 else box


def shell(centre, half, mesh):
    """Any other solid: its mesh in a box of half extents 1, stretched and put at its centre."""
    if min(half) <= 0:
        return None
    points = [Vector(*scaled(c + h * v for c, h, v in zip(centre, half, vertex))) for vertex in mesh[0]]
    return Solid(Shell([Face(Wire.make_polygon([points[k] for k in face])) for face in mesh[1]]))


class Place:
    """Where a solid goes: steps of which the last is done first."""

    def __init__(self, *steps):
        self.steps = steps

    def __mul__(self, inner):
        return Place(*self.steps, *inner.steps)

    def __call__(self, solid):
        for step in reversed(self.steps):
            solid = step(solid)
        return solid


def located(location):
    """A rigid motion."""
    return Place(lambda solid: location * solid)


def posed(centre, axes):
    """Local axes as columns of a rotation, about a point."""
    x, _, z = zip(*axes)
    return located(Location(Plane(origin=scaled(centre), x_dir=x, z_dir=z)))


def move(i, by):
    """Copy i of a translation loop."""
    return located(Location(scaled(i * step for step in by)))


def turn(degrees, about):
    """A turn about the vertical axis (x) through a point."""
    there, back = scaled((0, about[1], about[2])), scaled((0, -about[1], -about[2]))
    return located(Location(there) * Location((0, 0, 0), (degrees, 0, 0)) * Location(back))


def reflect(signs):
    """The mirror image along every axis whose sign is negative."""
    planes = [plane for plane, sign in zip((Plane.YZ, Plane.XZ, Plane.XY), signs) if sign < 0]
    return Place(*[lambda solid, plane=plane: solid.mirror(plane) for plane in planes])


def draw(name, colour, solid, at=Place()):
    """Put a solid into the world and keep it; one without volume draws nothing."""
    if solid is not None:
        part = world * at(solid)
        numbers[name] = numbers.get(name, 0) + 1
        part.label, part.color = f"{name}_{numbers[name]}", Color(*colour)
        parts.append(part)


'''

_TAIL = '''
model = Compound(label="{stem}", children=parts)


def union():
    """All parts as one solid."""
    return parts[0].fuse(*parts[1:]) if len(parts) > 1 else parts[0]


if __name__ == "__main__":
    export_step(model, "{stem}.step")
'''


_PLACE = "place"
"""The parameter of functions for the placement of their parts."""


def write_script(program: Program, path: Path, frame: Frame) -> None:
    """Write a build123d script; run, it makes a compound of named, coloured solids and writes it as STEP."""
    write_text(path, script_text(program, frame, path.stem))


MOST_SOLIDS = 1 << 11
"""Most solids of a STEP file: build123d takes some milliseconds for each."""


def write_step(program: Program, path: Path, frame: Frame) -> None:
    """Write named, coloured solids as STEP; a world unit counts as a millimetre.

    Raises
    ------
    OutputError
        If build123d is not installed, or the program draws nothing or more than ``MOST_SOLIDS``.
    """
    if (count := len(drawn_parts(program))) > MOST_SOLIDS:
        raise OutputError(
            f"the {count} parts of this program are too many for STEP, which takes at most {MOST_SOLIDS}",
            "lower the counts, or export a .py script, which keeps the loops, and run it where there is time",
        )
    if importlib.util.find_spec("build123d") is None:
        raise OutputError(
            f"cannot write {path}: STEP needs the library build123d, which is not installed",
            "pip install build123d, or export a .py script and run it where build123d is",
        )
    made: dict[str, Any] = {"__name__": "shapeprog_model"}
    # The script consists of checked names and numbers; running it avoids a second implementation of the geometry.
    exec(compile(script_text(program, frame, path.stem), f"{path.stem}.py", "exec"), made)
    with atomic_path(path) as temporary:
        if not made["export_step"](made["model"], str(temporary)):
            raise OutputError(f"cannot write {path}: build123d could not write the STEP file", "check path and disk")


def script_text(program: Program, frame: Frame, stem: str = "model") -> str:
    """The build123d script of a program.

    Inside the model x is up, y is depth (positive = rear) and z is left-right, in the unit of the program.
    """
    made = script_plan(program, _reserved())
    stem = "".join(letter for letter in stem if letter.isprintable() and letter not in "\"'\\{}") or "model"
    axes = np.asarray(frame.axes)
    lines = [_HEAD.format(stem=stem), f"# Lengths are in {made.word}."]
    for heading in made.headings:
        lines += [f"# {heading.name}: {heading.doc}"]
        lines += [f"{each.name} = {each.text}{_note(each)}" for each in heading.variables]
        lines += [""]
    for each in made.numbers:
        lines += [f"{each.name} = {each.text}" + (f"  # {each.note}" if each.note else "")]
    lines += [""] if made.numbers else []
    columns = [_tuple(axes[:, column]) for column in (0, 2)]
    lines += [f"# From {made.word} to the world of the input.", f"scale = {number(frame.scale / made.cell)}"]
    lines += [f"world = Location(Plane(origin={_tuple(frame.centre)}, x_dir={columns[0]}, z_dir={columns[1]}))"]
    for name, (vertices, faces) in made.shells.items():
        points = ", ".join(_tuple(np.round(vertex, 9)) for vertex in vertices)
        lines += [f"{name} = ([{points}], {[tuple(face) for face in faces.tolist()]})"]
    for name, table in made.tables.items():
        lines += [f"{name} = {table.tolist()}"]
    functions = [line for function in made.functions for line in _function(function)]
    steps = [line for step in made.body for line in _step(step, 0, "")]
    body = "\n".join([*functions, *steps, ""])
    tools = "\n\n\n".join(needed(_TOOLS.strip().split("\n\n\n"), body))
    return "\n".join(lines) + f"\n{tools}\n\n\n{body}" + _TAIL.format(stem=stem)


def _function(function: Module) -> Iterator[str]:
    given = [name if default is None else f"{name}={default}" for name, default in function.parameters]
    yield f"def {function.name}({', '.join([*given, f'{_PLACE}=Place()'])}):"
    if function.note:
        yield f"    # {function.note}"
    for step in function.body:
        yield from _step(step, 1, _PLACE)
    yield from () if function.body else ("    pass",)
    yield from ("", "")


def _reserved() -> set[str]:
    """Reserved words of these scripts."""
    script = ast.parse(_HEAD + _TOOLS + _TAIL)
    found = {*dir(builtins), "scale", "world", _PLACE}
    for node in script.body:
        match node:
            case ast.ImportFrom(_, aliases):
                found |= {alias.name for alias in aliases}
            case ast.FunctionDef(name) | ast.ClassDef(name):
                found.add(name)
            case ast.Assign([ast.Name(name)]):
                found.add(name)
    return found


def _note(each: Variable) -> str:
    return "  # not used below: changing it has no effect" if each.fixed else ""


def _tuple(values: Any) -> str:
    return f"({', '.join(number(float(value)) for value in values)})"


def _step(step: Step, depth: int, place: str) -> Iterator[str]:
    indent = "    " * depth
    if isinstance(step, Definition):
        yield f"{indent}{step.name} = {step.text}"
        return
    if isinstance(step, Invocation):
        given = [f"{name}={text}" for name, text in step.arguments] + ([f"{_PLACE}={place}"] if place else [])
        yield f"{indent}{step.name}({', '.join(given)})"
        return
    if isinstance(step, Repetition):
        words = [place] if place else []
        words += [f"move({step.shift[0]}, {step.shift[1]})"] if step.shift else []
        words += [f"turn({', '.join(step.turn)})"] if step.turn else []
        words += [f"reflect({step.signs})"] if step.signs else []
        yield f"{indent}for {step.letter} in range({step.count}):"
        if words[1 if place else 0 :]:
            yield f"{indent}    at_{step.letter} = {' * '.join(words)}"
            place = f"at_{step.letter}"
        for inner in step.body:
            yield from _step(inner, depth + 1, place)
        return
    arguments, around = list(step.arguments), place
    if step.axes is not None:
        axes = f"({', '.join(_tuple(np.round(row, 12)) for row in step.axes)})"
        around = f"{place} * posed({arguments[0]}, {axes})" if place else f"posed({arguments[0]}, {axes})"
        lean = f" - ({arguments[2]}) / 2" if len(arguments) > 2 else ""
        half = [f"-({arguments[1]})[{k}] / 2" for k in range(3)]
        half[1] += lean
        arguments[0] = f"[{', '.join(half)}]" if step.kind == "cuboid" else "(0, 0, 0)"
    call = f"{step.kind}({', '.join([*arguments, *([step.shell] if step.shell else [])])})"
    name = step.name.rpartition("_")[0]
    shade = "({:.3f}, {:.3f}, {:.3f})".format(*(channel / 255 for channel in colour(step.statement)))
    yield f'{indent}draw("{name}", {shade}, {call}{f", {around}" if around else ""})'

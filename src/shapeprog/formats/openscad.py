"""OpenSCAD out: loops stay loops, and every number is a named variable at the top, ready for the customizer."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from shapeprog.files import write_text
from shapeprog.formats.colours import colour
from shapeprog.formats.plan import (
    Definition,
    Heading,
    Invocation,
    Module,
    Plan,
    Repetition,
    Solid,
    Step,
    Variable,
)
from shapeprog.formats.preamble import needed
from shapeprog.formats.symbolic import number
from shapeprog.formats.written_plan import script_plan
from shapeprog.geometry.primitives.cylinder import SEGMENTS
from shapeprog.language.program import Program
from shapeprog.space import Frame

_MODULES = """
// A box from its low corner and its extents; its top is shifted by lean along y (a shear, not a turn).
module cuboid(low, size, lean = 0) {
  if (min(size) > 0) translate(low)
    multmatrix([[1, 0, 0, 0], [lean / size[0], 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]) cube(size);
}

// A round bar between two points, which may be tapered; as a prism of the same volume as the true one.
module cylinder_between(start, end, radius, end_radius = undef) {
  last = is_undef(end_radius) ? radius : end_radius;
  fuller = sqrt(2 * PI / segments / sin(360 / segments));
  along = end - start;
  height = norm(along);
  flat = norm([along[0], along[1]]);
  if (height > 0 && min(radius, last) >= 0 && max(radius, last) > 0) translate(start)
    rotate([0, acos(max(-1, min(1, along[2] / height))), flat > 0 ? atan2(along[1], along[0]) : 0])
      cylinder(h = height, r1 = radius * fuller, r2 = last * fuller, $fn = segments);
}

// A box from its low corner, turned to the rear by tilt degrees about its bottom front edge.
module tilted_box(at, size, tilt) {
  if (min(size) > 0) translate(at) rotate([0, 0, tilt]) cube(size);
}

// A bar between two points, turned about them by turn degrees: the sides of its section lie along the axes that it runs
// along least, in their order, and are leaned with it.
module bar_between(start, end, section, turn) {
  along = end - start;
  far = [for (way = along) abs(way)];
  main = far[0] == max(far) ? 0 : far[1] == max(far) ? 1 : 2;
  axis = [for (k = [0:2]) k == main ? 1 : 0];
  size = main == 0 ? [norm(along), section[0], section[1]] :
         main == 1 ? [section[0], norm(along), section[1]] : [section[0], section[1], norm(along)];
  leaned = along[main] < 0 ? -along : along;
  across = cross(axis, leaned);
  if (min(size) > 0) translate((start + end) / 2)
    rotate(atan2(norm(across), leaned[main]), across) rotate(turn * axis) cube(size, center = true);
}

// A round bar along the circle from one point through a second to a third, at most as thick as fills the ring; its
// prisms have the volume of the true one.
module arc_through(start, through, end, radius) {
  middle = (start + end) / 2;
  half = norm(end - start) / 2;
  unit = (end - start) / (2 * half);
  along = (through - middle) * unit;
  away = through - middle - along * unit;
  height = norm(away);
  rest = half * half - along * along - height * height;
  // How high the circle rises over its chord.
  rise = 2 * height * half * half / (norm([2 * height * half, rest]) + rest);
  if (half > 0 && radius > 0) {
    if (rise > half / 100000) {
      ring = (half * half + rise * rise) / (2 * rise);
      angle = 4 * atan2(rise, half);
      step = angle / segments;
      fuller = sqrt(2 * PI / segments / sin(360 / segments) * step * PI / 180 / sin(step));
      thick = min(min(radius, ring) * fuller, 0.9999 * ring / cos(180 / segments));
      bulge = away / height;
      side = cross(bulge, unit);
      posed(middle + (rise - ring) * bulge, [for (k = [0:2]) [bulge[k], unit[k], side[k]]])
        rotate([0, 0, -angle / 2]) rotate_extrude(angle = angle, $fn = segments * 360 / angle)
          translate([ring, 0]) rotate(180 / segments) circle(r = thick, $fn = segments);
    } else cylinder_between(start, end, radius);
  }
}

// A box from its low corner, with rounded edges: a ball of polygons around it, pulled apart.
module rounded_box(at, size, edge) {
  radius = min(edge, min(size) / 2);
  last = segments / 2 - 1;
  step = 360 / segments;
  fuller = 1 / cos(step / 2);
  if (min(size) > 0 && radius > 0) {
    points = [for (tilt = [step / 2:step:180], a = [step / 2:step:360])
      let (way = [cos(tilt), sin(tilt) * cos(a) * fuller, sin(tilt) * sin(a) * fuller])
        [for (n = [0:2]) at[n] + size[n] / 2 + sign(way[n]) * (size[n] / 2 - radius) + way[n] * radius * fuller]];
    caps = [[for (j = [1:segments]) segments - j], [for (j = [0:segments - 1]) last * segments + j]];
    sides = [for (k = [0:last - 1], j = [0:segments - 1])
      let (a = k * segments + j, b = k * segments + (j + 1) % segments) [a, b, b + segments, a + segments]];
    polyhedron(points = points, faces = concat(caps, sides), convexity = 2);
  } else cuboid(at, size);
}

// Any other solid: its mesh in a box of half extents 1, stretched and put at its centre.
module shell(centre, half, mesh) {
  if (min(half) > 0) translate(centre) scale(half) polyhedron(points = mesh[0], faces = mesh[1], convexity = 10);
}

// Local axes as columns of a rotation, about a point.
module posed(centre, axes) {
  multmatrix([for (r = [0:2]) [axes[r][0], axes[r][1], axes[r][2], centre[r]]]) children();
}

// Copy i of a translation loop.
module move(i, by) { translate(i * by) children(); }

// The mirror image along every axis whose sign is negative.
module reflect(signs) {
  multmatrix([[signs[0], 0, 0, 0], [0, signs[1], 0, 0], [0, 0, signs[2], 0], [0, 0, 0, 1]]) children();
}

// A turn about the vertical axis (x) through a point.
module turn(degrees, about = [0, 0, 0]) {
  translate([0, about[1], about[2]]) rotate([degrees, 0, 0]) translate([0, -about[1], -about[2]]) children();
}
"""


_KEYWORDS = """
module function if else for let true false undef include use each assert echo PI segments world
abs sign sin cos tan acos asin atan atan2 floor round ceil ln len log pow sqrt exp rands min max norm cross concat
lookup str chr ord search version version_num parent_module is_undef is_bool is_num is_string is_list is_function
cube sphere cylinder polyhedron square circle polygon text import projection surface render group
union difference intersection hull minkowski translate rotate scale resize mirror multmatrix color offset
linear_extrude rotate_extrude children intersection_for assign child echo roof
"""


def write_scad(program: Program, path: Path, frame: Frame) -> None:
    """Write an OpenSCAD model; the outermost transformation maps it to the coordinates of the input."""
    write_text(path, scad_text(program, frame))


def scad_text(program: Program, frame: Frame) -> str:
    """The OpenSCAD model of a program.

    Inside the model x is up, y is depth (positive = rear) and z is left-right, in the unit of the program.
    """
    made = script_plan(program, _reserved())
    lines = ["// Made by shapeprog. Change the numbers below, or use the customizer."]
    lines += [f"// Lengths are in {made.word}.", ""]
    if made.numbers:
        lines += ["/* [Numbers] */", *(line for each in made.numbers for line in _definition(each, made.step)), ""]
    for heading in made.headings:
        lines += [*_heading(heading, made), ""]
    lines += ["/* [Quality and place] */", f"segments = {SEGMENTS}; // [12:4:128]"]
    placed = replace(frame, scale=frame.scale / made.cell).matrix()
    matrix = ", ".join(f"[{', '.join(number(value) for value in row)}]" for row in placed)
    lines += [f"// From {made.word} to the world of the input.", f"world = [{matrix}];", ""]
    lines += ["/* [Hidden] */", *_tables(made)]
    body = [line for function in made.functions for line in [*_module(function), ""]]
    body += ["multmatrix(world) union() {"]
    body += [line for step in made.body for line in _step(step, 1)]
    tools = [f"{piece}\n" for piece in needed(_MODULES.strip().split("\n\n"), "\n".join(body))]
    return "\n".join([*lines, *tools, *body, "}", ""])


def _heading(heading: Heading, made: Plan) -> Iterator[str]:
    yield f"/* [{heading.name}] */"
    yield f"// {heading.doc}"
    for each in heading.variables:
        yield f"{each.name} = {each.text}; // {_range(each, made)}"


def _definition(each: Definition, step: float) -> Iterator[str]:
    if each.note:
        yield f"// {each.note}"
    slider = ""
    if each.value is not None:
        far = 10 * step * np.ceil(abs(each.value) / (5 * step))
        low, high = sorted((0.0, np.copysign(far, each.value)))
        if each.whole:  # a share of a span between copies is undefined for one copy
            low = min(2.0, each.value)
        slider = f" // [{number(low)}:{1 if each.whole else number(step)}:{number(max(high, 10 * step))}]"
    yield f"{each.name} = {each.text};{slider}"


def _module(function: Module) -> Iterator[str]:
    if function.note:
        yield f"// {function.note}"
    given = [name if default is None else f"{name} = {default}" for name, default in function.parameters]
    yield f"module {function.name}({', '.join(given)}) {{"
    for step in function.body:
        yield from _step(step, 1)
    yield "}"


def _reserved() -> set[str]:
    """Reserved words of OpenSCAD and of these scripts."""
    return {*_KEYWORDS.split(), *re.findall(r"(?:module|function) (\w+)", _MODULES)}


def _range(each: Variable, made: Plan) -> str:
    if each.fixed:
        return "not used below: changing it has no effect"
    cell, whole = (made.cell, 10 * made.step) if each.quantity.spatial else (1.0, 1.0)
    step = 1 if each.quantity.discrete else whole / 2
    values = [float(word) for word in each.text.strip("[]").split(",")]
    low, high = min(each.quantity.low * cell, *values, 0), max(each.quantity.high * cell, *values)
    return f"[{number(whole * np.floor(low / whole))}:{number(step)}:{number(whole * np.ceil(high / whole))}]"


def _tables(made: Plan) -> Iterator[str]:
    for name, (vertices, faces) in made.shells.items():
        points = ", ".join(f"[{', '.join(number(round(value, 9)) for value in vertex)}]" for vertex in vertices)
        # OpenSCAD wants faces clockwise from outside.
        triangles = ", ".join(f"[{a}, {c}, {b}]" for a, b, c in faces.tolist())
        yield f"{name} = [[{points}], [{triangles}]];"
    for name, table in made.tables.items():
        rows = [number(row) if np.ndim(row) == 0 else f"[{', '.join(map(number, row))}]" for row in table]
        yield f"{name} = [{', '.join(rows)}];"


def _step(step: Step, depth: int) -> Iterator[str]:
    indent = "  " * depth
    if isinstance(step, Definition):
        yield f"{indent}{step.name} = {step.text};"
        return
    if isinstance(step, Invocation):
        yield f"{indent}{step.name}({', '.join(f'{name} = {text}' for name, text in step.arguments)});"
        return
    if isinstance(step, Repetition):
        words = [f"for ({step.letter} = [0 : 1 : {step.count} - 1])"]
        words += [f"move({step.shift[0]}, {step.shift[1]})"] if step.shift else []
        words += [f"turn({', '.join(step.turn)})"] if step.turn else []
        words += [f"reflect({step.signs})"] if step.signs else []
        yield f"{indent}{' '.join(words)} {{"
        for inner in step.body:
            yield from _step(inner, depth + 1)
        yield f"{indent}}}"
        return
    shade = ", ".join(f"{channel / 255:.3f}" for channel in colour(step.statement))
    yield f"{indent}color([{shade}]) {_call(step)}; // {step.name}"


def _call(step: Solid) -> str:
    arguments, around = list(step.arguments), ""
    if step.axes is not None:
        axes = ", ".join(f"[{', '.join(number(round(value, 12)) for value in row)}]" for row in step.axes)
        around = f"posed({arguments[0]}, [{axes}]) "
        lean = f" - [0, ({arguments[2]}) / 2, 0]" if len(arguments) > 2 else ""
        arguments[0] = f"-{arguments[1]} / 2{lean}" if step.kind == "cuboid" else "[0, 0, 0]"
    return f"{around}{step.kind}({', '.join([*arguments, *([step.shell] if step.shell else [])])})"

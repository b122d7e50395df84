"""A small twin of the scripts for CAD: it runs the expressions of a plan, to be compared with what unrolling draws."""

from __future__ import annotations

import math

import numpy as np
import torch

from shapeprog.formats.plan import Definition, Invocation, Repetition
from shapeprog.geometry.primitive import primitives
from shapeprog.language import unroll
from shapeprog.language.tensors import encode


def matrix(linear=None, shift=(0, 0, 0)):
    out = np.eye(4)
    out[:3, :3], out[:3, 3] = np.eye(3) if linear is None else linear, shift
    return out


def move(i, by):
    return matrix(shift=i * np.array(by))


def turn(degrees, about):
    axis = np.array([0, *about[1:]])
    return matrix(shift=axis) @ matrix(spin(np.eye(3)[0], degrees)) @ matrix(shift=-axis)


def spin(axis, degrees):
    """The rotation about an axis of any length, by Rodrigues."""
    length = np.linalg.norm(axis)
    cross = np.cross(np.eye(3), axis / max(length, 1e-12))
    angle = math.radians(degrees)
    return np.eye(3) + math.sin(angle) * cross + (1 - math.cos(angle)) * cross @ cross


CORNERS = np.array([[a, b, c] for a in (0, 1) for b in (0, 1) for c in (0, 1)])


def cuboid(low, size, lean=0.0):
    return low + CORNERS * size + CORNERS[:, :1] * [0, lean, 0]


def tilted_box(at, size, tilt):
    return at + CORNERS * size @ spin(np.eye(3)[2], tilt).T


def bar_between(start, end, section, turn):
    along = end - start
    main = int(np.abs(along).argmax())
    size = np.insert(section, main, np.linalg.norm(along))
    axis, upright = np.eye(3)[main], along * np.sign(along[main])
    lean = math.degrees(math.acos(min(1, upright[main] / size[main])))
    rotation = spin(np.cross(axis, upright), lean) @ spin(axis, turn)
    return (start + end) / 2 + (CORNERS - 0.5) * size @ rotation.T


def cylinder_between(start, end, *radii):
    along = (end - start) / max(np.linalg.norm(end - start), 1e-12)
    return np.stack([start, end]), np.array([radii[0], radii[-1]]), np.stack([along, along])


WAYS = np.linspace(0, 1, 2001)


def arc_through(start, through, end, radius):
    """By the centre of the circle through three points, and angles from the first."""
    one, two = through - start, end - start
    axis = np.cross(one, two)
    square = axis @ axis
    reach = np.cross(one @ one * two - two @ two * one, axis) / (2 * square)
    centre, axis = start + reach, axis / math.sqrt(square)
    ring = np.linalg.norm(reach)
    first = -reach / ring
    second = np.cross(axis, first)
    whole = math.atan2((end - centre) @ second, (end - centre) @ first) % (2 * math.pi)
    angle = (WAYS * whole)[:, None]
    points = centre + ring * (np.cos(angle) * first + np.sin(angle) * second)
    return points, np.full(len(WAYS), min(radius, ring)), np.cos(angle) * second - np.sin(angle) * first


def rounded_box(at, size, edge):
    radius = min(edge, size.min() / 2)
    return at + radius + CORNERS * (size - 2 * radius), np.full(8, radius), np.zeros((8, 3))


REFERENCES = (cuboid, tilted_box, bar_between, cylinder_between, arc_through, rounded_box)


def described(points, radius=None, along=None, place=None):
    """Bounding box and second moments: of points that are corners, or of discs across ``along`` or balls about them.

    The place is a rigid motion, or a reflection, and a change of scale.
    """
    place = np.eye(4) if place is None else place
    world = points @ place[:3, :3].T + place[:3, 3]
    spread = np.zeros_like(world)
    if radius is not None:
        scale = np.linalg.norm(place[0, :3])
        spread = scale * np.array(radius)[:, None] * np.sqrt(np.maximum(0, 1 - (along @ place[:3, :3].T / scale) ** 2))
    bounds = [(world - spread).min(0), (world + spread).max(0)]
    return (np.round(np.concatenate([*bounds, (world.T @ world / len(world)).ravel()]), 5) + 0.0).tolist()


def evaluate(made, changed=None):
    """What the solids of a plan are in cells, by its expressions alone, see :func:`described`; numbers may be changed
    first."""
    names = {v.name: eval(v.text) for heading in made.headings for v in heading.variables}
    names |= {name: table.tolist() for name, table in made.tables.items()} | (changed or {})
    for number in made.numbers:
        if number.name not in names:
            names[number.name] = eval(number.text, {}, names)
    functions = {function.name: function for function in made.functions}
    references = {function.__name__: function for function in REFERENCES}
    found = []

    def run(steps, place, scope):
        for step in steps:
            if isinstance(step, Definition):
                scope = scope | {step.name: eval(step.text, {}, scope)}
                continue
            if isinstance(step, Invocation):
                function = functions[step.name]
                given = {name: eval(text, {}, names) for name, text in function.parameters if text is not None}
                given |= {name: eval(text, {}, scope) for name, text in step.arguments}
                run(function.body, place, names | given)
                continue
            if isinstance(step, Repetition):
                for copy in range(eval(step.count, {}, scope)):
                    inner = scope | {step.letter: copy}
                    here = place
                    if step.shift:
                        here = here @ move(*(eval(word, {}, inner) for word in step.shift))
                    if step.turn:
                        here = here @ turn(*(eval(word, {}, inner) for word in step.turn))
                    if step.signs:
                        here = here @ np.diag([*eval(step.signs, {}, inner), 1])
                    run(step.body, here, inner)
                continue
            arguments = [np.array(eval(word, {}, scope), float) for word in step.arguments]
            here = place
            if step.axes is not None:
                here = place @ matrix(step.axes, arguments[0])
                arguments[0] = np.zeros(3)
                if step.kind == "cuboid":
                    arguments[0] = -arguments[1] / 2 - [0, float(arguments[2]) / 2 if len(arguments) > 2 else 0, 0]
            if step.kind == "shell":
                found.append(described(made.shells[step.shell][0] * arguments[1] + arguments[0], place=here))
                continue
            drawn = references[step.kind](*arguments)
            found.append(described(*(drawn if isinstance(drawn, tuple) else (drawn,)), place=here))

    run(made.body, np.diag([*np.full(3, 1 / made.cell), 1]), names)
    return sorted(found)


def expected(program):
    """The same from the sizes and poses of the unrolled program."""
    scene = unroll(encode(program, dtype=torch.float64))
    found = []
    for slot in torch.nonzero(scene.mask)[:, 0].tolist():
        size, centre, rotation = (t[slot].numpy() for t in (scene.size, scene.centre, scene.rotation))
        kind, place = primitives[int(scene.kind[slot])], matrix(rotation, centre)
        if kind.name in ("cylinder", "frustum"):
            ends, axis = np.array([[-size[0], 0, 0], [size[0], 0, 0]]), np.eye(3)[[0, 0]]
            found.append(described(ends, size[[1, 1 if kind.name == "cylinder" else 2]], axis, place))
        elif kind.name == "rounded_box":
            inner = size[:3] - min(size[3], size[:3].min())
            found.append(described((2 * CORNERS - 1) * inner, np.full(8, size[0] - inner[0]), np.zeros((8, 3)), place))
        elif kind.name == "arc":
            half, radius, rise = size[:3]
            ring = (half**2 + rise**2) / (2 * rise)
            sine, cosine = (f((2 * WAYS - 1) * 2 * math.atan2(rise, half)) for f in (np.sin, np.cos))
            points = np.stack([ring * sine, rise / 2 - ring * (1 - cosine), 0 * sine], 1)
            along = np.stack([cosine, -sine, 0 * sine], 1)
            found.append(described(points, np.full(len(WAYS), min(radius, ring)), along, place))
        else:
            found.append(described(kind.mesh(size)[0], place=place))
    return sorted(found)


def same(one, two):
    assert len(one) == len(two)
    np.testing.assert_allclose(one, two, atol=2e-4)

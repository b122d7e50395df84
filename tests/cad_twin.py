"""What scripts for CAD draw: the solids of an OpenSCAD model, of a build123d script, and of the meshes of a program."""

from __future__ import annotations

import json
import re
import subprocess
from itertools import pairwise
from pathlib import Path

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.spatial import ConvexHull

from shapeprog.formats.parts import parts


def of_meshes(program, frame):
    """Bounds and volume of every part, a row each."""
    return [(*part.vertices.min(0), *part.vertices.max(0), volume_of(part)) for part in parts(program, frame)]


def volume_of(part):
    """Volume enclosed by a part, by the divergence theorem."""
    return float(np.linalg.det(part.vertices[part.faces]).sum() / 6)


def of_build123d(script):
    """The same of the solids of a script."""
    scope = {"__name__": "model"}
    exec(compile(script, "script", "exec"), scope)
    boxes = [(part.bounding_box(optimal=True), part.volume) for part in scope["parts"]]
    return [(*tuple(box.min), *tuple(box.max), volume) for box, volume in boxes]


def of_openscad(text, folder: Path, changes=None):
    """The same of an OpenSCAD model, from the tree of primitives that it comes to; warnings are errors."""
    (folder / "model.scad").write_text(text)
    given = [word for name, value in (changes or {}).items() for word in ("-D", f"{name}={value}")]
    ended = subprocess.run(
        ["openscad", "-o", "model.csg", *given, "model.scad"], cwd=folder, check=True, capture_output=True, text=True
    )
    assert "WARNING" not in ended.stderr, ended.stderr
    found = []
    _read(re.findall(r"-?\d[\d.e+-]*|[\w$]+|[\[\](){},;=-]", (folder / "model.csg").read_text()), np.eye(4), found)
    return [(*vertices.min(0), *vertices.max(0), volume) for vertices, volume in found if volume > 0]


def same(found, wanted, tolerance=3e-3):
    """Whether solids are alike, in any order: bounds within a share of the size of all, volumes within 0.5 %."""
    assert len(found) == len(wanted)
    one, two = np.array(found), np.array(wanted)
    apart = np.abs(one[:, None, :6] - two[None, :, :6]).max(-1) / np.ptp(two[:, :6])
    apart += 0.1 * np.abs(np.log(one[:, None, 6] / two[None, :, 6]))
    pairs = linear_sum_assignment(apart)
    np.testing.assert_allclose(apart[pairs], 0, atol=tolerance)


def _read(tokens, place, found):
    """Read statements until a brace closes: ``name(arguments) { ... }`` or ``name(arguments);``."""
    while tokens and tokens[0] != "}":
        name, depth, words = tokens.pop(0), 0, []
        while not words or depth:
            depth += {"(": 1, ")": -1}.get(tokens[0], 0)
            words.append(tokens.pop(0))
        arguments = _arguments("".join(words[1:-1]))
        block = tokens.pop(0) == "{"
        if name == "rotate_extrude":
            profile = []
            _read(tokens, np.eye(4), profile)
            found.append(_extruded(profile[0][0], arguments, place))
        elif block:
            _read(tokens, place @ np.array(arguments[0]) if name == "multmatrix" else place, found)
        elif name in ("cube", "cylinder", "polyhedron", "circle"):  # others have nothing inside
            points = _points(name, arguments) @ place[:3, :3].T + place[:3, 3]
            found.append((points, 0 if name == "circle" else ConvexHull(points).volume))  # all others are convex
        if block:
            tokens.pop(0)


def _arguments(text):
    named = re.sub(r"([$\w]*[$a-z]\w*)=", r'"\1":', text)
    if named == text:
        return json.loads(f"[{text}]")
    return json.loads(f"{{{named}}}")


def _points(name, arguments):
    if name == "cube":
        low = -0.5 if arguments["center"] else 0
        return (np.array(list(np.ndindex(2, 2, 2))) + low) * arguments["size"]
    if name == "polyhedron":
        return np.array(arguments["points"])
    angles = np.arange(arguments["$fn"]) * 2 * np.pi / arguments["$fn"]
    circle = np.stack([np.cos(angles), np.sin(angles), 0 * angles], 1)
    if name == "circle":
        return circle * arguments["r"]
    return np.concatenate([circle * arguments["r1"], circle * arguments["r2"] + [0, 0, arguments["h"]]])


def _extruded(profile, arguments, place):
    """A profile turned about z: its points, and the sum of its convex slices."""
    steps = round(arguments["$fn"] * arguments["angle"] / 360)
    angles = np.radians(arguments["angle"]) * np.arange(steps + 1) / steps
    ways = np.stack([np.cos(angles), np.sin(angles), 0 * angles], 1)
    points = profile[None, :, :1] * ways[:, None] + profile[None, :, 1:2] * [0, 0, 1]
    points = points @ place[:3, :3].T + place[:3, 3]
    volume = sum(ConvexHull(np.concatenate(pair)).volume for pair in pairwise(points))
    return points.reshape(-1, 3), volume

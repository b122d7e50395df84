"""The words of build123d scripts: boxes placed in boxes, roles, loops, solids."""

from __future__ import annotations

HEAD = '''"""Made by shapeprog. Change the numbers, then run this file to write {stem}.step (pip install build123d)."""

from collections import Counter
from contextlib import contextmanager
from itertools import product
from math import atan2, degrees, hypot
from types import SimpleNamespace

from build123d import (
    Align, Axis, Box, Color, Compound, Cone, Cylinder, Face, Location, Plane, Pos, Rot, Shell, Solid, Unit, Vector,
    Wire, export_step, fillet,
)
'''
"""The beginning, with the imports; ``stem`` is the name of the STEP file."""

TOOLS = '''
WORDS = (("left", "right", "width", "x"), ("front", "rear", "depth", "y"), ("bottom", "top", "height", "z"))
SIDES = {word for words in WORDS for word in words} | {"tilt"}
LOW, BOTTOM = (Align.MIN, Align.MIN, Align.MIN), (Align.CENTER, Align.CENTER, Align.MIN)
parts = []
# The box around, and the motions of the solids drawn in it, the outermost first.
here = SimpleNamespace(width=width, depth=depth, height=height, first=None, moves=world)


def scaled(numbers):
    """Numbers of the program in units of the model."""
    return tuple(scale * value for value in numbers)


def span(axis, sides):
    """The interval of a box along an axis of the box around, by its keywords."""
    low, high, size, offset = (sides.get(word) for word in WORDS[axis])
    full = (here.width, here.depth, here.height)[axis]
    if size is None:
        return low or 0, full - (high or 0)
    if low is None and high is not None:
        low = full - high - size
    elif low is None:
        low = 0 if offset is None and axis == 2 else (full - size) / 2 + (offset or 0)
    return low, low + size


@contextmanager
def moved(move):
    """Solids drawn with a motion; without one they are not drawn."""
    before = here.moves
    here.moves = (*before, move)
    yield
    here.moves = before


@contextmanager
def inside(tilt=0, **sides):
    """A box in the box around, leaned to the rear about its bottom front edge."""
    spans = [span(axis, sides) for axis in range(3)]
    here.first = here.first or spans
    before = vars(here).copy()
    at_corner = Pos(*scaled(low for low, _ in spans)) * Rot(-tilt, 0, 0)
    here.width, here.depth, here.height = (high - low for low, high in spans)
    with moved(lambda solid: at_corner * solid):
        yield
    vars(here).update(before)


def function(body):
    """A function, which draws in a separate box."""

    def call(**given):
        start = len(parts)
        with inside(**{word: value for word, value in given.items() if word in SIDES}):
            body(**{word: value for word, value in given.items() if word not in SIDES})
        return parts[start:]

    return call


def role(name):
    """A role: it names the parts that are drawn in its call and have no name; alone it is a box."""

    def named(drawn=None, **sides):
        drawn = box(**sides) if drawn is None else drawn
        for part in drawn:
            part.label = part.label or name
        return drawn

    return named


def draw(kind, solid):
    """Put a solid in its place and keep it."""
    if solid is None or None in here.moves:
        return []
    for move in reversed(here.moves):
        solid = move(solid)
    solid = solid.solid()
    solid.label, solid.kind = "", kind
    parts.append(solid)
    return [solid]


def at(**sides):
    """A point, by distances from the sides of the box around and offsets from its middle."""
    return sides


def point(sides, other=None):
    """The place of a point; an axis without a keyword is that of another one, or the middle of the bottom."""
    place = list(other or (here.width / 2, here.depth / 2, 0))
    for axis, (low, high, _, offset) in enumerate(WORDS):
        full = (here.width, here.depth, here.height)[axis]
        if low in sides:
            place[axis] = sides[low]
        elif high in sides:
            place[axis] = full - sides[high]
        elif offset in sides:
            place[axis] = full / 2 + sides[offset]
    return tuple(place)


def ends(*points):
    """Points, the first of which is the start of a part and the reference of a row."""
    first = point(points[0])
    here.first = here.first or [(value, value) for value in first]
    return [Vector(*scaled(first)), *(Vector(*scaled(point(each, first))) for each in points[1:])]


def copies(count, move):
    """Copies of the solids drawn; of none the first is evaluated, for a row around them."""
    count = max(0, round(count))
    for copy in range(max(1, count)):
        location = move(copy, max(1, count))
        with moved((lambda solid: location * solid) if count else None):
            yield


def translate(count, x=0, y=0, z=0):
    """Copies at fixed steps."""
    return copies(count, lambda copy, _: Pos(*scaled((copy * x, copy * y, copy * z))))


def rotate(count, step=None, **sides):
    """Copies about a vertical axis, counter-clockwise as seen from above."""
    axis = Pos(*scaled(point(sides)))
    return copies(count, lambda i, n: axis * Rot(0, 0, i * (360 / n if step is None else step)) * axis.inverse())


def mirror(**sides):
    """The solids drawn and their mirror image; along several axes, all of them."""
    planes = [plane.offset(scale * place) for plane, place in zip((Plane.YZ, -Plane.XZ, Plane.XY), point(sides))]
    used = [plane for plane, words in zip(planes, WORDS) if {*words} & {*sides}]
    for flips in product((False, True), repeat=len(used)):
        through = [plane for plane, flip in zip(used, flips) if flip]

        def reflect(solid, through=through):
            for plane in through:
                solid = solid.mirror(plane)
            return solid

        with moved(reflect):
            yield


def row(count, last):
    """Evenly spaced copies: the keywords place the first part of the last copy."""
    before, here.first, step = here.first, None, [0, 0, 0]
    for copy, _ in enumerate(copies(count, lambda i, n: Pos(*scaled(i * along / max(1, n - 1) for along in step)))):
        yield
        for axis, (low, high, _, offset) in enumerate(WORDS if copy == 0 else ()):
            start, end = here.first[axis]
            for word, place in ((low, start), (high, end), (offset, (start + end) / 2)):
                if word in last:
                    step[axis] = point(last)[axis] - place
    here.first = before or here.first


def divide(count, axis, gap=0, tilt=0, **sides):
    """Equal boxes along an axis of a box."""
    low, _, size, _ = WORDS["xyz".index(axis)]
    with inside(tilt, **sides):
        count = max(0, round(count))
        each = (getattr(here, size) + gap) / max(1, count) - gap
        for copy in range(count):
            with inside(**{low: copy * (each + gap), size: each}):
                yield


x, y, z = "xyz"


def box(lean=0, **sides):
    """A box; lean moves its top to the rear."""
    with inside(**sides):
        w, d, h = size = scaled((here.width, here.depth, here.height))
        if min(size) <= 0 or not lean:
            return draw("box", Box(*size, align=LOW) if min(size) > 0 else None)
        bottom = Face(Wire.make_polygon([(0, 0, 0), (w, 0, 0), (w, d, 0), (0, d, 0)]))
        return draw("box", Solid.extrude(bottom, Vector(0, scale * lean, h)))


def cushion(edge, **sides):
    """A box with rounded edges."""
    with inside(**sides):
        size = scaled((here.width, here.depth, here.height))
        if min(size) <= 0:
            return []
        solid, radius = Box(*size, align=LOW), min(scale * edge, 0.9999 * min(size) / 2)
        return draw("cushion", fillet(solid.edges(), radius) if radius > 0 else solid)


def cylinder(**sides):
    """An upright cylinder, by its radius or by the size of its box."""
    return upright("cylinder", **sides)


def upright(kind, radius=None, **sides):
    """An upright round solid, by its radius or by the size of its box; a pair of radii is (bottom, top)."""
    if radius is None:
        by = [size in sides or {low, high} <= {*sides} for low, high, size, _ in WORDS[:2]]
        start, end = span(1 if by[1] and not by[0] else 0, sides)
        radius, sides = (end - start) / 2, {"width": end - start, "depth": end - start} | sides
    else:
        diameter = 2 * (max(radius) if isinstance(radius, tuple) else radius)
        sides = {**sides, "width": diameter, "depth": diameter}
    with inside(**sides):
        bottom = Pos(*scaled((here.width / 2, here.depth / 2, 0)))
        return draw(kind, round_solid(bottom, scale * here.height, radius))


def round_solid(bottom, height, radius):
    """A cylinder or cone on a place."""
    first, last = scaled(radius if isinstance(radius, tuple) else (radius, radius))
    if height <= 0 or max(first, last) <= 0:
        return None
    solid = Cylinder(first, height, align=BOTTOM) if first == last else Cone(first, last, height, align=BOTTOM)
    return bottom * solid


def between(kind, start, end, radius):
    """A round solid between two points."""
    start, end = ends(start, end)
    if not (end - start).length:
        return []
    return draw(kind, round_solid(Plane(start, z_dir=end - start).location, (end - start).length, radius))


def rod(start=None, end=None, **sides):
    """A round rod between two points, or upright."""
    return upright("rod", **sides) if start is None else between("rod", start, end, **sides)


def taper(start=None, end=None, **sides):
    """A round rod with two radii, between two points or upright."""
    return upright("taper", **sides) if start is None else between("taper", start, end, **sides)


def bar(start, end, turn=0, **sizes):
    """An upright box with two sizes across and a length along the third axis, turned about that, and brought onto the
    line between two points by the least rotation."""
    start, end = ends(start, end)
    along = end - start
    main = next(axis for axis, words in enumerate(WORDS) if words[2] not in sizes)
    size = [scale * sizes[words[2]] if words[2] in sizes else along.length for words in WORDS]
    if min(size) <= 0:
        return []
    axis = Vector(*(float(k == main) for k in range(3)))
    leaned = along * (-1 if axis.dot(along) < 0 else 1)
    across, solid = axis.cross(leaned), Box(*size).rotate(Axis((0, 0, 0), axis), turn)
    if across.length > 1e-12 * along.length:
        solid = solid.rotate(Axis((0, 0, 0), across), degrees(atan2(across.length, axis.dot(leaned))))
    return draw("bar", Pos((start + end) / 2) * solid)


def bent_rod(start, through, end, radius):
    """A round rod along the circle from one point through a second to a third, at most as thick as fills the ring."""
    first, second, last = ends(start, through, end)
    half, centre, radius = (last - first).length / 2, (first + last) / 2, scale * radius
    if min(half, radius) <= 0:
        return []
    unit, beside = (last - first) / (2 * half), second - centre
    away = beside - unit * beside.dot(unit)
    rest = half**2 - beside.length**2
    # How high the circle rises over its chord.
    rise = 2 * away.length * half**2 / max(hypot(2 * away.length * half, rest) + rest, 1e-9 * half**2)
    if rise <= half / 100000:
        return draw("bent_rod", round_solid(Plane(first, z_dir=last - first).location, 2 * half, radius / scale))
    ring, bulge = (half**2 + rise**2) / (2 * rise), away.normalized()
    middle = centre + bulge * (rise - ring)
    plane = Plane(middle, x_dir=first - middle, z_dir=bulge.cross(unit))
    angle = degrees(4 * atan2(rise, half))
    return draw("bent_rod", Solid.make_torus(ring, min(radius, 0.9999 * ring), plane, major_angle=angle))


def mesh(kind, points, faces):
    """Any other solid, by its corners and triangles."""
    corners = [Vector(*point) for point in points]
    return draw(kind, Solid(Shell([Face(Wire.make_polygon([corners[k] for k in face])) for face in faces])))


'''
"""Definitions with two empty lines between them."""

TAIL = '''
numbers = Counter()
for part in parts:
    part.label = part.label or part.kind
    part.color = Color(colours[part.label])
    numbers[part.label] += 1
    part.label = f"{{part.label}}_{{numbers[part.label]}}"
model = Compound(label="{stem}", children=parts)


def union():
    """All parts as one solid."""
    return parts[0].fuse(*parts[1:]) if len(parts) > 1 else parts[0]


if __name__ == "__main__":
    export_step(model, "{stem}.step", unit=Unit.{unit})
'''
"""The end, which names and writes the parts."""

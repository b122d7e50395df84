"""The arc: a round rod bent along an arc of a circle, with flat caps; without sagitta it is the cylinder.

Sizes are half the chord between the ends, the radius of the rod and the sagitta, the height of the arc over its chord.
The chord is parallel to local axis 0, at minus half the sagitta along axis 1; the apex is at plus half the sagitta.

All follows from the curvature k = 2 s / (c^2 + s^2), which is zero for a straight rod, and is written so that nothing
cancels there: with h from the apex to an end, half the arc is h / sinc(t / 2) long, where t, its angle, has
sin t = k c and cos t = 1 - k s.  A sagitta beyond half the chord makes more than half a ring; the rod is at most as
thick as fills the ring.
"""

from __future__ import annotations

import math

import numpy as np
from jaxtyping import Float, Int

from shapeprog.geometry.primitive import Kernels, Mesh, Points, Primitive, Scalars, Sizes, Triple, safe_norm
from shapeprog.geometry.primitives.cylinder import SEGMENTS
from shapeprog.kernels.compile import helper
from shapeprog.kernels.rows import clip, fill_row, stretch
from shapeprog.kernels.table import CENTRE, ROTATION, SIZE, local
from shapeprog.lazy_torch import Tensor, torch
from shapeprog.space import Array, FloatArray

SHORTEST = 1e-6  # half a chord in cells below this counts as this
SERIES = 0.1  # angles up to which sinc is taken from its series
PIECES = 24  # straight pieces of a mesh along the arc


def _bend(size: Sizes) -> tuple[Scalars, Scalars, Scalars, Scalars]:
    """Half the chord, radius in force, sagitta and curvature."""
    half, radius, sagitta = size[..., :3].clamp(min=0).unbind(-1)
    half = half.clamp(min=SHORTEST)
    curvature = 2 * sagitta / (half**2 + sagitta**2)
    return half, radius / (curvature * radius).clamp(min=1), sagitta, curvature


def _sinc(angle: Scalars) -> Scalars:
    """sin(x) / x, whose gradient is as exact near zero as elsewhere."""
    near, square = angle.abs() < SERIES, angle**2
    series = 1 - square / 6 * (1 - square / 20 * (1 - square / 42 * (1 - square / 72)))
    far = torch.where(near, 1.0, angle)
    return torch.where(near, series, far.sin() / far)


def _length(size: Sizes) -> tuple[Scalars, Scalars]:
    """Half the length of the arc, and half its angle seen from the centre of the circle."""
    half, _, sagitta, _ = _bend(size)
    angle = torch.atan2(sagitta, half)
    return (half**2 + sagitta**2).sqrt() / _sinc(angle), 2 * angle


def distance(points: Points, size: Sizes) -> Scalars:
    """Exact signed distance: the nearer one of the tube, beside the arc, and the cap at the end of a point's side."""
    half, radius, sagitta, curvature = _bend(size)
    along, out, side = points[..., 0].abs(), points[..., 1] - sagitta / 2, points[..., 2]

    # At x along and y out from the apex, and k times its distance from the centre (turn), a point is this far beyond
    # the circle: (k (x^2 + y^2) + 2 y) / (turn + 1).
    turn = safe_norm((curvature * along) ** 2 + (1 + curvature * out) ** 2)
    beyond = (curvature * (along**2 + out**2) + 2 * out) / (turn + 1)
    tube = safe_norm(beyond**2 + side**2) - radius

    sine, cosine = curvature * half, 1 - curvature * sagitta
    ahead, above = along - half, out + sagitta
    over_cap = ahead * cosine - above * sine
    across = safe_norm((ahead * sine + above * cosine) ** 2 + side**2)
    cap = safe_norm(over_cap**2 + (across - radius).clamp(min=0) ** 2)
    return torch.where(over_cap > 0, cap, torch.maximum(tube, -cap))


def bound(size: Sizes) -> Points:
    """Half extents of the box around the arc; beyond half a ring it is wider than its chord."""
    half, radius, sagitta, curvature = _bend(size)
    over = sagitta > half
    along = torch.where(over, (half**2 + sagitta**2) / (2 * sagitta).clamp(min=SHORTEST), half)
    tilt = torch.where(over, 1.0, curvature * half)
    return torch.stack([along + radius * tilt, sagitta / 2 + radius, radius], -1)


def areas(size: Sizes) -> Float[Tensor, "*batch faces"]:
    """Areas of the two caps and of the tube, which by Pappus is as large as that of a straight one."""
    _, radius, _, _ = _bend(size)
    cap = math.pi * radius**2
    return torch.stack([cap, cap, 4 * math.pi * radius * _length(size)[0]], -1)


def sample(size: Sizes, face: Int[Tensor, "*batch"], u: Points) -> Points:
    """Place along the arc in [-1, 1] and in the unit disc, its first axis pointing away from the centre of the circle.

    The tube has 1 + k r cos(a) times as much area at an angle a from there: angles are drawn evenly, and turned to the
    other side with the chance that makes it so.
    """
    _, radius, _, curvature = _bend(size)
    angle, tube = 2 * math.pi * u[..., 0], face == 2
    cosine = angle.cos()
    inner = tube & (2 * u[..., 1] > 1 + curvature * radius * cosine)
    rim = torch.where(tube, 1.0, u[..., 1].sqrt())
    along = torch.where(tube, 2 * u[..., 2] - 1, (2 * face - 1).to(u))
    return torch.stack([along, rim * torch.where(inner, -cosine, cosine), rim * angle.sin()], -1)


def place(size: Sizes, unit: Points) -> Points:
    """Point of the arc for a place along it and in the unit disc.

    On the arc it ends a chord from the apex, which is tilted by half its angle.
    """
    _, radius, sagitta, _ = _bend(size)
    length, whole = _length(size)
    way, out, side = unit.unbind(-1)
    tilt, out = way * whole / 2, radius * out
    chord = way * length * _sinc(tilt)
    along = chord * tilt.cos() + out * (2 * tilt).sin()
    above = sagitta / 2 - chord * tilt.sin() + out * (2 * tilt).cos()
    return torch.stack([along, above, radius * side], -1)


def normal(size: Sizes, unit: Points, face: Int[Tensor, "*batch"]) -> Points:
    """Outward normal: along the arc on the caps, away from it on the tube."""
    way, out, side = unit.unbind(-1)
    angle = way * _length(size)[1]
    sine, cosine = angle.sin(), angle.cos()
    cap = torch.stack([way * cosine, -way * sine, torch.zeros_like(way)], -1)
    return torch.where((face == 2)[..., None], torch.stack([out * sine, out * cosine, side], -1), cap)


def mesh(size: FloatArray) -> Mesh:
    """Polygons along the arc, each as large as makes up for the circle and for the straight pieces between them.

    An edge of each lies on the inner side, so that they reach the centre of the circle later than the rod does.
    """
    whole = 2 * math.atan2(max(size[2], 0.0), max(size[0], SHORTEST))
    step, turn = 2 * math.pi / SEGMENTS, 2 * whole / PIECES
    grown = math.sqrt(1 / np.sinc(step / math.pi) / np.sinc(turn / math.pi))
    angle, way = step * (np.arange(SEGMENTS) + 0.5), np.linspace(-1, 1, PIECES + 1)
    rings = np.zeros((PIECES + 1, SEGMENTS, 3))
    rings[..., 0], rings[..., 1], rings[..., 2] = way[:, None], grown * np.cos(angle), grown * np.sin(angle)
    unit = torch.from_numpy(np.concatenate([rings.reshape(-1, 3), [[-1.0, 0, 0], [1, 0, 0]]]))
    vertices = place(torch.as_tensor(size).expand(len(unit), 4), unit).numpy()
    a, last = np.arange(SEGMENTS), PIECES * SEGMENTS
    b, foot, head = (a + 1) % SEGMENTS, np.full(SEGMENTS, last + SEGMENTS), np.full(SEGMENTS, last + SEGMENTS + 1)
    faces = [np.stack([foot, b, a], 1), np.stack([head, a + last, b + last], 1)]
    for low in range(0, last, SEGMENTS):
        faces += [np.stack([a, b, b + SEGMENTS], 1) + low, np.stack([a, b + SEGMENTS, a + SEGMENTS], 1) + low]
    return vertices, np.concatenate(faces).astype(np.int64)


def volume(size: Sizes) -> Scalars:
    """By Pappus, length times the area of the circle."""
    _, radius, _, _ = _bend(size)
    return 2 * math.pi * radius**2 * _length(size)[0]


def cell_size(size: Sizes) -> Sizes:
    """The sizes by which cells are tested, in cells; none is inside an arc without length or radius."""
    solid = (size[..., 1] > 0) & ((size[..., 0] > 0) | (size[..., 2] > 0))
    return torch.where(solid[..., None], size, torch.nan)


# Twins for kernels; sizes are at SIZE: half the chord, radius and sagitta.


@helper
def _bent(table: Array, row: int) -> tuple[float, float, float, float]:
    """Twin of :func:`_bend`."""
    half, sagitta = max(table[row, SIZE], SHORTEST), max(table[row, SIZE + 2], 0.0)
    curvature, radius = 2 * sagitta / (half * half + sagitta * sagitta), max(table[row, SIZE + 1], 0.0)
    return half, radius / max(curvature * radius, 1.0), sagitta, curvature


@helper
def _to_sizes(
    table: Array, row: int, half: float, radius: float, sagitta: float, by_curvature: float
) -> tuple[float, float, float]:
    """Derivatives by the three sizes from those by half the chord, radius in force, sagitta and curvature."""
    chord, bulge = max(table[row, SIZE], SHORTEST), max(table[row, SIZE + 2], 0.0)
    square = chord * chord + bulge * bulge
    curvature = 2 * bulge / square
    if curvature * table[row, SIZE + 1] >= 1:
        by_curvature, radius = by_curvature - radius / (curvature * curvature), 0.0
    half -= by_curvature * 2 * curvature * chord / square
    return half, radius, sagitta + by_curvature * (2 / square - curvature * curvature)


@helper
def _sinc_kernel(angle: float) -> tuple[float, float]:
    """Twin of :func:`_sinc`, and its derivative."""
    if abs(angle) < SERIES:
        square = angle * angle
        value = 1 - square / 6 * (1 - square / 20 * (1 - square / 42 * (1 - square / 72)))
        return value, -angle / 3 * (1 - square / 10 * (1 - square / 28 * (1 - square / 54)))
    value = math.sin(angle) / angle
    return value, (math.cos(angle) - value) / angle


@helper
def _beyond(curvature: float, along: float, out: float) -> tuple[float, float]:
    """How far a point of the plane of the circle is beyond it, and k times its distance from the centre."""
    turn = math.sqrt((curvature * along) ** 2 + (1 + curvature * out) ** 2)
    return (curvature * (along * along + out * out) + 2 * out) / (turn + 1), turn


@helper
def distance_kernel(table: Array, row: int, a: float, b: float, c: float) -> float:
    """Twin of :func:`distance`."""
    half, radius, sagitta, curvature = _bent(table, row)
    return _away(half, radius, sagitta, curvature, a, b, c)


@helper
def _away(half: float, radius: float, sagitta: float, curvature: float, a: float, b: float, c: float) -> float:
    """The signed distance, given :func:`_bent`."""
    along, out = abs(a), b - sagitta / 2
    sine, cosine = curvature * half, 1 - curvature * sagitta
    ahead, above = along - half, out + sagitta
    over_cap, across = ahead * cosine - above * sine, ahead * sine + above * cosine
    over_rim = max(math.sqrt(across * across + c * c) - radius, 0.0)
    cap = math.sqrt(over_cap * over_cap + over_rim * over_rim)
    if over_cap > 0:
        return cap
    beyond = _beyond(curvature, along, out)[0]
    return max(math.sqrt(beyond * beyond + c * c) - radius, -cap)


@helper
def slopes_kernel(table: Array, row: int, a: float, b: float, c: float, out: Array) -> None:
    """Derivatives of :func:`distance_kernel`; by the angle of the arc, the cap turns around its centre."""
    half, radius, sagitta, curvature = _bent(table, row)
    along, away = abs(a), b - sagitta / 2
    sine, cosine = curvature * half, 1 - curvature * sagitta
    ahead, above = along - half, away + sagitta
    over_cap, across = ahead * cosine - above * sine, ahead * sine + above * cosine
    from_rim = math.sqrt(across * across + c * c)
    over_rim = max(from_rim - radius, 0.0)
    cap = math.sqrt(over_cap * over_cap + over_rim * over_rim)
    beyond, turn = _beyond(curvature, along, away)
    from_arc = math.sqrt(beyond * beyond + c * c)
    for k in range(7):
        out[k] = 0.0
    if over_cap <= 0 and from_arc - radius >= -cap:
        by_along, by_away, by_half, by_curvature, by_sagitta = 0.0, 0.0, 0.0, 0.0, 0.0
        if from_arc >= 1e-12 and turn >= 1e-12:
            scale, lift = beyond / from_arc, 1 + curvature * away
            by_along, by_away = scale * curvature * along / turn, scale * lift / turn
            square = along * along + away * away
            by_turn = (curvature * along * along + lift * away) / turn
            by_curvature, by_sagitta = scale * (square - beyond * by_turn) / (turn + 1), -by_away / 2
            out[2] = c / from_arc
        by_radius = -1.0
    else:
        if cap < 1e-12:
            return
        scale = 1.0 if over_cap > 0 else -1.0
        by_over, by_radius = scale * over_cap / cap, -scale * over_rim / cap
        by_across = 0.0
        if from_rim >= 1e-12:
            by_across, out[2] = -by_radius * across / from_rim, -by_radius * c / from_rim
        by_along, by_away = by_over * cosine + by_across * sine, by_across * cosine - by_over * sine
        by_angle = by_across * over_cap - by_over * across
        square = half * half + sagitta * sagitta
        by_half, by_curvature = -by_along - by_angle * curvature, 0.0
        by_sagitta = by_away / 2 + by_angle * 2 * half / square
    out[0], out[1] = by_along * np.sign(a), by_away
    out[3], out[4], out[5] = _to_sizes(table, row, by_half, by_radius, by_sagitta, by_curvature)


@helper
def bound_kernel(table: Array, row: int) -> Triple:
    """Twin of :func:`bound`."""
    half, radius, sagitta, curvature = _bent(table, row)
    along = 1 / curvature + radius if sagitta > half else half + radius * curvature * half
    return along, sagitta / 2 + radius, radius


@helper
def excess_kernel(table: Array, row: int, a: float, b: float, c: float) -> float:
    """How far a point is beyond the caps, or its squared distance from the arc beyond that of the tube."""
    half, radius, sagitta, curvature = _bent(table, row)
    along, out = abs(a), b - sagitta / 2
    over_cap = (along - half) * (1 - curvature * sagitta) - (out + sagitta) * curvature * half
    if over_cap > 0:
        return over_cap
    beyond = _beyond(curvature, along, out)[0]
    return max(over_cap, beyond * beyond + c * c - radius * radius)


@helper
def sample_kernel(table: Array, row: int, face: int, one: float, two: float, three: float) -> Triple:
    """Twin of :func:`sample`."""
    angle = 2 * math.pi * one
    cosine, sine = math.cos(angle), math.sin(angle)
    if face == 2:
        _, radius, _, curvature = _bent(table, row)
        return 2 * three - 1, -cosine if 2 * two > 1 + curvature * radius * cosine else cosine, sine
    rim = math.sqrt(two)
    return 2.0 * face - 1, rim * cosine, rim * sine


@helper
def place_kernel(table: Array, row: int, u: float, v: float, w: float) -> Triple:
    """Twin of :func:`place`."""
    half, radius, sagitta, _ = _bent(table, row)
    quarter = math.atan2(sagitta, half)
    length, tilt = math.sqrt(half * half + sagitta * sagitta) / _sinc_kernel(quarter)[0], quarter * u
    chord, out = u * length * _sinc_kernel(tilt)[0], radius * v
    low, high = math.sin(tilt), math.cos(tilt)
    return chord * high + out * 2 * low * high, sagitta / 2 - chord * low + out * (1 - 2 * low * low), radius * w


@helper
def normal_kernel(table: Array, row: int, face: int, u: float, v: float, w: float) -> Triple:
    """Twin of :func:`normal`."""
    half, _, sagitta, _ = _bent(table, row)
    angle = 2 * math.atan2(sagitta, half) * u
    sine, cosine = math.sin(angle), math.cos(angle)
    if face == 2:
        return v * sine, v * cosine, w
    return u * cosine, -u * sine, 0.0


@helper
def pull_kernel(
    table: Array, row: int, u: float, v: float, w: float, da: float, db: float, dc: float, out: Array
) -> None:
    """Gradient of :func:`place_kernel` by the sizes."""
    half, radius, sagitta, _ = _bent(table, row)
    square, quarter = half * half + sagitta * sagitta, math.atan2(sagitta, half)
    whole, by_quarter = _sinc_kernel(quarter)
    chord, tilt = math.sqrt(square), quarter * u
    part, by_tilt = _sinc_kernel(tilt)
    low, high = math.sin(tilt), math.cos(tilt)
    sine, cosine, way, across = 2 * low * high, 1 - 2 * low * low, u * chord / whole, 2 * radius * v
    to_way = part * (da * high - db * low)
    to_tilt = da * (way * (by_tilt * high - part * low) + across * cosine)
    to_tilt -= db * (way * (by_tilt * low + part * high) + across * sine)
    to_chord, to_quarter = to_way * u / whole, u * to_tilt - to_way * way * by_quarter / whole
    by_half = to_chord * half / chord - to_quarter * sagitta / square
    by_sagitta = to_chord * sagitta / chord + to_quarter * half / square + db / 2
    by_radius = v * (da * sine + db * cosine) + dc * w
    by_half, by_radius, by_sagitta = _to_sizes(table, row, by_half, by_radius, by_sagitta, 0.0)
    out[row, SIZE] += by_half
    out[row, SIZE + 1] += by_radius
    out[row, SIZE + 2] += by_sagitta


@helper
def cells_kernel(table: Array, row: int, square: bool, planes: Array, plane: int, low: Array, high: Array) -> bool:
    """Twin of :func:`cell_size`; since an arc is not convex, rows of cells are walked through as far as it is away."""
    if table[row, SIZE + 1] <= 0 or (table[row, SIZE] <= 0 and table[row, SIZE + 2] <= 0):
        return True
    resolution, box = planes.shape[2], bound_kernel(table, row)
    reach = 0.0
    for axis in range(3):
        reach, column = 0.0, ROTATION + 3 * axis
        for other in range(3):
            reach += abs(table[row, column + other]) * box[other]
        if not math.isfinite(reach):
            return True
        low[axis] = clip(np.floor(table[row, CENTRE + axis] - reach - 0.5), resolution)
        high[axis] = clip(np.ceil(table[row, CENTRE + axis] + reach + 0.5), resolution)
    half, radius, sagitta, curvature = _bent(table, row)
    middle = table[row, CENTRE + 2]
    for i in range(low[0], high[0]):
        for j in range(low[1], high[1]):
            x, y = i + 0.5 - table[row, CENTRE], j + 0.5 - table[row, CENTRE + 1]
            near, far = stretch(table, row, box, x, y, reach)
            if near > far:
                continue
            k = max(clip(np.floor(near + middle - 0.5), resolution), low[2])
            last = min(clip(np.ceil(far + middle + 0.5), resolution), high[2])
            while k < last:
                a, b, c = local(table, row, i + 0.5, j + 0.5, k + 0.5)
                away = _away(half, radius, sagitta, curvature, a, b, c)
                after = k + 1
                if abs(away) > 1:  # the same is true of all cells nearer than that, but for rounding
                    after = min(k + int(np.ceil(min(abs(away), float(resolution)) - 1e-9)), last)
                if away <= 0:
                    fill_row(planes, plane, i, j, k, after)
                k = after
    return True


PRIMITIVE = ARC = Primitive(
    "arc", ("half_chord", "radius", "sagitta"), 2,
    distance, bound, areas, sample, place, normal, mesh, volume, cell_size,
    kernels=Kernels(
        distance_kernel, slopes_kernel, bound_kernel, excess_kernel, sample_kernel, place_kernel, normal_kernel,
        pull_kernel, cells_kernel,
    ),
)  # fmt: skip

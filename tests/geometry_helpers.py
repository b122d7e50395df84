"""Scenes for the tests of geometry, and a primitive of a user's own."""

import dataclasses
import itertools
from contextlib import contextmanager

import numpy as np
import pytest
import torch

from shapeprog.geometry.primitive import Primitive, primitives, safe_norm
from shapeprog.geometry.primitives import BUILT_IN, built_in_names
from shapeprog.geometry.scene import Scene
from shapeprog.space import HALF, Frame

NAMES = tuple(primitive.name for primitive in BUILT_IN)


def make_scene(kinds, sizes, centres, rotation=None, dtype=torch.float32, lead=()):
    kind = torch.tensor([primitives.kind(k) if isinstance(k, str) else k for k in kinds], dtype=torch.long)
    count = len(kinds)
    size = torch.zeros(count, 4, dtype=dtype)
    for row, values in enumerate(sizes):
        size[row, : len(values)] = torch.tensor(values, dtype=dtype)
    centre = torch.tensor(centres, dtype=dtype).reshape(count, 3)
    rotation = torch.eye(3, dtype=dtype).expand(count, 3, 3) if rotation is None else rotation.to(dtype)
    zero = torch.zeros_like(kind)
    parts = (kind, size, centre, rotation, zero == 0, zero + 1, zero, zero)
    return Scene(*(part.expand(*lead, *part.shape) for part in parts))


def random_scene(seed, lead=(), slots=5, dtype=torch.float32, user=False, names=NAMES):
    """Primitives of these names, turned and upright, sheared and rounded ones among them; the last slot is padding."""
    g = torch.Generator().manual_seed(seed)
    kinds = torch.tensor([*map(primitives.kind, names), *([ellipsoid_kind()] if user else [])])
    kind = kinds[torch.randint(0, len(kinds), (*lead, slots), generator=g)]
    if user:
        kind[..., 0] = ellipsoid_kind()
    size = torch.rand(*lead, slots, 4, generator=g, dtype=torch.float64) * 4 + 0.5
    size[..., 3] = torch.where(torch.rand(*lead, slots, generator=g) < 0.5, size[..., 3] - 2, 0)
    lean, radius = (kind == primitives.kind(name) for name in ("cuboid", "rounded_box"))
    size[..., 3] = torch.where(radius, size[..., 3].abs(), size[..., 3] * lean)
    centre = torch.rand(*lead, slots, 3, generator=g, dtype=torch.float64) * 16 - 8
    rotation = torch.linalg.qr(torch.randn(*lead, slots, 3, 3, generator=g, dtype=torch.float64))[0]
    upright = torch.rand(*lead, slots, generator=g) < 0.4
    rotation = torch.where(upright[..., None, None], torch.eye(3, dtype=torch.float64), rotation)
    mask = torch.ones(*lead, slots, dtype=torch.bool)
    mask[..., -1] = False
    zero = torch.zeros(*lead, slots, dtype=torch.long)
    return Scene(kind, size.to(dtype), centre.to(dtype), rotation.to(dtype), mask, zero + 1, zero, zero)


def require(scene, **changes):
    return dataclasses.replace(scene, **changes)


def with_leaves(scene):
    """The scene with size, centre and rotation as leaves, and the leaves."""
    leaves = [t.detach().clone().requires_grad_() for t in (scene.size, scene.centre, scene.rotation)]
    return require(scene, size=leaves[0], centre=leaves[1], rotation=leaves[2]), leaves


# ---------------------------------------------------------------- a primitive as a user would declare it


def _ellipsoid_distance(points, size):
    """Along the ray through the centre; exact for a ball."""
    radii = size[..., :3].clamp(min=1e-6)
    length = safe_norm(((points / radii) ** 2).sum(-1))
    slope = safe_norm(((points / radii**2) ** 2).sum(-1))
    deep = -radii.amin(-1)
    return torch.where(length > 1e-6, length * (length - 1) / slope.clamp(min=1e-12), deep)


def _ball_mesh(size):
    import trimesh

    ball = trimesh.creation.icosphere(subdivisions=3)
    return np.asarray(ball.vertices) * size[:3], np.asarray(ball.faces, np.int64)


def _on_ball(size, face, u):
    side = 2 * u[..., 0] - 1
    angle = 2 * torch.pi * u[..., 1]
    ring = (1 - side**2).clamp(min=0).sqrt()
    return torch.stack([side, ring * angle.cos(), ring * angle.sin()], -1)


def _ball_normal(size, unit, face):
    normal = unit / size[..., :3].clamp(min=1e-6)
    return normal / safe_norm((normal**2).sum(-1, keepdim=True))


def cell_centres(resolution=32):
    """Centres (R, R, R, 3) of all cells in the grid frame."""
    ticks = (torch.arange(resolution) + 0.5) * 32 / resolution - 16
    return torch.stack(torch.meshgrid(ticks, ticks, ticks, indexing="ij"), -1)


def ellipsoid_kind():
    """Index of the test's ellipsoid, declared on first use."""
    name = "test_ellipsoid"
    if name not in primitives.names:
        primitives.register(
            Primitive(
                name, ("r_up", "r_depth", "r_side"), 3,
                distance=_ellipsoid_distance,
                bound=lambda size: size[..., :3],
                areas=lambda size: 4 * torch.pi * (size[..., :3].prod(-1, keepdim=True).clamp(min=0)) ** (2 / 3),
                sample=_on_ball,
                place=lambda size, unit: size[..., :3] * unit,
                normal=_ball_normal,
                mesh=_ball_mesh,
                volume=lambda size: 4 / 3 * torch.pi * size[..., :3].prod(-1),
            )
        )  # fmt: skip
    return primitives.kind(name)


@pytest.fixture(autouse=True, params=["as registered", "the other way round"])
def any_order(request):
    """Every law holds whatever number a primitive has; import this fixture to have it so."""
    with primitives_restored():
        if request.param == "as registered":
            yield
        else:
            with primitives_in_another_order():
                yield


@contextmanager
def primitives_restored():
    """Forget afterwards what was declared inside, so that no other test sees it."""
    with primitives.using(built_in_names()):
        yield


@contextmanager
def primitives_in_another_order():
    """The built-in primitives as if they had been registered the other way round."""
    known, names = list(primitives._kinds), dict(primitives.names)
    primitives._kinds[: len(BUILT_IN)] = reversed(BUILT_IN)
    primitives.names.update({name: len(BUILT_IN) - 1 - names[name] for name in built_in_names()})
    try:
        yield
    finally:
        primitives._kinds[:] = known
        primitives.names.update(names)


def write_binvox(path, voxels, frame=None):
    """Cells (R, R, R) of the grid as a binvox file in the coordinates that a frame maps them to."""
    frame = frame or Frame()
    axes, size = np.asarray(frame.axes), len(voxels)
    order = np.abs(axes).argmax(1)  # the grid axis that runs along each world axis
    turned = np.flip(voxels.transpose(order), tuple(axis for axis in range(3) if axes[axis, order[axis]] < 0))
    flat = turned.transpose(0, 2, 1).reshape(-1)
    runs = bytearray()
    for value, group in itertools.groupby(flat.tolist()):
        full, partial = divmod(sum(1 for _ in group), 255)
        runs += bytes((value, 255)) * full + (bytes((value, partial)) if partial else b"")
    translate = " ".join(str(number) for number in np.asarray(frame.centre) - frame.scale * HALF)
    head = f"#binvox 1\ndim {size} {size} {size}\ntranslate {translate}\nscale {frame.scale * 2 * HALF}\ndata\n"
    path.write_bytes(head.encode() + bytes(runs))

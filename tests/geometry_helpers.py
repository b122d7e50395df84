"""Scenes for the tests of geometry."""

import dataclasses
import itertools

import numpy as np
import torch

from shapeprog.geometry.primitives import KINDS
from shapeprog.geometry.scene import Scene
from shapeprog.space import HALF, Frame

NAMES = tuple(KINDS)


def make_scene(kinds, sizes, centres, rotation=None, dtype=torch.float32, lead=()):
    kind = torch.tensor([KINDS[name] for name in kinds], dtype=torch.long)
    count = len(kinds)
    size = torch.zeros(count, 4, dtype=dtype)
    for row, values in enumerate(sizes):
        size[row, : len(values)] = torch.tensor(values, dtype=dtype)
    centre = torch.tensor(centres, dtype=dtype).reshape(count, 3)
    rotation = torch.eye(3, dtype=dtype).expand(count, 3, 3) if rotation is None else rotation.to(dtype)
    zero = torch.zeros_like(kind)
    parts = (kind, size, centre, rotation, zero == 0, zero + 1, zero, zero)
    return Scene(*(part.expand(*lead, *part.shape) for part in parts))


def random_scene(seed, lead=(), slots=5, dtype=torch.float32, names=NAMES):
    """Primitives of these names, turned and upright, sheared and rounded ones among them; the last slot is padding."""
    g = torch.Generator().manual_seed(seed)
    kinds = torch.tensor([KINDS[name] for name in names])
    kind = kinds[torch.randint(0, len(kinds), (*lead, slots), generator=g)]
    size = torch.rand(*lead, slots, 4, generator=g, dtype=torch.float64) * 4 + 0.5
    size[..., 3] = torch.where(torch.rand(*lead, slots, generator=g) < 0.5, size[..., 3] - 2, 0)
    lean, radius = (kind == KINDS[name] for name in ("cuboid", "rounded_box"))
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


def cell_centres(resolution=32):
    """Centres (R, R, R, 3) of all cells in the grid frame."""
    ticks = (torch.arange(resolution) + 0.5) * 32 / resolution - 16
    return torch.stack(torch.meshgrid(ticks, ticks, ticks, indexing="ij"), -1)


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

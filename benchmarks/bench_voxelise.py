"""Mesh to solid voxels: time and fidelity on a union of solids with 10,000 faces, whole and ruined in four ways.

Prints one JSON line per figure: name, value, unit, which direction is better, and a bound where there is one.
The baseline, in the same run and on the same mesh, is trimesh's own voxeliser followed by its fill.

    python benchmarks/bench_voxelise.py
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
import trimesh

from shapeprog.data.sampling import sample_surface
from shapeprog.geometry.mesh import joined
from shapeprog.geometry.voxelise import SHRINK, voxelise_mesh
from shapeprog.space import Array, BoolArray

CENTRES = np.stack(np.meshgrid(*[np.arange(32) - 15.5] * 3, indexing="ij"), -1)
FACES = 10_000

Solid = tuple[Array, Array, Callable[[Array], BoolArray]]
"""Vertices and faces of a solid, and which of several points are inside."""


def row(name: str, value: float, unit: str, better: str, bound: float | None = None) -> None:
    print(json.dumps({"name": name, "value": round(float(value), 5), "unit": unit, "better": better, "bound": bound}))


def solids(rng: np.random.Generator) -> list[Solid]:
    """Eleven overlapping solids: upright boxes, turned boxes and balls."""
    parts = list[Solid]()
    for index in range(11):
        centre = rng.uniform(-7, 7, 3)
        if index % 3 == 2:
            radius = rng.uniform(2, 5)
            mesh, turn = trimesh.creation.icosphere(3, radius), np.eye(3)
            inside = partial(in_ball, 0.99 * radius)  # the ball of triangles lies between this radius and the full one
        else:
            half = rng.uniform(1, 5, 3)
            mesh = trimesh.creation.box(2 * half)
            random = trimesh.transformations.random_rotation_matrix(rng.random(3))[:3, :3]
            turn = np.eye(3) if index % 3 == 0 else random
            inside = partial(in_box, half)
        vertices, faces = mesh.vertices, mesh.faces
        while len(faces) < FACES / 16:
            vertices, faces = trimesh.remesh.subdivide(vertices, faces)
        parts.append((vertices @ turn.T + centre, faces, partial(moved, inside, turn, centre)))
    return parts


def in_ball(radius: float, points: Array) -> BoolArray:
    return np.linalg.norm(points, axis=-1) <= radius


def in_box(half: Array, points: Array) -> BoolArray:
    return np.asarray((np.abs(points) <= half).all(-1))


def moved(inside: Callable[[Array], BoolArray], turn: Array, centre: Array, points: Array) -> BoolArray:
    """Which points are inside a solid that is turned and then moved."""
    return inside((points - centre) @ turn)


def union(parts: Sequence[Solid]) -> tuple[Array, Array]:
    return joined([(vertices, faces) for vertices, faces, _ in parts])


def truth(parts: Sequence[Solid], vertices: Array, faces: Array) -> BoolArray:
    """Cells with their centre inside any solid, or touched by the whole surface (dense samples, never too many)."""
    points = sample_surface(vertices, faces, 2_000_000, 0) + 16
    within = np.abs(points - np.floor(points) - 0.5).max(1) < 0.5 - SHRINK
    cells = np.zeros((32,) * 3, bool)
    cells[tuple(np.clip(np.floor(points[within]).astype(int), 0, 31).T)] = True
    for _, _, inside in parts:
        cells |= inside(CENTRES)
    return cells


def ruined(
    vertices: Array,
    faces: Array,
    rng: np.random.Generator,
    missing: float = 0.0,
    flipped: float = 0.0,
    soup: bool = False,
) -> tuple[Array, Array]:
    faces = faces[rng.random(len(faces)) >= missing]
    over = rng.random(len(faces)) < flipped
    faces[over] = faces[over][:, ::-1]
    if not soup:
        return vertices, faces
    faces = faces[rng.permutation(len(faces))]
    return vertices[faces].reshape(-1, 3), np.arange(3 * len(faces)).reshape(-1, 3)


def baseline(vertices: Array, faces: Array) -> Any:
    return trimesh.Trimesh(vertices, faces, process=False).voxelized(1.0).fill()


def timed(call: Callable[[], object], repeat: int) -> float:
    """Median time of calls, in ms."""
    spent = []
    for _ in range(repeat):
        start = time.perf_counter()
        call()
        spent.append(time.perf_counter() - start)
    return 1e3 * float(np.median(spent))


def main() -> None:
    rng = np.random.default_rng(0)
    parts = solids(rng)
    vertices, faces = union(parts)
    row("faces", len(faces), "faces", "none")
    start = time.perf_counter()
    voxelise_mesh(vertices, faces)
    row("first call, compilation or its cache", time.perf_counter() - start, "s", "less")
    ours = timed(lambda: voxelise_mesh(vertices, faces), 15)
    theirs = timed(lambda: baseline(vertices, faces), 3)
    row("voxelise", ours * 10_000 / len(faces), "ms per 10,000 faces", "less", 30)
    row("trimesh voxelized + fill", theirs * 10_000 / len(faces), "ms per 10,000 faces", "less")
    row("times faster than trimesh", theirs / ours, "x", "more")
    damages: dict[str, dict[str, Any]] = {
        "overlapping parts": {},
        "5 % faces missing": {"missing": 0.05},
        "half the faces flipped": {"flipped": 0.5},
        "soup": {"soup": True},
        "all of it": {"missing": 0.05, "flipped": 0.5, "soup": True},
    }
    scores: dict[str, list[float]] = {name: [] for name in damages}
    for seed in range(5):
        drawn = np.random.default_rng(seed)
        parts = solids(drawn)
        mesh = union(parts)
        solid = truth(parts, *mesh)
        for name, damage in damages.items():
            cells = voxelise_mesh(*ruined(*mesh, drawn, **damage))
            scores[name].append((cells & solid).sum() / (cells | solid).sum())
    for name, values in scores.items():
        row(f"IoU, {name}", min(values), "worst of 5", "more", 0.97)
    ball = trimesh.creation.icosphere(8, 12.0)
    many = np.concatenate([ball.triangles, 0.9 * ball.triangles]).reshape(-1, 3)
    indices = np.arange(len(many)).reshape(-1, 3)
    row(f"voxelise {len(indices):,} faces", timed(lambda: voxelise_mesh(many, indices), 1), "ms", "less")


if __name__ == "__main__":
    argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter).parse_args()
    main()

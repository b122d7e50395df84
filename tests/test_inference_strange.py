"""Fifty strange shapes: each gives a program of finite numbers and a message, or a refusal that says why."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator

import numpy as np
import pytest

import shapeprog as sp
from shapeprog.data.placement import shape_from_mesh, shape_from_points, shape_from_voxels
from shapeprog.data.remarks import doubt_of_furniture, remark_on_size
from shapeprog.data.shape import Shape
from shapeprog.errors import ShapeProgError
from shapeprog.inference.surface.evidence import evidence_of
from shapeprog.language.parser import parse
from shapeprog.language.unroll import unroll

RANDOM = np.random.default_rng(0)
START = RANDOM.bit_generator.state
QUADS = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])
CUBE = (
    np.array(list(itertools.product((-1.0, 1.0), repeat=3))),
    np.concatenate([QUADS[:, :3], QUADS[:, [0, 2, 3]]]),
)

Mesh = tuple[np.ndarray, np.ndarray]


def moved(mesh: Mesh, scale: object = 1.0, by: object = 0.0) -> Mesh:
    return mesh[0] * scale + by, mesh[1]


def together(*meshes: Mesh) -> Mesh:
    starts = np.cumsum([0, *(len(vertices) for vertices, _ in meshes)])
    faces = [faces + start for (_, faces), start in zip(meshes, starts, strict=False)]
    return np.concatenate([vertices for vertices, _ in meshes]), np.concatenate(faces)


def soup(count: int, size: float) -> Mesh:
    corners = RANDOM.uniform(-1, 1, (count, 1, 3)) + RANDOM.normal(0, size, (count, 3, 3))
    return corners.reshape(-1, 3), np.arange(3 * count).reshape(-1, 3)


def ball(rings: int = 12) -> Mesh:
    up, around = np.linspace(0, np.pi, rings), np.linspace(0, 2 * np.pi, 2 * rings, endpoint=False)
    a, b = (each.reshape(-1) for each in np.meshgrid(up, around, indexing="ij"))
    vertices = np.stack([np.cos(a), np.sin(a) * np.cos(b), np.sin(a) * np.sin(b)], 1)
    i, j = (each.reshape(-1) for each in np.meshgrid(np.arange(rings - 1), np.arange(2 * rings), indexing="ij"))
    k, width = (j + 1) % (2 * rings), 2 * rings
    quads = np.stack([i * width + j, i * width + k, (i + 1) * width + k, (i + 1) * width + j], 1)
    return vertices, np.concatenate([quads[:, :3], quads[:, [0, 2, 3]]])


def grid(of: Callable[[np.ndarray], np.ndarray], size: int = 32) -> np.ndarray:
    return np.asarray(of(np.indices((size,) * 3)), bool)


SHEET = (np.array([[0.0, 0, 0], [0, 1, 0], [0, 0, 1], [0, 1, 1]]), np.array([[0, 1, 2], [1, 3, 2]]))
ROD = moved(CUBE, [10.0, 0.05, 0.05])

MESHES: dict[str, Callable[[], Mesh]] = {
    "one triangle": lambda: (np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]), np.array([[0, 1, 2]])),
    "a sliver": lambda: (np.array([[0.0, 0, 0], [1, 0, 0], [1, 1e-7, 0]]), np.array([[0, 1, 2]])),
    "a face without area": lambda: (np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0]]), np.array([[0, 1, 2]])),
    "a sheet": lambda: SHEET,
    "a leaning sheet": lambda: moved(SHEET, 1.0, SHEET[0][:, 1:2]),
    "crossed sheets": lambda: together(SHEET, (SHEET[0][:, [1, 0, 2]], SHEET[1])),
    "twenty sheets": lambda: together(*(moved(SHEET, 1.0, [k / 20, 0, 0]) for k in range(20))),
    "a soup of ten triangles": lambda: soup(10, 0.3),
    "a soup of a thousand": lambda: soup(1000, 0.1),
    "dust": lambda: soup(5000, 0.003),
    "thousands of cubes": lambda: together(*(moved(CUBE, 0.02, each) for each in RANDOM.uniform(-1, 1, (2000, 3)))),
    "a cube": lambda: CUBE,
    "a flipped cube": lambda: (CUBE[0], CUBE[1][:, ::-1]),
    "half of its faces flipped": lambda: (CUBE[0], np.concatenate([CUBE[1][:6], CUBE[1][6:, ::-1]])),
    "a cube without a side": lambda: (CUBE[0], CUBE[1][1:6]),
    "a cube three times": lambda: together(CUBE, CUBE, CUBE),
    "nested shells": lambda: together(*(moved(CUBE, 1 - k / 12) for k in range(10))),
    "a ball": ball,
    "a flat ball": lambda: moved(ball(), [0.01, 1, 1]),
    "a ring of balls": lambda: together(
        *(moved(ball(8), 0.2, [0, np.cos(turn), np.sin(turn)]) for turn in np.linspace(0, 6, 12))
    ),
    "a needle": lambda: moved(CUBE, [1.0, 1e-4, 1e-4]),
    "a bundle of needles": lambda: together(*(moved(ROD, 1.0, [0, y, z]) for y in range(4) for z in range(4))),
    "dust far away": lambda: together(CUBE, moved(soup(200, 1e-4), 0.01, 50.0)),
    "two pieces far apart": lambda: together(CUBE, moved(CUBE, 0.5, 40.0)),
    "very large": lambda: moved(CUBE, 1e6, 1e7),
    "very small": lambda: moved(CUBE, 1e-6),
    "a ladder": lambda: together(
        *(moved(CUBE, [12, 0.3, 0.3], [0, 0, z]) for z in (-3, 3)),
        *(moved(CUBE, [0.2, 0.2, 3], [x, 0, 0]) for x in np.linspace(-11, 11, 30)),
    ),
    "turned by every angle": lambda: (CUBE[0] @ np.linalg.qr(RANDOM.normal(size=(3, 3)))[0], CUBE[1]),
    "an unused vertex far away": lambda: (np.concatenate([CUBE[0], [[1e3, 0, 0]]]), CUBE[1]),
}

CLOUDS: dict[str, Callable[[], np.ndarray]] = {
    "one point": lambda: np.zeros((1, 3)),
    "three points": lambda: RANDOM.random((3, 3)),
    "one place": lambda: np.ones((500, 3)),
    "two places": lambda: np.repeat([[0.0, 0, 0], [1, 1, 1]], 50, 0),
    "a line": lambda: np.linspace(0, 1, 200)[:, None] * [1.0, 2, 3],
    "a plane": lambda: RANDOM.random((2000, 3)) * [0, 1, 1],
    "a lattice": lambda: np.stack(np.meshgrid(*[np.arange(8.0)] * 3), -1).reshape(-1, 3),
    "noise": lambda: RANDOM.random((2000, 3)),
    "a gaussian": lambda: RANDOM.normal(size=(2000, 3)),
    "a plane with outliers": lambda: np.concatenate([RANDOM.random((1000, 3)) * [0, 1, 1], RANDOM.random((50, 3))]),
    "a helix": lambda: np.stack([t := np.linspace(0, 20, 3000), np.cos(t), np.sin(t)], 1),
    "a curve": lambda: RANDOM.normal(size=(3000, 3)) * [1, 1e-3, 1e-3],
}

GRIDS: dict[str, Callable[[], np.ndarray]] = {
    "full": lambda: grid(lambda at: at[0] >= 0),
    "one cell": lambda: grid(lambda at: (at == 16).all(0)),
    "a flat sheet": lambda: grid(lambda at: at[0] == 16),
    "noise": lambda: RANDOM.random((32, 32, 32)) < 0.3,
    "a checkerboard": lambda: grid(lambda at: at.sum(0) % 2 == 0),
    "a sparse grid of 64": lambda: RANDOM.random((64, 64, 64)) < 0.001,
    "stairs": lambda: grid(lambda at: at[0] == at[1]),
    "a lattice": lambda: grid(lambda at: (at % 4 == 0).sum(0) > 1),
    "a ball": lambda: grid(lambda at: ((at - 15.5) ** 2).sum(0) < 150),
}


def shapes() -> Iterator[tuple[str, Callable[[], Shape]]]:
    for name, mesh in MESHES.items():
        yield f"mesh: {name}", lambda mesh=mesh, name=name: shape_from_mesh(*mesh(), name=name, axes=np.eye(3))
    for name, cloud in CLOUDS.items():
        yield f"points: {name}", lambda cloud=cloud, name=name: shape_from_points(cloud(), name=name, axes=np.eye(3))
    for name, cells in GRIDS.items():
        yield f"cells: {name}", lambda cells=cells, name=name: shape_from_voxels(cells(), name=name)


SHAPES = dict(shapes())


def test_there_are_fifty_of_them() -> None:
    assert len(SHAPES) == 50


@pytest.mark.parametrize("name", SHAPES)
def test_a_strange_shape_gives_a_program_of_finite_numbers_or_a_refusal(name: str) -> None:
    RANDOM.bit_generator.state = START  # each shape the same, whichever tests run before
    try:
        found = sp.infer(SHAPES[name](), blocks=3)
    except ShapeProgError:
        return
    assert 1 <= found.program.blocks <= 3
    assert found.reason
    assert not found.cut
    assert all(np.isfinite(node.values).all() for node in found.program.walk())


def test_what_does_not_look_like_furniture_is_reported() -> None:
    def doubt(mesh: Mesh) -> str:
        evidence = evidence_of(shape_from_mesh(*mesh, name="a shape", axes=np.eye(3)))
        return doubt_of_furniture(evidence.surface, evidence.surface_normals)

    turned, across = np.meshgrid(np.linspace(0, 2 * np.pi, 40), np.linspace(0, 2 * np.pi, 20), indexing="ij")
    reach = 3 + np.cos(across)
    torus = np.stack([reach * np.cos(turned), np.sin(across), reach * np.sin(turned)], -1).reshape(-1, 3)
    corner = (np.arange(39)[:, None] * 20 + np.arange(19)).reshape(-1)
    faces = np.concatenate([np.stack([corner, corner + 20, corner + step], -1) for step in (1, 21)])
    assert "does not look like furniture" in doubt((torus, faces))
    assert not doubt(moved(CUBE, [5.0, 1, 1]))


def test_separate_objects_and_hidden_surface_are_reported() -> None:
    def reason(*meshes: Mesh) -> str:
        return sp.infer(shape_from_mesh(*together(*meshes), name="a shape", axes=np.eye(3))).reason

    assert "2 separate pieces, the smallest with 50.0% of its cells" in reason(CUBE, moved(CUBE, 1.0, [0, 5, 0]))
    assert "is hidden inside)" in reason(*(moved(CUBE, 1 - k / 20) for k in range(20)))


def test_a_program_that_is_smaller_than_its_input_is_reported() -> None:
    surface = evidence_of(shape_from_mesh(*moved(CUBE, [4.0, 2, 1]), name="a box", axes=np.eye(3))).surface
    whole, half = (unroll(parse(f"box(at=(-12, -6, -3), size=({high}, 12, 6))")) for high in (24, 12))
    assert not remark_on_size(whole, surface)
    assert "is 50% as high as the input" in remark_on_size(half, surface)

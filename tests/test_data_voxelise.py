"""Laws and known answers of voxelisation: cells touched, solids filled, soups survived."""

from __future__ import annotations

import numpy as np
import pytest

from shapeprog.data.sampling import sample_surface
from shapeprog.geometry.voxelise import SHRINK, occupied_bounds, resample_voxels, voxelise_mesh, voxelise_points

CORNERS = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], float)
QUADS = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
FACES = np.array([triangle for a, b, c, d in QUADS for triangle in ((a, b, c), (a, c, d))])
CENTRES = np.stack(np.meshgrid(*[np.arange(32) - 15.5] * 3, indexing="ij"), -1)


def box(low, high):
    return np.asarray(low) + CORNERS * (np.asarray(high, float) - low), FACES


def subdivided(mesh, times):
    vertices, faces = mesh
    for _ in range(times):
        a, b, c = vertices[faces[:, 0]], vertices[faces[:, 1]], vertices[faces[:, 2]]
        d, e, f = (a + b) / 2, (b + c) / 2, (c + a) / 2
        vertices = np.concatenate([np.stack(t, 1) for t in ((a, d, f), (d, b, e), (f, e, c), (d, e, f))]).reshape(-1, 3)
        faces = np.arange(len(vertices)).reshape(-1, 3)
    return vertices, faces


def joined(*meshes):
    starts = np.cumsum([0] + [len(vertices) for vertices, _ in meshes])
    return (
        np.concatenate([vertices for vertices, _ in meshes]),
        np.concatenate([faces + start for (_, faces), start in zip(meshes, starts, strict=False)]),
    )


def turned(mesh, angles):
    a, b = angles
    first = np.array([[np.cos(a), -np.sin(a), 0], [np.sin(a), np.cos(a), 0], [0, 0, 1]])
    second = np.array([[1, 0, 0], [0, np.cos(b), -np.sin(b)], [0, np.sin(b), np.cos(b)]])
    return mesh[0] @ (first @ second).T, mesh[1]


def cells_of(low, high):
    return ((np.asarray(low) < CENTRES) & (np.asarray(high) > CENTRES)).all(-1)


def iou(a, b):
    return (a & b).sum() / (a | b).sum()


def clipped(polygon, axis, bound, sign):
    """The polygon's part where sign * (x[axis] - bound) >= 0 (Sutherland & Hodgman 1974)."""
    kept = []
    for here, there in zip(polygon, polygon[1:] + polygon[:1], strict=True):
        p, q = sign * (here[axis] - bound), sign * (there[axis] - bound)
        if p >= 0:
            kept.append(here)
        if (p > 0 > q) or (p < 0 < q):
            kept.append(here + (there - here) * (p / (p - q)))
    return kept


def touched_slowly(vertices, faces, size=32):
    """Twin of the surface part: clip each triangle by the box of each cell near it and see whether anything is left."""
    cells = np.zeros((size,) * 3, bool)
    half = 0.5 - SHRINK
    for face in faces:
        corners = vertices[face] + size / 2
        low, high = np.floor(corners.min(0)).astype(int) - 1, np.floor(corners.max(0)).astype(int) + 2
        for cell in np.ndindex(*(high - low)):
            place = np.array(cell) + low
            if (place < 0).any() or (place >= size).any() or cells[tuple(place)]:
                continue
            polygon = list(corners)
            for axis in range(3):
                polygon = clipped(polygon, axis, place[axis] + 0.5 - half, 1)
                polygon = clipped(polygon, axis, place[axis] + 0.5 + half, -1) if polygon else []
            cells[tuple(place)] = bool(polygon)
    return cells


@pytest.mark.parametrize("seed", range(4))
def test_touched_cells_equal_the_clipping_twin(seed):
    rng = np.random.default_rng(seed)
    size = 8
    vertices = rng.uniform(-4.5, 4.5, (3, 1, 3)) + rng.normal(0, [[[0.3]], [[1.5]], [[4.0]]], (3, 3, 3))
    vertices, faces = vertices.reshape(-1, 3), np.arange(9).reshape(-1, 3)
    from shapeprog.geometry.voxelise_kernels import mark_triangles

    fast = np.zeros((size,) * 3, np.bool_)
    mark_triangles(np.ascontiguousarray(vertices[faces] + size / 2), 0.5 - SHRINK, fast)
    np.testing.assert_array_equal(fast, touched_slowly(vertices, faces, size))


@pytest.mark.parametrize(
    "low_high", [((-12, -12, -12), (12, 12, 12)), ((-12, -3, 2), (12, 4, 5)), ((0, 0, 0), (1, 1, 1))]
)
def test_a_box_from_boundary_to_boundary_fills_exactly_its_cells(low_high):
    np.testing.assert_array_equal(voxelise_mesh(*box(*low_high)), cells_of(*low_high))


def test_rounding_noise_at_a_boundary_changes_nothing():
    vertices, faces = subdivided(box((-12, -6, -8), (12, 6, 8)), 2)
    noise = np.random.default_rng(0).uniform(-1e-3, 1e-3, vertices.shape)
    np.testing.assert_array_equal(voxelise_mesh(vertices + noise, faces), cells_of((-12, -6, -8), (12, 6, 8)))


def test_a_face_within_a_cell_touches_it():
    np.testing.assert_array_equal(
        voxelise_mesh(*box((-2.5, -1.1, 0.2), (3.5, 1.9, 0.4))), cells_of((-3, -2, 0), (4, 2, 1))
    )


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("height", [-12.0, 0.0, 5.0, 12.0, 3.3])
def test_a_sheet_without_thickness_is_one_cell_thick(axis, height):
    low, high = np.full(3, -6.0), np.full(3, 6.0)
    low[axis] = high[axis] = height
    cells = voxelise_mesh(*box(low, high))
    assert cells.sum() == 12 * 12
    assert cells.any(tuple({0, 1, 2} - {axis})).sum() == 1


def test_thin_boards_stay_thin_and_rooms_open_to_one_side_stay_empty():
    boards = [box((-12, -6, -8), (12, -5.5, 8)), box((-12, -6, -8), (12, 6, -7.5)), box((-12, -6, 7.5), (12, 6, 8))]
    boards += [box((-12, -6, -8), (-11.5, 6, 8)), box((11.5, -6, -8), (12, 6, 8)), box((0, -6, -8), (0.5, 6, 8))]
    cells = voxelise_mesh(*joined(*boards))
    expected = np.zeros_like(cells)
    for vertices, _ in boards:
        expected |= cells_of(np.floor(vertices.min(0)), np.ceil(vertices.max(0)))
    np.testing.assert_array_equal(cells, expected)


def test_a_slot_of_one_cell_between_two_boards_stays_open():
    cells = voxelise_mesh(*joined(box((-6, -6, -2), (6, 6, -1)), box((-6, -6, 0), (6, 6, 1))))
    np.testing.assert_array_equal(cells, cells_of((-6, -6, -2), (6, 6, -1)) | cells_of((-6, -6, 0), (6, 6, 1)))


def soup(mesh, rng, missing=0.05, flipped=0.5):
    vertices, faces = mesh
    faces = faces[rng.random(len(faces)) >= missing]
    turned_over = rng.random(len(faces)) < flipped
    faces[turned_over] = faces[turned_over][:, ::-1]
    faces = faces[rng.permutation(len(faces))]
    return vertices[faces].reshape(-1, 3), np.arange(3 * len(faces)).reshape(-1, 3)


@pytest.mark.parametrize("seed", range(3))
def test_overlapping_parts_missing_faces_flips_and_soup_keep_the_solid(seed):
    rng = np.random.default_rng(seed)
    spans = [(rng.uniform(-11, 2, 3), rng.uniform(3, 9, 3)) for _ in range(4)]
    mesh = joined(*(subdivided(box(low, low + side), 4) for low, side in spans))
    truth = np.zeros((32,) * 3, bool)
    for low, side in spans:
        truth |= cells_of(np.floor(low), np.ceil(low + side))
    np.testing.assert_array_equal(voxelise_mesh(*mesh), truth)
    assert iou(voxelise_mesh(*soup(mesh, rng)), truth) >= 0.98


def test_a_turned_box_full_of_holes_is_solid():
    rng = np.random.default_rng(5)
    mesh = turned(subdivided(box((-7, -5, -6), (7, 5, 6)), 5), (0.5, 0.9))
    whole = voxelise_mesh(*mesh)
    assert iou(voxelise_mesh(*soup(mesh, rng)), whole) >= 0.98
    inside = (CENTRES**2).sum(-1) < 25  # the ball within the box, wherever it is turned
    assert whole[inside].all()


def test_doubled_sheets_and_closed_shells_within_shells_are_solid():
    shell = box((-8, -8, -8), (8, 8, 8))
    inner = box((-3, -3, -3), (3, 3, 3))
    truth = cells_of((-8, -8, -8), (8, 8, 8))
    np.testing.assert_array_equal(voxelise_mesh(*joined(shell, shell)), truth)
    np.testing.assert_array_equal(voxelise_mesh(*joined(shell, inner, inner)), truth)


def test_mirrored_meshes_give_mirrored_cells():
    vertices, faces = turned(box((-7, -5, -3), (6, 4, 2)), (0.3, 0.2))
    np.testing.assert_array_equal(
        voxelise_mesh(vertices * [1, 1, -1], faces), voxelise_mesh(vertices, faces)[:, :, ::-1]
    )


def test_the_resolution_is_free():
    assert voxelise_mesh(*box((-3, -3, -3), (3, 3, 3)), resolution=9).sum() == 7**3
    assert voxelise_mesh(*box((-20, -20, -20), (20, 20, 20)), resolution=64).sum() == 40**3


def test_what_lies_outside_the_grid_is_left_out():
    assert not voxelise_mesh(*box((20, 20, 20), (30, 30, 30))).any()


def test_a_dense_cloud_fills_what_it_encloses():
    mesh = box((-12, -5, -7), (12, 5, 7))
    points = sample_surface(*mesh, 5000, seed=1)
    assert iou(voxelise_points(points), cells_of((-12, -5, -7), (12, 5, 7))) >= 0.97


def test_a_cloud_of_a_board_stays_a_board():
    points = sample_surface(*box((-12, -8, 0.2), (12, 8, 0.6)), 5000)
    cells = voxelise_points(points)
    assert cells.any((0, 1)).sum() == 1
    assert cells.sum() >= 0.97 * 24 * 16


@pytest.mark.parametrize("factor", [0.25, 0.5, 1.0, 2.0, 4.0])
def test_a_grid_of_another_size_is_resampled_without_holes(factor):
    size = round(24 / factor)
    cells = resample_voxels(np.ones((size,) * 3, bool), np.full(3, -12.0), factor)
    np.testing.assert_array_equal(cells, cells_of((-12, -12, -12), (12, 12, 12)))


def resampled_slowly(voxels, low, scale, size=32):
    """Twin of resampling: every cell of the grid that each occupied cell reaches, one occupied cell after another."""
    cells = np.zeros((size,) * 3, bool)
    margin = scale / 2 if scale < 1 else SHRINK
    for place in np.argwhere(voxels):
        start = np.asarray(low) + size / 2 + place * scale
        first = np.floor(start + margin).astype(int)
        last = np.maximum(np.ceil(start + scale - margin).astype(int) - 1, first)
        cells[tuple(slice(max(low, 0), max(high + 1, 0)) for low, high in zip(first, last, strict=True))] = True
    return cells


@pytest.mark.parametrize("seed", range(8))
def test_resampling_equals_its_twin(seed):
    rng = np.random.default_rng(seed)
    voxels = rng.random(rng.integers(1, 20, 3)) < rng.choice([0.02, 0.3, 1])
    scale = float(rng.choice([0.1, 0.5, 0.77, 1, 1.5, 4, 7.3]))
    low = rng.uniform(-20, 4, 3) if seed % 2 else rng.integers(-20, 4, 3) * 1.0
    np.testing.assert_array_equal(resample_voxels(voxels, low, scale), resampled_slowly(voxels, low, scale))


@pytest.mark.parametrize("seed", range(4))
def test_bounds_are_those_of_the_occupied_cells(seed):
    rng = np.random.default_rng(seed)
    voxels = np.zeros((9, 7, 8), bool)
    voxels[tuple(rng.integers(0, (9, 7, 8), (3, 3)).T)] = True
    low, high = occupied_bounds(voxels.transpose(2, 0, 1)[::-1])
    places = np.argwhere(voxels.transpose(2, 0, 1)[::-1])
    np.testing.assert_array_equal((low, high), (places.min(0), places.max(0) + 1))


def test_samples_lie_on_the_surface_by_area_and_repeat_with_the_seed():
    mesh = box((-2, -1, -1), (2, 1, 1))
    points = sample_surface(*mesh, 40_000, seed=3)
    on = np.isclose(np.abs(points), [2, 1, 1], atol=1e-6)
    assert on.any(1).all()
    # Two ends of 4 of a surface of 40: the count is binomial; five standard deviations.
    assert abs(on[:, 0].mean() - 0.2) < 5 * np.sqrt(0.2 * 0.8 / 40_000)
    np.testing.assert_array_equal(points, sample_surface(*mesh, 40_000, seed=3))
    assert (points != sample_surface(*mesh, 40_000, seed=4)).any()

"""Known answers for arcs and rounded boxes, and what they become at the ends of their sizes."""

import math

import numpy as np
import pytest
import torch
import trimesh
import twins
from geometry_helpers import make_scene, with_leaves

from shapeprog.geometry import surface as room
from shapeprog.geometry.arrays import table_of
from shapeprog.geometry.cells import voxels
from shapeprog.geometry.distance import each_distance, signed_distance
from shapeprog.geometry.mesh import part_meshes, union_mesh
from shapeprog.geometry.primitives.arc import ARC
from shapeprog.geometry.primitives.cuboid import CUBOID
from shapeprog.geometry.primitives.cylinder import CYLINDER
from shapeprog.geometry.primitives.rounded_box import ROUNDED_BOX

ARCS = [  # half the chord, radius, sagitta
    (5.0, 1.0, 5.0), (5.0, 1.0, 0.0), (5.0, 1.0, 1e-6), (5.0, 0.0, 2.0), (0.0, 1.0, 6.0), (0.0, 1.0, 0.0),
    (0.0, 0.0, 0.0), (2.0, 9.0, 2.5), (1.0, 0.7, 6.0), (3.0, -1.0, 1.0), (4.0, 1.0, -2.0),
]  # fmt: skip
BOXES = [
    (3.0, 2.0, 1.0, 0.0), (3.0, 2.0, 1.0, 0.6), (3.0, 2.0, 1.0, 5.0), (3.0, 2.0, 1.0, -1.0), (2.0, 2.0, 2.0, 7.0),
    (3.0, 2.0, 0.0, 1.0), (0.0, 0.0, 0.0, 1.0),
]  # fmt: skip
LIMITS = [*(("arc", size) for size in ARCS), *(("rounded_box", size) for size in BOXES)]


def size_of(*sizes, dtype=torch.float64):
    return torch.tensor([*sizes, 0.0, 0.0][:4], dtype=dtype)


def cloud(count, reach=7.0, dtype=torch.float64):
    generator = torch.Generator().manual_seed(3)
    return (torch.rand(count, 3, generator=generator, dtype=torch.float64) * 2 - 1).mul(reach).to(dtype)


def distances(kind, sizes, points):
    points = torch.as_tensor(points, dtype=torch.float64)
    return kind.distance(points, size_of(*sizes).expand(len(points), 4))


def test_distances_from_half_a_ring():
    # around (0, -2.5), with radius 5; its caps look down
    points = {
        (0.0, 2.5, 0.0): -1, (0, -2.5, 0): 4, (0, 5.5, 0): 2, (0, 2.5, 3): 2, (5, -5.5, 0): 3, (-5, -5.5, 0.5): 3,
        (8, -6.5, 0): math.sqrt(2**2 + 4**2), (5, -4.5, 3): math.sqrt(2**2 + 2**2), (4, 0.5, 0): -1, (6, 5.5, 0): 4,
        (5, -2.3, 0): -0.2,
    }  # fmt: skip
    found = distances(ARC, (5.0, 1.0, 5.0), list(points))
    assert found.tolist() == pytest.approx(list(points.values()), abs=1e-9)
    assert float(ARC.volume(size_of(5, 1, 5))) == pytest.approx(math.pi * 5 * math.pi)
    assert ARC.bound(size_of(5, 1, 5)).tolist() == pytest.approx([6, 3.5, 1])


def test_three_quarters_of_a_ring_leave_a_quarter_open():
    root = math.sqrt(2)
    size, centre = (root, 0.5, 2 + root), (2 + root) / 2 - 2
    found = distances(ARC, size, [[0, centre, 0], [0, centre - 2, 0], [2.5, centre, 0], [0, centre + 2, 0.5]])
    gap = math.hypot(root, 1.5 - root)
    assert found.tolist() == pytest.approx([1.5, gap, 0, 0], abs=1e-9)
    assert float(ARC.volume(size_of(*size))) == pytest.approx(math.pi / 4 * 3 * math.pi)
    assert ARC.bound(size_of(*size)).tolist() == pytest.approx([2.5, 1.5 + root / 2, 0.5])


def test_a_chord_of_no_length_closes_the_ring():
    points = cloud(200)
    ring = (points[:, :2].norm(dim=-1) - 3).hypot(points[:, 2]) - 1
    found = distances(ARC, (0.0, 1.0, 6.0), points)
    torch.testing.assert_close(found[ring > 0], ring[ring > 0], atol=1e-5, rtol=0)
    assert (found[ring < 0] < 1e-5).all()
    assert float(ARC.volume(size_of(0, 1, 6))) == pytest.approx(2 * math.pi**2 * 3, rel=1e-6)


def test_a_rod_thicker_than_its_bend_counts_as_thick_as_that():
    thick, full = (2.0, 9.0, 2.5), (2.0, (2**2 + 2.5**2) / 5, 2.5)
    torch.testing.assert_close(distances(ARC, thick, cloud(100)), distances(ARC, full, cloud(100)))
    for measure in (ARC.volume, ARC.areas, ARC.bound):
        torch.testing.assert_close(measure(size_of(*thick)), measure(size_of(*full)))


@pytest.mark.parametrize("sagitta", [0.0, 1e-6])
@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_an_arc_without_sagitta_is_the_cylinder(dtype, sagitta):
    arc, rod = size_of(10, 1.5, sagitta, dtype=dtype), size_of(10, 1.5, dtype=dtype)
    points = cloud(400, 14, dtype)
    torch.testing.assert_close(
        ARC.distance(points, arc.expand(400, 4)), CYLINDER.distance(points, rod.expand(400, 4)), atol=3e-6, rtol=0
    )
    for word in ("volume", "areas", "bound"):
        torch.testing.assert_close(getattr(ARC, word)(arc), getattr(CYLINDER, word)(rod), atol=1e-4, rtol=0)


@pytest.mark.parametrize("sagitta", [0.0, 1e-12, 1e-6, 1e-3, 0.1, 1.0, 1.1, 5.0, 10.0, 30.0])
def test_single_precision_holds_for_arcs_of_any_curvature(sagitta):
    """Distances, points and their derivatives are those of double precision, straight or bent."""
    found = []
    for dtype in (torch.float32, torch.float64):
        size = size_of(10, 1, sagitta, dtype=torch.float32).to(dtype).requires_grad_()
        points = cloud(300, 14, torch.float32).to(dtype).requires_grad_()
        unit = cloud(300, 0.7, torch.float32).to(dtype)
        distance, place = ARC.distance(points, size.expand(300, 4)), ARC.place(size.expand(300, 4), unit)
        inputs = torch.autograd.grad(distance.sum(), (size, points), retain_graph=True)
        moves = [torch.autograd.grad(place[:, axis].sum(), size, retain_graph=True)[0] for axis in range(2)]
        sized = torch.autograd.grad(ARC.volume(size) + ARC.areas(size).sum(), size)[0]
        found.append([each.detach().double() for each in (distance, place, *inputs, *moves, sized)])
    for single, double in zip(*found, strict=True):
        torch.testing.assert_close(single, double, atol=3e-4 if single.dim() == 1 else 3e-5, rtol=1e-5)


@pytest.mark.parametrize("sagitta", [0.0, 1e-6, 1e-3, 0.1, 3.0, 12.0])
def test_points_move_smoothly_with_the_bend(sagitta):
    unit = cloud(20, 1.0)
    size = size_of(4, 0.1, sagitta + 1e-3).requires_grad_()
    assert torch.autograd.gradcheck(lambda s: ARC.place(s.expand(20, 4), unit), size)
    assert torch.autograd.gradcheck(lambda s: ARC.distance(4 * unit, s.expand(20, 4)), size)


def test_an_arc_is_the_same_from_both_sides():
    points = cloud(50)
    expected = distances(ARC, (3.0, 0.8, 2.0), points)
    for mirror in ([-1.0, 1, 1], [1, 1, -1]):
        found = distances(ARC, (3.0, 0.8, 2.0), points * torch.tensor(mirror))
        torch.testing.assert_close(found, expected, rtol=0, atol=0)


def test_a_rounded_box_without_radius_is_the_cuboid_and_with_the_largest_a_ball():
    points = cloud(300)
    sharp, ball = (3.0, 2.0, 1.0), (2.0, 2.0, 2.0)
    torch.testing.assert_close(distances(ROUNDED_BOX, sharp, points), distances(CUBOID, sharp, points))
    torch.testing.assert_close(distances(ROUNDED_BOX, (*ball, 2.0), points), points.norm(dim=-1) - 2)
    assert float(ROUNDED_BOX.volume(size_of(*sharp))) == 48
    assert float(ROUNDED_BOX.areas(size_of(*sharp)).sum()) == 88
    assert float(ROUNDED_BOX.volume(size_of(*ball, 2))) == pytest.approx(4 / 3 * math.pi * 8)
    torch.testing.assert_close(distances(ROUNDED_BOX, (*ball, 9.0), points), points.norm(dim=-1) - 2)


def test_known_distances_from_a_rounded_box():
    points = [[0.0, 0, 0], [5, 0, 0], [2.5 + 3, 1.5 + 4, 0], [2.5 + 1, 1.5 + 2, 0.5 + 2], [2.9, 0, 0]]
    found = distances(ROUNDED_BOX, (3.0, 2.0, 1.0, 0.5), points)
    assert found.tolist() == pytest.approx([-1, 2, 4.5, 2.5, -0.1])


@pytest.mark.parametrize("size", [(3.0, 2.0, 1.0, 0.5), (3.0, 2.0, 1.0, 1.0), (2.0, 2.0, 2.0, 2.0)])
def test_the_mesh_of_a_rounded_box_fills_its_bound_and_lies_on_its_surface(size):
    vertices, faces = ROUNDED_BOX.mesh(np.array(size))
    assert np.abs(vertices).max(0) == pytest.approx(size[:3], abs=1e-9)
    found = distances(ROUNDED_BOX, size, vertices)
    assert found.abs().max() < 0.01 * size[3]
    assert trimesh.Trimesh(vertices, faces, process=False).is_winding_consistent


@pytest.mark.parametrize("size", [(5.0, 1.0, 5.0), (5.0, 1.0, 0.0), (2.0, 9.0, 2.5), (0.5, 1.0, 6.0)])
def test_the_mesh_of_an_arc_is_a_solid_that_joins_others(size):
    scene = make_scene(["arc", "rounded_box"], [size, (1.0, 2, 3, 0.5)], [[0.0, 0, 0], [0, size[2] / 2, 0]])
    assert [part.slot for part in part_meshes(scene)] == [0, 1]
    assert trimesh.Trimesh(*union_mesh(scene), process=False).is_watertight


def test_a_row_of_cells_leaves_a_ring_and_enters_it_again():
    ring = make_scene(["arc"], [[0.0, 2.0, 16.0]], [[0.0, 0, 0]], rotation=torch.eye(3)[None, [2, 0, 1]])
    filled = voxels(ring).numpy()
    ticks = np.arange(32) - 15.5
    along = np.hypot(ticks[None, :, None], ticks[None, None, :]) - 8
    upright = np.hypot(along, ticks[:, None, None]) <= 2
    assert (filled == upright).all()


@pytest.mark.parametrize("resolution", [32, 45])
def test_limits_fill_the_same_cells_by_kernel_and_by_declaration(resolution):
    for name, size in LIMITS:
        turn = torch.linalg.qr(cloud(3))[0][None]
        for rotation in (None, turn):
            scene = make_scene([name], [size], [[0.13, 0.21, -0.37]], rotation, torch.float64, lead=(1,))
            assert (voxels(scene[0], resolution).numpy() == twins.cells(scene[0], resolution)).all(), (name, size)


@pytest.mark.parametrize(("name", "size"), LIMITS)
def test_limits_have_the_same_distance_and_finite_gradient_by_kernel_and_by_declaration(name, size):
    scene, leaves = with_leaves(make_scene([name], [size], [[0.1, 0.2, -0.3]], dtype=torch.float64))
    points = cloud(200).requires_grad_()
    fast, slow = signed_distance(scene, points), each_distance(scene, points)[:, 0]
    torch.testing.assert_close(fast, slow)
    lengths = (torch.tensor([*size, 0.0])[:4] > 0).nonzero()[:, 0]  # where a length ends, either side is right
    for got, expected in zip(
        torch.autograd.grad(fast.sum(), [*leaves, points]), torch.autograd.grad(slow.sum(), [*leaves, points]),
        strict=True,
    ):  # fmt: skip
        assert got.isfinite().all()
        assert expected.isfinite().all()
        if got.shape[-1] == 4:
            got, expected = got[..., lengths], expected[..., lengths]
        torch.testing.assert_close(got, expected, rtol=1e-6, atol=1e-8)


@pytest.mark.parametrize(
    ("name", "size"), [(name, size) for name, size in LIMITS if min(size[:2]) > 0 and size[2] >= 0]
)
def test_limits_are_placed_with_the_same_gradient_by_kernel_and_by_declaration(name, size):
    scene, leaves = with_leaves(make_scene([name], [size], [[0.1, 0.2, -0.3]], dtype=torch.float64, lead=(1,)))
    areas = room.face_areas(scene)
    table = table_of(scene)
    choice = room.visible(table, room.area_shares(areas.detach(), scene), 200, 5)
    weigh = cloud(200)[None]
    fast, slow = room._Placed.apply(*leaves, areas, table, choice)[0], twins.place(scene, areas, choice)[0]
    torch.testing.assert_close(fast, slow)
    lengths = (torch.tensor([*size, 0.0])[:4] > 0).nonzero()[:, 0]
    got, expected = (torch.autograd.grad(each, leaves[0], weigh)[0][..., lengths] for each in (fast, slow))
    torch.testing.assert_close(got, expected)

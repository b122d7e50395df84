"""Pieces: boxes proposed for built shapes, whose parts are known."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import pytest

import shapeprog as sp
from shapeprog.data.placement import shape_from_mesh, shape_from_points
from shapeprog.data.sampling import sample_surface
from shapeprog.data.shape import Shape
from shapeprog.geometry.mesh import union_mesh
from shapeprog.inference.pieces.pieces import Pieces, Source, find_pieces
from shapeprog.inference.surface.cloud import points_of_scan, projected
from shapeprog.inference.surface.components import components, enclosed, solid_sides
from shapeprog.inference.surface.evidence import evidence_of
from shapeprog.inference.surface.oriented import Boxes, boxes_around
from shapeprog.space import Array, FloatArray, Frame

Mesh = tuple[FloatArray, Array]

QUADS = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])

TABLE = """
top_rectangle(at=(8, 0, 0), thickness=1.5, half=(8, 12))
for i in translate(2, by=(0, 0, 20)):
    for j in translate(2, by=(0, 13, 0)):
        leg(at=(-12, -7.5, -11), size=(20, 2, 2))
"""


def box(centre: Array, half: Array, rotation: Array | None = None) -> Mesh:
    signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], np.float64)
    corners = (signs * half) @ (np.eye(3) if rotation is None else rotation).T + centre
    return corners, np.concatenate([QUADS[:, :3], QUADS[:, [0, 2, 3]]])


def cylinder(centre: Array, axis: Array, radius: float, half: float, sides: int = 24) -> Mesh:
    along = np.asarray(axis) / np.linalg.norm(axis)
    across = np.cross(along, [0.3, 0.5, 0.9])
    across /= np.linalg.norm(across)
    other, turn = np.cross(along, across), np.arange(sides) * 2 * np.pi / sides
    ring = radius * (np.cos(turn)[:, None] * across + np.sin(turn)[:, None] * other)
    vertices = np.concatenate([ring - half * along, ring + half * along, [-half * along, half * along]]) + centre
    k, after = np.arange(sides), (np.arange(sides) + 1) % sides
    faces = [[k, after, k + sides], [after, after + sides, k + sides]]
    faces += [[after, k, 0 * k + 2 * sides], [k + sides, after + sides, 0 * k + 2 * sides + 1]]
    return vertices, np.concatenate([np.stack(each, 1) for each in faces])


def together(*meshes: Mesh) -> Mesh:
    first = np.cumsum([0, *(len(vertices) for vertices, _ in meshes)])
    faces = [faces + at for (_, faces), at in zip(meshes, first, strict=False)]
    return np.concatenate([vertices for vertices, _ in meshes]), np.concatenate(faces)


def turn(axis: int, degrees: float) -> FloatArray:
    cosine, sine = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    one, two = (axis + 1) % 3, (axis + 2) % 3
    found = np.eye(3)
    found[[one, one, two, two], [one, two, one, two]] = cosine, -sine, sine, cosine
    return found


def shape_of(mesh: Mesh) -> Shape:
    """The mesh as it is, in cells: it need not fill the grid."""
    vertices, faces = mesh
    shape = shape_from_mesh(vertices, faces)
    return Shape("built", shape.voxels, shape.points, Frame(), vertices.astype(np.float32), faces.astype(np.int32))


def pieces_of(shape: Shape) -> Pieces:
    return find_pieces(evidence_of(shape))


def overlap(boxes: Boxes, centre: Array, half: Array, rotation: Array | None = None) -> FloatArray:
    """IoU (N,) of boxes with one box."""
    axes = np.eye(3) if rotation is None else rotation
    drawn = np.random.default_rng(0).uniform(-1, 1, (2000, 3)) * half @ axes.T + centre
    at = np.einsum("npi,nij->npj", drawn - boxes.centre[:, None], boxes.rotation)
    own, other = np.prod(2 * np.asarray(half)), np.prod(2 * boxes.half, axis=1)
    shared = (np.abs(at) <= boxes.half[:, None]).all(2).mean(1) * own
    return shared / (own + other - shared)


def angle(boxes: Boxes, direction: Array) -> FloatArray:
    """Degrees (N,) between a direction and the axis nearest to it."""
    unit = np.asarray(direction) / np.linalg.norm(direction)
    return np.degrees(np.arccos(np.minimum(np.abs(unit @ boxes.rotation).max(1), 1)))


def of(pieces: Pieces, source: Source) -> Boxes:
    return pieces.boxes.take(pieces.source == source.value)


def splayed_stool() -> tuple[Mesh, list[tuple[Array, Array, Array]]]:
    parts = [(np.array([6.0, 0, 0]), np.array([0.5, 6, 6]), np.eye(3))]
    for y in (-4, 4):
        for z in (-4, 4):
            tilt = turn(1, 12 * np.sign(z)) @ turn(2, -12 * np.sign(y))
            parts.append((np.array([-1.0, y, z]), np.array([6.0, 0.5, 0.5]), tilt))
    return together(*(box(*part) for part in parts)), parts


@cache
def fused_table() -> Shape:
    vertices, faces = union_mesh(sp.unroll(sp.parse(TABLE)))
    return shape_of((np.asarray(vertices, np.float64), np.asarray(faces)))


TABLE_PARTS = [((8.75, 0, 0), (0.75, 8, 12))]
TABLE_PARTS += [((-2, y, z), (10, 1, 1)) for y in (-6.5, 6.5) for z in (-10, 10)]


def test_splayed_legs_and_a_seat_are_five_boxes_along_their_own_axes():
    mesh, parts = splayed_stool()
    found = of(pieces_of(shape_of(mesh)), Source.COMPONENT)
    assert len(found.half) == 5
    for centre, half, rotation in parts:
        best = overlap(found, centre, half, rotation).argmax()
        np.testing.assert_allclose(found.centre[best], centre, atol=0.01)
        np.testing.assert_allclose(np.sort(found.half[best]), np.sort(half), atol=0.01)
        assert angle(found.take(np.array([best])), rotation[:, np.argmax(half) if half[0] > 1 else 0])[0] < 0.1


def test_boxes_lie_along_the_axes_of_the_world_where_that_costs_little():
    flat = np.random.default_rng(0).normal(0, 1, (200, 3))
    ball = flat / np.linalg.norm(flat, axis=1, keepdims=True)
    assert (boxes_around([ball]).rotation == np.eye(3)).all()


@pytest.mark.parametrize("sides", [3, 4, 6, 24])
def test_a_long_thin_rod_gets_a_box_along_its_axis(sides):
    axis = np.array([1.0, 0.3, 0.2])
    vertices, _ = cylinder(np.zeros(3), axis, 0.4, 6, sides)
    found = boxes_around([vertices])
    assert angle(found, axis)[0] < 0.5
    assert found.half.max() == pytest.approx(6, rel=0.02)


def test_the_box_of_many_points_holds_them_all_and_is_as_small_as_that_of_its_corners():
    rotation = turn(0, 20) @ turn(1, 35) @ turn(2, 10)
    corners, _ = box(np.ones(3), np.array([4, 2, 0.5]), rotation)
    inner = np.random.default_rng(0).uniform(-1, 1, (3000, 3)) * [4, 2, 0.5] @ rotation.T + 1
    points = np.concatenate([inner, corners])
    found = boxes_around([points])
    at = np.abs((points - found.centre[0]) @ found.rotation[0])
    assert (at <= found.half[0] + 1e-9).all()
    np.testing.assert_allclose(np.sort(found.half[0]), [0.5, 2, 4], atol=1e-6)


def test_an_l_bracket_in_one_piece_divides_in_two():
    outline = np.array([[0, 0], [10, 0], [10, 1], [1, 1], [1, 8], [0, 8]], np.float64)
    vertices = np.concatenate([np.column_stack([outline, np.full(6, z)]) for z in (-3.0, 3.0)])
    cap = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5]])
    side = np.concatenate([[[k, (k + 1) % 6, k + 6], [(k + 1) % 6, (k + 1) % 6 + 6, k + 6]] for k in range(6)])
    found = pieces_of(shape_of((vertices - [5, 4, 0], np.concatenate([cap, cap + 6, side])))).boxes
    assert overlap(found, np.array([0, -3.5, 0]), np.array([5, 0.5, 3])).max() > 0.85
    assert overlap(found, np.array([-4.5, 0, 0]), np.array([0.5, 4, 3])).max() > 0.85


@pytest.mark.parametrize("given", ["mesh", "points"])
def test_the_top_and_each_leg_of_a_table_in_one_piece_are_found(given):
    shape = fused_table()
    if given == "points":
        cloud = sample_surface(shape.vertices, shape.faces, 20_000, 3)
        shape = shape_from_points(cloud, points=20_000)
    found = pieces_of(shape).boxes
    for centre, half in TABLE_PARTS:
        middle = 0 if given == "mesh" else 1.25  # clouds are centred
        best = overlap(found, np.add(centre, (middle, 0, 0)), np.array(half)).max()
        assert best > 0.8, (centre, best)


@pytest.mark.parametrize("known", [True, False])
def test_a_leaning_cylinder_is_a_rod_along_its_axis(known):
    axis = np.array([1.0, 0.25, -0.2])
    mesh = together(cylinder(np.zeros(3), axis, 0.8, 8, 48), box(np.array([-9.0, 0, 0]), np.array([0.5, 8, 12])))
    shape = shape_of(mesh)
    if not known:
        shape = Shape("cloud", shape.voxels, sample_surface(*mesh, 20_000, 1))
    rods = of(pieces_of(shape), Source.ROD)
    cosine = np.abs(rods.rotation[:, :, 0] @ axis / np.linalg.norm(axis))
    along = np.degrees(np.arccos(np.minimum(cosine, 1)))
    best = along.argmin()
    assert along[best] < 1
    np.testing.assert_allclose(rods.half[best], [8, 0.8, 0.8], rtol=0.12)


def rewritten(mesh: Mesh, how: str) -> Mesh:
    vertices, faces = mesh
    if how == "soup":
        return vertices[faces.reshape(-1)], np.arange(faces.size).reshape(-1, 3)
    return vertices, np.concatenate([faces, faces[:, ::-1], faces])


@pytest.mark.parametrize("how", ["soup", "doubled"])
def test_unwelded_and_doubled_faces_make_the_same_pieces(how):
    mesh, _ = splayed_stool()
    one, two = (pieces_of(shape_of(each)) for each in (mesh, rewritten(mesh, how)))
    for a, b in zip(one.boxes, two.boxes, strict=True):
        np.testing.assert_array_equal(a, b)
    np.testing.assert_array_equal(one.source, two.source)


def test_components_come_by_falling_area_and_no_face_is_lost():
    mesh, _ = splayed_stool()
    found = components(*rewritten(mesh, "soup"))
    assert len(found.vertices) == 40
    assert len(found.faces) == 60
    assert (np.diff(found.area) <= 1e-6).all()
    assert found.area.sum() == pytest.approx(2 * 144 + 4 * 12 + 4 * (4 * 12 + 2), rel=1e-6)


def test_closed_solids_that_share_an_edge_are_separate_components():
    case, door = box(np.zeros(3), np.array([4.0, 3, 5])), box(np.array([0.0, -4, 3]), np.array([4.0, 1, 2]))
    found = components(*together(case, door))
    assert found.area == pytest.approx([2 * (48 + 80 + 60), 2 * (16 + 32 + 8)], rel=1e-6)
    assert [len(np.unique(faces)) for faces in np.split(found.faces, found.start[1:-1])] == [8, 8]
    joined = components(*together((case[0], case[1][1:]), door))  # the case is open, the door is not
    assert len(joined.area) == 2
    assert len(components(*together((case[0], case[1][1:]), (door[0], door[1][1:]))).area) == 1


def test_faces_of_closed_solids_are_told_which_way_they_face():
    cube = box(np.zeros(3), np.ones(3))
    turned = box(np.array([5.0, 0, 0]), np.ones(3))
    rod = cylinder(np.array([0.0, 5, 0]), np.array([1.0, 2, 3]), 0.5, 3)
    sheet = np.array([[0, 9, 0], [1, 9, 0], [0, 9, 1.0]]), np.array([[0, 1, 2]])
    open_box = box(np.array([0.0, 0, 5]), np.ones(3))
    crumpled = box(np.array([0.0, 0, 9]), np.array([1, 1, 0.05]))
    everything = [cube, (turned[0], turned[1][:, ::-1]), rod, sheet, (open_box[0], open_box[1][1:]), crumpled]
    found, whole = (
        [solid_sides(mesh, enclosed(mesh)) for mesh in (components(*each) for each in meshes)]
        for meshes in (everything, [together(*everything)])
    )
    assert np.bincount(whole[0] + 1).tolist() == [12, 11 + 1 + 12, 12 + 96]
    vertices, faces = cube
    outwards = (
        np.cross(*(vertices[faces[0, k]] - vertices[faces[0, 0]] for k in (1, 2))) @ vertices[faces[0]].mean(0) > 0
    )
    sign = 1 if outwards else -1
    assert [set(sides.tolist()) for sides in found] == [{sign}, {-sign}, {1}, {0}, {0}, {0}]


def test_boards_side_by_side_are_also_offered_as_one_panel():
    slats = [box(np.array([0, 2.2 * k - 4.4, 0]), np.array([0.3, 1.0, 10])) for k in range(5)]
    found = of(pieces_of(shape_of(together(*slats))), Source.GROUP)
    assert overlap(found, np.zeros(3), np.array([0.3, 5.4, 10])).max() > 0.95


def test_a_bent_bar_in_one_piece_with_a_block_is_a_limb():
    turns = np.linspace(0, 1.2, 40)
    path = np.column_stack([12 * np.sin(turns), 0 * turns, 12 - 12 * np.cos(turns)])
    around = np.arange(16) * 2 * np.pi / 16
    out = np.column_stack([-np.sin(turns), 0 * turns, np.cos(turns)])
    ring = np.cos(around)[None, :, None] * out[:, None] + np.sin(around)[None, :, None] * [0, 1, 0]
    tube = path[:, None] + 0.5 * ring
    k, j = np.meshgrid(np.arange(39), np.arange(16), indexing="ij")
    a, b = 16 * k + j, 16 * k + (j + 1) % 16
    faces = np.concatenate([np.stack([a, b, a + 16], -1), np.stack([b, b + 16, a + 16], -1)]).reshape(-1, 3)
    mesh = together((tube.reshape(-1, 3), faces), box(np.array([-3.0, 0, 0]), np.array([3.0, 3, 3])))
    points = sample_surface(*mesh, 20_000, 0)
    found = of(pieces_of(Shape("bent", shape_of(mesh).voxels, points)), Source.LIMB)
    whole = boxes_around([tube.reshape(-1, 3)])
    assert overlap(found, whole.centre[0], whole.half[0], whole.rotation[0]).max() > 0.7


def test_the_same_target_gives_the_same_pieces():
    one, two = pieces_of(fused_table()), pieces_of(fused_table())
    for a, b in zip((*one.boxes, one.source), (*two.boxes, two.source), strict=True):
        np.testing.assert_array_equal(a, b)


def test_pieces_are_proper_boxes():
    mesh, _ = splayed_stool()
    found = pieces_of(shape_of(mesh))
    assert len(found.source) <= 600
    np.testing.assert_allclose(np.linalg.det(found.boxes.rotation), 1)
    assert (found.boxes.half >= 0).all()


def test_a_soup_of_thousands_of_triangles_is_no_trouble():
    corners = np.random.default_rng(0).uniform(-12, 12, (20_000, 1, 3))
    corners = corners + np.random.default_rng(1).normal(0, 0.2, (20_000, 3, 3))
    found = pieces_of(shape_of((corners.reshape(-1, 3), np.arange(60_000).reshape(-1, 3))))
    assert 0 < len(found.source) <= 600


@pytest.mark.parametrize("count", [1, 2, 5, 40])
def test_few_points_give_few_pieces_but_no_error(count):
    points = np.random.default_rng(0).uniform(-12, 12, (count, 3)).astype(np.float32)
    cells = np.zeros((32, 32, 32), np.bool_)
    cells[16, 16, 16] = True
    assert len(pieces_of(Shape("few", cells, points)).source) <= 4


def noisy(mesh: Mesh) -> FloatArray:
    points: FloatArray = sample_surface(*mesh, 5_000, 0) + np.random.default_rng(0).normal(0, 0.17, (5_000, 3))
    return points


def test_noisy_points_are_projected_onto_what_they_were_drawn_on():
    points = noisy(box(np.zeros(3), np.array([6.0, 8, 8])))
    off = np.abs(np.abs(points) - [6, 8, 8]).min(1)
    near = np.abs(np.abs(projected(points)) - [6, 8, 8]).min(1)
    assert np.median(near) < 0.6 * np.median(off)


@pytest.mark.parametrize("noise", [0.0, 0.003, 0.12])
def test_all_points_of_a_clean_scan_are_looked_at_and_few_of_a_noisy_one(noise):
    mesh, _ = splayed_stool()
    points = sample_surface(*mesh, 20_000, 0) + np.random.default_rng(0).normal(0, noise, (20_000, 3))
    shape = shape_from_points(points)
    assert shape.points is not None
    assert len(shape.points) == 5_000
    assert len(points_of_scan(shape)) == (5_000 if noise > 0.1 else 20_000)
    assert len(points_of_scan(shape_from_points(points[:3_000]))) == 3_000


@pytest.mark.parametrize("half", [(12, 5.3, 7.2), (10.1, 5.3, 12), (12, 12, 12), (5, 12, 7.7)])
def test_the_inside_of_a_box_is_not_free_though_its_sides_lie_between_cells(half):
    shape = shape_from_mesh(*box(np.zeros(3), np.array(half)), name="box", axes=np.eye(3))
    assert not evidence_of(shape).free[30:34, 30:34, 30:34].any()

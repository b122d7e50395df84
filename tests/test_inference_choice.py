"""Evidence, what candidates cover of it, and which are chosen: known answers, and kernels against their twins."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest
import torch

from shapeprog.data.placement import shape_from_mesh, shape_from_points, shape_from_voxels
from shapeprog.data.sampling import sample_surface
from shapeprog.data.shape import Shape
from shapeprog.geometry.batch import Batch
from shapeprog.geometry.distance import each_distance
from shapeprog.geometry.mesh import union_mesh
from shapeprog.inference.choice.bits import covers, pack, sorted_by_cell
from shapeprog.inference.choice.choice import choose, explained, value
from shapeprog.inference.choice.coverage import Coverage, CoverageTable, Prices, overlapping, shares
from shapeprog.inference.choice.coverage_kernels import LIFT, TURNED
from shapeprog.inference.surface import evidence as seen
from shapeprog.inference.surface.evidence import Evidence, evidence_of
from shapeprog.inference.surface.settings import SURFACE
from shapeprog.language.parser import parse
from shapeprog.language.program import Program
from shapeprog.language.unroll import unroll
from tests.geometry_helpers import random_scene

TOP = "locker(at=(10, -8, -12), size=(2, 16, 24))"
LEGS = [f"leg(at=(-12, {y}, {z}), size=(22, 2, 2))" for y in (-8, 6) for z in (-12, 10)]
LOOP = f"for i in translate(2, by=(0, 14, 0)):\n    for j in translate(2, by=(0, 0, 22)):\n        {LEGS[0]}\n"
TABLE = [parse(text) for text in (TOP, *LEGS)]


def joined(programs: list[Program]) -> Program:
    return Program(tuple(node for program in programs for node in program.body))


def mesh_of(*programs: Program) -> Shape:
    """The shape of what programs draw; it spans 24 cells about the origin, so it stays where it is."""
    vertices, faces = union_mesh(unroll(joined(list(programs))))
    return shape_from_mesh(vertices, faces)


def random_blocks(count: int, seed: int) -> list[Program]:
    random = np.random.default_rng(seed)
    rows = np.concatenate([random.uniform(-12, 8, (count, 3)), random.uniform(0.5, 10, (count, 3))], 1).round(2)
    return [parse("leg(at=({}, {}, {}), size=({}, {}, {}))".format(*row)) for row in rows]


@pytest.fixture(scope="module")
def table() -> Evidence:
    return evidence_of(mesh_of(*TABLE))


def chosen(candidates: list[Program], evidence: Evidence, blocks: int = 10) -> tuple[int, ...]:
    return choose(Coverage(evidence).table(candidates), blocks)


# ---------------------------------------------------------------- choice


def test_a_planted_table_is_chosen_exactly_among_hundreds(table):
    candidates = [*random_blocks(150, 1), *TABLE, *random_blocks(150, 2)]
    assert chosen(candidates, table) == (150, 151, 152, 153, 154)
    assert explained(Coverage(table).table(TABLE), range(5)) > 0.99


def test_a_loop_of_four_legs_is_chosen_before_four_legs(table):
    assert chosen([*TABLE, parse(LOOP)], table) == (0, 5)


def test_every_block_more_explains_more_up_to_the_best(table):
    made = Coverage(table).table(TABLE)
    options = [choose(made, blocks) for blocks in range(7)]
    assert [len(option) for option in options] == [0, 1, 2, 3, 4, 5, 5]
    for measure in (value, explained):
        assert all(measure(made, one) < measure(made, two) for one, two in itertools.pairwise(options[:6]))


def test_a_block_that_fills_free_space_is_not_chosen(table):
    under = parse("locker(at=(-12, -8, -12), size=(22, 16, 24))")  # its sides pass through those of all legs
    floating = parse("locker(at=(-4, -3, -5), size=(6, 6, 10))")
    assert chosen([under, floating], table) == ()


def test_what_lies_inside_another_costs_its_price_and_no_more():
    body, board = (
        parse("locker(at=(-12, -8, -12), size=(24, 16, 24))"),
        parse("layer(at=(0, 0, 0), thickness=1, half=(6, 9))"),
    )
    made = Coverage(evidence_of(mesh_of(body))).table([body, board])
    assert value(made, (1,)) < -2 * made.prices[1]
    assert value(made, (0, 1)) == pytest.approx(value(made, (0,)) - made.prices[1])


def test_what_another_buries_explains_nothing():
    body, board, side = (
        parse("locker(at=(-12, -8, -12), size=(24, 16, 24))"),
        parse("layer(at=(0, 0, 0), thickness=1, half=(6, 9))"),
        parse("locker(at=(-12, -8, -12), size=(24, 16, 1))"),
    )
    vertices, faces = zip(*(union_mesh(unroll(each)) for each in (body, board)), strict=True)
    both = shape_from_mesh(np.concatenate(vertices), np.concatenate([faces[0], faces[1] + len(vertices[0])]))
    made = Coverage(evidence_of(both)).table([body, board, side])
    assert explained(made, (1,)) > 0.02  # the board is in the mesh, unseen
    assert explained(made, (0, 1)) == explained(made, (1, 0)) == explained(made, (0,))
    assert value(made, (0, 1)) == pytest.approx(value(made, (0,)) - made.prices[1])
    assert explained(made, (1, 2)) == pytest.approx(explained(made, (1,)) + explained(made, (2,)))
    assert choose(made, 3) == (0,)


def test_a_round_post_is_less_near_to_a_square_one():
    square, rounded = (
        parse("box(at=(-12, -0.6, -0.6), size=(24, 1.2, 1.2))"),
        parse("cylinder(at=(-12, 0, 0), height=24, radius=0.7)"),
    )
    evidence = evidence_of(shape_from_mesh(*union_mesh(unroll(square))))
    near, plain = (Coverage(evidence, prices).table([square, rounded]) for prices in (Prices(), Prices(close=0)))
    assert explained(near, (1,)) == pytest.approx(explained(near, (0,)), abs=0.01)
    gains = [value(near, (k,)) - value(plain, (k,)) for k in range(2)]
    assert gains[0] == pytest.approx(Prices.close, rel=0.02)
    assert gains[1] < 0.75 * Prices.close


def test_feet_of_thin_legs_count_as_a_side_of_the_target() -> None:
    evidence = evidence_of(mesh_of(joined(TABLE)))
    with_sides, without = (Coverage(evidence, prices).table(TABLE) for prices in (Prices(side=0.03), Prices()))
    gains = [value(with_sides, chosen) - value(without, chosen) for chosen in ((0, 1, 2, 3), (0, 1, 2, 3, 4))]
    assert gains[1] == pytest.approx(6 * 0.03, rel=0.02)  # each side counts as much as any other
    assert gains[1] - gains[0] > 0.2 * 0.03  # one of four feet, and what the leg has of two more sides


@pytest.mark.parametrize(
    ("block", "known"),
    [
        ("box(at=(0, 3, -6), size=(1, 2, 12))", 1),
        ("box(at=(0, -1, -6), size=(1, 2, 12))", 2),
        ("box(at=(0, 3, -5), size=(1, 2, 12))", 0),
        ("for i in translate(3, by=(0, 0, 5)):\n    box(at=(0, 3, -6), size=(1, 2, 2))", 1),
        ("for i in mirror(side):\n    box(at=(0, 3, 4), size=(1, 2, 2))", 0),
        ("for i in mirror(side):\n    box(at=(0, -1, 4), size=(1, 2, 2))", 1),
        ("for i in rotate(4, step=1):\n    box(at=(0, 3, 4), size=(1, 2, 2))", 0),
    ],
)
def test_what_is_in_the_middle_writes_a_number_less(table, block, known):
    prices, program = Prices(), parse(block)
    (price,) = Coverage(table, prices).table([program]).prices
    assert price == pytest.approx(prices.of(program) - known * prices.number)


@pytest.mark.parametrize(
    ("block", "overlap"),
    [
        ("box(at=(0, 3, 4), size=(1, 2, 2))", False),
        ("for i in mirror(side):\n    box(at=(0, 3, 4), size=(1, 2, 2))", False),
        ("for i in mirror(side):\n    box(at=(0, -1, -3), size=(1, 2, 7))", True),  # across the middle
        ("for i in mirror(side):\n    bar(start=(-6, 0, -7), end=(6, 0, 7), section=(1, 1))", False),  # a cross
        ("for i in mirror(side):\n    bar(start=(0, 0, -7), end=(1, 0, 7), section=(8, 2))", True),
        ("for i in translate(3, by=(0, 3, 0)):\n    box(at=(0, -6, -3), size=(1, 2, 7))", False),
        ("for i in translate(3, by=(0, 1, 0)):\n    box(at=(0, -6, -3), size=(1, 2, 7))", True),
    ],
)
def test_copies_that_overlap_are_implausible(table, block, overlap):
    program = parse(block)
    assert overlapping(unroll([program])).tolist() == [overlap]
    with_price, without = (Coverage(table, prices).table([program]).prices for prices in (None, Prices(implausible=0)))
    assert with_price - without == pytest.approx(overlap * Prices.implausible)


def test_copies_of_a_loop_hide_each_other(table):
    crossing = "for i in translate(2, by=(0, 3, 0)):\n    locker(at=(-4, -3, -5), size=(6, 6, 10))\n"
    apart = crossing.replace("(0, 3, 0)", "(0, 6.5, 0)")
    costs = [-value(Coverage(table, Prices(free=0)).table([parse(text)]), (0,)) for text in (crossing, apart)]
    assert costs[0] < 0.85 * costs[1]


def test_two_equal_blocks_do_not_hide_each_other(table):
    floating = parse("locker(at=(-4, -3, -5), size=(6, 6, 10))")
    made = Coverage(table, Prices(free=0)).table([floating, floating])
    assert value(made, (0, 1)) == pytest.approx(2 * value(made, (0,)), rel=0.05)


def test_nothing_is_chosen_for_points_of_noise():
    noise = np.random.default_rng(3).uniform(-1, 1, (5000, 3))
    assert chosen(random_blocks(200, 4), evidence_of(shape_from_points(noise))) == ()


def test_nothing_is_chosen_from_nothing(table):
    empty = parse("for i in translate(0, by=(1, 0, 0)):\n    leg(at=(0, 0, 0), size=(1, 1, 1))\n")
    assert chosen([empty, parse("leg(at=(0, 0, 0), size=(0, 0, 0))")], table) == ()
    assert chosen([], table) == ()


def test_the_same_seed_chooses_the_same():
    shape, pool = mesh_of(*TABLE), [*random_blocks(60, 1), *TABLE]
    one, two = (choose(Coverage(evidence_of(shape, 5)).table(pool), 4, seed=5) for _ in range(2))
    assert one == two


def random_table(seed: int, count: int, free: int = 1) -> CoverageTable:
    """Bits of which each is set with a probability of a quarter, and costs of the size of gains."""
    random = np.random.default_rng(seed)
    flags = random.random((count, 64 * (2 + free + count))) < 0.25
    weights = np.concatenate([random.random(2) / 64, -random.random(free) / 400])
    buried = pack((random.random((count, 64 * 2)) < 0.1) & ~flags[:, : 64 * 2])
    rows = pack(flags)
    own = pack(random.random((count, 64)) < 0.5)[:, 0] & ~rows[np.arange(count), 2 + free + np.arange(count)]
    return CoverageTable(rows, weights, 2, buried, own, random.random(count) / 600, random.random(count) / 50)


@pytest.mark.parametrize("seed", range(8))
def test_the_search_finds_the_best_of_all_sets(seed):
    made = random_table(seed, 11)
    every = [c for size in range(5) for c in itertools.combinations(range(11), size)]
    assert value(made, choose(made, 4)) == pytest.approx(max(value(made, one) for one in every))


def test_a_body_does_not_stand_in_for_the_boards_around_what_it_buries():
    """A body explains all that is outside at once; six boards explain that and the inside, and only all together."""
    boards, words = 6, 2
    inner, outer = np.zeros((boards + 1, 64), bool), np.zeros((boards + 1, 64), bool)
    outer[0] = True
    for board in range(boards):
        inner[1 + board, board::boards] = outer[1 + board, board::boards] = True
    buried = np.zeros((boards + 1, 64 * words), bool)
    buried[0, 64:] = True
    rows = pack(np.concatenate([outer, inner, np.zeros((boards + 1, 64 * (boards + 1)), bool)], 1))
    nothing = np.zeros(boards + 1)
    weights = np.array([0.7, 0.3]) / 64
    made = CoverageTable(rows, weights, words, pack(buried), nothing.astype(np.uint64), nothing, nothing + 0.01)
    assert value(made, (0,)) == pytest.approx(0.69)
    assert all(value(made, (0, *range(1, 1 + size))) < value(made, (0,)) for size in range(1, 1 + boards))
    assert choose(made, 10) == tuple(range(1, 1 + boards))
    assert value(made, choose(made, 10)) == pytest.approx(0.94)
    assert choose(made, 1) == (0,)


def test_a_choice_goes_on_from_where_it_is_told_to():
    made = random_table(3, 40)
    best = choose(made, 6, rounds=4000)
    assert value(made, choose(made, 6, start=best, rounds=4)) >= value(made, best) - 1e-12


# ---------------------------------------------------------------- kernels and their twins


def single(scene, element, slot):
    """One primitive of a batch in double precision."""
    part = scene[element : element + 1]
    fields = (each[:, slot : slot + 1] for each in (part.kind, part.size, part.centre, part.rotation, part.mask))
    return Batch(*(each.double() if each.is_floating_point() else each for each in fields))


def explains_twin(scene, points, normals, tolerance, agreement):
    """The normal of a surface is the slope of its distance."""
    found = torch.zeros(len(scene), len(points), dtype=torch.bool)
    unknown = normals.norm(dim=1) < 0.5
    for element, slot in scene.mask.nonzero().tolist():
        part, above = single(scene, element, slot), (points + LIFT * normals).requires_grad_()
        (slope,) = torch.autograd.grad(each_distance(part, above).sum(), above)
        fits = ((slope * normals).sum(1).abs() >= agreement) | unknown
        found[element] |= (each_distance(part, points)[0, :, 0].abs() <= tolerance) & fits
    return found


def holds_twin(scene, points, depth):
    found = torch.zeros(len(scene), len(points), dtype=torch.bool)
    for element, slot in scene.mask.nonzero().tolist():
        found[element] |= each_distance(single(scene, element, slot), points)[0, :, 0] < -depth
    return found


def test_points_explained_and_held_are_those_of_the_declarations():
    scene = random_scene(7, lead=(6,))
    random = np.random.default_rng(0)
    points = random.uniform(-13, 13, (3000, 3))
    normals = random.normal(size=(3000, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    normals[::5] = 0
    mesh = evidence_of(mesh_of(*TABLE))
    at, facing = torch.from_numpy(points), torch.from_numpy(normals)
    binned = sorted_by_cell(points, normals)
    for tolerance in (0.0, 0.3, mesh.tolerance):
        held = holds_twin(scene, at, tolerance)
        wanted = explains_twin(scene, at, facing, tolerance, mesh.agreement) & ~held
        explained, interior = covers(scene, binned, tolerance, mesh.agreement)
        assert np.array_equal(interior, pack(held.numpy()))
        assert np.array_equal(explained & ~interior, pack(wanted.numpy()))
    assert 50 < wanted.sum() < 15_000


def shares_of_pairs(samples: np.ndarray, normals: np.ndarray, known: Evidence) -> np.ndarray:
    """The twin of :func:`shares`, over all pairs."""
    near = np.linalg.norm(samples[:, None] - known.surface, axis=2) <= known.reach
    unknown = np.linalg.norm(known.surface_normals, axis=1) < 0.5
    cosine = normals @ known.surface_normals.T
    fits = np.where(known.surface_outward, cosine, np.abs(cosine)) >= known.agreement
    turned = (near & (cosine <= -known.agreement)).any(1)
    return np.where((near & (fits | unknown)).any(1), 0.0, np.where(turned, TURNED, 1.0))


def test_samples_pay_what_all_pairs_say(table):
    random = np.random.default_rng(0)
    kept = {name: getattr(table, name)[::40] for name in ("surface", "surface_normals")}
    few = replace(table, **kept, surface_outward=random.random(1000) < 0.5)
    samples = random.uniform(-13, 13, (500, 3))
    samples[:250] = few.surface[:250] + random.normal(0, 0.1, (250, 3))
    normals = random.choice([-1, 1], (500, 1)) * np.eye(3)[random.integers(3, size=500)]
    wanted = shares_of_pairs(samples, normals, few)
    assert all((wanted == share).sum() >= 10 for share in (0, TURNED, 1))
    assert np.array_equal(shares(samples, normals, few, sorted_by_cell(few.surface, few.surface_normals)), wanted)


def test_the_inner_face_of_the_wall_of_a_solid_pays_for_facing_the_other_way(table):
    highest = table.surface[:, 0].max() - 0.1
    top = table.surface[(table.surface_normals @ [1, 0, 0] > 0.9) & (table.surface[:, 0] > highest)]
    below = top[:200] - [0.5 * table.reach, 0, 0]
    facing = np.tile([1.0, 0, 0], (200, 1))
    assert (shares(below, facing, table, sorted_by_cell(table.surface, table.surface_normals)) == 0).all()
    assert (shares(below, -facing, table, sorted_by_cell(table.surface, table.surface_normals)) == TURNED).all()
    unknown = replace(table, surface_outward=np.zeros(len(table.surface), np.bool_))
    assert (shares(below, -facing, unknown, sorted_by_cell(table.surface, table.surface_normals)) == 0).all()
    assert (shares(below - [1, 0, 0], facing, table, sorted_by_cell(table.surface, table.surface_normals)) == 1).all()


def looking_of_all(barrier: np.ndarray, starts: np.ndarray, steps: np.ndarray, wanted: int, *, through: bool):
    """The twin of :func:`seen.looking`: all rays at once."""
    size = len(barrier)
    paths = starts[:, None, None] + steps[:, None] * np.arange(size + 1)[:, None]  # (N, D, steps, 3)
    backward = starts[:, None, None] - steps[:, None] * np.arange(size + 1)[:, None]

    def clear(places: np.ndarray) -> np.ndarray:
        inside = ((places >= 0) & (places < size)).all(-1)
        cell = np.clip(places.astype(np.int64), 0, size - 1)
        return ~(inside & barrier[tuple(np.moveaxis(cell, -1, 0))]).any(-1)

    ways = clear(paths) & clear(backward) if through else clear(paths)
    return ways.sum(1) >= wanted


@pytest.mark.parametrize("through", [False, True])
def test_rays_find_the_way_out_as_their_twin_does(through):
    random = np.random.default_rng(1)
    barrier = random.random((12, 12, 12)) < 0.12
    data = barrier, random.uniform(-1, 13, (300, 3)), seen.DIRECTIONS[::2], 3
    wanted = looking_of_all(*data, through=through)
    assert 50 < wanted.sum() < 290
    assert np.array_equal(seen.looking(*data, through=through), wanted)


# ---------------------------------------------------------------- evidence


def cell(evidence: Evidence, *place: float) -> bool:
    """Whether the space at a place is known to be free."""
    scale = len(evidence.free) / 32
    return bool(evidence.free[tuple(int((value + 16) * scale) for value in place)])


def test_inner_faces_count_little_and_space_within_is_not_free():
    outer, inner = (
        parse("locker(at=(-12, -8, -12), size=(24, 16, 24))"),
        parse("locker(at=(-6, -4, -6), size=(12, 8, 12))"),
    )
    (places, faces), (others, more) = (union_mesh(unroll(each)) for each in (outer, inner))
    made = evidence_of(shape_from_mesh(np.concatenate([places, others]), np.concatenate([faces, more + len(places)])))
    inside = np.abs(made.points).max(1) < 7
    assert inside.mean() > 0.1
    assert made.weights[inside].max() == pytest.approx(0.1 * made.weights[~inside].min())
    assert made.weights.sum() == pytest.approx(1)
    assert not cell(made, 0, 0, 0)
    assert not cell(made, 10, 0, 0)
    assert made.area == pytest.approx(2 * (24 * 16 * 2 + 24 * 24) + 0.1 * 2 * (12 * 8 * 2 + 144), rel=0.03)


def test_space_behind_an_open_front_is_free():
    sides = ["(1, 16, 24)", "(24, 1, 24)", "(24, 16, 1)"]
    corners = [
        ("(-12, -8, -12)", 0),
        ("(11, -8, -12)", 0),
        ("(-12, 7, -12)", 1),
        ("(-12, -8, -12)", 2),
        ("(-12, -8, 11)", 2),
    ]
    boards = [parse(f"locker(at={at}, size={sides[which]})") for at, which in corners]
    made = evidence_of(mesh_of(*boards))
    assert cell(made, 0, 0, 0)
    assert not cell(made, 0, 7.5, 0)


@pytest.mark.parametrize("deviation", [0.15, 0.3])
def test_the_tolerance_of_a_scan_follows_its_noise(deviation):
    shape = mesh_of(*TABLE)
    points = sample_surface(shape.vertices, shape.faces, 5000, 1).astype(np.float64)
    noisy = points + np.random.default_rng(2).normal(0, deviation, points.shape)
    made = evidence_of(Shape("scan", shape.voxels, noisy.astype(np.float32), kind="points"))
    assert made.tolerance == pytest.approx(max(SURFACE.tolerance, 2 * deviation), rel=0.25)
    clean = evidence_of(Shape("scan", shape.voxels, points.astype(np.float32), kind="points"))
    assert clean.tolerance == SURFACE.tolerance
    assert clean.area == pytest.approx(evidence_of(shape).area, rel=0.2)


def test_a_missing_side_of_a_scan_frees_nothing():
    body = mesh_of(parse("locker(at=(-12, -8, -12), size=(24, 16, 24))"))
    points = sample_surface(body.vertices, body.faces, 5000, 1).astype(np.float64)
    made = evidence_of(shape_from_points(points[points[:, 1] > -7]))
    assert made.free.mean() < 0.001  # of the grid: at the rim


def test_the_free_space_of_cells_is_the_empty_cells_and_a_box_through_them_is_explained():
    drawn = unroll(parse("locker(at=(-12, -6, -12), size=(24, 12, 24))")).voxels().numpy().astype(bool)
    made = evidence_of(shape_from_voxels(drawn))
    assert np.array_equal(made.free, ~drawn)
    box = parse("locker(at=(-12, -5.5, -12), size=(24, 11, 24))")
    assert chosen([*random_blocks(50, 1), box], made) == (50,)
    assert explained(Coverage(made).table([box]), (0,)) > 0.95

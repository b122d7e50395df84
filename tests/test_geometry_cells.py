import numpy as np
import pytest
import torch
import twins
from geometry_helpers import make_scene, random_scene, require
from hypothesis import given, settings
from hypothesis import strategies as st

from shapeprog.data.random import random_program
from shapeprog.errors import ShapeProgError
from shapeprog.geometry.cells import (
    cells_of,
    count,
    iou,
    pack,
    pack_rows,
    rasterise,
    rasterise_apart,
    unpack,
    voxels,
    words_of,
)
from shapeprog.geometry.primitives import KINDS
from shapeprog.geometry.scene import Scene
from shapeprog.language import Code, encode, language, unroll
from shapeprog.language.parser import parse
from shapeprog.liang2022.decode import widen

PARAMETERS = [0, 6, 6, 5, 5, 6, 5, 5, 5, 5, 6, 6, 6, 6, 6, 7, 6, 7, 6, 4, 2, 0]
DRAWN = [*range(1, 17), 18]


def scene_of(kind, size, centre, rotation=None, mask=None):
    mask = torch.tensor(kind) >= 0 if mask is None else mask
    kind = torch.tensor([KINDS[("cuboid", "cylinder")[number]] for number in kind])
    size = torch.tensor(size, dtype=torch.float64)
    rotation = torch.eye(3).double().expand(*kind.shape, 3, 3) if rotation is None else rotation
    return Scene(
        kind=kind, size=size, centre=torch.tensor(centre, dtype=torch.float64), rotation=rotation,
        mask=mask, statement=kind, block=kind, copy=kind,
    )  # fmt: skip


def random_code(rng, blocks, reach):
    """Whole-numbered published blocks; ``reach`` sets how far parameters leave the ordinary range."""
    ids, values = np.zeros((blocks, 3), np.int64), np.zeros((blocks, 3, 7))
    for row in range(blocks):
        form = rng.integers(4)
        k = int(rng.choice(DRAWN))
        chain = [[k], [19, k], [19, 19, k], [20, 10]][form]
        for step, number in enumerate(chain):
            ids[row, step] = number
            values[row, step] = rng.integers(-reach, reach + 1, 7)
            if number >= 19:
                values[row, step, 0] = rng.integers(-1, 31 if rng.random() < 0.1 else 5)
                values[row, step, 1:4] = rng.integers(-7, 8, 3)
            elif rng.random() < 0.8:
                values[row, step, 3:6] = rng.integers(0, 14, 3)
    return ids, values


def executed(ids, values):
    grid = np.zeros((32, 32, 32), np.uint8)
    for row_ids, row_values in zip(ids, values, strict=True):
        grid |= twins.executed_block([i for i in row_ids if i], row_values)
    return grid


@settings(max_examples=12, deadline=None)
@given(st.integers(0, 2**32 - 1), st.sampled_from([8, 16, 40, 300]))
def test_whole_numbered_programs_fill_the_cells_of_the_specification(seed, reach):
    rng = np.random.default_rng(seed)
    codes = [random_code(rng, 3, reach) for _ in range(12)]
    code = Code(torch.from_numpy(np.stack([c[0] for c in codes])), torch.from_numpy(np.stack([c[1] for c in codes])))
    filled = voxels(unroll(Code(code.ids, code.parameters.float()))).numpy()
    for number, (ids, values) in enumerate(codes):
        assert (filled[number] == executed(ids, values)).all(), (ids, values)


@pytest.mark.parametrize("k", DRAWN)
def test_each_statement_alone_looped_and_clipped(k):
    rng = np.random.default_rng(k)
    ids = np.zeros((40, 1, 3), np.int64)
    values = rng.integers(-20, 20, (40, 1, 3, 7)).astype(np.float64)
    ids[:20, 0, 0] = k
    ids[20:30, 0, :2] = (19, k)
    ids[30:, 0] = (19, 19, k)
    values[20:, 0, :, 0] = np.where(ids[20:, 0] == 19, rng.integers(-1, 5, (20, 3)), values[20:, 0, :, 0])
    filled = voxels(unroll(Code(torch.from_numpy(ids), torch.from_numpy(values)))).numpy()
    assert (filled == np.stack([executed(*each) for each in zip(ids, values, strict=True)])).all()


@pytest.mark.parametrize("resolution", [8, 13, 32, 40, 64])
@pytest.mark.parametrize("turned", [False, True])
def test_any_pose_and_resolution_against_the_twin(resolution, turned):
    g = torch.Generator().manual_seed(resolution)
    count = 6
    rotation = torch.linalg.qr(torch.randn(count, 3, 3, generator=g, dtype=torch.float64))[0]
    if not turned:
        rotation = torch.eye(3).double().expand(count, 3, 3)
    size = torch.rand(count, 4, generator=g, dtype=torch.float64) * 6 + 0.3
    size[:, 3] = 0
    centre = torch.rand(count, 3, generator=g, dtype=torch.float64) * 30 - 15
    kinds = [0, 1, 0, 1, 0, 1] if turned else [1] * count
    scene = scene_of(kinds, size.tolist(), centre.tolist(), rotation)
    assert (voxels(scene, resolution).numpy() == twins.cells(scene, resolution)).all()


def test_a_quarter_turn_of_a_sheared_board_turns_its_cells():
    turn = torch.tensor([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]).double()
    board = scene_of([0], [[5.0, 1, 4, 3]], [[0.0, 1.5, 2]])
    turned = scene_of([0], [[5.0, 1, 4, 3]], [[0.0, -2, 1.5]], turn[None])
    cells = voxels(board).numpy()
    assert (voxels(turned).numpy() == np.rot90(cells, 1, (1, 2))).all()
    assert cells.sum() == 10 * 2 * 8


def test_a_leg_fills_its_cells_whatever_number_its_primitive_has():
    assert int(voxels(unroll(parse("leg(at=(-8, -3, -3), size=(16, 6, 6))"))).sum()) == 576


RESOLUTIONS = [8, 13, 32, 40, 64, 96, 256]


def random_cells(resolution, lead=(3,), seed=0):
    if resolution > 100:
        return random_cells(64, lead, seed).repeat_interleave(resolution // 64, -1).tile(resolution // 64, 4, 1)
    return torch.rand(*lead, *(resolution,) * 3, generator=torch.Generator().manual_seed(seed)) < 0.3


@pytest.mark.parametrize("resolution", RESOLUTIONS)
def test_packed_cells_hold_every_cell_and_are_the_same_on_every_device(resolution):
    cells = random_cells(resolution, (2,) if resolution > 100 else (2, 3))
    packed = pack(cells)
    assert packed.dtype == torch.int32
    assert packed.shape == (*cells.shape[:-3], -(-resolution // 32) * resolution, resolution)
    assert (unpack(packed) == cells).all()
    words = (torch.nn.functional.pad(cells, (0, -resolution % 32)).unflatten(-1, (-1, 32)) << torch.arange(32)).sum(-1)
    assert (pack_rows(cells) == words.to(torch.int32)).all()
    assert (pack(cells.numpy()) == packed).all()
    assert (pack(cells.to(torch.uint8)) == packed).all()
    assert (cells_of(words_of(packed)) == packed).all()


@pytest.mark.parametrize("resolution", RESOLUTIONS)
def test_counts_and_unions_are_those_of_single_cells(resolution):
    one, two = random_cells(resolution), random_cells(resolution, seed=1)
    first, second = pack(one), pack(two)
    assert count(first).tolist() == one.flatten(1).sum(-1).tolist()
    expected = (one & two).flatten(1).sum(-1) / (one | two).flatten(1).sum(-1).double()
    torch.testing.assert_close(iou(first, second), expected, rtol=0, atol=0)
    assert iou(first[:, None], first[None]).diagonal().tolist() == [1, 1, 1]
    assert iou(first[0], second).shape == (3,)
    assert float(iou(first[0] * 0, first[0] * 0)) == 1


def test_widened_cells_reach_one_cell_through_every_face():
    cells = random_cells(32, (), seed=3) & (random_cells(32, (), seed=4))
    wide = np.pad(cells.numpy(), 1)
    moved = [np.roll(wide, step, axis) for axis in range(3) for step in (-1, 1)]
    expected = np.logical_or.reduce([wide, *moved])[1:-1, 1:-1, 1:-1]
    assert (unpack(widen(pack(cells))).numpy() == expected).all()


def by_twin(scene, resolution=32):
    """Packed cells of elements (B, N), cell by cell."""
    return pack(np.stack([twins.cells(each, resolution) for each in scene]))


def without_upright_shears(scene):
    """The scene without cuboids whose layers are moved by whole cells."""
    return require(scene, mask=scene.mask & ~((scene.kind == KINDS["cuboid"]) & (scene.size[..., 3] != 0)))


@pytest.mark.parametrize("whole", [True, False])
def test_random_programs_fill_the_same_cells_by_kernel_and_by_declaration(whole):
    random = torch.Generator().manual_seed(1)
    drawn = [random_program(random, blocks=1 + n % 5, whole=whole, copies=5) for n in range(180)]
    if whole:  # whole ends put the slanting faces of statements that lean on centres of cells, where either is right
        drawn = [each for each in drawn if all(language()[node.name].taught for node in each.walk())]
    scene = without_upright_shears(unroll(encode(drawn[:60])))
    assert (rasterise(scene) == by_twin(scene)).all()
    apart = rasterise_apart(scene, scene.block, 5)
    assert (unpack(apart).amax(1) == unpack(rasterise(scene))).all()
    only = require(scene, mask=scene.mask & (scene.block == 2))
    assert (apart[:, 2] == rasterise(only)).all()


@pytest.mark.parametrize("resolution", [32, 45, 64])
def test_any_pose_and_kind_fills_the_same_cells_by_kernel_and_by_declaration(resolution):
    scene = without_upright_shears(random_scene(3, (6,), slots=7))
    assert (rasterise(scene, resolution) == by_twin(scene, resolution)).all()


def test_quarter_turns_of_all_primitives_fill_the_same_cells_by_kernel_and_by_declaration():
    random = torch.Generator().manual_seed(2)
    scene = without_upright_shears(random_scene(5, (200,), slots=4))
    axes = torch.stack([torch.randperm(3, generator=random) for _ in range(800)])
    signs = torch.randint(0, 2, (800, 3, 1), generator=random) * 2.0 - 1
    scene = require(scene, rotation=(torch.eye(3)[axes] * signs).reshape(200, 4, 3, 3))
    assert (rasterise(scene) == by_twin(scene)).all()


def test_broken_and_absurd_solids_fill_the_same_cells_by_kernel_and_by_declaration():
    scene = without_upright_shears(random_scene(1, (7,), slots=3))
    size, centre, rotation = scene.size.clone(), scene.centre.clone(), scene.rotation.clone()
    size[0, 0], size[1, 0], size[2, 0], centre[3, 0] = torch.nan, -1, 0, torch.inf
    size[4, 0], centre[5, 0], rotation[6, 0] = 1e30, -1e30, torch.nan
    scene = require(scene, size=size, centre=centre, rotation=rotation)
    assert (rasterise(scene) == by_twin(scene)).all()
    assert rasterise(scene[:0]).shape == (0, 32, 32)


def test_a_ball_and_a_cone_fill_the_cells_whose_centre_they_contain():
    ball = make_scene(["rounded_box"], [[5.0, 5, 5, 5]], [[0.0, 0, 0]])
    ticks = np.arange(32) - 15.5
    square = ticks[:, None, None] ** 2 + ticks[:, None] ** 2 + ticks**2
    assert (voxels(ball).numpy() == (square <= 25)).all()
    cone = make_scene(["frustum"], [[4.0, 6, 0]], [[0.0, 0, 0]])
    radius = np.where(np.abs(ticks) <= 4, 3 - 0.75 * ticks, -1)[:, None, None]
    expected = (ticks[:, None] ** 2 + ticks**2)[None] <= np.where(radius > 0, radius, 0) ** 2
    assert (voxels(cone).numpy() == expected).all()


def test_lines_are_the_same_every_time_and_translated_whole():
    ids = torch.tensor([[[19, 17, 0]]])
    values = torch.zeros(1, 1, 3, 7)
    values[0, 0, 0, :4] = torch.tensor([2.0, 0, 0, 9])
    values[0, 0, 1] = torch.tensor([-12.0, -5, -8, 9, 4, -6, 1])
    cells = voxels(unroll(Code(ids, values))).numpy()[0]
    assert (cells == voxels(unroll(Code(ids, values))).numpy()[0]).all()
    one = values.clone()
    one[0, 0, 0, 0] = 1
    single = voxels(unroll(Code(ids, one))).numpy()[0]
    moved = np.zeros_like(single)
    moved[:, :, 9:] = single[:, :, :-9]
    assert (cells == (single | moved)).all()
    assert single.sum() > 60


@pytest.mark.parametrize("lead", [(), (3,), (2, 2)])
def test_leading_dimensions(lead):
    scene = scene_of([0, 1], [[2.0, 3, 4, 0], [5, 2, 0, 0]], [[0.0, 0, 0], [4, 4, 4]])
    batch = Scene(**{name: t.expand(*lead, *t.shape) for name, t in vars(scene).items()})
    assert (voxels(batch) == voxels(scene)).all()
    assert voxels(batch).shape == (*lead, 32, 32, 32)
    assert rasterise(batch).shape == (*lead, 32, 32)


def test_empty_broken_and_absurd_scenes_fill_nothing():
    broken = scene_of([0, 1, 0, 0], [[torch.nan, 1, 1, 0], [-1, 2, 0, 0], [0, 2, 2, 0], [1, 1, 1, 0]], [[0.0] * 3] * 4,
                      mask=torch.tensor([True, True, True, False]))  # fmt: skip
    assert voxels(broken).sum() == 0
    assert voxels(unroll(Code(torch.zeros(2, 1, 3).long(), torch.zeros(2, 1, 3, 7)))).shape == (2, 32, 32, 32)
    assert voxels(scene_of([0], [[1e30, 1e30, 1e30, 0]], [[0.0] * 3])).all()
    with pytest.raises(ShapeProgError, match="resolution"):
        voxels(broken, 0)

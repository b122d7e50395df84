import numpy as np
import pytest
import torch
import twins
from hypothesis import given, settings
from hypothesis import strategies as st

from shapeprog.errors import ShapeProgError
from shapeprog.geometry.occupancy import pack, packed_iou, packed_rows, voxels
from shapeprog.geometry.scene import Scene
from shapeprog.language import Code, unroll

PARAMETERS = [0, 6, 6, 5, 5, 6, 5, 5, 5, 5, 6, 6, 6, 6, 6, 7, 6, 7, 6, 4, 2, 0]
DRAWN = [*range(1, 17), 18]


def scene_of(kind, size, centre, rotation=None, mask=None):
    kind = torch.tensor(kind)
    size = torch.tensor(size, dtype=torch.float64)
    rotation = torch.eye(3).double().expand(*kind.shape, 3, 3) if rotation is None else rotation
    return Scene(
        kind=kind, size=size, centre=torch.tensor(centre, dtype=torch.float64), rotation=rotation,
        mask=kind >= 0 if mask is None else mask, statement=kind, block=kind, copy=kind,
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


def test_bits_and_bytes_agree_and_count():
    rng = np.random.default_rng(0)
    ids, values = random_code(rng, 4, 12)
    other = random_code(rng, 4, 12)
    scene = unroll(Code(torch.from_numpy(np.stack([ids, other[0]])), torch.from_numpy(np.stack([values, other[1]]))))
    cells, rows = voxels(scene).numpy(), packed_rows(scene)
    assert rows.dtype == np.uint32
    assert rows.shape == (2, 32, 32)
    assert (pack(cells) == rows).all()
    expected = (cells[0] & cells[1]).sum() / max((cells[0] | cells[1]).sum(), 1)
    assert packed_iou(rows[0], rows[1]) == expected
    assert packed_iou(rows[:, None], rows[None]).tolist() == [[1.0, expected], [expected, 1.0]]
    assert packed_iou(rows[0] * 0, rows[0] * 0) == 1


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
    assert packed_rows(batch).shape == (*lead, 32, 32)


def test_empty_broken_and_absurd_scenes_fill_nothing():
    broken = scene_of([0, 1, 0, 0], [[torch.nan, 1, 1, 0], [-1, 2, 0, 0], [0, 2, 2, 0], [1, 1, 1, 0]], [[0.0] * 3] * 4,
                      mask=torch.tensor([True, True, True, False]))  # fmt: skip
    assert voxels(broken).sum() == 0
    assert voxels(unroll(Code(torch.zeros(2, 1, 3).long(), torch.zeros(2, 1, 3, 7)))).shape == (2, 32, 32, 32)
    assert voxels(scene_of([0], [[1e30, 1e30, 1e30, 0]], [[0.0] * 3])).all()
    with pytest.raises(ShapeProgError, match="resolution"):
        voxels(broken, 0)

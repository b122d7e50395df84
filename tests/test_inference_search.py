"""The structure search finds again what was planted, keeps to its limits, and never makes anything worse."""

from __future__ import annotations

import numpy as np
import pytest

from shapeprog.data.random import outside_published
from shapeprog.geometry.cells import voxels as voxels_of
from shapeprog.inference.budget import Deadline
from shapeprog.inference.cells import search
from shapeprog.inference.cells.block_kernels import MOST_MOVES, WIDTH, draw_all, moves, statements, valid
from shapeprog.inference.cells.blocks import to_program
from shapeprog.inference.cells.search import search_structure
from shapeprog.inference.cells.settings import Settings
from shapeprog.language.parser import parse
from shapeprog.language.unroll import unroll

TABLE = """
top_rectangle(at=(4, 0, 0), thickness=2, half=(9, 11))
for i in translate(2, by=(0, 0, 18)):
    for j in translate(2, by=(0, 14, 0)):
        leg(at=(-12, -8, -10), size=(16, 2, 2))
"""
SHELF = """
for i in translate(5, by=(5, 0, 0)):
    layer(at=(-11, 0, 0), thickness=1, half=(4, 10))
for i in translate(2, by=(0, 0, 18)):
    sideboard(at=(-12, 0, -10), height=24, half_depth=4, width=2)
"""
ROUND = """
top_circle(at=(4, 0, 0), thickness=2, radius=8)
support_cylinder(at=(-8, 0, 0), height=12, radius=2)
base_circle(at=(-10, 0, 0), thickness=2, radius=6)
"""
CHAIR = """
top_square(at=(-2, 0, 0), thickness=2, half=8)
for i in translate(2, by=(0, 0, 14)):
    for j in translate(2, by=(0, 14, 0)):
        leg(at=(-12, -8, -8), size=(10, 2, 2))
back(at=(0, 6, -8), size=(12, 2, 16), tilt=2)
"""


def cells(text):
    return voxels_of(unroll(parse(text))).numpy().astype(bool)


def iou_of(blocks, solid):
    drawn = voxels_of(unroll(to_program(blocks))).numpy().astype(bool)
    return (drawn & solid).sum() / (drawn | solid).sum()


def target(solid):
    return search.Target(solid, Settings(blocks=6, families=40))


@pytest.mark.parametrize(
    ("text", "iou", "blocks"),
    [(TABLE, 1, 2), (SHELF, 1, 2), (ROUND, 1, 3), (CHAIR, 1, 3)],
    ids=["table", "shelf", "round", "chair"],
)
def test_planted_programs_are_found_again(text, iou, blocks):
    solid = cells(text)
    found, _ = search_structure(solid, Settings(blocks=blocks))
    assert iou_of(found, solid) >= iou
    assert len(found) <= blocks
    program = to_program(found)
    assert program.size == parse(text).size or iou_of(found, solid) < 1
    assert outside_published(program) == []
    text_price = Settings().price * statements(found.T).sum()
    assert search.value_of(found, target(solid)) == pytest.approx(iou_of(found, solid) - text_price, abs=1e-12)


def test_the_same_seed_gives_the_same_blocks():
    solid = cells(CHAIR) | cells(TABLE)
    quick = Settings(rounds=20)
    first, again = (search_structure(solid, quick, seed=3) for _ in range(2))
    assert np.array_equal(first[0], again[0])


@pytest.mark.parametrize("most", [1, 2, 3])
def test_no_more_blocks_than_allowed_and_more_are_no_worse(most):
    solid = cells(CHAIR)
    quick = Settings(rounds=10, blocks=most)
    found, _ = search_structure(solid, quick)
    assert 1 <= len(found) <= most
    if most > 1:
        fewer, _ = search_structure(solid, Settings(rounds=10, blocks=most - 1))
        assert iou_of(found, solid) >= iou_of(fewer, solid)


def test_a_passed_deadline_still_gives_a_structure_and_says_so():
    found, reason = search_structure(cells(TABLE), Settings(), deadline=Deadline(0.0))
    assert len(found)
    assert "0 of 600 rounds, at the time limit" in reason
    told = []
    _, reason = search_structure(
        cells(TABLE), Settings(rounds=2), progress=lambda what, share: told.append((what, share))
    )
    assert "all 2 rounds" in reason
    assert told[-1] == ("searching structure", 1.0)


def test_the_search_stops_when_nothing_has_gained_for_long():
    found, reason = search_structure(cells(TABLE), Settings(rounds=200, patience=40))
    assert reason == "40 rounds without improvement"
    assert iou_of(found, cells(TABLE)) == 1


def noisy_blocks(solid, seed, count=5):
    """Random small boxes near a solid, some of them repeated."""
    random = np.random.default_rng(seed)
    blocks = np.zeros((count, WIDTH))
    blocks[:, 8] = blocks[:, 12] = 1
    blocks[:, 1:4] = random.integers(-10, 6, (count, 3))
    blocks[:, 4:7] = random.integers(1, 7, (count, 3))
    blocks[0, 8], blocks[0, 9:12] = 2, (0, 0, 9)
    return blocks


@pytest.mark.parametrize("seed", range(3))
def test_descent_and_polish_never_lower_the_objective(seed):
    solid = cells(CHAIR)
    aim = target(solid)
    blocks = noisy_blocks(solid, seed)
    others = draw_all(blocks[1:])
    better = search.improved(blocks[0], others, aim)
    before = iou_of(blocks, solid) - aim.settings.price * statements(blocks[0])
    after = iou_of(np.concatenate([better[None], blocks[1:]]), solid) - aim.settings.price * statements(better)
    assert after >= before
    polished = search.polish(blocks, aim)
    start = search.value_of(blocks, aim)
    assert search.value_of(polished, aim) >= start
    assert len(search.rebuilt(polished, aim, np.random.default_rng(seed))) <= 6


def test_a_move_changes_a_block_and_none_of_its_copies_overlap():
    block = np.zeros(WIDTH)
    block[4:7], block[8], block[9:12], block[12] = 2, 3, (0, 0, 4), 1
    out = np.zeros((MOST_MOVES, WIDTH))
    count = moves(block, out)
    assert count <= MOST_MOVES
    assert not (out[:count] == block).all(1).any()
    assert valid(block)
    block[11] = 1
    assert not valid(block)


def test_a_block_that_does_not_pay_is_dropped():
    solid = cells(TABLE)
    aim = target(solid)
    found, _ = search_structure(solid, Settings(rounds=20))
    useless = np.concatenate([found, found[:1]])
    assert len(search.polish(useless, aim)) == len(found)


def test_full_grids_single_cells_and_flat_sheets_are_one_block():
    full, single, sheet = (np.zeros((32, 32, 32), np.bool_) for _ in range(3))
    full[:], single[16, 16, 16], sheet[16, 4:28, 4:28] = True, True, True
    for solid in (full, single, sheet):
        found, _ = search_structure(solid, Settings(rounds=4))
        assert iou_of(found, solid) == 1
        assert len(found) == 1

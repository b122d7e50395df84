"""Blocks are what the language draws, whatever they are called, and are called by what they do."""

from __future__ import annotations

import numpy as np
import pytest

from shapeprog.data.random import outside_published
from shapeprog.geometry.cells import rasterise, voxels, words_of
from shapeprog.inference.cells.block_kernels import (
    BACK,
    BOX,
    COUNT1,
    COUNT2,
    DISC,
    EXTENT,
    FIRST,
    FORM,
    SHIFT1,
    SHIFT2,
    TILT,
    WIDTH,
    cells_of,
    draw_all,
    draw_each,
)
from shapeprog.inference.cells.blocks import to_program
from shapeprog.language.unroll import unroll


def random_block(form, random):
    """A block of a form with loops, here and there beyond the grid."""
    block = np.zeros(WIDTH)
    block[FORM], block[COUNT1], block[COUNT2] = form, 1, 1
    block[FIRST:EXTENT] = random.integers(-19, 17, 3)
    block[EXTENT : EXTENT + 3] = random.integers(1, 13, 3)
    if form == BACK:
        block[TILT] = random.integers(-4, 5)
    for slot, shift in ((COUNT1, SHIFT1), (COUNT2, SHIFT2)):
        block[slot] = random.integers(1, 4)
        block[shift : shift + 3] = random.integers(-7, 8, 3)
    return block


def rows_of(program):
    return words_of(rasterise(unroll(program))).reshape(-1).view(np.uint64)


@pytest.mark.parametrize("form", [BOX, DISC, BACK])
def test_a_block_covers_the_cells_that_its_program_draws(form):
    random = np.random.default_rng(form)
    for _ in range(12):
        block = random_block(form, random)
        program = to_program(block[None])
        assert np.array_equal(draw_all(block[None]), rows_of(program)), program
        assert outside_published(program) == []


def test_names_change_no_cell():
    random = np.random.default_rng(7)
    for _ in range(25):
        blocks = np.stack([random_block(random.integers(3), random) for _ in range(random.integers(1, 7))])
        assert np.array_equal(draw_all(blocks), rows_of(to_program(blocks)))


def test_the_cells_of_blocks_together_are_those_of_each():
    random = np.random.default_rng(1)
    blocks = np.stack([random_block(form, random) for form in range(3)])
    drawn = draw_each(blocks)
    for words, block in zip(drawn, blocks, strict=True):
        program = to_program(block[None])
        assert np.array_equal(words, rows_of(program))
        assert np.array_equal(cells_of(words), voxels(unroll(program)).numpy().astype(bool))
    assert np.array_equal(draw_all(blocks), np.bitwise_or.reduce(drawn))


def box(low, size, *loops):
    block = np.zeros(WIDTH)
    block[FORM], block[COUNT1], block[COUNT2] = BOX, 1, 1
    block[FIRST:EXTENT], block[EXTENT : EXTENT + 3] = low, size
    for slot, (count, step) in zip((COUNT1, COUNT2), loops, strict=False):
        block[slot], block[slot + 1 : slot + 4] = count, step
    return block


def names(*blocks):
    """Name of each block, in the order given."""
    found = {}
    for number, block in enumerate(blocks):
        program = to_program(np.stack([*blocks[:number], *blocks[number + 1 :], block]))
        cells = rows_of(to_program(block[None]))
        for chain in program.chains:
            from shapeprog.language.program import Program, nest

            if np.array_equal(rows_of(Program((nest(chain),))), cells):
                found[number] = chain[-1].name
    return [found[number] for number in range(len(blocks))]


FOUR = ((2, (0, 0, 14)), (2, (0, 14, 0)))
SEAT = box((-2, -8, -8), (2, 16, 16))
LEGS = box((-12, -8, -8), (10, 2, 2), *FOUR)


def test_the_parts_of_a_chair_are_named_by_what_they_do():
    back = box((0, 6, -8), (12, 2, 16))
    arms = box((5, -6, -8), (2, 12, 2), (2, (0, 0, 14)))
    posts = box((0, -6, -8), (5, 2, 2), (2, (0, 0, 14)))
    bars = box((-8, -6, -8), (2, 12, 2), (2, (0, 0, 14)))
    assert names(SEAT, LEGS, back, arms, posts, bars) == [
        "top_square", "leg", "back", "chair_beam", "chair_beam", "horizontal_bar",
    ]  # fmt: skip


def test_slats_of_a_back_support_it_and_rear_legs_that_go_on_stay_legs():
    slats = box((0, 6, -4), (10, 1, 2), (3, (0, 0, 4)))
    rear = box((-12, 6, -8), (24, 2, 2), (2, (0, 0, 14)))
    rail = box((10, 6, -6), (2, 1, 12))
    assert names(SEAT, slats, rear, rail) == ["top_square", "back_support", "leg", "chair_beam"]


def test_tables_shelves_cabinets_and_columns_are_named_by_what_they_do():
    assert names(box((8, -8, -12), (2, 16, 24)), box((-12, -6, -12), (20, 12, 2), (2, (0, 0, 22)))) == [
        "top_rectangle", "sideboard",
    ]  # fmt: skip
    shelves = box((-12, -4, -10), (2, 8, 20), (4, (7, 0, 0)))
    sides = box((-12, -4, -12), (24, 7, 2), (2, (0, 0, 22)))  # an odd depth has no centre on the grid
    assert names(shelves, sides, box((-12, 3, -12), (24, 1, 24))) == ["layer", "vertical_board", "vertical_board"]
    assert names(box((8, -10, -10), (2, 20, 20)), box((-10, -2, -2), (18, 4, 4)), box((-12, -6, -6), (2, 12, 12))) == [
        "top_square", "support_cuboid", "base_square",
    ]  # fmt: skip
    assert names(box((-8, -10, -12), (16, 20, 24)), box((-10, -9, -11), (2, 2, 2), (2, (0, 0, 20)))) == [
        "locker",
        "leg",
    ]


def test_a_seat_with_an_odd_width_keeps_its_cells_under_another_name():
    assert names(box((-2, -8, -8), (2, 15, 16)), LEGS) == ["horizontal_bar", "leg"]


def test_no_blocks_are_the_empty_program():
    assert to_program(np.zeros((0, WIDTH))).blocks == 0

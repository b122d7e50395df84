"""The exact parts of the search: heaviest boxes, folded repetitions, and greedy boxes as the baseline."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from shapeprog.geometry.cells import voxels as voxels_of
from shapeprog.inference.cells import proposal_kernels
from shapeprog.inference.cells.block_kernels import COUNT1, COUNT2, EXTENT, FIRST, SHIFT1, SHIFT2, WIDTH
from shapeprog.inference.cells.proposal_kernels import MIRROR, families, mirrors, search_family
from shapeprog.inference.cells.search import greedy_boxes
from shapeprog.language.unroll import unroll

ANY = 1 << 20


def heaviest_box(weights, limit0, limit1, floor):
    """The compiled search, its sum and its box."""
    box = np.zeros(6, np.int64)
    return proposal_kernels.heaviest_box(weights, limit0, limit1, floor, box), box


def all_boxes(shape):
    sides = [list(itertools.combinations(range(size + 1), 2)) for size in shape]
    for (a, b), (c, d), (e, f) in itertools.product(*sides):
        yield a, b, c, d, e, f


def brute_force(weights, limits=(ANY, ANY)):
    """The largest sum over all boxes, by summing each."""
    best = 0.0
    for a, b, c, d, e, f in all_boxes(weights.shape):
        if b - a <= limits[0] and d - c <= limits[1]:
            best = max(best, float(weights[a:b, c:d, e:f].sum()))
    return best


def whole_weights(shape, seed):
    return np.random.default_rng(seed).integers(-3, 3, shape).astype(np.float32)


@pytest.mark.parametrize(("shape", "limits"), [((4, 5, 3), (ANY, ANY)), ((3, 4, 6), (2, 1)), ((1, 5, 5), (ANY, 2))])
def test_the_heaviest_box_is_that_of_brute_force(shape, limits):
    for seed in range(8):
        weights = whole_weights(shape, seed)
        best, box = heaviest_box(weights, *limits, 0.0)
        assert best == brute_force(weights, limits)
        a, b, c, d, e, f = box
        assert float(weights[a:b, c:d, e:f].sum()) == best
        assert b - a <= limits[0]
        assert d - c <= limits[1]


def test_no_box_beats_a_floor_that_is_too_high():
    weights = whole_weights((4, 4, 4), 0)
    best = brute_force(weights)
    assert heaviest_box(weights, ANY, ANY, best)[0] == best
    assert not heaviest_box(weights, ANY, ANY, best)[1].any()
    assert heaviest_box(weights, ANY, ANY, best - 1)[0] == best


def test_folding_finds_what_searching_all_explicit_copies_finds():
    weights = whole_weights((4, 3, 5), 3)
    table = families(weights.shape, 3)
    assert len(table) > 20
    for family in table:
        found = np.zeros(WIDTH)
        best = search_family(weights, family, 0.0, found)
        assert best == repeated_by_hand(weights, family), family
        if best > 0:
            found = found.astype(int)
            covered = np.zeros(weights.shape, np.int64)
            for i, j in itertools.product(range(found[COUNT1]), range(found[COUNT2])):
                low = found[FIRST:EXTENT] + i * found[SHIFT1 : SHIFT1 + 3] + j * found[SHIFT2 : SHIFT2 + 3]
                size = found[EXTENT : EXTENT + 3]
                covered[tuple(slice(a, a + n) for a, n in zip(low, size, strict=True))] += 1
            assert covered.max() == 1
            assert float(weights[covered == 1].sum()) == best


def repeated_by_hand(weights, family):
    """The largest sum of one family, by drawing all copies of every box."""
    best = 0.0
    for box in all_boxes(weights.shape):
        drawn = [tuple(box)]
        for axis, kind, a, b in (family[:4], family[4:]):
            if axis < 0:
                continue
            low, high = 2 * axis, 2 * axis + 1
            if kind == MIRROR:
                left, right = mirrors(a)
                images = [list(one) for one in drawn] if box[high] <= left + 1 else []
                for one in images:
                    one[low], one[high] = left + right + 1 - one[high], left + right + 1 - one[low]
                drawn = drawn + [tuple(one) for one in images] if images else []
            else:
                copies = []
                for one in drawn:
                    for i in range(a):
                        moved = [*one]
                        moved[low], moved[high] = one[low] + i * b, one[high] + i * b
                        copies.append(tuple(moved))
                drawn = copies if box[high] - box[low] < b else []
        inside = all(one[2 * k] >= 0 and one[2 * k + 1] <= weights.shape[k] for one in drawn for k in range(3))
        if drawn and inside:
            best = max(best, sum(float(weights[a:b, c:d, e:f].sum()) for a, b, c, d, e, f in drawn))
    return best


def test_greedy_boxes_take_the_heaviest_box_of_what_is_left_each_time():
    solid = np.zeros((32, 32, 32), np.bool_)
    solid[13:19, 14:18, 13:18] = np.random.default_rng(0).random((6, 4, 5)) < 0.7
    program = greedy_boxes(solid, 4)
    assert program.blocks == 4
    drawn = voxels_of(unroll(program)).numpy().astype(bool)
    weights = np.where(solid, 1.0, -1.0)
    gained = 0.0
    for _ in range(4):
        near = weights[13:19, 14:18, 13:18]
        gain, _ = max(
            (float(near[a:b, c:d, e:f].sum()), (a, b, c, d, e, f)) for a, b, c, d, e, f in all_boxes(near.shape)
        )
        found, exact = heaviest_box(weights.astype(np.float32), 32, 32, 0.0)
        assert found == gain
        a, b, c, d, e, f = exact
        weights[a:b, c:d, e:f] = 0
        gained += gain
    assert float(np.where(drawn, np.where(solid, 1, -1), 0).sum()) == gained


def test_greedy_boxes_of_a_box_is_that_box():
    solid = np.zeros((32, 32, 32), np.bool_)
    solid[4:20, 8:12, 3:9] = True
    program = greedy_boxes(solid)
    assert program.blocks == 1
    assert np.array_equal(voxels_of(unroll(program)).numpy().astype(bool), solid)

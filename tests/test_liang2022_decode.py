"""Decoding, teacher forcing on the canvases that it leaves, and measures of what it writes."""

from __future__ import annotations

import pytest
import torch
from liang2022_toys import small, targets, write_targets
from torch import Tensor
from torch.nn.functional import max_pool3d

from shapeprog.data.packs import read_pack
from shapeprog.errors import ShapeProgError
from shapeprog.geometry.cells import count, unpack
from shapeprog.language import encode
from shapeprog.language.parser import parse
from shapeprog.language.unroll import draw_blocks, unroll
from shapeprog.liang2022.decode import EXACT_WEIGHT, Decoded, decode
from shapeprog.liang2022.evaluate import decode_all, measure, scores_on_packs
from shapeprog.liang2022.generator import Generator, union
from shapeprog.liang2022.pretrain import scheduled_sampling, teacher_forcing
from shapeprog.liang2022.prior import PRIORS
from shapeprog.liang2022.weights import load_generator

pytestmark = pytest.mark.paper


def seeded(seed: int = 0) -> torch.Generator:
    return torch.Generator().manual_seed(seed)


def decoded(decoder: str, seed: int = 0, generator: Generator | None = None) -> Decoded:
    return decode(generator or small(), targets(6), decoder=decoder, rng=seeded(seed))  # type: ignore[arg-type]


@pytest.mark.parametrize("decoder", ["argmax", "novel", "select", "sample", "sample-ids"])
def test_canvases_are_the_cells_of_the_blocks_before(decoder: str):
    result = decoded(decoder)
    drawn = draw_blocks(result.code)
    for k in range(drawn.shape[1]):
        assert torch.equal(result.canvases[:, k], union(drawn[:, :k]) if k else torch.zeros_like(drawn[:, 0]))
    last = unpack(union(drawn))
    both, either = ((part > 0).sum((1, 2, 3)) for part in (last & targets(6), last | targets(6)))
    torch.testing.assert_close(result.iou().double(), both / either.double())
    live = result.live
    assert not result.code.ids[~live].any(), "nothing follows the end"
    whole = encode(result.programs(rounded=True), blocks=10)
    assert torch.equal(union(draw_blocks(whole)), union(drawn))


def test_novel_ends_rather_than_write_a_block_that_draws_nothing_new():
    result = decoded("novel")
    new = count(draw_blocks(result.code) & ~result.canvases) > 0
    writes = (result.code.ids > 0).any(-1)
    assert torch.equal(new, writes)
    assert writes.any()
    still = decoded("argmax")
    assert ((still.code.ids > 0).any(-1) & (count(draw_blocks(still.code) & ~still.canvases) == 0)).any()


@pytest.mark.wrong_types
@pytest.mark.parametrize(
    ("target", "message"),
    [
        (
            torch.zeros(1, 16, 16, 16),
            r"target has the shape \(1, 16, 16, 16\)\n  hint: give the shape B x 32 x 32 x 32",
        ),
        (torch.zeros(32, 32, 32), r"target has the shape \(32, 32, 32\)"),
        (torch.zeros(0, 32, 32, 32), r"target has the shape \(0, 32, 32, 32\)\n.* 1 or more"),
        (torch.zeros(1, 32, 32, 32).numpy(), "target is no tensor but ndarray"),
    ],
)
def test_targets_of_another_shape_are_refused(target: Tensor, message: str):
    with pytest.raises(ShapeProgError, match=message):
        decode(small(), target)
    with pytest.raises(ShapeProgError, match="blocks is -1"):
        decode(small(), targets(1), blocks=-1)


def test_a_generator_in_training_mode_is_refused_and_stays_as_it_was():
    generator = small().train()
    before = {name: value.clone() for name, value in generator.state_dict().items()}
    with pytest.raises(ShapeProgError, match=r"training mode\n  hint: call generator.eval\(\) first"):
        decode(generator, targets(2))
    assert all(torch.equal(value, before[name]) for name, value in generator.state_dict().items())


def widened(cells: Tensor) -> Tensor:
    """Cells that share a face with a filled one, and these."""
    grid = cells[:, None].float()
    ways = [max_pool3d(grid, kernel, 1, [size // 2 for size in kernel]) for kernel in ((3, 1, 1), (1, 3, 1), (1, 1, 3))]
    return torch.stack(ways).amax(0)[:, 0].bool()


def test_select_writes_only_blocks_that_agree_with_the_target_and_never_lowers_the_agreement():
    target, generator = targets(6).bool(), load_generator("fast-narrow")
    result = decoded("select", generator=generator)
    blocks = unpack(draw_blocks(result.code)).bool()
    for k in range(blocks.shape[1]):
        canvas = unpack(result.canvases[:, k]).bool()
        new = blocks[:, k] & ~canvas
        exact = (new & target).sum((1, 2, 3)) - (new & ~target).sum((1, 2, 3))
        near = (target & widened(blocks[:, k]) & ~widened(canvas)).sum((1, 2, 3))
        near -= (new & ~widened(target)).sum((1, 2, 3))
        writes = (result.code.ids[:, k] > 0).any(-1)
        assert (EXACT_WEIGHT * exact + near > 0)[writes].all()
    assert result.iou().mean() >= max(0.5, decoded("argmax", generator=generator).iou().mean())
    empty = decode(generator, torch.zeros_like(targets(2)), decoder="select")
    assert not empty.code.ids.any(), "nothing helps where there is nothing"


def test_sampling_depends_on_its_seed_alone():
    one, two, three = decoded("sample", 1), decoded("sample", 1), decoded("sample", 2)
    assert torch.equal(one.code.ids, two.code.ids)
    assert torch.equal(one.code.parameters, two.code.parameters)
    assert not torch.equal(one.code.ids, three.code.ids)
    assert torch.equal(one.code.parameters, one.code.parameters.round()), "sampled numbers are whole"


def test_blocks_come_in_order_of_what_they_cover_and_those_that_add_nothing_are_dropped():
    made = PRIORS["wide"].batch(16, 2, 0)
    batch = teacher_forcing(made.voxels, made.code)
    drawn = draw_blocks(batch.code)
    new = count(drawn & ~batch.canvases)
    writes = (batch.code.ids > 0).any(-1)
    assert torch.equal(new > 0, writes)
    assert (new[:, :-1] >= new[:, 1:]).all()
    assert torch.equal(unpack(union(drawn)), made.voxels)
    first = count(draw_blocks(made.code)).amax(-1)
    assert torch.equal(new[:, 0], first), "the largest block comes first"
    twice = encode([parse("leg(at=(0, 0, 0), size=(4, 4, 4))\nleg(at=(0, 0, 0), size=(8, 8, 8))\n")])
    cells = unroll(twice).voxels()
    assert teacher_forcing(cells, twice).live.tolist() == [[True, True, False]]
    written = teacher_forcing(cells, twice, "written")
    assert torch.equal(written.code.ids[:, :2], twice.ids)
    assert written.live.tolist() == [[True, True, True]]


def test_scheduled_sampling_asks_for_the_block_that_adds_most_to_a_canvas_of_the_generator():
    made = PRIORS["narrow"].batch(6, 3, 0)
    batch = teacher_forcing(made.voxels, made.code)
    generator = small().train()
    sampled = scheduled_sampling(generator, batch, seeded())
    assert generator.training
    assert torch.equal(sampled.target, batch.target)
    blocks, wanted = draw_blocks(batch.code), draw_blocks(sampled.code)
    assert count(sampled.canvases[:, 1:]).any()
    for k in range(sampled.canvases.shape[1]):
        canvas = sampled.canvases[:, k]
        most = count(blocks & ~canvas[:, None]).amax(-1)
        assert torch.equal(count(wanted[:, k] & ~canvas), most), "or the end, where nothing adds"
        assert not sampled.code.ids[:, k][most == 0].any()


def test_measures_are_those_of_the_written_programs_and_an_empty_one_is_a_point(tmp_path):
    path = write_targets(tmp_path / "few.npz", 2)
    generator, shapes = load_generator("fast-narrow"), list(read_pack(path))
    rows = list(map(measure, *decode_all(generator, shapes, "select"), shapes))
    assert [row.iou for row in rows] == pytest.approx(decode(generator, targets(2)).iou().tolist())
    scores = scores_on_packs(generator, [path], "select")
    assert scores.keys() == {"few_iou", "few_cd", "few_blocks", "few_cd_median"}
    assert scores["few_cd"] == pytest.approx(sum(row.cd for row in rows) / 2)
    with torch.no_grad():
        generator.id_head[2].bias[0] += 100
    silent = list(map(measure, *decode_all(generator, shapes, "argmax"), shapes))
    assert [row.blocks for row in silent] == [0, 0]
    assert all(0 < row.cd < 1 for row in silent)

"""The synthetic data of the paper: laws that every sample keeps, and the statistics of the published data."""

from __future__ import annotations

import pytest
import torch

from shapeprog.data.random import outside_published
from shapeprog.errors import InputError
from shapeprog.geometry.cells import unpack, voxels
from shapeprog.language import standard
from shapeprog.language.statement import END
from shapeprog.language.tensors import Code, decode
from shapeprog.language.unroll import draw_blocks, unroll
from shapeprog.liang2022.generator import preceding, union
from shapeprog.liang2022.prior import BLOCKS, PRIORS, Prior, own_cells, programs
from shapeprog.space import HALF, SPAN

pytestmark = pytest.mark.paper

TRANSLATE, ROTATE = standard["translate"].id, standard["rotate"].id


@pytest.fixture(params=PRIORS.values(), ids=PRIORS.keys())
def each(request: pytest.FixtureRequest) -> Prior:
    return request.param


def drawing(code: Code) -> torch.Tensor:
    return (code.ids != 0).any(-1)


def extents(cells: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
    along = [cells.amax(tuple({1, 2, 3} - {axis})) for axis in (1, 2, 3)]
    low = torch.stack([a.argmax(-1) - HALF for a in along], -1)
    return low, torch.stack([HALF - a.flip(-1).argmax(-1) for a in along], -1)


@pytest.mark.parametrize(("count", "seed"), [(1, 0), (3, 1), (300, 2)])
def test_every_sample_is_a_published_program_of_whole_numbers(each: Prior, count: int, seed: int) -> None:
    code, grids = each.sample(count, seed)
    assert code.ids.shape == (count, BLOCKS, 3)
    assert code.parameters.shape == (count, BLOCKS, 3, 7)
    assert torch.equal(code.parameters, code.parameters.round())
    assert torch.equal(grids, voxels(unroll(code)))
    for program, blocks in zip(decode(code), drawing(code).sum(-1).tolist(), strict=True):
        assert outside_published(program) == []
        assert 1 <= program.blocks == blocks


def test_empty_blocks_come_last_and_unused_numbers_are_zero(each: Prior) -> None:
    code, _ = each.sample(300, 0)
    assert (drawing(code).int().diff(dim=-1) <= 0).all()
    sizes = torch.tensor([0, *(standard[number].size for number in range(1, END))])
    unused = torch.arange(7) >= sizes[code.ids][..., None]
    assert (code.parameters[unused] == 0).all()


def test_every_block_has_cells_of_its_own(each: Prior) -> None:
    code, grids = each.sample(300, 1)
    blocks = draw_blocks(code)
    own = (blocks & ~(preceding(blocks) | preceding(blocks.flip(1)).flip(1))).flatten(2).any(-1)
    assert torch.equal(own, drawing(code))
    assert torch.equal(grids, unpack(union(blocks)))


def test_hidden_blocks_go_and_the_shape_stays() -> None:
    blocks = torch.randint(0, 2, (80, 6, 32, 32), dtype=torch.int32) * torch.randint(0, 2, (80, 6, 1, 1)).int()
    blocks[:, 1] = blocks[:, 4]
    keep = own_cells(blocks)
    assert torch.equal(union(blocks * keep[..., None, None]), union(blocks))
    assert not keep[:, 4].any()


def test_wide_is_centred_as_large_as_real_shapes_and_uses_every_statement() -> None:
    code, grids = PRIORS["wide"].sample(3000, 3)
    low, high = extents(grids)
    assert ((high - low).amax(-1) == SPAN).float().mean() > 0.85
    assert (high + low).abs().float().mean() < 0.3
    loops = code.parameters[code.ids == TRANSLATE]
    assert (loops[:, 0].min(), loops[:, 0].max()) == (2, 8)
    assert set(code.ids.unique().tolist()) == set(range(END))


def test_narrow_has_the_published_statistics() -> None:
    code, _ = PRIORS["narrow"].sample(8000, 7)
    loops = code.parameters[code.ids == TRANSLATE]
    assert (loops[:, 0] == 2).all()
    assert (loops[:, 1] == 0).all(), "no repeat is vertical"
    assert drawing(code).sum() / len(code.ids) == pytest.approx(4.7, abs=0.3)
    assert drawing(code).sum(-1).max() == 8
    assert len(loops) / len(code.ids) == pytest.approx(1.96, abs=0.15)
    assert (code.ids == ROTATE).sum() / len(code.ids) == pytest.approx(0.25, abs=0.03)
    for name, slot, low, high in (
        ("top_rectangle", 3, 1, 5), ("top_rectangle", 4, 4, 12), ("top_rectangle", 5, 4, 12), ("top_square", 4, 4, 12),
        ("top_circle", 4, 4, 12), ("leg", 3, 5, 24), ("leg", 4, 1, 3), ("leg", 5, 1, 3), ("back", 6, 0, 4),
        ("back", 4, 1, 3), ("support_cylinder", 4, 1, 11), ("line", 6, 1, 1), ("horizontal_bar", 5, 1, 24),
    ):  # fmt: skip
        values = code.parameters[code.ids == standard[name].id][:, slot]
        assert low <= values.min() <= values.max() <= high, name


def test_a_batch_depends_on_prior_seed_and_index_alone(each: Prior) -> None:
    last, again = each.batch(20, 11, 3), [each.batch(20, 11, index) for index in (0, 2, 3)][-1]
    assert torch.equal(last.code.parameters, again.code.parameters)
    assert torch.equal(last.voxels, again.voxels)
    for other in (each.batch(20, 11, 2), each.batch(20, 12, 3)):
        assert not torch.equal(last.voxels, other.voxels)


def test_wrong_names_are_refused_in_words() -> None:
    with pytest.raises(InputError, match=r"there is no prior 'wyde'\n.*did you mean 'wide'"):
        programs("wyde", 1, 0)


def test_unions_and_preceding_cells_are_those_of_the_blocks():
    blocks = draw_blocks(PRIORS["narrow"].sample(20, 0).code)
    grids = unpack(blocks).bool()
    assert (unpack(union(blocks)) == grids.any(1)).all()
    assert not preceding(blocks)[:, 0].any()
    assert (unpack(preceding(blocks)[:, 2]) == grids[:, :2].any(1)).all()

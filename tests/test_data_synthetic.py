"""Synthetic furniture: laws that every sample keeps, the published statistics, and errors in words."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import torch
from declared import LANGUAGE
from typer.testing import CliRunner

from shapeprog.cli.app import app
from shapeprog.data import read_pack
from shapeprog.data.random import outside_published
from shapeprog.data.synthetic import PRIORS, Prior, Stream, prior, read_programs, write_programs
from shapeprog.data.synthetic.hiding import with_own_cells
from shapeprog.errors import InputError, OutputError, ShapeProgError
from shapeprog.geometry.cells import preceding, voxels
from shapeprog.language import Language, standard, using
from shapeprog.language.statement import END
from shapeprog.language.tensors import Code, decode
from shapeprog.language.unroll import draw_blocks, unroll
from shapeprog.space import HALF, SPAN

TRANSLATE, ROTATE = 19, 20
SEEDS = range(4)


def drawn(one: Prior, seed: int, count: int = 256) -> Code:
    return one(count, torch.Generator().manual_seed(seed))


def statements(code: Code) -> torch.Tensor:
    """Blocks that draw, (B, K)."""
    return (code.ids != 0).any(-1)


@pytest.fixture(params=PRIORS.values(), ids=PRIORS.keys())
def each(request: pytest.FixtureRequest) -> Prior:
    found: Prior = request.param
    return found


@pytest.mark.parametrize("seed", SEEDS)
def test_every_sample_is_a_published_program_of_whole_numbers(each: Prior, seed: int) -> None:
    code = drawn(each, seed)
    assert code.ids.shape == (256, each.blocks, 3)
    assert code.parameters.shape == (256, each.blocks, 3, 7)
    assert torch.equal(code.parameters, code.parameters.round())
    for program, blocks in zip(decode(code), statements(code).sum(-1).tolist(), strict=True):
        assert outside_published(program) == []
        assert 1 <= program.blocks == blocks


@pytest.mark.parametrize("count", [1, 2, 3])
def test_a_few_samples_are_as_good_as_many(each: Prior, count: int) -> None:
    for seed in range(5):
        assert all(program.blocks for program in decode(drawn(each, seed, count)))


def test_empty_blocks_come_last_and_unused_numbers_are_zero(each: Prior) -> None:
    code = drawn(each, 0)
    here = statements(code).int()
    assert (here.diff(dim=-1) <= 0).all()
    sizes = torch.zeros(END + 1, dtype=torch.long)
    for declared in standard:
        if declared.id < END:
            sizes[declared.id] = declared.size
    unused = torch.arange(7) >= sizes[code.ids][..., None]
    assert (code.parameters[unused] == 0).all()


def test_every_block_has_cells_of_its_own(each: Prior) -> None:
    code = drawn(each, 1)
    blocks = draw_blocks(code)
    after = preceding(blocks.flip(1)).flip(1)
    own = (blocks & ~(preceding(blocks) | after)).flatten(2).any(-1)
    assert torch.equal(own, statements(code))


def test_the_kernel_that_finds_hidden_blocks_agrees_with_its_twin() -> None:
    blocks = torch.randint(0, 2, (80, 6, 32, 32), dtype=torch.int32) * torch.randint(0, 2, (80, 6, 1, 1)).int()
    for one, two in zip(with_own_cells(blocks), with_own_cells.twin(blocks), strict=True):
        assert torch.equal(one, two)


def test_shapes_are_centred_and_as_large_as_real_ones_are_scaled() -> None:
    cells = Stream(prior("wide"), 512, seed=3)[0].voxels
    low, high = [], []
    for axis in (1, 2, 3):
        rest = tuple(other for other in (1, 2, 3) if other != axis)
        along = cells.amax(rest)
        low.append(along.argmax(-1) - HALF)
        high.append(HALF - along.flip(-1).argmax(-1))
    size = torch.stack(high, -1) - torch.stack(low, -1)
    assert (size.amax(-1) == SPAN).float().mean() > 0.85
    assert (torch.stack(high, -1) + torch.stack(low, -1)).abs().float().mean() < 0.3


def test_wide_repeats_up_to_eight_in_every_direction_leans_and_turns() -> None:
    code = drawn(prior("wide"), 5, 3000)
    loops = code.parameters[code.ids == TRANSLATE]
    assert loops[:, 0].min() == 2
    assert loops[:, 0].max() == 8
    for axis in (1, 2, 3):
        assert loops[loops[:, axis] != 0][:, 0].max() == 8
    assert (code.ids == TRANSLATE).sum(-1).max() == 2
    assert (code.ids == ROTATE).any()
    assert code.parameters[code.ids == standard["back"].id][:, 6].max() == 6
    missing = set(range(1, END)) - set(code.ids.unique().tolist())
    assert missing == set()


def test_narrow_has_the_published_statistics() -> None:
    code = drawn(prior("narrow"), 7, 8192)
    count = len(code.ids)
    assert (code.parameters[..., 0][code.ids == TRANSLATE] == 2).all()
    assert (code.parameters[..., 1][code.ids == TRANSLATE] == 0).all(), "no repeat is vertical"
    assert int(statements(code).sum()) / count == pytest.approx(4.7, abs=0.3)
    assert int((code.ids == TRANSLATE).sum()) / count == pytest.approx(1.96, abs=0.1)
    assert int((code.ids == ROTATE).sum()) / count == pytest.approx(0.25, abs=0.03)
    assert int(statements(code).sum(-1).max()) == 8


@pytest.mark.parametrize(
    ("name", "slot", "low", "high"),
    [
        ("top_rectangle", 3, 1, 5), ("top_rectangle", 4, 4, 12), ("top_rectangle", 5, 4, 12), ("top_square", 4, 4, 12),
        ("top_circle", 4, 4, 12), ("leg", 3, 5, 24), ("leg", 4, 1, 3), ("leg", 5, 1, 3), ("back", 6, 0, 4),
        ("back", 4, 1, 3), ("support_cylinder", 4, 1, 11), ("line", 6, 1, 1), ("horizontal_bar", 5, 1, 24),
    ],
)  # fmt: skip
def test_narrow_keeps_to_the_published_ranges(name: str, slot: int, low: int, high: int) -> None:
    code = drawn(prior("narrow"), 8, 4096)
    values = code.parameters[code.ids == standard[name].id][:, slot]
    assert low <= values.min()
    assert values.max() <= high


def test_voxels_are_those_of_the_programs_and_points_lie_on_them(each: Prior) -> None:
    batch = Stream(each, 512, seed=1, points=50)[2]
    scene = unroll(decode(batch.code))
    assert torch.equal(batch.voxels, voxels(scene))
    assert batch.points is not None
    assert scene.distance(batch.points).abs().max() < 1e-3


def test_a_batch_depends_on_seed_and_index_alone(each: Prior) -> None:
    one, two = Stream(each, 1000, seed=11, blocks=12), Stream(each, 1000, seed=11, blocks=12)
    last = one[3]
    for index in (0, 2, 3):
        again = two[index]
    assert again.code.ids.shape == (1000, 12, 3)
    assert torch.equal(last.code.ids, again.code.ids)
    assert torch.equal(last.code.parameters, again.code.parameters)
    assert torch.equal(last.voxels, again.voxels)
    for other in (two[2], Stream(each, 1000, seed=12, blocks=12)[3]):
        assert not torch.equal(last.voxels, other.voxels)


def test_what_a_user_does_to_a_batch_stays_there(each: Prior) -> None:
    stream = Stream(each, 8, seed=0)
    assert stream[0].points is None
    kept = stream[0].code.parameters.clone()
    stream[0].code.parameters.zero_()
    assert torch.equal(stream[0].code.parameters, kept)


def test_statements_of_users_take_part_and_suffice_on_their_own() -> None:
    with using(LANGUAGE):
        own = (drawn(prior("wide"), 0, 128).ids > END).any(-1).any(-1)
        assert 0.05 < own.float().mean() < 0.5
        assert not (drawn(prior("narrow"), 0, 64).ids > END).any()
    alone = Language()
    for declared in LANGUAGE:
        if declared.id > END and not declared.is_loop and declared.taught:
            alone.register(declared)
    with using(alone):
        code = drawn(prior("wide"), 0, 32)
        for declared in alone:
            values = code.parameters[code.ids == declared.id]
            for slot, quantity in enumerate(declared.quantities):
                assert (values[:, slot] >= quantity.low).all()
                assert (values[:, slot] <= quantity.high).all()
        assert voxels(unroll(code)).flatten(1).any(-1).all()
    with using(Language()), pytest.raises(ShapeProgError, match="no statements to write programs with"):
        drawn(prior("wide"), 0, 4)


def test_programs_are_stored_whole_and_small(each: Prior, tmp_path: Path) -> None:
    code = drawn(each, 2)
    path = tmp_path / "programs.npz"
    assert write_programs(path, code) == 256
    found = read_programs(path)
    assert torch.equal(found.ids, code.ids)
    assert torch.equal(found.parameters, code.parameters)
    assert path.stat().st_size < 256 * 300
    assert list(tmp_path.iterdir()) == [path]


def test_data_sets_that_cannot_be_used_are_refused_in_words(tmp_path: Path) -> None:
    code = drawn(prior("wide"), 0, 4)
    with pytest.raises(OutputError, match="whole numbers of 16 bits"):
        write_programs(tmp_path / "a.npz", Code(code.ids, code.parameters + 0.5))
    with pytest.raises(OutputError, match="is no name for a data set"):
        write_programs(tmp_path / "a.bin", code)
    with pytest.raises(InputError, match="there is no file"):
        read_programs(tmp_path / "none.npz")
    damaged = tmp_path / "damaged.npz"
    damaged.write_bytes(b"PK\x03\x04 nothing")
    with pytest.raises(InputError, match="cannot be read as NPZ: it is damaged"):
        read_programs(damaged)
    np.savez(tmp_path / "other.npz", voxels=np.zeros(3))
    with pytest.raises(InputError, match="is no data set of programs: it has no ids and no parameters"):
        read_programs(tmp_path / "other.npz")
    with using(LANGUAGE):
        write_programs(tmp_path / "own.npz", drawn(prior("wide"), 0))
    with pytest.raises(InputError, match="which the language in force does not have"):
        read_programs(tmp_path / "own.npz")


ODD_ARRAYS = {
    "ids": [np.zeros((2, 3), int), np.zeros((2, 3, 3)), np.array(["a"]), np.array(3), np.array([None])],
    "parameters": [np.zeros((2, 3, 3, 6), int), np.zeros((2, 3, 3, 7)), np.array(["a"]), np.zeros(0, int)],
    "statement_ids": [np.array(1), np.array([1, 2]), np.array(["leg"])],
    "statement_names": [np.array("leg"), np.array([1]), np.array(["leg", "leg"]), np.array([b"leg"])],
}


@pytest.mark.parametrize("name", ODD_ARRAYS)
def test_data_sets_of_other_arrays_are_refused_in_words(name: str, tmp_path: Path) -> None:
    write_programs(tmp_path / "good.npz", drawn(prior("wide"), 0, 4))
    with np.load(tmp_path / "good.npz") as content:
        good = dict(content)
    for odd in ODD_ARRAYS[name]:
        np.savez(tmp_path / "odd.npz", **{**good, name: odd})
        with pytest.raises(InputError, match=r"^odd\.npz[: ](?!.*(invalid|literal|pickled)).*(not|no|objects|which) "):
            read_programs(tmp_path / "odd.npz")


def test_wrong_names_and_sizes_are_refused_in_words() -> None:
    with pytest.raises(InputError, match="there is no prior 'wyde'") as caught:
        prior("wyde")
    assert "did you mean 'wide'?" in str(caught.value)
    with pytest.raises(InputError, match="a batch of 0 shapes"):
        Stream(prior("wide"), 0, seed=0)
    with pytest.raises(InputError, match="4 blocks do not hold"):
        Stream(prior("wide"), 1, seed=0, blocks=4)
    with pytest.raises(IndexError):
        Stream(prior("wide"), 1, seed=0)[-1]


def test_the_command_writes_sheets_folders_packs_and_data_sets(tmp_path: Path) -> None:
    words = ["sample", "narrow", "--count", "3", "--seed", "5", "--out", str(tmp_path / "sheet.png")]
    words += ["--folder", str(tmp_path / "shapes"), "--pack", str(tmp_path / "pack.npz"), "--points", "64"]
    done = CliRunner().invoke(app, [*words, "--programs", str(tmp_path / "programs.npz")])
    assert done.exit_code == 0, done.output
    assert (tmp_path / "sheet.png").stat().st_size > 1000
    assert len(list((tmp_path / "shapes").glob("*.shape"))) == 3
    pack = read_pack(tmp_path / "pack.npz")
    code = read_programs(tmp_path / "programs.npz")
    assert torch.equal(torch.from_numpy(np.stack([shape.voxels for shape in pack])), voxels(unroll(code)).bool())
    assert torch.equal(code.ids, drawn(prior("narrow"), 5, 3).ids)
    printed = CliRunner().invoke(app, ["sample", "wide", "--count", "2"])
    assert printed.exit_code == 0
    assert "# wide_0" in printed.output
    assert CliRunner().invoke(app, ["sample", "wyde"]).exit_code == 2

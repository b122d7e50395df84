"""What a generator proposes takes part in the search, helps where it is right, and does no harm where it is not."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
import torch
from test_inference_blocks import random_block
from test_inference_search import CHAIR, SHELF, STAR, TABLE, cells, target

from shapeprog.cli import main
from shapeprog.data.shape import Shape
from shapeprog.errors import InputError, ShapeProgError
from shapeprog.geometry.cells import pack, rasterise, words_of
from shapeprog.inference import Schedule, Settings, infer, proposing, snapped_from
from shapeprog.inference.blocks import to_program
from shapeprog.inference.chance_kernels import start
from shapeprog.inference.drawing import draw_all
from shapeprog.inference.editing import Plan, recreate, value_of
from shapeprog.inference.pool import Pool
from shapeprog.inference.proposing import propose_program, ready_generator, single_pass
from shapeprog.inference.raster_kernels import ROWS
from shapeprog.inference.reading import from_program
from shapeprog.inference.structure import Proposals, search_structure
from shapeprog.language.named import names
from shapeprog.language.parameters import Length, Position
from shapeprog.language.program import Draw, Loop, Program
from shapeprog.language.shapes import disc
from shapeprog.language.statement import Language, language, standard, statement, using
from shapeprog.language.tensors import decode as decode_code
from shapeprog.language.text import parse
from shapeprog.language.unroll import unroll
from shapeprog.models.checkpoint import card_of, save_checkpoint
from shapeprog.models.decoding import decode
from shapeprog.models.designs import build_generator

EXAMPLES = {"table": TABLE, "shelf": SHELF, "star": STAR, "chair": CHAIR}
QUICK = Settings(rounds=20)


def generator(seed=0):
    torch.manual_seed(seed)
    return build_generator("swift", {"widths": (4, 4, 4), "squeeze": 4, "feature": 16}).eval()


def rows_of(program):
    return words_of(rasterise(unroll(program))).reshape(-1)


def random_program(rng, length):
    return to_program(np.stack([random_block(rng.integers(5), rng) for _ in range(length)]))


def test_a_program_read_as_blocks_has_the_same_cells():
    rng = np.random.default_rng(3)
    for _ in range(30):
        program = random_program(rng, rng.integers(1, 7))
        blocks = from_program(program)
        assert len(blocks) == program.blocks
        assert np.array_equal(draw_all(blocks), rows_of(program))


def test_every_statement_is_read_with_the_cells_it_draws():
    rng = np.random.default_rng(5)
    for each in language():
        if each.is_loop or not each.taught:
            continue
        values = [float(round(rng.uniform(max(q.low, -8), min(q.high, 8)))) for q in each.quantities]
        program = Program((Loop("translate", (2.0, 0.0, 3.0, 9.0), (Draw(each.name, tuple(values)),)),))
        assert np.array_equal(draw_all(from_program(program)), rows_of(program.snap())), each.name


@pytest.mark.parametrize("step", [1.0, 3.0, -1.0, 5.0])
@pytest.mark.parametrize("count", [1, 2, 3, 4])
def test_turned_cross_arms_are_read_from_either_end(count, step):
    arm = Draw("base_cross", (-10.0, 0.0, 0.0, 2.0, 9.0, 1.0))
    program = Program((Loop("rotate", (float(count), step), (arm,)),))
    assert np.array_equal(draw_all(from_program(program)), rows_of(program))


def test_numbers_are_rounded_as_the_executor_rounds_them():
    program = Program((Draw("top_rectangle", (0.4, 0.5, 1.5, 2.2, 2.5, 3.5)),))
    assert np.array_equal(draw_all(from_program(program)), rows_of(program.snap()))


UNREADABLE = {
    "turned box": Loop("rotate", (3.0, 1.0), (Draw("leg", (0.0,) * 3 + (2.0,) * 3),)),
    "half turns": Loop("rotate", (2.0, 2.0), (Draw("base_cross", (0.0, 0.0, 0.0, 2.0, 5.0, 0.0)),)),
    "no copies": Loop("translate", (0.0, 0.0, 0.0, 3.0), (Draw("leg", (0.0,) * 3 + (2.0,) * 3),)),
    "no volume": Draw("leg", (0.0,) * 6),
    "negative": Draw("top_circle", (0.0, 0.0, 0.0, 2.0, -4.0)),
    "far away": Draw("leg", (900.0, 0.0, 0.0, 2.0, 2.0, 2.0)),
    "not a number": Draw("leg", (float("nan"), 0.0, 0.0, 2.0, 2.0, 2.0)),
    "infinite": Loop("translate", (2.0, float("inf"), 0.0, 3.0), (Draw("leg", (0.0,) * 3 + (2.0,) * 3),)),
}


@pytest.mark.parametrize("node", UNREADABLE.values(), ids=UNREADABLE)
def test_what_blocks_have_no_words_for_is_left_out(node):
    good = parse(TABLE)
    assert np.array_equal(from_program(Program((node, *good.body))), from_program(good))


def test_a_pool_finds_its_best_block_and_loses_no_cells():
    rng = np.random.default_rng(0)
    occupied, covered = (words_of(pack(rng.random((32, 32, 32)) < 0.3)).reshape(-1) for _ in range(2))
    blocks = np.stack([random_block(rng.integers(5), rng) for _ in range(20)])
    pool = Pool.of([blocks[:10], blocks], 3.0)
    gains = []
    for block, price in zip(pool.blocks, pool.prices, strict=True):
        rows = draw_all(block[None])
        good = np.bitwise_count(rows & occupied & ~covered).sum()
        bad = np.bitwise_count(rows & ~occupied & ~covered).sum()
        gains.append(float(good) - 0.3 * float(bad) - price)
    assert len(np.unique(pool.blocks, axis=0)) == len(pool.blocks)
    gain, block = pool.best(occupied, covered, 0.3)
    assert gain == pytest.approx(max(0, *gains))
    assert np.array_equal(block, pool.blocks[np.argmax(gains)])
    assert np.array_equal(pool.several(occupied, covered, 0.3, 2), pool.blocks[np.argsort(gains)[::-1][:2]])


def test_an_empty_pool_offers_nothing():
    pool = Pool.of([], 1.0)
    empty = np.zeros(ROWS, np.uint32)
    assert pool.best(empty, empty, 1.0)[0] == 0
    assert len(pool.several(empty, empty, 1.0, 3)) == 0


@pytest.mark.parametrize("text", EXAMPLES.values(), ids=EXAMPLES)
def test_the_program_itself_is_kept_when_it_is_proposed(text):
    solid = cells(text)
    found = search_structure(solid, replace(QUICK, rounds=0), proposals=Proposals.of([parse(text)]))
    assert found.iou == 1
    assert value_of(found.blocks, target(solid)) >= value_of(from_program(parse(text)), target(solid)) - 1e-9


def test_the_search_is_never_worse_than_a_proposal_or_its_own_starts():
    rng = np.random.default_rng(1)
    for text in EXAMPLES.values():
        solid = cells(text)
        aim = target(solid)
        wrong = random_program(rng, 4)
        alone = search_structure(solid, replace(QUICK, rounds=0))
        found = search_structure(solid, QUICK, proposals=Proposals.of([wrong]))
        assert value_of(found.blocks, aim) >= value_of(alone.blocks, aim) - 1e-9
        assert value_of(found.blocks, aim) >= value_of(from_program(wrong), aim)
        assert len(found.blocks) <= QUICK.blocks


def test_a_block_of_the_pool_is_put_in_where_it_gains():
    aim, whole = target(cells(STAR)), from_program(parse(STAR))
    pool = Pool.of([whole], aim.price * aim.cells)
    plan = Plan(10, families=len(aim.table), forms=0.0, heat=0.0, recall=1.0, pool=pool)
    for missing in range(len(whole)):
        start(0)
        found = recreate(np.delete(whole, missing, 0), 1, aim, plan)
        assert value_of(found, aim) == pytest.approx(value_of(whole, aim))


GARBAGE = {
    "nothing": Proposals(),
    "an empty program": Proposals.of([Program()]),
    "outside": Proposals.of([Program((Draw("leg", (40.0, 40.0, 40.0, 2.0, 2.0, 2.0)),))]),
    "not a number": Proposals.of([Program((UNREADABLE["not a number"],))]),
    "too many": Proposals.of([Program(parse(TABLE).body * 20)]),
}  # fmt: skip


@pytest.mark.parametrize("proposals", GARBAGE.values(), ids=GARBAGE)
def test_garbage_does_no_harm(proposals):
    found = search_structure(cells(TABLE), Settings(rounds=40, recall=0.5), proposals=proposals)
    assert found.iou == 1
    assert len(found.blocks) == 2


def test_the_search_stops_when_nothing_has_gained_for_long():
    found = search_structure(cells(TABLE), Settings(rounds=200, patience=40))
    assert found.reason == "40 rounds of editing in a row gained nothing"
    assert found.iou == 1


def test_proposals_depend_on_the_seed_alone():
    solid = cells(CHAIR)
    writer = generator()
    one, two, other = (
        propose_program(writer, solid, blocks=3, suggestions=8, price=0.001, seed=seed) for seed in (4, 4, 5)
    )
    assert np.array_equal(one.programs[0], two.programs[0])
    assert np.array_equal(one.loose, two.loose)
    assert not np.array_equal(one.loose, other.loose)
    assert len(one.programs[0]) <= 3


def shape(text=CHAIR):
    return Shape("planted", cells(text), None)


def test_inference_with_a_generator_repeats_and_says_who_took_part():
    writer, settings, schedule = generator(), Settings(rounds=20, recall=0.5), Schedule(steps=2)
    one, two = (infer(shape(), settings=settings, schedule=schedule, generator=writer, proposals=4) for _ in range(2))
    assert one == two
    assert "generator took part" in one.reason
    assert one.scores["proposed"] in (0, 1)
    alone = infer(shape(), settings=settings, schedule=schedule, generator=None, ties=False)
    assert "generator" not in alone.reason
    assert "proposed" not in alone.scores
    assert snapped_from(alone.program, alone.snapped)


def test_a_program_found_on_cells_is_tied_where_it_gets_no_longer():
    tied, plain = (
        infer(shape(), settings=QUICK, schedule=Schedule(steps=2), generator=None, ties=ties) for ties in (True, False)
    )
    assert plain.snapped is not None
    assert tied.snapped is None
    assert [each.name for each in names(tied.program)][:2] == ["width", "depth"]
    assert tied.scores["numbers"] < plain.scores["numbers"]
    assert tied.scores["iou"] >= plain.scores["iou"] - 0.02


def test_a_single_pass_is_what_the_generator_writes():
    writer = generator()
    solid = cells(CHAIR)
    said = decode(writer, torch.from_numpy(solid.astype(np.uint8))[None], blocks=4)
    found = infer(shape(), blocks=4, generator=writer, search=False)
    assert found.program == decode_code(said.code)[0] == single_pass(writer, solid, 4)[0]
    assert found.snapped == found.program.snap()
    assert "single pass" in found.reason
    refined = infer(shape(), blocks=4, generator=writer, search=False, schedule=Schedule(steps=2))
    assert snapped_from(refined.program, refined.snapped)


@pytest.fixture
def weights(tmp_path, monkeypatch):
    """A folder of weights that ship, with default ones."""
    monkeypatch.setattr(proposing, "SHIPPED", tmp_path)
    monkeypatch.setattr("shapeprog.models.checkpoint.SHIPPED", tmp_path)
    writer = generator()
    save_checkpoint(tmp_path / "default.safetensors", writer, card_of(writer))
    return tmp_path / "default.safetensors"


def test_default_weights_take_part_when_they_ship_and_are_not_missed_when_not(weights):
    assert ready_generator("default")[0] is ready_generator("default")[0]
    assert ready_generator(weights)[0] is not None
    weights.unlink()
    assert ready_generator("default") == (None, "")
    assert ready_generator(None) == (None, "")
    with pytest.raises(ShapeProgError, match="no generator"):
        ready_generator("default", needed=True)
    with pytest.raises(InputError):
        ready_generator("other")


def test_statements_that_weights_do_not_know_hinder_nothing(weights):
    assert weights.exists()
    with using(Language()):
        for known in standard:
            language().register(known)

        @statement("puff")
        def puff(at: Position, height: Length, radius: Length):
            """A round cushion."""
            return disc(at, height, radius)

        assert ready_generator("default")[1] == ""
        both = Program((*parse(TABLE).body, Draw("puff", (0.0, 0.0, 0.0, 2.0, 3.0))))
        assert np.array_equal(from_program(both), from_program(parse(TABLE)))


def test_default_weights_for_another_language_are_left_out_with_a_reason(weights):
    found = ready_generator(weights)[0]
    record = found.vocabulary.record()
    record["leg"] = {**record["leg"], "id": 99}
    save_checkpoint(weights, found, replace(card_of(found), vocabulary=json.loads(json.dumps(record))))
    writer, hindered = ready_generator("default")
    assert writer is None
    assert "'leg' has changed" in hindered
    with pytest.raises(ShapeProgError, match="leg"):
        ready_generator(weights)


def test_the_command_writes_what_a_generator_says_in_a_single_pass(weights, tmp_path, capsys):
    np.save(tmp_path / "chair.npy", cells(CHAIR))

    def run(*more):
        words = ["infer", tmp_path / "chair.npy", "--out", tmp_path / "out", "--no-picture", "--no-search"]
        with pytest.raises(SystemExit) as end:
            main([str(word) for word in (*words, *more)])
        return end.value.code, capsys.readouterr()

    code, told = run("--json", "--weights", weights)
    assert code in (None, 0)
    assert "single pass of the generator" in json.loads(told.out)["reason"]
    code, told = run("--weights", "none")
    assert code == 2
    assert "there is no generator to write a program" in told.err
    code, told = run("--weights", tmp_path / "missing.safetensors")
    assert code == 2
    assert "missing.safetensors" in told.err

"""What is taught: pretraining and the executor learn a few shapes by heart, and are told the truth."""

from __future__ import annotations

import signal
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from shapeprog.cli import main
from shapeprog.cli.training import stopping
from shapeprog.data.packs import write_pack
from shapeprog.data.shape import Shape
from shapeprog.data.synthetic import Stream, prior
from shapeprog.errors import ShapeProgError
from shapeprog.evaluation.generated import code_iou, evaluate_generator, generated, measured
from shapeprog.evaluation.metrics import evaluate_program
from shapeprog.geometry.cells import unpack
from shapeprog.language.tensors import Code, decode
from shapeprog.language.unroll import draw_blocks
from shapeprog.models.checkpoint import load_executor, load_generator
from shapeprog.models.designs import build_generator
from shapeprog.models.executor import NeuralExecutor
from shapeprog.models.vocabulary import Vocabulary
from shapeprog.training import validation
from shapeprog.training.engine import Engine
from shapeprog.training.executor import ExecutorSettings, ExecutorTraining, train_executor, widened
from shapeprog.training.folder import BEST, WEIGHTS, read_log
from shapeprog.training.lessons import lesson
from shapeprog.training.loop import run
from shapeprog.training.pretrain import PRESETS, Pretraining, PretrainSettings, pretrain

TINY = {"widths": (8, 8, 16), "squeeze": 8, "feature": 64}
SMALL = PretrainSettings(visits=8, batch=4, precision="float32", warm_up=0, rows=0, sampled=0.0)


@pytest.fixture(scope="module")
def engine() -> Engine:
    return Engine("cpu", threads=1)


@pytest.fixture(autouse=True)
def few_shapes(monkeypatch: pytest.MonkeyPatch) -> None:
    """Validation on as few shapes as will do."""
    monkeypatch.setattr(validation, "BATCH", 4)
    monkeypatch.setattr(validation, "SHAPES", 8)
    monkeypatch.setattr("shapeprog.training.executor.VALIDATION_BLOCKS", 32)


def test_a_generator_learns_two_shapes_by_heart(tmp_path: Path, engine: Engine):
    settings = replace(SMALL, visits=2 * 50, batch=2, shapes=2, rate=5e-3, decay=0.0, schedule="constant")
    torch.manual_seed(0)
    objective = Pretraining(build_generator("swift", TINY), settings)
    records = list(run(objective, settings, tmp_path, engine))
    assert records[-1]["loss"] < 0.1 * records[0]["loss"]
    right, ids, off, slots = validation.told(objective.module, objective.batch(0))
    assert right / ids > 0.9
    assert off / slots < 0.5


@pytest.mark.wrong_types
def test_scores_of_a_prediction_that_is_right_are_perfect():
    made = Stream(prior("wide"), 4, seed=1)[0]
    assert torch.equal(code_iou(made.code, made.voxels), torch.ones(4, dtype=torch.float64))
    each = lesson(made.voxels, made.code)
    generator = build_generator("swift", TINY).eval()
    ids = each.code.ids[each.live]

    class Knowing:
        vocabulary = generator.vocabulary

        def predict(self, *_: Any) -> Any:
            logits = torch.nn.functional.one_hot(ids, generator.vocabulary.size).float().log()
            told = generator.predict(each.target, each.canvases, each.code, each.live)
            perfect = replace(told, logits=logits)
            perfect.__dict__["values"] = each.code.parameters[each.live]  # in the place of what it would say
            return perfect

    right, number, off, slots = validation.told(Knowing(), each)  # type: ignore[arg-type]
    assert (right, off) == (number, 0)
    assert slots == float(generator.vocabulary.used[ids].sum())


def test_iou_of_codes_is_that_of_their_programs():
    made = Stream(prior("wide"), 6, seed=2)[0]
    other = made.voxels.roll(1, 0)
    shapes = [Shape(str(n), cells.numpy().astype(np.bool_)) for n, cells in enumerate(other)]
    expected = [evaluate_program(p, s).iou for p, s in zip(decode(made.code), shapes, strict=True)]
    np.testing.assert_allclose(code_iou(made.code, other), expected)


def test_shapes_are_measured_in_their_order():
    torch.manual_seed(1)
    generator = build_generator("swift", TINY).eval()
    cells = Stream(prior("wide"), 3, seed=2)[0].voxels.numpy().astype(np.bool_)
    shapes = [Shape(str(n), each, np.argwhere(each).astype(np.float32) - 15.5) for n, each in enumerate(cells)]
    rows = evaluate_generator(generator, shapes, blocks=3, points=50)
    written = generated(generator, shapes, blocks=3)
    assert repr(rows) == repr([measured(p, s, points=50) for p, s in zip(written, shapes, strict=True)])
    assert generated(generator, []) == []


def test_own_canvases_are_drawn_alike_for_the_same_seed_and_step(engine: Engine):
    torch.manual_seed(0)
    objective = Pretraining(build_generator("swift", TINY), replace(SMALL, sampled=0.5, rows=2))
    batch = objective.batch(0)
    terms = [objective.loss(batch, 1.0, engine.random(0, step)) for step in (0, 0, 1)]
    assert objective.module.training
    assert terms[0] == terms[1] != terms[2]
    assert all(bool(term.isfinite()) for term in terms[0].values())


def test_weights_make_a_beginning_and_carry_their_card(tmp_path: Path, engine: Engine):
    settings = replace(SMALL, rows=2)
    shapes = [Shape("one", Stream(prior("wide"), 1, seed=5)[0].voxels[0].numpy().astype(np.bool_))]
    write_pack(tmp_path / "real.npz", shapes)
    *_, last = pretrain(tmp_path / "run", settings, engine, packs=[tmp_path / "real.npz"], command="shapeprog pretrain")
    assert 0 <= last["val_real_iou"] == last["val_score"] <= 1
    generator, card = load_generator(tmp_path / "run" / WEIGHTS)
    assert (card.visits, card.seed, card.command, card.data) == (8, 0, "shapeprog pretrain", "synthetic, prior wide")
    assert card.scores["real_iou"] == last["val_real_iou"]
    assert (tmp_path / "run" / BEST).exists()
    on = list(pretrain(tmp_path / "on", replace(settings, rate=0.0), engine, start=str(tmp_path / "run" / WEIGHTS)))
    assert len(on) == 2
    after = load_generator(tmp_path / "on" / WEIGHTS)[0]
    for name, value in generator.named_parameters():
        torch.testing.assert_close(dict(after.named_parameters())[name], value)
    with pytest.raises(ShapeProgError, match="of the design chained, not tian2019"):
        next(pretrain(tmp_path / "x", PRESETS["tian2019"], engine, start=str(tmp_path / "run" / WEIGHTS)))


def test_the_published_recipe_is_a_preset():
    recipe = PRESETS["tian2019"]
    assert recipe.steps(1) == 20 * 120_000 / 32
    assert {recipe.rate_at(visits) for visits in (0, 10**6, 2_399_999)} == {1e-3}
    assert (recipe.clip, recipe.clip_by, recipe.optimiser, recipe.order) == (0.1, "value", "adam", "written")


def test_the_executor_learns_a_few_blocks_by_heart(tmp_path: Path, engine: Engine):
    settings = ExecutorSettings(
        visits=8 * 60,
        batch=8,
        prior="wide",
        precision="float32",
        rate=5e-3,
        warm_up=0,
        validate_every=0,
    )
    torch.manual_seed(0)
    objective = ExecutorTraining(NeuralExecutor(Vocabulary.current(), width=32), settings)
    blocks = objective.batch(0)
    objective.batch = lambda index: blocks  # type: ignore[method-assign]
    records = list(run(objective, settings, tmp_path, engine))
    assert records[-1]["loss"] < 0.6 * records[0]["loss"]
    assert 0 <= records[-1]["val_widened_iou"] <= 1


def test_the_executor_is_saved_with_its_card(tmp_path: Path, engine: Engine):
    settings = ExecutorSettings(visits=4, batch=2, prior="wide", precision="float32")
    *_, last = train_executor(tmp_path, settings, engine)
    _, card = load_executor(tmp_path / WEIGHTS)
    assert card.scores["iou"] == last["val_iou"]


def test_blocks_are_drawn_as_they_are_told():
    settings = ExecutorSettings(batch=16, prior="wide")
    objective = ExecutorTraining(NeuralExecutor(Vocabulary.current(), width=16), settings)
    blocks, again = objective.batch(3), objective.batch(3)
    assert all(torch.equal(one, two) for one, two in zip(blocks, again, strict=True))
    drawn = draw_blocks(Code(blocks.ids[:, None], blocks.parameters[:, None]))[:, 0]
    assert torch.equal(unpack(drawn), blocks.cells)
    assert (blocks.ids > 0).any(-1).all()


def test_widened_numbers_stay_whole_and_within_their_ranges():
    vocabulary = Vocabulary.current()
    ids = torch.randint(0, vocabulary.size, (500, 3))
    low, high = vocabulary.ranges[ids].unbind(-1)
    before = (low + (high - low) * torch.rand(low.shape)).round()
    after = widened(ids, before, vocabulary, 4, torch.Generator().manual_seed(0))
    used = vocabulary.used[ids]
    assert ((after >= low) & (after <= high))[used].all()
    assert torch.equal(after, after.round())
    assert (after[~used] == 0).all()
    assert ((after - before).abs() <= 4)[used & ~vocabulary.discrete[ids]].all()


def run_command(*words: object) -> int:
    with pytest.raises(SystemExit) as end:
        main([str(word) for word in words])
    return int(end.value.code or 0)


def test_the_command_goes_on_with_the_run_of_its_folder(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    words = ["pretrain", tmp_path / "run", "--batch", 2, "--device", "cpu", "--seed", 3, "--precision", "float32"]
    assert run_command(*words, "--visits", 4) == 0
    assert "weights.safetensors" in capsys.readouterr().out
    assert run_command(*words, "--visits", 4) == 0
    assert "nothing left to do" in capsys.readouterr().out
    assert run_command(*words, "--visits", 6) == 0
    assert [record["step"] for record in read_log(tmp_path / "run")] == [1, 2, 3]
    assert run_command(*words[:-4], "--visits", 8) == 2
    told = capsys.readouterr().err
    assert "seed was 3, is now 0" in told
    assert "--restart" in told
    assert run_command("pretrain", tmp_path / "x", "--preset", "tian2020") == 2
    assert "tian2019" in capsys.readouterr().err


def test_the_first_interruption_saves_and_says_how_to_go_on(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
):
    def interrupted(self: Any, batch: Any, progress: float, random: Any) -> dict[str, torch.Tensor]:
        signal.raise_signal(signal.SIGINT)
        return {"fit": next(self.module.parameters()).square().mean()}

    monkeypatch.setattr(ExecutorTraining, "loss", interrupted)
    words = ["train-executor", tmp_path, "--visits", 64, "--batch", 2, "--prior", "wide", "--device", "cpu"]
    before = signal.signal(signal.SIGINT, signal.default_int_handler)  # ignored where the suite runs in the background
    try:
        assert run_command(*words) == 130
        assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    finally:
        signal.signal(signal.SIGINT, before)
    told = " ".join(capsys.readouterr().err.split())
    assert "the same command goes on with it" in told
    assert [record["step"] for record in read_log(tmp_path)] == [1]


def test_what_was_ignored_when_a_run_began_does_not_stop_it():
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        with stopping() as stop:
            signal.raise_signal(signal.SIGINT)
            assert not stop.is_set()
            signal.raise_signal(signal.SIGTERM)
            assert stop.is_set()
        assert signal.getsignal(signal.SIGINT) is signal.SIG_IGN
    finally:
        signal.signal(signal.SIGINT, before)

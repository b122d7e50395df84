"""The commands of the paper's package: help, results, mistakes in a sentence, interruption."""

from __future__ import annotations

import argparse
import re
from pathlib import Path

import pytest
import torch
from commands import Run, table
from liang2022_toys import small, write_targets

import shapeprog as sp
from shapeprog.liang2022 import losses
from shapeprog.liang2022.cli import app
from shapeprog.liang2022.loop import LOG, STATE, WEIGHTS, read_log
from shapeprog.liang2022.tian2019 import PUBLISHED, Tian2019
from shapeprog.liang2022.weights import load_generator, read_card, save_weights

pytestmark = pytest.mark.paper
COMMANDS = [str(each.name) for each in app.registered_commands]
REACH = """
import signal
from pathlib import Path
from shapeprog.liang2022.losses import loss

@loss("reach")
def reach(comparison):
    if not Path("interrupted").exists():
        Path("interrupted").touch()
        signal.raise_signal(signal.SIGTERM)
    return comparison.scene.distance(comparison.points).square().mean(-1)
"""


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with weights, a pack and a mesh."""
    monkeypatch.setattr(losses, "LOSSES", dict(losses.LOSSES))
    save_weights(tmp_path / "small.safetensors", small(), data="nothing", scores={"iou": 0.25})
    write_targets(tmp_path / "few.npz", 2)
    table(tmp_path / "table.obj")
    return tmp_path


ADAPT = """paper adapt runs --train few.npz --initial small.safetensors --rehearsal 0 --batch-size 2 --num-shapes 8
--decoder argmax --points 50 --device cpu"""


def test_every_command_has_an_example(run: Run):
    helped = run("paper", "--help")
    assert helped.code == 0
    for name in COMMANDS:
        assert name in helped.out
        shown = run("paper", name, "--help")
        assert shown.code == 0
        assert f"Example: shapeprog paper {name}" in shown.out
    assert "--learning-rate" in shown.out


def test_help_names_the_options_of_the_paper(run: Run):
    shown = {name: " ".join(run("paper", name, "--help").out.split()) for name in ("infer", "adapt")}
    assert "Closest to the paper: --weights tian2019-narrow --decoder argmax." in shown["infer"]
    words = re.search(r"Closest to the paper: (.*?)\.", shown["adapt"])
    assert words
    assert run("paper", "adapt", "runs", *words[1].split()).err.startswith("error: there are no shapes to adapt to")


def test_infer_writes_programs(run: Run, here: Path):
    ended = run("paper", "infer", "table.obj", "few.npz", "gone.obj", "--out", "out")
    assert (ended.code, "there is no file gone.obj" in ended.err) == (1, True), ended.err
    assert ended.out.count("IoU 0.") == 3
    assert sorted(path.name for path in (here / "out").iterdir()) == ["s0.shape", "s1.shape", "table.shape"]
    assert sp.load(here / "out" / "table.shape").blocks > 0
    (here / "more").mkdir()
    (here / "more" / "table.obj").write_bytes((here / "table.obj").read_bytes())
    assert run("paper", "infer", "table.obj", "more/table.obj", "--out", "twice").code == 0
    assert sorted(path.name for path in (here / "twice").iterdir()) == ["table.shape", "table_2.shape"]
    ended = run("paper", "infer", "gone.obj")
    assert (ended.code, "there is no file gone.obj" in ended.err) == (2, True), ended.err


def test_a_users_loss_adapts_and_an_interrupted_run_is_resumed_by_the_same_command(run: Run, here: Path):
    (here / "mine.py").write_text(REACH)
    words = (ADAPT + " --with mine.py --loss reach=2,chamfer --val few.npz --validate-every 4").split()
    first = run(*words)
    assert (first.code, "the same command resumes it" in first.err) == (130, True), first.err
    assert (here / "runs" / STATE).is_file()
    assert len(read_log(here / "runs" / LOG)) == 1
    losses.LOSSES.pop("reach")
    second = run(*words)
    assert (second.code, "the weights are runs" in second.out) == (0, True), second.err
    assert "4 shapes: few_iou" in second.err
    records = read_log(here / "runs" / LOG)
    assert [each["samples_seen"] for each in records] == [2, 4, 6, 8]
    assert all(each["reach"] > 0 and each["chamfer"] > 0 for each in records)
    assert load_generator(here / "runs" / WEIGHTS).design == "fast"
    losses.LOSSES.pop("reach")
    changed = run(*words, "--learning-rate", 0.1)
    assert (changed.code, "learning_rate was 0.0003, is now 0.1" in changed.err) == (2, True), changed.err


@pytest.mark.wrong_types
@pytest.mark.parametrize(
    ("words", "message"),
    [
        ([*ADAPT.split(), "--methd", "direct"], "No such option"),
        ([*ADAPT.split(), "--method", "dirct"], "unknown method 'dirct'"),
        ([*ADAPT.split(), "--loss", "chamfr"], "did you mean 'chamfer'?"),
        ([*ADAPT.split(), "--method", "guided", "--loss", "coverage=1"], "those of direct adaptation"),
        ([*ADAPT.split(), "--loss", "neural=1"], "those of guided adaptation, and the method is direct"),
        ([*ADAPT.split(), "--learn", "some"], "unknown learn 'some'"),
        ([*ADAPT.split(), "--device", "gpu"], "unknown device 'gpu'"),
        ([*ADAPT.split(), "--with", "gone.py"], "there is no file gone.py"),
        ([*ADAPT.split(), "--with", "one.py", "--with", "two.py"], "the loss 'reach' is declared twice"),
        ([*ADAPT.split(), "--with", "table.obj/a.py"], "table.obj/a.py cannot be read: a part of its path is a file"),
        ([*ADAPT.split(), "--with", "table.obj"], "table.obj raised SyntaxError"),
        ([*ADAPT.split(), "--method", "guided", "--executor", "gone.safetensors"], "there is no file gone.safetensors"),
        (["paper", "infer", "few.npz", "--weights", "small.safetensors", "--decoder", "selct"], "did you mean select"),
        (["paper", "adapt", "runs"], "give a pack: --train"),
        (["paper", "pretrain", "runs", "--prior", "narow"], "unknown prior 'narow'"),
        (["paper", "train-executor", "runs", "--batch-size", "0"], "batch_size is 0"),
        (["paper", "import", "table.obj", "--out", "a.safetensors"], "nothing in it was run"),
    ],
)
def test_mistakes_are_explained_in_a_sentence(run: Run, here: Path, words: list[str], message: str):
    for name in ("one.py", "two.py"):
        (here / name).write_text(REACH)
    ended = run(*words)
    assert ended.code == 2
    assert message in " ".join(ended.err.split())
    assert "Traceback" not in ended.err
    assert not (here / "runs" / STATE).exists()


def test_published_weights_are_imported_and_listed(run: Run, here: Path):
    torch.save({"model": Tian2019(PUBLISHED).state_dict(), "opt": argparse.Namespace()}, here / "chair.t7")
    assert run("paper", "import", "chair.t7", "--out", "chair.safetensors").code == 0
    assert run("paper", "import", "small.safetensors", "--half", "--out", "half.safetensors").code == 0
    assert read_card("half.safetensors") == read_card("small.safetensors")
    assert (here / "half.safetensors").stat().st_size < 0.6 * (here / "small.safetensors").stat().st_size
    listed = run("paper", "models", ".")
    assert listed.code == 0, listed.err
    assert "tian2019" in listed.out
    assert "iou 0.25" in listed.out
    (here / "bad.safetensors").write_text("text")
    ended = run("paper", "models", ".")
    assert (ended.code, "bad.safetensors cannot be read as weights" in ended.err) == (2, True)


def test_samples_make_a_contact_sheet(run: Run, here: Path):
    assert run("paper", "sample", "narrow", "--count", 2).code == 0
    assert (here / "sheet.png").stat().st_size > 1000
    assert "did you mean 'wide'" in run("paper", "sample", "wyde").err

"""The training loop: it resumes exactly, on one process and on two, and explains errors in a sentence."""

from __future__ import annotations

import os
import random
import subprocess
import sys
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import pytest
import torch
from liang2022_toys import TOY, Toy, run, same

from shapeprog.errors import InputError, ShapeProgError
from shapeprog.liang2022 import loop
from shapeprog.liang2022.loop import BEST, LOG, STATE, WEIGHTS, read_log, train
from shapeprog.liang2022.settings import TrainingSettings
from shapeprog.liang2022.weights import read_card

pytestmark = pytest.mark.paper
SCRIPT = Path(__file__).with_name("liang2022_toys.py")


def untimed(folder: Path) -> list[dict[str, float]]:
    return [{name: value for name, value in each.items() if name != "seconds"} for each in read_log(folder / LOG)]


def state(folder: Path) -> dict[str, object]:
    return torch.load(folder / STATE, weights_only=True)


def test_a_stopped_run_goes_on_as_if_nothing_had_happened(tmp_path: Path):
    whole, records = run(tmp_path / "whole")
    assert [each["step"] for each in records] == list(range(1, 21))
    for stop_at in (3, 11):
        assert run(tmp_path / "parts", stop_at=stop_at)[1][-1]["step"] == stop_at + 1
    parts, rest = run(tmp_path / "parts")
    assert [each["step"] for each in rest] == list(range(13, 21))
    assert same(whole.module.state_dict(), parts.module.state_dict())
    assert same(state(tmp_path / "whole"), state(tmp_path / "parts"))
    assert untimed(tmp_path / "parts") == untimed(tmp_path / "whole") == records
    assert run(tmp_path / "parts")[1] == [], "a finished run has nothing left to do"


def test_two_processes_resume_exactly_with_one_set_of_running_statistics(tmp_path: Path):
    launch = [sys.executable, "-m", "torch.distributed.run", "--nproc-per-node", "2", "--standalone", str(SCRIPT)]
    environment = {**os.environ, "OMP_NUM_THREADS": "1", "CUDA_VISIBLE_DEVICES": ""}
    done = subprocess.run([*launch, str(tmp_path)], capture_output=True, text=True, env=environment, check=False)
    assert done.returncode == 0, done.stderr
    one, two = (torch.load(tmp_path / f"rank{rank}.pt", weights_only=True) for rank in (0, 1))
    assert same(one, two)
    assert one["1.running_mean"].any()
    assert same(state(tmp_path / "whole"), state(tmp_path / "parts"))
    assert untimed(tmp_path / "parts") == untimed(tmp_path / "whole")
    assert [each["samples_seen"] for each in read_log(tmp_path / "whole" / LOG)] == list(range(8, 81, 8))


def test_changed_settings_are_refused_by_name_and_a_longer_run_is_none(tmp_path: Path):
    run(tmp_path)
    with pytest.raises(ShapeProgError, match=r"batch_size was 4, is now 8; learning_rate was 0\.001, is now 0\.1"):
        run(tmp_path, settings=replace(TOY, batch_size=8, learning_rate=0.1))
    longer = replace(TOY, num_shapes=88, validate_every=0)
    assert [each["step"] for each in run(tmp_path, settings=longer)[1]] == [21, 22]
    again = list(train(Toy(), TOY, tmp_path, device="cpu", restart=True))
    assert len(again) == len(read_log(tmp_path / LOG)) == 20


def test_records_after_the_saved_state_are_dropped(tmp_path: Path):
    run(tmp_path / "whole")
    run(tmp_path / "killed", stop_at=9)
    with (tmp_path / "killed" / LOG).open("a") as stream:  # as a process leaves it that is killed between two states
        stream.write('{"step": 11, "loss": 7.0}\n{"step": 12, "lo')
    run(tmp_path / "killed")
    assert untimed(tmp_path / "killed") == untimed(tmp_path / "whole")


def test_a_damaged_state_or_log_is_named(tmp_path: Path):
    run(tmp_path, stop_at=5)
    good, dice = (tmp_path / STATE).read_bytes(), random.Random(0)
    refused = 0
    for number in range(30):
        content = bytearray(good)
        for _ in range((1, 8, 64)[number % 3]):
            content[dice.randrange(len(content))] = dice.randrange(256)
        (tmp_path / STATE).write_bytes(content)
        (tmp_path / LOG).write_text("")
        try:
            run(tmp_path, stop_at=6)
        except ShapeProgError:
            refused += 1
    assert refused > 10
    (tmp_path / STATE).write_bytes(good[:-9])
    with pytest.raises(InputError, match=r"state\.pt is damaged, or of another network\n.*--restart"):
        run(tmp_path)
    (tmp_path / STATE).write_bytes(good)
    for damaged in (b"{\n", b"\xff\n"):
        (tmp_path / LOG).write_bytes(damaged)
        with pytest.raises(InputError, match=r"the log .* is damaged"):
            run(tmp_path)


def test_a_state_of_another_network_is_refused(tmp_path: Path):
    run(tmp_path, stop_at=2)
    other = Toy()
    other.module = torch.nn.Sequential(torch.nn.Linear(8, 1))
    with pytest.raises(InputError, match=r"state\.pt is damaged, or of another network"):
        run(tmp_path, task=other)


def test_a_folder_belongs_to_one_process(tmp_path: Path):
    going = train(Toy(), TOY, tmp_path, device="cpu")
    next(going)
    with pytest.raises(ShapeProgError, match="another process trains in"):
        run(tmp_path)
    going.close()
    run(tmp_path, stop_at=1)


def test_the_folder_may_be_text(tmp_path: Path):
    next(train(Toy(), TOY, str(tmp_path / "run"), device="cpu"))
    assert state(tmp_path / "run")["step"] == 0


def test_a_loss_that_is_not_finite_ends_the_run(tmp_path: Path):
    toy = Toy()
    with torch.no_grad():
        toy.module[4].bias.fill_(torch.nan)
    cause = r"the loss of step 1 is nan because of 'square', 'size', the norm .*\n.*correct the loss.* of step 0$"
    with pytest.raises(ShapeProgError, match=cause):
        run(tmp_path, task=toy)
    assert not (tmp_path / WEIGHTS).exists()
    assert state(tmp_path)["step"] == 0


def test_the_error_of_a_run_that_diverges_says_what_its_folder_holds(tmp_path: Path):
    wild = replace(TOY, learning_rate=1e18, warm_up=0, clip_norm=0.0)
    with pytest.raises(ShapeProgError, match=r"the loss of step [2-9] is .*\n.* holds the state of step 0$"):
        run(tmp_path, settings=wild)
    begun = state(tmp_path)
    assert (begun["step"], begun["optimiser"]["state"]) == (0, {})  # type: ignore[index]
    assert same(begun["module"], Toy().module.state_dict())
    assert len(list(train(Toy(), TOY, tmp_path, device="cpu", restart=True))) == 20


def test_only_the_process_that_saves_says_what_the_folder_holds(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(loop, "_processes", lambda _: (1, 2, torch.device("cpu")))
    monkeypatch.setattr(loop, "_average", lambda _: None)
    with pytest.raises(ShapeProgError, match=r"the loss of step [2-9] is .*\n.*a lower learning rate$"):
        run(tmp_path, settings=replace(TOY, learning_rate=1e18, warm_up=0, clip_norm=0.0))


@pytest.mark.parametrize("part", ["batch", "losses"])
def test_a_restart_that_fails_before_its_first_loss_leaves_the_run_as_it_was(
    part: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    def full(*_: object) -> None:
        raise RuntimeError("out of memory")

    run(tmp_path, stop_at=5)
    kept = {name: (tmp_path / name).read_bytes() for name in (STATE, LOG)}
    task = Toy()
    monkeypatch.setattr(task, part, full)
    with pytest.raises(RuntimeError, match="out of memory"):
        list(train(task, TOY, tmp_path, device="cpu", restart=True))
    assert kept == {name: (tmp_path / name).read_bytes() for name in (STATE, LOG)}
    assert run(tmp_path)[1][0]["step"] == 7


def test_a_run_that_is_killed_before_its_first_step_begins_again_as_it_was(tmp_path: Path):
    going = train(Toy(), TOY, tmp_path / "killed", device="cpu")
    next(going)
    going.close()
    assert state(tmp_path / "killed")["step"] == 0
    other = Toy()
    with torch.no_grad():
        other.module[4].bias.fill_(7.0)  # as if another start had been drawn
    run(tmp_path / "killed", task=other)
    run(tmp_path / "whole")
    assert untimed(tmp_path / "killed") == untimed(tmp_path / "whole")


def test_weights_are_written_at_each_validation_and_the_best_kept(tmp_path: Path):
    _, records = run(tmp_path)
    scores = {each["samples_seen"]: each["val_score"] for each in records if "val_score" in each}
    assert list(scores) == [20, 40, 60, 80]
    assert read_card(tmp_path / BEST).samples_seen == max(scores, key=scores.__getitem__)
    assert read_card(tmp_path / WEIGHTS).samples_seen == 80
    assert all({"loss", "square", "size", "worst", "gradient_norm", "learning_rate"} <= each.keys() for each in records)
    assert records[0]["loss"] == pytest.approx(records[0]["square"] + records[0]["size"])


def test_the_learning_rate_rises_from_zero_and_falls_to_zero():
    settings = TrainingSettings(num_shapes=1000, batch_size=1, learning_rate=0.5, warm_up=100)
    rates = [settings.learning_rate_at(seen) for seen in range(1000)]
    assert (rates[0], rates[100], max(rates)) == (0.005, 0.5, 0.5)
    assert rates[-1] == pytest.approx(0, abs=1e-5)
    assert all(later <= sooner for sooner, later in pairwise(rates[100:]))

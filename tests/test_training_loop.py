"""The training loop: it resumes exactly, on one process or several, and says what is wrong."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
import torch
from toy_training import Toy, plain

from shapeprog.errors import InputError, OutputError, ShapeProgError
from shapeprog.training import folder as folders
from shapeprog.training.engine import Engine, scrambled
from shapeprog.training.folder import read_log
from shapeprog.training.loop import due, run
from shapeprog.training.settings import Settings
from shapeprog.training.state import card_of

SETTINGS = Settings(visits=80, batch=4, validate_every=20, warm_up=8, clip=1.0, decay=0.01)
TIMES = {"seconds"}
SCRIPT = str(Path(__file__).with_name("toy_training.py"))


@pytest.fixture(scope="module")
def engine() -> Engine:
    return Engine("cpu", threads=1)


def train(folder: Path, engine: Engine, settings: Settings = SETTINGS, **options: Any) -> tuple[Toy, list[Any]]:
    toy = options.pop("toy", None) or Toy()
    return toy, list(run(toy, settings, folder, engine, **options))


def untimed(records: list[Any]) -> list[Any]:
    return [{name: value for name, value in each.items() if name not in TIMES} for each in records]


def same(one: torch.nn.Module, two: torch.nn.Module) -> bool:
    pairs = zip(one.state_dict().values(), two.state_dict().values(), strict=True)
    return all(torch.equal(a, b) for a, b in pairs)


def test_a_stopped_run_goes_on_as_if_nothing_had_happened(tmp_path: Path, engine: Engine):
    whole, records = train(tmp_path / "whole", engine)
    for at in (3, 11):
        stop, toy = threading.Event(), Toy()
        for record in run(toy, SETTINGS, tmp_path / "parts", engine, stop=stop):
            if record["step"] == at:
                stop.set()
        assert record["step"] == at + 1
    for record in run(Toy(), SETTINGS, tmp_path / "parts", engine):
        if record["step"] == 16:
            break  # closing the generator saves too
    parts, rest = train(tmp_path / "parts", engine)
    assert [each["step"] for each in rest] == [17, 18, 19, 20]
    assert same(whole.module, parts.module)
    assert untimed(read_log(tmp_path / "parts")) == untimed(read_log(tmp_path / "whole")) == untimed(records)
    state = [(tmp_path / each / folders.STATE).read_bytes() for each in ("whole", "parts")]
    assert state[0] == state[1]
    assert train(tmp_path / "parts", engine)[1] == [], "a run that is done has nothing left to do"


def test_a_run_that_shall_end_where_it_is_leaves_its_weights(tmp_path: Path, engine: Engine):
    for record in run(Toy(), SETTINGS, tmp_path, engine):
        if record["step"] == 4:
            break
    assert not (tmp_path / folders.WEIGHTS).exists()
    assert train(tmp_path, engine, replace(SETTINGS, visits=12))[1] == []
    assert (tmp_path / folders.WEIGHTS).read_text() == "16"


def test_a_killed_run_goes_on_exactly(tmp_path: Path, engine: Engine):
    folder = tmp_path / "killed"
    words = [sys.executable, SCRIPT, "noisy", str(folder), "160"]
    with subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        for line in process.stdout:
            if int(line) >= 14:
                process.send_signal(signal.SIGKILL)
                break
    state = card_of((folder / folders.STATE).read_bytes(), "")
    assert 0 < state["step"] <= 20
    with (folder / folders.LOG).open("a") as stream:
        stream.write('{"step": 15, "vis')  # a line that was being written
    settings = Settings(visits=160, batch=4)
    resumed, rest = train(folder, engine, settings, toy=Toy(pause=1e-9))
    whole, records = train(tmp_path / "whole", engine, settings, toy=Toy(pause=1e-9))
    assert rest[0]["step"] == state["step"] + 1
    assert same(whole.module, resumed.module)
    assert untimed(read_log(folder)) == untimed(records)


def test_two_processes_are_one_with_twice_the_batch(tmp_path: Path, engine: Engine):
    """Exactly so where the loss is a mean over the shapes; batch norm would see each half by itself."""
    folder = tmp_path / "two"
    launch = [sys.executable, "-m", "torch.distributed.run", "--nproc-per-node", "2", "--standalone"]
    done = subprocess.run(
        [*launch, SCRIPT, "plain", str(folder), "48"], capture_output=True, text=True, timeout=120,
        env={**os.environ, "OMP_NUM_THREADS": "1", "CUDA_VISIBLE_DEVICES": ""}, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    one, two = (torch.load(folder / f"rank{rank}.pt", weights_only=True) for rank in (0, 1))
    assert all(torch.equal(one[name], two[name]) for name in one)
    toy, records = train(tmp_path / "one", engine, Settings(visits=48, batch=8), toy=plain(4, 2))
    for name, value in toy.module.state_dict().items():
        torch.testing.assert_close(one[name], value, atol=1e-5, rtol=0)
    losses = [each["loss"] for each in read_log(folder)]
    assert losses == pytest.approx([each["loss"] for each in records], abs=1e-5)
    with pytest.raises(ShapeProgError, match="processes was 2, is now 1"):
        train(folder, engine, Settings(visits=48, batch=4), toy=plain(4, 1))


def test_changed_settings_are_refused_by_name(tmp_path: Path, engine: Engine):
    train(tmp_path, engine)
    with pytest.raises(ShapeProgError, match=r"batch was 4, is now 8; rate was 0\.001, is now 0\.1.*"):
        train(tmp_path, engine, replace(SETTINGS, batch=8, rate=0.1))
    longer = replace(SETTINGS, visits=100, validate_every=0)
    assert [each["step"] for each in train(tmp_path, engine, longer)[1]] == [21, 22, 23, 24, 25]
    assert len(train(tmp_path, engine, restart=True)[1]) == 20
    assert len(read_log(tmp_path)) == 20


def test_a_run_begun_anew_never_goes_back_to_the_old_one(tmp_path: Path, engine: Engine):
    train(tmp_path, engine)
    going = run(Toy(), SETTINGS, tmp_path, engine, restart=True)
    next(going)
    assert card_of((tmp_path / folders.STATE).read_bytes(), "")["step"] == 0
    going.close()


def test_another_network_is_refused(tmp_path: Path, engine: Engine):
    train(tmp_path, engine)
    other = Toy()
    other.module = torch.nn.Sequential(torch.nn.Flatten(), torch.nn.Linear(64, 3))
    with pytest.raises(InputError, match="another network"):
        train(tmp_path, engine, toy=other)


DAMAGES = {
    "emptied": lambda content: b"",
    "cut": lambda content: content[:-10],
    "lengthened": lambda content: content + b"\0",
    "with one bit of a weight turned": lambda content: content[:-1] + bytes([content[-1] ^ 1]),
    "with another step": lambda content: content.replace(b'\\"step\\": 20', b'\\"step\\": 10'),
    "with an endless header": lambda content: b"\xff" * 8 + content[8:],
    "with a header that is no table": lambda content: (2).to_bytes(8, "little") + b"[]",
    "with a deep header": lambda content: (9999).to_bytes(8, "little") + b"[" * 9999,
    "of something else": lambda content: b"weights" * 99,
}  # fmt: skip


@pytest.mark.parametrize("damage", DAMAGES)
def test_a_damaged_state_is_left_alone_and_the_last_good_one_named(tmp_path: Path, engine: Engine, damage: str):
    train(tmp_path, engine, save_seconds=0)
    state, previous = tmp_path / folders.STATE, tmp_path / folders.PREVIOUS
    whole, log = state.read_bytes(), (tmp_path / folders.LOG).read_text()
    damaged = DAMAGES[damage](whole)
    assert damaged != whole
    state.write_bytes(damaged)
    with pytest.raises(InputError, match=r"is (empty|damaged).*the last good state is .*previous.* of step 19") as told:
        train(tmp_path, engine)
    assert "rename it to state.safetensors" in told.value.hint
    assert (state.read_bytes(), (tmp_path / folders.LOG).read_text()) == (damaged, log)
    previous.rename(state)
    assert [record["step"] for record in train(tmp_path, engine)[1]] == [20]
    assert state.read_bytes() == whole, "nothing was lost"


def test_a_run_without_its_state_is_not_begun_anew_unasked(tmp_path: Path, engine: Engine):
    train(tmp_path, engine)
    for name in (folders.STATE, folders.PREVIOUS):
        (tmp_path / name).unlink()
        with pytest.raises(InputError, match=r"holds the log of a run but no state\.safetensors"):
            train(tmp_path, engine)
    assert len(train(tmp_path, engine, restart=True)[1]) == 20


LOGS = {
    "a line that is no JSON": lambda lines: [*lines[:5], "{", *lines[6:]],
    "a record that is none": lambda lines: [*lines[:5], "[6]", *lines[6:]],
    "a record without numbers": lambda lines: [*lines[:5], '{"step": 6, "loss": "low"}', *lines[6:]],
    "a line without end": lambda lines: [*lines[:5], "[" * 9999, *lines[6:]],
    "a line that is no text": lambda lines: [*lines[:5], "\udcff", *lines[6:]],
    "records that are missing": lambda lines: [*lines[:5], *lines[7:]],
    "an end that is missing": lambda lines: lines[:5],
}


@pytest.mark.parametrize("damage", LOGS)
def test_a_damaged_log_is_left_alone_and_its_last_good_record_named(tmp_path: Path, engine: Engine, damage: str):
    train(tmp_path, engine, replace(SETTINGS, visits=40))
    path = tmp_path / folders.LOG
    lines = path.read_text().splitlines()
    damaged = "".join(f"{line}\n" for line in LOGS[damage](lines)).encode(errors="surrogateescape")
    path.write_bytes(damaged)
    with pytest.raises(InputError, match=r"the log .* is damaged: .*the last good record is that of step 5"):
        train(tmp_path, engine)
    assert path.read_bytes() == damaged
    path.rename(tmp_path / "old.jsonl")
    assert [record["step"] for record in train(tmp_path, engine)[1]] == list(range(11, 21))
    assert [record["step"] for record in read_log(tmp_path)] == list(range(11, 21))
    path.write_bytes(damaged)
    assert len(train(tmp_path, engine, restart=True)[1]) == 20


def test_an_emptied_log_is_no_new_one(tmp_path: Path, engine: Engine):
    train(tmp_path, engine, replace(SETTINGS, visits=40))
    (tmp_path / folders.LOG).write_text("")
    with pytest.raises(InputError, match="there is no good record"):
        train(tmp_path, engine)


def test_what_a_killed_run_was_writing_is_removed_at_the_next_start(tmp_path: Path, engine: Engine):
    (tmp_path / f".01234567~{folders.STATE}").write_bytes(b"half")
    next(run(Toy(), SETTINGS, tmp_path, engine))
    assert not [path.name for path in tmp_path.iterdir() if "~" in path.name]


def test_only_one_process_trains_into_a_folder(tmp_path: Path, engine: Engine):
    going = run(Toy(), SETTINGS, tmp_path, engine)
    next(going)
    with pytest.raises(ShapeProgError, match="another process"):
        train(tmp_path, engine)
    going.close()
    assert train(tmp_path, engine)[1][0]["step"] == 2


def test_a_full_disk_keeps_the_last_good_state(tmp_path: Path, engine: Engine, monkeypatch: pytest.MonkeyPatch):
    train(tmp_path, engine, replace(SETTINGS, visits=40))
    good = (tmp_path / folders.STATE).read_bytes()

    def full(path: Path, content: bytes) -> int:
        if folders.STATE in path.name:
            raise OSError(28, "No space left on device")
        return write(path, content)

    write = Path.write_bytes
    with monkeypatch.context() as patched:
        patched.setattr(Path, "write_bytes", full)
        with pytest.raises(OutputError, match="the disk is full"):
            train(tmp_path, engine, save_seconds=0)
    assert (tmp_path / folders.STATE).read_bytes() == good
    assert not [path for path in tmp_path.iterdir() if "~" in path.name]
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match="file of that name"):
        train(tmp_path / "file", engine)


def test_a_loss_that_is_no_number_ends_the_run(tmp_path: Path, engine: Engine):
    toy = plain(4, 1)
    with torch.no_grad():
        toy.module[3].bias.fill_(float("inf"))
    with pytest.raises(ShapeProgError, match="the loss of step 1 is inf"):
        train(tmp_path, engine, toy=toy)


def test_best_weights_are_those_of_the_best_validation(tmp_path: Path, engine: Engine):
    _, records = train(tmp_path, engine)
    scores = {each["visits"]: each["val_score"] for each in records if "val_score" in each}
    assert list(scores) == [20, 40, 60, 80]
    assert int((tmp_path / folders.BEST).read_text()) == max(scores, key=scores.__getitem__)
    assert int((tmp_path / folders.WEIGHTS).read_text()) == 80


def test_curves_for_tensorboard_are_written_when_asked_for(tmp_path: Path, engine: Engine):
    pytest.importorskip("tensorboard")
    train(tmp_path, engine, Settings(visits=8, batch=4), tensorboard=True)
    assert list((tmp_path / "tensorboard").glob("events*"))


@pytest.mark.parametrize(("package", "options"), [("accelerate", {}), ("tensorboard", {"tensorboard": True})])
def test_what_is_not_installed_is_named_with_its_cure(
    package: str, options: dict[str, bool], tmp_path: Path, engine: Engine, monkeypatch: pytest.MonkeyPatch
):
    for name in [name for name in sys.modules if name.split(".")[0] == package or "tensorboard" in name]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(ShapeProgError, match=r"pip install 'shapeprog\[train\]'"):
        train(tmp_path, engine, **options) if options else Engine("cpu")


def test_batches_come_in_order_and_their_errors_are_passed_on(engine: Engine):
    assert list(engine.ahead(lambda index: index * index, range(7))) == [n * n for n in range(7)]
    with pytest.raises(ZeroDivisionError):
        list(engine.ahead(lambda index: 1 / (3 - index), range(7)))


@pytest.mark.parametrize("schedule", ["cosine", "constant", "steps"])
def test_schedules_begin_at_zero_and_end_as_they_say(schedule: Any):
    settings = Settings(visits=1000, batch=1, rate=0.5, warm_up=100, schedule=schedule)
    rates = [settings.rate_at(visits) for visits in range(1000)]
    assert rates[0] == 0.005
    assert max(rates) == 0.5 == rates[100]
    assert rates[-1] == pytest.approx({"cosine": 0.0, "constant": 0.5, "steps": 0.02}[schedule], abs=1e-5)
    assert all(later <= sooner for sooner, later in pairwise(rates[100:]))


def test_clipping_by_norm_keeps_the_direction_and_by_value_bounds_each_element():
    gradient = torch.tensor([3.0, -4.0])
    assert float(Settings(clip=1.0).limit([gradient])) == 5
    torch.testing.assert_close(gradient, torch.tensor([0.6, -0.8]))
    gradient = torch.tensor([3.0, -0.05])
    Settings(clip=0.1, clip_by="value").limit([gradient])
    torch.testing.assert_close(gradient, torch.tensor([0.1, -0.05]))


def test_a_setting_that_a_run_did_not_know_was_as_by_default():
    begun = SETTINGS.record()
    del begun["schedule"]
    SETTINGS.check(begun, SETTINGS.record(), "here")
    constant = replace(SETTINGS, schedule="constant")
    with pytest.raises(ShapeProgError, match="schedule was 'cosine', is now 'constant'"):
        constant.check(begun, constant.record(), "here")


@pytest.mark.wrong_types
@pytest.mark.parametrize(
    "wrong", [{"schedule": "linear"}, {"visits": 0}, {"rate": float("nan")}, {"precision": "fp16"}]
)
def test_settings_that_make_no_sense_are_refused(wrong: Any):
    with pytest.raises(ShapeProgError, match=next(iter(wrong))):
        Settings(**wrong)


def test_validation_is_due_at_multiples_and_at_the_end():
    assert [step for step in range(1, 11) if due(step, 10, 4, 10)] == [3, 5, 8, 10]
    assert [step for step in range(1, 11) if due(step, 10, 4, 0)] == [10]


def test_seeds_of_steps_and_processes_differ():
    assert (
        len({scrambled(seed, step, rank) for seed in range(8) for step in range(64) for rank in range(8)}) == 8 * 64 * 8
    )

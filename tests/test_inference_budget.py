"""Rounds, steps and the seed decide what inference finds; the clock does not, and where it must, the result says so."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from itertools import accumulate, chain, repeat
from pathlib import Path

import numpy as np
import pytest
from test_inference_search import TABLE, cells

from shapeprog import view
from shapeprog.cli import main
from shapeprog.data.shape import Shape
from shapeprog.inference import Result, Settings, infer
from shapeprog.inference.budget import BUDGET
from shapeprog.inference.infer import SEARCH_SHARE

SHAPE = Shape("table", cells(TABLE))
SETTINGS = Settings(rounds=6)

Clock = Callable[[Iterator[float]], None]


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    """Have the clock go forward by these seconds from one look at it to the next."""

    def start(jumps: Iterator[float]) -> None:
        now = accumulate(jumps)
        monkeypatch.setattr(time, "monotonic", lambda: next(now))

    return start


@pytest.fixture(scope="module")
def found() -> Callable[[float], Result]:
    """What is found within a budget, by a short search, and by fitting."""

    def infer_within(budget: float) -> Result:
        return infer(
            SHAPE,
            blocks=2,
            budget=budget,
            settings=SETTINGS,
            statements="paper",
        )

    return infer_within


@pytest.mark.parametrize("seed", range(3))
def test_how_the_clock_goes_changes_nothing_below_the_budget(found: Callable[[float], Result], clock: Clock, seed: int):
    usual, total = found(BUDGET), 0.9 * SEARCH_SHARE * BUDGET
    clock(chain([0.0], np.random.default_rng(seed).dirichlet(np.full(8, 0.1)) * total, repeat(0.0)))
    odd = found(BUDGET)
    assert odd == usual
    assert not odd.cut
    assert "budget" not in odd.reason
    assert odd.seconds == pytest.approx(total)


def test_a_result_is_either_the_usual_one_or_says_what_the_budget_cut_short(
    found: Callable[[float], Result], clock: Clock
):
    usual, seen = found(float("inf")), set[str]()
    for budget in (0.0, 4.0, 8.0, 12.0, 30.0, 100.0):
        clock(repeat(1.0))
        hurried = found(budget)
        assert hurried.cut or hurried == usual
        assert ("--budget" in hurried.reason) == bool(hurried.cut)
        assert all(work in hurried.reason for work in hurried.cut)
        assert hurried.snapped.size, "there is a program even without any time"
        stages = {work.split()[1] for work in hurried.cut}
        stopped = "" if "search" in stages else "all 6 rounds"
        assert hurried.reason.startswith(f"The search ended after {stopped}")
        seen |= stages or {"nothing"}
    assert seen == {"search", "refinement", "nothing"}


def test_the_same_seed_writes_the_same_files_whatever_the_clock_says(
    tmp_path: Path, clock: Clock, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(view, "picture", lambda _shape, _program, path, scores: path.write_text(repr(scores)))
    np.save(tmp_path / "table.npy", SHAPE.voxels)
    for folder, jump in (("one", 1e-3), ("two", 2e-2)):
        clock(repeat(jump))
        with pytest.raises(SystemExit) as end:
            main(f"infer {tmp_path}/table.npy --out {tmp_path}/{folder} --rounds 2 --blocks 2 --quiet".split())
        assert not end.value.code
    one, two = ({path.name: path.read_bytes() for path in (tmp_path / name).iterdir()} for name in ("one", "two"))
    assert sorted(one) == ["table.glb", "table.json", "table.png", "table.shape"]
    assert one == two

"""The experiment: how rows become a table, how runs depend on each other, and blocks beyond the synthetic ranges."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import torch

from benchmarks.experiment import extrapolation
from benchmarks.experiment.document import extrapolation_table
from benchmarks.experiment.efficiency import Curve, mean_curve, visits_to_reach
from benchmarks.experiment.measuring import ARGMAX
from benchmarks.experiment.recipes import CATEGORIES, RECIPES
from benchmarks.experiment.stages import Experiment, Run, runs
from benchmarks.experiment.tables import DIRECT, GUIDED, ORDER, cell, reached, table
from shapeprog.geometry.cells import voxels
from shapeprog.language.statement import language
from shapeprog.language.tensors import Code
from shapeprog.language.unroll import unroll

MEASURES = {"f1": 0.5, "blocks": 3, "statements": 4, "primitives": 5, "cpu_seconds": 0.02, "noise_floor": 0.0001}


def row(
    cd: float, seed: int = 0, method: str = "guided", name: str = "a", pack: str = "bench_test"
) -> dict[str, object]:
    found = {"cd": cd, "iou": 0.7, "drawn_iou": float("nan"), "seed": seed, "method": method, "name": name}
    return {**found, "pack": pack, **MEASURES}


def test_one_seed_is_told_by_its_standard_error() -> None:
    values = [0.001, 0.002, 0.006]
    assert cell([row(value) for value in values], "cd") == "3.00 ± 1.53 (2.00)"
    assert np.std(values, ddof=1) / np.sqrt(3) == pytest.approx(0.00153, abs=1e-5)


def test_several_seeds_are_told_by_the_spread_of_their_means() -> None:
    rows = [row(0.001, 0), row(0.003, 0), row(0.005, 1), row(0.007, 1)]
    assert cell(rows, "cd") == "4.00 ± 2.83 (4.00)"


def test_what_no_shape_has_is_a_dash() -> None:
    assert cell([row(0.001)], "drawn_iou") == "-"


def test_a_table_holds_the_rows_of_its_pack_in_order() -> None:
    rows = [
        row(0.002, method="guided"),
        row(0.001, method="greedy boxes"),
        row(9, pack="cabinet_test", method="search"),
    ]
    lines = table(rows, "bench_test").splitlines()
    assert [line.split("|")[1].strip() for line in lines[2:4]] == ["greedy boxes", "guided"]
    assert lines[-1].startswith("1 shapes; noise floor of CD x 1000: 0.10")
    assert table(rows, "chair_test") == ""


def test_what_was_missed_is_said() -> None:
    rows = [row(0.0079, method=GUIDED + ARGMAX), row(0.0092, method=GUIDED + ARGMAX, pack="cabinet_test")]
    rows += [row(0.0015, method="hybrid", seed=2), row(0.0079 / 4, method=DIRECT + ARGMAX)]
    lines = reached(rows, {"bench": ("hybrid", 2)}).splitlines()
    assert lines[3].endswith("| <= 7.80 | 7.90 (missed) | <= 9.20 | 9.20 |")
    assert lines[5].endswith("| <= 0.50 | 0.25 | <= 0.50 | - |")
    assert lines[8].endswith("| <= 1.40 | 1.50 (missed) | <= 1.90 | - |")


def test_every_row_has_a_place() -> None:
    assert len(set(ORDER)) == len(ORDER)
    assert {recipe.row for recipe in RECIPES.values() if recipe.row} <= set(ORDER)


def test_runs_follow_what_they_need(tmp_path: Path) -> None:
    experiment = Experiment(tmp_path / "packs", tmp_path / "results")
    order = runs()
    assert len({run.name for run in order}) == len(order)
    for place, run in enumerate(order):
        assert set(experiment.needs(run)) <= set(order[:place])
    assert {run.category for run in runs(["guided"])} == set(CATEGORIES)
    assert [run.seed for run in runs(["guided"], "bench", 1)] == [1]


def test_a_run_is_finished_by_the_command_that_is_asked_for(tmp_path: Path) -> None:
    experiment, run = Experiment(tmp_path / "packs", tmp_path / "results"), Run("direct", "bench", 1)
    assert "--seed 1 --val PACKS/bench_val.npz" in experiment.command(run)
    assert str(tmp_path) not in experiment.command(run)
    experiment.folder(run).mkdir(parents=True)
    note = experiment.folder(run) / "finished.json"
    note.write_text(json.dumps({"command": experiment.command(run)}))
    assert experiment.finished(run)
    assert not Experiment(tmp_path / "packs", tmp_path / "results", share=0.5).finished(run)


def test_visits_to_reach_a_score_are_read_along_the_curve() -> None:
    curve = Curve(np.array([0.0, 100, 200]), np.array([4.0, 2, 1]))
    assert [visits_to_reach(curve, cd) for cd in (5, 4, 3, 1, 0.5)] == [0, 0, 50, 200, np.inf]
    shorter = Curve(np.array([0.0, 100]), np.array([2.0, 2]))
    assert mean_curve([curve, shorter]).cd.tolist() == [3, 2]


@pytest.mark.parametrize("kinds", extrapolation.KINDS.values(), ids=list(extrapolation.KINDS))
def test_blocks_leave_the_range_and_stay_in_the_grid(kinds: tuple[str, ...]) -> None:
    ranges = extrapolation.ranges_of(extrapolation.blocks_of("narrow", 2000, 0))
    distance = 3
    ids, parameters = extrapolation.sample("narrow", ranges, kinds, distance, 40, 1)
    assert len(ids) == 40
    free = extrapolation.slots_of(kinds)[ids]
    low, high = ranges.low[ids], ranges.high[ids]
    beyond = torch.maximum(parameters - high, low - parameters)[free]
    assert float(beyond.max()) == distance
    moved = (torch.maximum(parameters - high, low - parameters).nan_to_num(0, 0, 0) * free).flatten(1).amax(1)
    assert bool((moved >= distance - 1).all())  # ranges are read from other programs
    scene = unroll(Code(ids[:, None], parameters[:, None]))
    assert bool(extrapolation.in_grid(scene).all())
    assert bool(voxels(scene).flatten(1).any(1).all())


def test_every_slot_has_one_kind() -> None:
    kinds = [extrapolation.slots_of((kind,)) for kind in ("length", "position", "shift", "count", "turn")]
    used = sum(each.int() for each in kinds)
    assert int(used.sum()) == sum(declared.size for declared in language() if declared.taught)


def test_extrapolation_is_told_by_what_is_moved_and_who_draws() -> None:
    rows = [{"moved": "a length", "drawn by": "renderer", "beyond": place, "iou": 0.9} for place in (0, 2)]
    assert extrapolation_table(rows).splitlines()[-1] == "| a length | renderer | 0.900 | 0.900 |"

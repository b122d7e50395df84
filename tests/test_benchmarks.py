"""What the benchmarks of planted programs and of labels count, on cases whose answer is known."""

from __future__ import annotations

import json
import runpy
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from declared import LANGUAGE

import shapeprog as sp
from benchmarks import labels, library, planted, ties
from shapeprog.language import standard, using
from shapeprog.language.ast import Assignment
from shapeprog.language.expression import Name
from shapeprog.language.parser import parse
from shapeprog.language.program import Draw, Loop

TABLE = """\
box(at=(6, -9, -12), size=(2, 18, 24))
for i in mirror(side):
    leg(taper(start=(-8, 0, 10), end=(6, 0, 8), radius=(0.5, 1)))
"""


def compared(found: str) -> dict[str, float]:
    one, two = parse(TABLE), parse(found)
    return planted.solid_scores(one, sp.unroll(one), two, sp.unroll(two))


SCRIPTS = sorted(path for path in Path(labels.__file__).parent.glob("*.py") if "__main__" in path.read_text())


@pytest.mark.parametrize("path", SCRIPTS, ids=lambda path: path.stem)
def test_every_benchmark_says_what_it_takes(path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Any) -> None:
    monkeypatch.setattr(sys, "argv", [path.name, "--help"])
    with pytest.raises(SystemExit, match=r"^0$"):
        runpy.run_path(str(path), run_name="__main__")
    assert f"usage: {path.name}" in capsys.readouterr().out


def test_a_planted_program_that_is_found_as_it_is_scores_in_full() -> None:
    scores = compared(TABLE)
    assert (scores["solid_recall"], scores["solid_precision"], scores["statements"]) == (1, 1, 1)


def test_parts_that_are_missed_split_or_called_otherwise_count_against_it() -> None:
    found = """\
top(box(at=(6, -9, -12), size=(2, 18, 24)))
leg(taper(start=(-8, 0, 10), end=(6, 0, 8), radius=(0.5, 1)))
brace(rod(start=(-8, 0, -10), end=(-2, 0, -9.1), radius=0.7))
"""
    scores = compared(found)
    assert scores["solid_recall"] == pytest.approx(2 / 3)
    assert scores["solid_precision"] == pytest.approx(2 / 3)
    assert scores["roles"] == pytest.approx(1 / 2)


def test_overlaps_of_solids_are_those_of_their_volumes() -> None:
    one = sp.unroll(parse("box(at=(0, 0, 0), size=(4, 4, 4))"))
    two = sp.unroll(parse("box(at=(0, 0, 2), size=(4, 4, 4))\nrod(start=(0, 2, 2), end=(4, 2, 2), radius=1)"))
    np.testing.assert_allclose(planted.solid_overlaps(one, two), [[1 / 3, np.pi / 16]], atol=0.01)


def test_a_user_finds_the_example_when_it_stands_for_every_leg() -> None:
    with using(LANGUAGE):
        text = planted.cone_table(np.random.default_rng(3))
        one, legs = parse(text), text.count("cone_leg")
        assert legs in (3, 4)
        assert planted.solid_scores(one, sp.unroll(one), one, sp.unroll(one))["found"] == 1
        fewer = parse("\n".join(text.splitlines()[:-1]))
        assert planted.solid_scores(one, sp.unroll(one), fewer, sp.unroll(fewer))["found"] == 0


def test_labels_are_counted_by_declared_words_fitted_words_and_blocks(tmp_path: Path) -> None:
    chair = {
        "method": "all", "labels": ["back", "seat", "leg", "arm"],
        "counted": [("seat", [0, 50, 10, 0]), ("leg", [0, 0, 20, 0]), ("leg", [20, 0, 0, 0])],
    }  # fmt: skip
    with using(standard):
        (tmp_path / "rows.jsonl").write_text(json.dumps(chair) + "\n")
        row = labels.table(tmp_path / "rows.jsonl").splitlines()[-1]
    back, seat, leg = 0, 50 / 60, 20 / 50
    assert row.startswith(f"| all, 1 | 0.700 / {(back + seat + leg) / 3:.3f} |")
    assert row.endswith(f"0.900 / {(1 + 50 / 60 + 20 / 30) / 3:.3f} |")


def test_what_stitch_calls_counts_as_a_statement_where_it_holds_any() -> None:
    a = Name("a")
    arm = Draw("box", (0.0, a / 2, 1 - a, 1.0, -a, 2.0), "arm")
    leg = Draw("leg", (0.0, 0.0, 0.0, 1.0, 1.0, 1.0))
    lines = (Assignment((("a", 3.0),)), Loop("mirror", (2.0, 2.0, 0.0), (arm,)), leg)
    arms = "(mirror 2 side 0 (arm_of (box 0 (/ a 2) (- 1 a) 1 (neg a) 2)))"
    assert library.expression(lines, whole=False) == f"(seq {arms} (leg 0 0 0 1 1 1))"
    assert library.expression(lines[2:], whole=True) == "(leg 0 0 0 1 1 1)"
    assert library.statements_of_stitch(library.expression(lines, whole=False), ()) == 3
    functions = (("fn_0", "(/ #0 2)"), ("fn_1", "(mirror 2 side 0 (arm_of #0))"), ("fn_2", "(fn_1 (box 0 #0 1 1 1 2))"))
    assert library.statements_of_stitch("(seq (fn_2 (fn_0 a)) (leg 0 (fn_0 a) 0 1 1 1))", functions) == 2


NAMED = """\
width, depth, height = 10, 8, 24
thick = 1
box(left=3, width=3, depth=thick, bottom=2, height=4)
box(left=3, width=5, depth=thick, bottom=7, height=5)
"""


def test_features_follow_from_names_and_plain_numbers() -> None:
    program = parse(NAMED)
    plain = sp.inline(program)
    ways, own = ties.slopes(program, plain), ties.plain_slopes(plain)
    assert ways.shape == (2 * ties.PER, 1 + 12)  # lifting, four names and eight numbers
    assert own.shape == (2 * ties.PER, 1 + 12)
    rows = ties.relations_written(len(own))
    held = rows[np.abs(rows @ ways).max(1) < 1e-3]
    assert ties.rank(held @ own) == 3  # two middles at zero and equal thickness


def test_parts_are_compared_wherever_they_are_written() -> None:
    box = "box(at=(4, 0, 0), size=(1, 1, 1))\n"
    here = parse("for _ in mirror(side):\n    box(at=(0, 0, 2), size=(1, 2, 3))\n" + box)
    there = parse(box + "for _ in translate(2, by=(0, 0, 7)):\n    box(at=(0, 0, -5), size=(1, 2, 3))\n")
    ways = ties.slopes(there, here)
    assert ways.shape[0] == 2 * ties.PER
    first, second = ways.reshape(2, ties.PER, -1)
    assert (first != 0).any(0).sum() == 1 + 5  # lifting, a shift, a place and three sizes
    assert (second != 0).any(0).sum() == 1 + 4


def test_furniture_that_is_drawn_again_is_designed_alike() -> None:
    numbers = ties.redrawn(1004, 0)
    assert len(numbers) > ties.VARIANTS / 2
    assert np.ptp(numbers, axis=0).max() > 1
    rows = ties.relations_written(numbers.shape[1])
    always = rows[np.abs(rows @ numbers.T).max(1) <= ties.ROUNDED]
    assert 0 < ties.rank(always) < numbers.shape[1]


@pytest.mark.parametrize("number", range(12))
def test_planted_groups_are_programs_with_as_many_equal_parts(number: int) -> None:
    kind, role, text = ties.design(number, np.random.default_rng(number))
    program = parse(text)
    assert f"{kind}(" in text
    assert sum(chain[-1].role == role for chain in program.chains) == 1
    corners = ties.sides(sp.unroll(program))[0][:, 0]
    assert np.abs(corners[:, :6]).max() <= 16

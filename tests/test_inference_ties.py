"""Ties: relations that hold are found, what is free is named, and what is written with names draws the same."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import torch
from typer.testing import CliRunner

import shapeprog as sp
from shapeprog.cli.app import app
from shapeprog.evaluation.editing import edit_scores
from shapeprog.inference.evidence import evidence_of_program
from shapeprog.inference.ties.features import features
from shapeprog.inference.ties.fitting import ways_free
from shapeprog.inference.ties.pricing import worthwhile
from shapeprog.inference.ties.relations import Relation
from shapeprog.inference.ties.tying import tie
from shapeprog.inference.tunable import Tunable
from shapeprog.language.free import free_numbers, free_values, multiplied, numbers
from shapeprog.language.program import Draw, Program
from shapeprog.language.text import format_program
from shapeprog.language.unroll import unroll

TABLE = """
top(box(at=(5.02, -7.97, -12.03), size=(0.98, 15.98, 24.01)))
for i in mirror(side):
    for j in mirror(depth):
        leg(at=(-5.98, 6.03, 10.02), size=(11.03, 1.48, 1.52))
for i in mirror(side):
    stretcher(box(at=(-3.01, -6.02, 10.49), size=(0.51, 12.01, 0.52)))
"""
"""A table whose numbers are off by hundredths from: height 12, depth 16, width 24, thicknesses 1, 1.5 and .5."""


def tied_table() -> Program:
    program = sp.parse(TABLE)
    return tie(program, evidence_of_program(program)).program


def test_a_table_is_written_with_few_names_and_draws_nearly_the_same():
    program, tied = sp.parse(TABLE), tied_table()
    assert free_numbers(tied) <= 10
    assert numbers(program) == 18
    named = {each.name: each.value for each in sp.names(tied)}
    assert named["width"] == pytest.approx(24, abs=0.1)
    assert named["depth"] == pytest.approx(16, abs=0.1)
    assert named["height"] == pytest.approx(12, abs=0.1)
    one, two = unroll(program), unroll(tied)
    for ours, theirs in ((one.size, two.size), (one.centre, two.centre)):
        assert (ours - theirs).abs().max() < 0.15


def test_the_text_of_a_tied_program_reads_back():
    tied = tied_table()
    assert sp.parse(format_program(tied)) == tied


def test_a_wider_table_keeps_its_contacts_its_symmetry_and_is_one_piece():
    tied = tied_table()
    wide = sp.set(tied, width=36)
    legs = [tuple(place) for place in unroll(wide).centre[1:5, 1:].tolist()]
    assert all(abs(abs(side) - (18 - 1.2)) < 0.3 for _, side in legs)  # as far from the edge as they were
    scores = edit_scores(tied)
    assert scores.symmetry == 1
    assert scores.contacts >= 0.95
    assert scores.one_piece >= 0.95
    assert edit_scores(sp.parse(TABLE)).contacts < 0.9


def test_tidy_writes_what_was_tied(tmp_path: Path):
    given, out = tmp_path / "table.shape", tmp_path / "tidy.shape"
    given.write_text(TABLE)
    result = CliRunner().invoke(app, ["tidy", str(given), str(out)])
    assert result.exit_code == 0, result.output
    assert sp.load(out) == tied_table()
    assert "numbers are free; 18 were" in result.stderr.replace("\n", " ")


def test_tying_again_changes_no_number_of_the_table():
    tied = tied_table()
    again = tie(tied, evidence_of_program(tied)).program
    assert free_numbers(again) <= free_numbers(tied)
    assert (unroll(again).centre - unroll(tied).centre).abs().max() < 0.03


def test_a_program_without_relations_keeps_its_numbers():
    program = sp.parse(
        "box(at=(-3.1, 1.7, 2.9), size=(7.3, 4.9, 3.1))\nbox(at=(5.3, -6.1, -8.7), size=(2.2, 1.1, 5.9))\n"
    )
    tied = tie(program, evidence_of_program(program)).program
    torch.testing.assert_close(unroll(tied).centre, unroll(program).centre, atol=0.1, rtol=0)


def test_what_draws_nothing_is_left_alone():
    assert tie(Program(), evidence_of_program(sp.parse(TABLE))).program == Program()


def test_features_say_where_sides_are_when_numbers_change():
    tunable = Tunable(
        sp.parse(TABLE + "for i in translate(3, by=(1.5, 0, 0)):\n    shelf(box(at=(-4, -3, -2), size=(0.3, 6, 4)))\n")
    )
    known = features(tunable, tunable.poses(tunable.values))
    random = np.random.default_rng(0)
    moved = tunable.values.numpy() * random.uniform(0.9, 1.1, len(tunable.values))
    scene = tunable.poses(torch.from_numpy(moved)).scene
    low, high = scene.centre - scene.size[:, :3], scene.centre + scene.size[:, :3]
    drawn = [n for n, node in enumerate(tunable.nodes) if isinstance(node, Draw)]
    numbers_now = np.concatenate([moved, np.zeros(3)])
    checked = 0
    for each in known:
        if each.kind in ("low", "high") and each.node in drawn:
            slots = (scene.block == drawn.index(each.node)).nonzero()[:, 0]
            ends = (low if each.kind == "low" else high)[slots if each.all else slots[:1], each.axis]
            assert each.at(numbers_now) == pytest.approx(
                float(ends.min() if each.kind == "low" else ends.max()), abs=1e-9
            )
            checked += 1
    assert checked > 20


def test_a_relation_is_worth_having_where_its_price_is_below_that_of_a_number():
    # The misfit (x - 1)^2 + (y - 1.2)^2 rises by .02 where x = y, which is then 1.1.
    equal = Relation(np.array([1.0, -1.0]), 1.0)
    start, low = np.array([1.0, 1.2]), np.full(2, -np.inf)
    rows, at = worthwhile([equal], start, np.eye(2), 0.021, fixed=np.zeros((0, 2)), low=low)
    np.testing.assert_allclose(at, [1.1, 1.1])
    assert len(rows) == 1
    rows, at = worthwhile([equal], start, np.eye(2), 0.019, fixed=np.zeros((0, 2)), low=low)
    np.testing.assert_allclose(at, start)
    assert not len(rows)


def test_no_relation_moves_a_number_below_its_least():
    same = Relation(np.array([1.0, -1.0]), 1.0)
    rows, _ = worthwhile(
        [same], np.array([1.0, 1.2]), np.eye(2), 1.0, fixed=np.zeros((0, 2)), low=np.array([0.9, 1.15])
    )
    assert not len(rows)


def test_relations_hold_for_the_ways_that_are_free():
    rows = np.array([[1.0, -1, 0, 0], [0, 0, 1, -2]])
    ways = ways_free(rows, 4)
    assert ways.shape == (4, 2)
    np.testing.assert_allclose(rows @ ways, 0, atol=1e-12)


def test_what_says_how_often_something_is_repeated_is_no_free_number():
    text = "pairs, wide = 2, 7\n\ndef row(n, gap):\n    for i in translate(n, by=(0, gap, 0)):\n"
    text += "        leg(at=(0, 0, 0), size=(3, 1, 1))\n\ndef rows(n, gap):\n    row(n=n, gap=gap)\n\n"
    text += "rows(n=3, gap=2)\nrow(n=pairs, gap=wide)\n"
    program = sp.parse(text)
    assert free_values(program) == [7, 3, 1, 1, 2]
    assert multiplied(program, 4, 1.5).body[0].values == (3, 0, 3, 0)


def test_free_numbers_are_those_that_nothing_else_gives():
    program = sp.parse("""
a, b = 4, 2
c = a / 2
for i in translate(3, by=(0, 0, c)):
    box(at=(-a, 0, 1.5), size=(b, a, 1))
""")
    assert free_numbers(program) == numbers(program) == 4  # a, b, 1.5 and 1; no zero, no count
    scene = unroll(multiplied(program, 0, 2.0))
    assert (2 * scene.size[0, :3]).tolist() == [2, 8, 1]
    assert (scene.centre[1] - scene.centre[0]).tolist() == [0, 0, 4]


def test_edits_of_two_boxes_that_touch_are_as_known():
    # One stands on the other. Seven of the eight edits that move or stretch in height part or join them as follows.
    program = sp.parse("box(at=(0, -1, -1), size=(2, 2, 2))\nbox(at=(2, -1, -1), size=(2, 2, 2))\n")
    scores = edit_scores(program)
    assert scores.free == 11
    parted = 2  # the upper lifted by a fifth; the lower made shorter by one
    assert scores.contacts == pytest.approx(1 - parted / 22)
    assert scores.one_piece == pytest.approx(1 - parted / 22)

"""What adaptation learns from: targets, labels, and the terms that compare."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from shapeprog.data.packs import write_pack
from shapeprog.data.shape import Shape
from shapeprog.errors import InputError, ShapeProgError
from shapeprog.formats.json_form import program_to_json
from shapeprog.geometry.losses import chamfer
from shapeprog.geometry.surface import sample_surface
from shapeprog.language.converting import in_unit
from shapeprog.language.text import parse
from shapeprog.language.unit import Unit
from shapeprog.language.unroll import unroll
from shapeprog.models.vocabulary import Vocabulary
from shapeprog.training.labels import perturbed, read_labels, rendered
from shapeprog.training.shapes import TargetStream
from shapeprog.training.terms import NEURAL, TERMS, Comparison, compare, lacking, parse_terms

TEXTS = (
    "top_rectangle(at=(4, 0, 0), thickness=2, half=(9, 11))\nleg(at=(-12, -8, -10), size=(16, 2, 2))\n",
    "leg(at=(-6, -10, 3), size=(9, 20, 5))\n",
    "for i in translate(2, by=(0, 0, 18)):\n    leg(at=(-12, -5, -10), size=(20, 10, 3))\n",
)


@pytest.fixture(scope="module")
def pack(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three shapes; the second is known by its cells alone, so points are kept for none of them."""
    shapes = [Shape(f"s{n}", unroll(parse(text)).voxels().numpy().astype(np.bool_)) for n, text in enumerate(TEXTS)]
    path = tmp_path_factory.mktemp("pack") / "few.npz"
    write_pack(path, shapes)
    return path


def test_every_shape_comes_once_before_any_comes_again(pack: Path):
    stream = TargetStream([pack, pack], 4, seed=1, points=50)
    assert stream.names == ["s0", "s1", "s2"] * 2
    places = torch.cat([stream[index].place for index in range(3)])
    assert sorted(places[:6].tolist()) == sorted(places[6:].tolist()) == list(range(6))
    assert places[:6].tolist() != places[6:].tolist()
    again = TargetStream([pack, pack], 4, seed=1, points=50)[1]
    for name, value in vars(stream[1]).items():
        assert torch.equal(value, getattr(again, name))
    assert set(TargetStream([pack], 4, seed=1, points=9, places=np.array([2]))[0].place.tolist()) == {2}


def test_mirrored_targets_are_those_of_the_mirrored_shape(pack: Path):
    turned, plain = (TargetStream([pack], 3, seed=0, points=200, mirror=share)[0] for share in (1.0, 0.0))
    assert bool(turned.mirrored.all())
    for cells, points, place in zip(turned.cells, turned.points, turned.place, strict=True):
        before = plain.cells[plain.place.tolist().index(int(place))]
        assert torch.equal(cells, before.flip(-1))
        # Guessed points lie within the touched cells, whichever way they are turned.
        inside = (points + 16 - 1e-4 * points.sign()).floor().long()
        assert bool(cells[inside[:, 0], inside[:, 1], inside[:, 2]].all())


def test_labels_are_read_from_lines_and_folders(pack: Path, tmp_path: Path):
    lines = [
        {"name": "s0", "program": TEXTS[1], "snapped": TEXTS[0]},
        {"name": "s1", "program": json.loads(program_to_json(parse(TEXTS[1])))["program"]},
        {"name": "stranger", "program": TEXTS[1]},
    ]
    path = tmp_path / "labels.jsonl"
    path.write_text("".join(json.dumps(line) + "\n" for line in lines))
    names, vocabulary = ["s0", "s1", "s2"], Vocabulary.current()
    found = read_labels([path], names, vocabulary, 4)
    assert found.known.tolist() == [True, True, False]
    assert (found.code.ids[0, :, 0] > 0).tolist() == [True, True, False, False]
    cells = rendered(found.code)
    for place, text in enumerate(TEXTS[:2]):
        assert torch.equal(cells[place], unroll(parse(text)).voxels())
    as_it_is = read_labels([path], names, vocabulary, 4, "program")
    assert as_it_is.code.ids[0, 1, 0] == 0
    folder = tmp_path / "more"
    folder.mkdir()
    (folder / "s2.shape").write_text(TEXTS[2])
    assert bool(read_labels([path, folder], names, vocabulary, 4).known.all())
    with pytest.raises(InputError, match="has no program for any of the shapes"):
        read_labels([folder], ["a", "b"], vocabulary, 4)
    for line in ('{"name": "s0"}', "[" * 9999, f'{{"name": "s0", "program": {"[" * 980}{"]" * 980}}}', "3"):
        path.write_text(f"{line}\n")
        with pytest.raises(InputError, match=r"line 1 of labels\.jsonl(: \S+)? is no(t a)? (label|list|statement)"):
            read_labels([path], names, vocabulary, 4)


def test_labels_in_a_unit_are_those_in_cells(tmp_path: Path):
    unit, path = Unit("cm", 4), tmp_path / "labels.jsonl"
    told = json.loads(program_to_json(in_unit(parse(TEXTS[1]), unit)))
    whole = {"snapped": json.loads(program_to_json(parse(TEXTS[0])))["program"]}
    for form, more, text in (("program", whole, TEXTS[1]), ("snapped", whole, TEXTS[0]), ("snapped", {}, TEXTS[1])):
        path.write_text(json.dumps({"name": "s", **told, **more}) + "\n")
        found = read_labels([path], ["s"], Vocabulary.current(), 4, form)
        assert torch.equal(rendered(found.code)[0], unroll(parse(text)).voxels())


def test_blocks_that_cannot_be_said_are_left_out(tmp_path: Path):
    deep = "".join(f"{'    ' * n}for i{n} in translate(2, by=(0, 0, 9)):\n" for n in range(3))
    (tmp_path / "s.shape").write_text(f"{deep}            leg(at=(0, 0, 0), size=(2, 2, 2))\n{TEXTS[0]}")
    found = read_labels([tmp_path], ["s"], Vocabulary.current(), 4)
    assert found.dropped == 1
    assert torch.equal(rendered(found.code)[0], unroll(parse(TEXTS[0])).voxels())
    assert read_labels([tmp_path], ["s"], Vocabulary.current(), 1).dropped == 2


def test_perturbed_labels_draw_what_is_shown_and_stay_near(pack: Path, tmp_path: Path):
    for number, text in enumerate(TEXTS):
        (tmp_path / f"s{number}.shape").write_text(text)
    vocabulary = Vocabulary.current()
    code = read_labels([tmp_path], ["s0", "s1", "s2"], vocabulary, 3).code
    moved, cells = perturbed(code, vocabulary, 0.5, torch.Generator().manual_seed(0))
    assert torch.equal(rendered(moved), cells)
    assert torch.equal(moved.ids, code.ids)
    jump = moved.parameters - code.parameters
    assert set(jump.unique().tolist()) == {-1.0, 0.0, 1.0}
    fixed = ~(vocabulary.used & ~vocabulary.discrete)[code.ids]
    assert bool((jump[fixed] == 0).all())
    low, high = vocabulary.ranges[code.ids].unbind(-1)
    assert bool(((moved.parameters >= low) & (moved.parameters <= high))[~fixed].all())
    still, same = perturbed(code, vocabulary, 0.0, torch.Generator().manual_seed(0))
    assert torch.equal(still.parameters, code.parameters)
    assert torch.equal(same, rendered(code))


@pytest.mark.parametrize(
    ("text", "words"),
    [("chamfre=1", "did you mean 'chamfer'"), ("chamfer=one", "positive number"), ("chamfer=-1", "positive number"),
     ("chamfer,chamfer", "given twice"), ("", "choose from"), ("shadow=1", "choose from chamfer, coverage")],
)  # fmt: skip
def test_losses_that_are_not_known_are_refused_in_words(text: str, words: str):
    with pytest.raises(ShapeProgError, match=words):
        parse_terms(text)


def test_losses_are_read_with_their_weights():
    assert parse_terms("coverage=1, excess=0.5,volume=1e-4,neural") == {
        "coverage": 1, "excess": 0.5, "volume": 1e-4, NEURAL: 1
    }  # fmt: skip


def comparison(text: str, other: str, samples: int = 4000) -> Comparison:
    scene, target = unroll([parse(text)]), unroll([parse(other)])
    points = sample_surface(target, 2000, torch.Generator().manual_seed(0)).points
    return Comparison(scene, points, target.voxels(), samples, torch.Generator().manual_seed(1))


def test_every_term_is_small_for_the_right_program_and_larger_for_another():
    right, wrong = comparison(TEXTS[0], TEXTS[0]), comparison(TEXTS[1], TEXTS[0])
    for name in set(TERMS) - {"volume", "parts"}:
        assert float(TERMS[name](right)[0]) < 0.45 < float(TERMS[name](wrong)[0]), name
    assert compare(wrong, {"parts": 2.0, NEURAL: 1.0})["parts"].tolist() == [2.0]
    assert float(TERMS["volume"](wrong)[0]) == 9 * 20 * 5


def test_soft_iou_comes_near_the_hard_one():
    seen = comparison("leg(at=(-8, -8, -8), size=(16, 16, 16))\n", "leg(at=(-8, -8, -8), size=(16, 16, 8))\n")
    assert float(TERMS["soft_iou"](seen)[0]) == pytest.approx(0.5, abs=0.08)


def test_nothing_counts_as_a_point_in_the_centre():
    cloud = torch.randn(1, 500, 3) * 5
    weights = dict.fromkeys(TERMS, 1.0)
    found: dict[str, Any] = lacking(cloud, weights)
    assert set(found) == set(TERMS)
    torch.testing.assert_close(found["chamfer"], chamfer(torch.zeros(1, 1, 3), cloud))

"""Program files that are hard to read: each ends in a program or in words, and in time that grows with its length."""

from __future__ import annotations

import base64
import io
import itertools
import json
import os
import re
import sys
from pathlib import Path

import numpy as np
import pytest

from shapeprog import data
from shapeprog.cli import main, writing
from shapeprog.data import loading
from shapeprog.errors import InputError, OutputError, ProgramError, ShapeProgError
from shapeprog.files import write_text
from shapeprog.formats import export, load, save
from shapeprog.formats.json_form import program_from_json, program_to_json, read_result
from shapeprog.formats.parts import crease_normals, parts
from shapeprog.formats.shape import LARGEST_FILE, program_in, read_text
from shapeprog.language import Draw, Loop, Program, unroll
from shapeprog.language.parser import parse
from shapeprog.language.printer import format_program
from shapeprog.language.text import LONGEST
from shapeprog.language.unroll import MOST_COPIES
from shapeprog.space import Frame
from shapeprog.view import viewer
from shapeprog.view.page import scores_text

LEG = "leg(at=(1, 2, 3), size=(1, 2, 3))"
PROGRAM = parse(LEG)
PLATE = data.shape_from_voxels(np.ones((32, 32, 32), bool))


@pytest.mark.parametrize("digits", [39, 310, 400, 5000])
def test_whole_numbers_of_any_length_are_refused_in_words(digits: int) -> None:
    number = "9" * digits
    words = r"too large|too many digits|cannot be read|limit \(4300 digits\)"
    with pytest.raises(ShapeProgError, match=words):
        program_from_json(program_to_json(PROGRAM).replace("(1, ", f"({number}, "))
    with pytest.raises(ShapeProgError, match=words):
        parse(LEG.replace("1", number))
    with pytest.raises(ProgramError, match="no frame of a text"):
        program_in(f"# placed: up y, front z, origin 0 0 0, 1 unit = {number + '0' * 300}\n{LEG}", "x")


@pytest.mark.parametrize("depth", [500, 990, 100_000])
def test_what_is_nested_deeply_is_refused_in_words(depth: int, tmp_path: Path) -> None:
    nested = "[" * depth + "]" * depth
    text = program_to_json(PROGRAM)[:-3]
    (tmp_path / "one.json").write_text(f'{text}, "snapped": {nested}}}')
    with pytest.raises(InputError, match=r"nested too deeply|not a string"):
        assert read_result(tmp_path / "one.json").snapped
    with pytest.raises(ProgramError):
        parse(f"leg(at={'-' * depth}1)")


def test_texts_are_as_long_as_can_be_read_back() -> None:
    many = Program(PROGRAM.body * (LONGEST // len(LEG)))
    with pytest.raises(ShapeProgError, match="letters"):
        format_program(many)
    with pytest.raises(ProgramError, match="letters"):
        parse("\n" * (LONGEST + 1))


def test_only_regular_files_of_a_programs_size_are_read(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.shape")
    with pytest.raises(InputError, match="a pipe, a socket or a device"):
        load(tmp_path / "pipe.shape")
    (tmp_path / "endless.json").symlink_to("/dev/zero")
    with pytest.raises(InputError, match="a pipe, a socket or a device"):
        load(tmp_path / "endless.json")
    with open(tmp_path / "large.shape", "wb") as file:
        file.truncate(LARGEST_FILE + 1)
    with pytest.raises(InputError, match="larger than 16 MB"):
        load(tmp_path / "large.shape")
    for name in ("a\0b.shape", "a" * 5000 + ".shape"):
        with pytest.raises(InputError):
            read_text(name)


def test_endless_products_of_counts_are_refused_and_those_with_a_zero_draw_nothing() -> None:
    def nest(*counts: float) -> Program:
        node: Draw | Loop = PROGRAM.body[0]
        for count in counts:
            node = Loop("translate", (count, 0, 0, 1), (node,))
        return Program((node,))

    with pytest.raises(ShapeProgError, match=f"more than {MOST_COPIES} copies"):
        unroll(nest(*[16777216.0] * 60))
    assert not unroll(nest(*[16777216.0] * 60, 0.0)).mask.any()


SCORES = [
    "good", [1, 2], 3, None, {"iou": "x"}, {"iou": None}, {"cd": [1]}, {"f1_percent": True}, {"seconds": {}},
    {"iou": 10**400},
]  # fmt: skip


@pytest.mark.parametrize("scores", SCORES, ids=repr)
def test_odd_scores_of_a_foreign_file_are_left_out(scores: object, tmp_path: Path) -> None:
    whole = json.loads(program_to_json(PROGRAM)) | {"scores": scores}
    (tmp_path / "one.json").write_text(json.dumps(whole))
    result = read_result(tmp_path / "one.json")
    assert result.scores == {}
    assert len(scores_text(result.scores, result.program)) == 1


def test_scores_that_are_numbers_are_kept(tmp_path: Path) -> None:
    (tmp_path / "one.json").write_text(program_to_json(PROGRAM, scores={"iou": 0.5, "blocks": 3, "odd": "x"}))
    assert read_result(tmp_path / "one.json").scores == {"iou": 0.5, "blocks": 3}


@pytest.fixture
def places(tmp_path: Path) -> Path:
    """A folder with programs, and inputs beside it, in it and elsewhere."""
    for folder in ("results", "inputs/deep"):
        (tmp_path / folder).mkdir(parents=True)
    for name in ("elsewhere.obj", "results/beside.obj", "inputs/deep/one.obj"):
        export(PROGRAM, tmp_path / name, Frame())
    (tmp_path / "results" / "link.obj").symlink_to(tmp_path / "elsewhere.obj")
    return tmp_path


@pytest.mark.parametrize(
    ("source", "named", "shown"),
    [
        ("{}/results/beside.obj", None, True),
        ("beside.obj", None, True),
        ("{}/elsewhere.obj", None, False),
        ("../elsewhere.obj", None, False),
        ("link.obj", None, False),
        ("{}/elsewhere.obj", "elsewhere.obj", True),
        ("{}/inputs/deep/one.obj", "inputs", True),
        ("deep/one.obj", "inputs", True),
        ("/gone/inputs/deep/one.obj", "inputs", True),
        ("/gone/beside.obj", None, True),
        ("/gone/deep/one.obj", None, False),
        ("{}/elsewhere.obj", "inputs", False),
        ("/dev/zero", None, False),
        ("a\0b", None, False),
        ("a" * 5000, None, False),
        ("\ud800", None, False),
        ("", None, False),
        ("#", None, False),
    ],
)
def test_the_input_is_opened_only_beside_its_program_or_where_the_user_says(
    source: str, named: str | None, shown: bool, places: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = places / "results" / "one.json"
    path.write_text(program_to_json(PROGRAM, source=source.format(places)))
    opened: list[str] = []
    monkeypatch.setattr(loading, "load", lambda place, **_: opened.append(str(place)) or PLATE)
    found, *_ = writing._input_and_scores(path, PROGRAM, None if named is None else places / named)
    assert (len(opened), found is not None) == ((1, True) if shown else (0, False))


def test_show_says_that_an_input_elsewhere_is_not_shown(places: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = places / "results" / "one.json"
    path.write_text(program_to_json(PROGRAM, source=str(places / "elsewhere.obj"), scores="odd"))
    page = places / "page.html"
    for words, said in (([], True), (["--shape", str(places / "elsewhere.obj")], False), (["--quiet"], False)):
        with pytest.raises(SystemExit) as end:
            main(["show", str(path), str(page), *words])
        assert end.value.code in (0, None)
        assert ("--shape" in capsys.readouterr().err) == said
        assert ('"input":null' in page.read_text()) == (words[:1] != ["--shape"])


def test_an_ascii_terminal_shows_every_letter_somehow(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    name = tmp_path / "t\N{LATIN SMALL LETTER O WITH DIAERESIS}p.json"
    save(PROGRAM, name)
    for words in (
        ["export", str(name), str(name.with_suffix(".shape"))],
        ["paper", "models", str(name)],
        ["--help"],
    ):
        both = [io.TextIOWrapper(io.BytesIO(), "ascii", errors="strict") for _ in range(2)]
        monkeypatch.setattr(sys, "stdout", both[0])
        monkeypatch.setattr(sys, "stderr", both[1])
        with pytest.raises(SystemExit):
            main(words)
        for stream in both:
            stream.flush()
        told = b"".join(stream.buffer.getvalue() for stream in both)  # type: ignore[attr-defined]
        assert told.isascii()
        assert (rb"t\xf6p" in told) == (words != ["--help"])


def test_names_that_are_no_text_are_written_byte_for_byte(tmp_path: Path) -> None:
    name = os.fsdecode(b"caf\xe9.mtl")
    write_text(tmp_path / "one.obj", f"mtllib {name}\n")
    assert (tmp_path / "one.obj").read_bytes() == b"mtllib caf\xe9.mtl\n"


EXTREME = ["1e19", "-1e19", "3.4e38", "-3.4e38", "1e-38", "1e-45"]
SOLIDS = [
    "leg(at=({0}, 0, 0), size=(2, 2, 2))",
    "leg(at=(0, 0, 0), size=({0}, {0}, {0}))",
    "leg(at=({0}, {0}, {0}), size=({0}, {0}, {0}))",
    "line(start=(0, 0, 0), end=({0}, {0}, 4), radius={0})",
    "for i in translate(3, by=({0}, 0, 0)):\n    leg(at=(0, 0, 0), size=(2, 2, 2))",
]


def numbers_of(path: Path) -> np.ndarray:
    """The coordinates in a file."""
    content = path.read_bytes()
    if path.suffix == ".glb":
        start = 20 + int.from_bytes(content[12:16], "little") + 8
        views = [each for each in json.loads(content[20 : start - 8])["accessors"] if each["componentType"] == 5126]
        return np.array([number for each in views for number in each["min"] + each["max"] if "min" in each])
    words = re.findall(r"(?<![\w#])[-+]?(?:nan|inf|\d[\d.]*(?:e[-+]?\d+)?)", content.decode().lower())
    return np.array([float(word.rstrip(".")) for word in words])


@pytest.mark.parametrize("suffix", [".glb", ".obj", ".scad", ".py", ".xyz"])
def test_extreme_numbers_end_in_files_of_finite_numbers_or_in_words(suffix: str, tmp_path: Path) -> None:
    for solid, number in itertools.product(SOLIDS, EXTREME):
        program, path = parse(solid.format(number)), tmp_path / f"out{suffix}"
        try:
            export(program, path)
        except ShapeProgError:
            continue
        assert np.isfinite(numbers_of(path)).all(), (solid, number)


@pytest.mark.parametrize("frame", [Frame(1e300), Frame(1.0, (1e308, 0, 0))])
@pytest.mark.parametrize("suffix", [".glb", ".obj", ".ply", ".stl", ".xyz"])
def test_a_frame_beyond_what_files_hold_is_refused(suffix: str, frame: Frame, tmp_path: Path) -> None:
    with pytest.raises(OutputError, match="too large or too far away"):
        export(PROGRAM, tmp_path / f"out{suffix}", frame, on_input=True)


@pytest.mark.parametrize("number", ["1e7", "1e19", "3.4e38", "1e-38"])
def test_pages_of_extreme_parts_hold_finite_numbers_or_are_refused(number: str, tmp_path: Path) -> None:
    for solid in SOLIDS[:3]:
        try:
            viewer(parse(solid.format(number)), tmp_path / "one.html")
        except ShapeProgError:
            continue
        triangles = re.findall('"triangles":"([^"]*)"', (tmp_path / "one.html").read_text())
        assert np.isfinite(np.frombuffer(base64.b64decode("".join(triangles[:1])), "<f4")).all()


def test_parts_far_away_keep_their_edges() -> None:
    near, far = (parts(parse(SOLIDS[0].format(number)))[0] for number in ("0", "1000000"))
    for one, two in zip(*(crease_normals(each.vertices, each.faces) for each in (near, far)), strict=True):
        np.testing.assert_array_equal(one, two)

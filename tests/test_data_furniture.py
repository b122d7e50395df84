"""The prior of sketched furniture: what every sample is, as furniture and as a program."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest
import torch
from scipy.sparse.csgraph import connected_components
from typer.testing import CliRunner

import shapeprog as sp
from shapeprog.cli.app import app
from shapeprog.data import read_pack
from shapeprog.data.synthetic import furniture
from shapeprog.data.synthetic.sketch import Sketch, between
from shapeprog.geometry.distance import each_distance
from shapeprog.geometry.mesh import part_meshes
from shapeprog.geometry.surface import sample_surface
from shapeprog.language import Draw, Loop, Program, language
from shapeprog.language.parser import parse
from shapeprog.language.printer import format_program

SEED, COUNT = 3, 60
TOUCHING = 0.02
"""Distance in cells within which parts are in contact: lengths have two decimals."""


@cache
def sample() -> tuple[Program, ...]:
    return tuple(furniture(number, SEED) for number in range(COUNT))


def corners(program: Program) -> list[np.ndarray]:
    return [part.vertices for part in part_meshes(sp.unroll(program))]


def test_every_part_has_a_role_and_every_number_a_few_decimals() -> None:
    for program in sample():
        assert 2 <= program.blocks <= 10
        for node in program.walk():
            assert isinstance(node, Loop) or node.word in language().roles
            assert all(abs(value * 100 - round(value * 100)) < 1e-2 for value in node.values)
        assert parse(format_program(program)) == program


def test_all_parts_hang_together() -> None:
    for program in sample():
        scene = sp.unroll(program)
        alone = type(scene)(**{name: getattr(scene, name)[:, None] for name in scene.__dataclass_fields__})
        count = len(scene.mask)
        points = sample_surface(alone, 1000, torch.Generator().manual_seed(0)).points.reshape(-1, 3)
        gap = each_distance(scene, points).reshape(count, 1000, count).amin(1)
        assert connected_components((torch.minimum(gap, gap.T) <= TOUCHING).numpy())[0] == 1, format_program(program)


def test_it_stands_on_the_floor_on_all_sides_of_its_middle() -> None:
    for program in sample():
        places = np.concatenate(corners(program))
        low, high = places.min(0), places.max(0)
        standing = places[places[:, 0] < low[0] + 0.15, 1:]
        assert (standing.min(0) < (low + high)[1:] / 2).all(), format_program(program)
        assert (standing.max(0) > (low + high)[1:] / 2).all(), format_program(program)


def test_it_is_centred_and_as_large_as_real_shapes_are_scaled() -> None:
    for program in sample():
        places = np.concatenate(corners(program))
        assert np.ptp(places, axis=0).max() == pytest.approx(24, abs=0.1)
        assert places[:, 0].min() == pytest.approx(-places[:, 0].max(), abs=0.02)
        if not any(node.name == "rotate" for node in program.walk()):
            np.testing.assert_allclose(places.min(0), -places.max(0), atol=0.02)


def test_parts_are_no_thinner_than_wood_and_no_two_are_the_same() -> None:
    for program in sample():
        boxes = [np.concatenate([each.min(0), each.max(0)]) for each in corners(program)]
        assert min((box[3:] - box[:3]).min() for box in boxes) > 0.08
        assert len({tuple(box.round(2)) for box in boxes}) == len(boxes)


def test_it_draws_splayed_mirrored_tapered_bent_tilted_and_soft_parts() -> None:
    drawn = [node for number in range(120) for node in furniture(number, SEED).walk()]
    names = {node.name for node in drawn}
    solids = {"box", "board", "bar", "cylinder", "rod", "taper", "bent_rod", "cushion", "leg"}
    assert names == {*solids, "mirror", "translate", "rotate"}
    roles = {node.word for node in drawn if isinstance(node, Draw)}
    assert roles >= {"seat", "back", "leg", "arm", "top", "drawer", "door", "handle", "shelf", "slat", "rail", "pillow"}
    tapers = [node.values for node in drawn if node.name == "taper"]
    assert sum(values[1:3] != values[4:6] for values in tapers) > len(tapers) / 2


def test_a_program_depends_on_its_number_and_seed_alone() -> None:
    assert furniture(7, SEED) == sample()[7]
    assert furniture(7, SEED + 1) != sample()[7]
    assert len(set(sample())) == COUNT


def test_lengths_in_centimetres_become_tidy_cells() -> None:
    sketch = Sketch(np.random.default_rng(0), 1 / 3)
    assert sketch.cm(10) == 3.33
    sketch.box("leg", (0, 3.33), (1, 2), (0.5, 1.5), mirror="side depth")
    sketch.stick("leg", "taper", (0, 3, 0), (4, 0, 0), (0.5, 1), thick=1, count=2, side_step=5)
    assert format_program(sketch.program) == (
        "for i in mirror(side):\n    for j in mirror(depth):\n"
        "        leg(at=(0, 1, 0.5), size=(3.33, 1, 1))\n"
        "for i in translate(2, by=(0, 0, 5)):\n"
        "    leg(taper(start=(0.3, 3, 0), end=(4, 0, 0), radius=(0.5, 1)))\n"
    )
    assert between((0, 2, 1), (4, 0, 3), 1) == (1, 1.5, 1.5)


def test_it_is_sampled_by_command(tmp_path: Path) -> None:
    words = ["sample", "--count", "2", "--seed", str(SEED)]
    files = ["--folder", str(tmp_path), "--pack", str(tmp_path / "pack.npz"), "--out", str(tmp_path / "sheet.png")]
    done = CliRunner().invoke(app, [*words, *files])
    assert done.exit_code == 0, done.output
    assert sp.load(tmp_path / "furniture_1.shape") == sample()[1]
    assert len(read_pack(tmp_path / "pack.npz")) == 2
    assert (tmp_path / "sheet.png").stat().st_size > 1000
    assert "# furniture_0" in CliRunner().invoke(app, words).output

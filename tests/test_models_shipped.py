"""The weights that ship: what they are said to be, and what they know."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from shapeprog.data.shape import Shape
from shapeprog.data.synthetic import Batch, Stream, prior
from shapeprog.evaluation.generated import code_iou, generated, single_pass
from shapeprog.models.checkpoint import SHIPPED, load_generator, read_card
from shapeprog.models.generator import Generator
from shapeprog.training.lessons import lesson
from shapeprog.training.validation import told


@pytest.fixture(scope="module")
def generator() -> Generator:
    return load_generator("default")[0]


@pytest.fixture(scope="module")
def shapes() -> Batch:
    """Shapes of a seed that no training draws."""
    return Stream(prior("wide"), 64, seed=987_654_321)[0]


def test_the_card_says_how_they_were_made() -> None:
    file = SHIPPED / "default.safetensors"
    card = read_card(file).card
    assert card.kind == "generator"
    assert card.visits >= 200_000
    assert "synthetic" in card.data
    assert card.command.startswith("shapeprog pretrain")
    assert file.stat().st_size < 8 << 20


def test_nine_in_ten_statements_are_right_when_told_what_comes_before(generator: Generator, shapes: Batch) -> None:
    with torch.no_grad():
        right, number, off, slots = told(generator, lesson(shapes.voxels, shapes.code))
    assert right / number > 0.9
    assert off / slots < 0.6


def test_synthetic_shapes_are_rebuilt_in_a_single_pass(generator: Generator, shapes: Batch) -> None:
    _, drawn = single_pass(generator, shapes.voxels)
    assert float(code_iou(drawn, shapes.voxels).mean()) > 0.75


def test_a_table_is_a_top_on_legs(generator: Generator) -> None:
    cells = np.zeros((32, 32, 32), np.bool_)
    cells[19:21, 8:24, 4:28] = True
    for depth in (8, 22):
        for side in (4, 26):
            cells[4:19, depth : depth + 2, side : side + 2] = True
    chains = generated(generator, [Shape("table", cells)])[0].program.chains
    assert [node.name for node in chains[0]] == ["top_rectangle"]
    assert [node.name for node in chains[1]] == ["translate", "translate", "leg"]

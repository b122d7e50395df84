"""Named numbers: written out, changed, and as parameters with gradients."""

from __future__ import annotations

from pathlib import Path

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from placed import placed_text

import shapeprog as sp
from shapeprog.geometry.contacts import TOUCHING, contact_groups
from shapeprog.language import Program
from shapeprog.language.parser import parse
from shapeprog.language.printer import format_program

CHAIR = """\
width, depth, height = 10, 10, 12
thick = 2
span = width - thick
slope = 3

def legs(long, thick):
    # thick is another one here
    for _ in translate(2, x=span):
        leg(x=-span / 2, width=width / 5, y=slope, depth=thick, height=long)
    for _ in translate(3, z=1):
        # nothing yet
        pass

legs(long=9, thick=1)
legs(long=4 * thick, thick=thick, height=depth)
"""


@given(st.integers(0, 1 << 30))
def test_what_is_written_out_draws_the_same_and_has_no_names(seed: int) -> None:
    program = parse(placed_text(seed))
    plain = sp.inline(program)
    assert plain == parse(format_program(plain)) == Program(program.body)
    assert sp.inline(plain) == plain
    assert sp.names(plain) == []


def test_names_tell_their_values() -> None:
    found = {each.name: each for each in sp.names(parse(CHAIR))}
    assert [*found] == ["width", "depth", "height", "thick", "span", "slope"]
    assert [each.value for each in found.values()] == [10, 10, 12, 2, 8, 3]
    assert [each.free for each in found.values()] == [True, True, True, True, False, True]
    assert found["span"].text == "width - thick"


def test_a_number_that_is_set_moves_all_that_follows_from_it() -> None:
    program = parse(CHAIR)
    changed = sp.set(program, width=12)
    assert format_program(changed) == CHAIR.replace("= 10,", "= 12,")
    assert changed.body[0].values == (2, 0, 0, -20)
    assert sp.set(program, {"width": 12}) == changed
    assert sp.set(program, {}) == program


TABLE = """\
# unit: cm
diameter, ratio = 100, 2
width, depth, height = diameter, diameter, 74
leg_width = diameter / 20
inset = leg_width * ratio  # from both sides

def corner(size):
    leg(width=size, depth=size, top=3)

top(cylinder(top=0, height=3))
for _ in mirror(x=0, y=0):
    corner(size=leg_width, left=inset, front=inset)
"""


def test_a_number_replaces_an_expression_in_a_program_of_placed_parts() -> None:
    program = parse(TABLE)
    changed = sp.set(program, inset=4, height=148)
    text = TABLE.replace("leg_width * ratio", "4").replace("diameter, 74", "diameter, 148")
    assert format_program(changed) == text
    assert program.source is not None
    assert changed.source is not None
    assert changed.source.scale == program.source.scale, "the scale is that of the text as it was read"
    assert changed.body[0].values == pytest.approx((145 * 0.24 - 74 * 0.12, 0, 0, 0.72, 12))
    values = {each.name: each.value for each in sp.names(sp.set(changed, leg_width=6, diameter=90))}
    assert values == {
        "diameter": 90, "ratio": 2, "width": 90, "depth": 90, "height": 148, "leg_width": 6, "inset": 4,
    }  # fmt: skip


def test_names_of_placed_text_are_whole_where_they_count() -> None:
    text = TABLE + (
        "with inside(bottom=20, height=height / 2):\n    for _ in divide(ratio, z, gap=inset / 4):\n"
        "        shelf(height=height / 9)\n        shelf(rod(start=at(left=inset), end=at(right=0), radius=1))\n"
        "for _ in row(ratio, last=at(right=inset)):\n    foot(left=0, width=3)\n"
    )
    found = {each.name: each for each in sp.names(parse(text))}
    assert [name for name, each in found.items() if each.whole] == ["ratio"]


@pytest.mark.parametrize(
    ("text", "whole"),
    [
        ("n = 2\nfor _ in row(n + 1, last=at(top=2)):\n    shelf(height=3)\n", ["n"]),
        ("n = 2\nm = 2 * n\nfor _ in row(m, last=at(top=2)):\n    shelf(height=3)\n", ["n", "m"]),
        ("n = 2\nfor _ in row(n + 1, last=at(top=2)):\n    shelf(height=n)\n", []),
        ("n = 2\nfor _ in row(width / n, last=at(top=2)):\n    shelf(height=3)\n", []),
        ("n = 1.5\nfor _ in row(2 * n, last=at(top=2)):\n    shelf(height=3)\n", []),
    ],
)
def test_names_in_sums_and_products_of_counts_alone_are_whole(text: str, whole: list[str]) -> None:
    program = parse("width, depth, height = 24, 24, 24\n" + text)
    assert [each.name for each in sp.names(program) if each.whole] == whole
    assert ("n" in sp.Parametric(program).names) == (not whole)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"corner": 3}, "no name 'corner'"),
        ({"size": 3}, "no name 'size'"),
        ({"height": -1}, "the height of the whole is -1"),
        ({"leg_width": 0}, "width"),
    ],
)
def test_what_cannot_be_set_in_a_program_of_placed_parts_is_told(changes: dict[str, float], words: str) -> None:
    with pytest.raises(sp.ShapeProgError) as caught:
        sp.set(parse(TABLE), changes)
    assert words in str(caught.value)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"widht": 3}, "no name 'widht'\n  hint: did you mean width"),
        ({"long": 3}, "no name 'long'"),
        ({"width": float("inf")}, "too large"),
    ],
)
def test_what_cannot_be_set_is_told(changes: dict[str, float], words: str) -> None:
    with pytest.raises(sp.ShapeProgError) as caught:
        sp.set(parse(CHAIR), changes)
    assert words in str(caught.value)


def test_a_plain_program_has_nothing_to_set() -> None:
    with pytest.raises(sp.ShapeProgError, match="write name = number at its top"):
        sp.set(parse("leg(at=(0, 0, 0), size=(1, 1, 1))"), width=3)


def test_numbers_that_fit_no_more_are_told_when_they_are_set() -> None:
    text = "width, depth, height = 6, 6, 6\nn = 2\nw = 6 / n\nfor _ in translate(n, x=w):\n    leg(left=0, width=w)"
    program = parse(text)
    assert sp.set(program, n=3).body[0].count == 3
    with pytest.raises(sp.ShapeProgError, match="divides by zero"):
        sp.set(program, n=0)


@pytest.mark.parametrize(
    "loop", ["translate(n, x=2)", "row(n, last=at(right=0))", "divide(n, x)", "rotate(n + 1)", "translate(2 * n, z=1)"]
)
def test_numbers_of_copies_are_whole_and_not_negative(loop: str) -> None:
    program = parse(f"width, depth, height = 6, 6, 6\nn, w = 2, 1\nfor _ in {loop}:\n    leg(left=0, width=w)")
    for wrong in (2.5, -1, torch.tensor(0.5)):
        with pytest.raises(sp.ShapeProgError, match=r"n = .* is no number of copies\n  hint: .*whole number of 0"):
            sp.set(program, n=wrong)
    assert sp.set(program, n=3.0, w=1.5) == sp.set(program, n=3, w=torch.tensor(1.5))


BENT = "width, depth, height = 9, 9, 9\na, b = 2, 4\nbox(x=a * b, width=4, y=a / b, depth=b - 1, z=a, height=a)"


@pytest.mark.parametrize("text", [CHAIR, BENT])
def test_gradients_reach_every_name_through_loops_and_functions(text: str) -> None:
    program = parse(text)
    chair = sp.Parametric(program)
    assert (chair.matrix is None) == (text == BENT)
    point = torch.tensor([[0.5, 1.5, 2.5]], dtype=torch.float64)

    def distances(values: torch.Tensor) -> torch.Tensor:
        scene = sp.unroll(chair.at(values))
        return ((scene.centre - point) ** 2).sum() + (scene.size**3).sum()

    values = chair.values.clone().requires_grad_()
    assert torch.autograd.gradcheck(distances, values)
    (slope,) = torch.autograd.grad(distances(values), values)
    assert (slope[3:] != 0).all(), "names beside width, depth and height"
    for name, value in zip(chair.names, chair.values.tolist(), strict=True):
        other = chair.values.clone()
        other[chair.names.index(name)] = value * 1.25
        moved = sp.unroll(sp.encode(sp.set(program, {name: value * 1.25}), dtype=torch.float64))
        assert torch.allclose(sp.unroll(chair.at(other)).centre, moved.centre, atol=1e-5)


def test_counts_are_whole_and_what_is_divided_by_them_stays_linear() -> None:
    program = parse(
        "width, depth, height = 24, 8, 9\nspan, shelves, thick = 12, 4, 1\n"
        "for _ in translate(shelves, z=span / (shelves - 1)):\n    box(z=0, height=thick)\n"
    )
    assert [each.name for each in sp.names(program) if each.whole] == ["shelves"]
    shelf = sp.Parametric(program)
    assert shelf.names == ("width", "depth", "height", "span", "thick")
    assert shelf.matrix is not None
    moved = sp.unroll(shelf.at(torch.tensor([24.0, 8.0, 9.0, 18.0, 1.0], dtype=torch.float64)))
    assert moved.centre[:, 0].tolist() == [0, 6, 12, 18]
    more = sp.unroll(sp.set(program, shelves=5))
    assert more.centre[:, 0].tolist() == [0, 3, 6, 9, 12]


@given(st.integers(0, 1 << 30))
def test_parametric_programs_begin_as_they_are_written(seed: int) -> None:
    program = parse(placed_text(seed))
    chair = sp.Parametric(program)
    batch = chair.at(chair.values.expand(2, 1, -1))
    plain = sp.encode(program, dtype=torch.float64)
    assert torch.equal(batch.ids, plain.ids.expand(2, 1, -1, -1))
    for code in (chair.at(chair.values), batch):
        assert code.parameters.shape[-3:] == plain.parameters.shape
        assert torch.allclose(code.parameters, plain.parameters.expand_as(code.parameters), rtol=1e-5, atol=1e-5)


def test_a_plain_program_has_no_parameters() -> None:
    chair = sp.Parametric(parse("leg(at=(0, 0, 0), size=(1, 1, 1))"))
    assert chair.names == ()
    assert torch.equal(chair.at(chair.values).parameters, chair.code.parameters)


ROUND_LEGS = """\
width, depth, height = 20, 10, 24
leg_height, thickness, inset, legs = 22, 2, 3, 2
top(top=0, height=thickness)
for _ in row(legs, last=at(right=inset)):
    leg(cylinder(left=inset, radius=1, height=leg_height))
"""


def test_names_have_ranges_within_which_parts_touch_and_none_vanishes() -> None:
    found = {named.name: named for named in sp.names(parse(ROUND_LEGS))}
    ranges = {name: named.range for name, named in found.items()}
    assert ranges["leg_height"] == (22, 66)
    assert ranges["thickness"] == (2, 6)
    low, high = ranges["height"]
    assert 0 < low < 1
    assert high == pytest.approx(24 + TOUCHING, abs=0.05)
    assert ranges["inset"] == (0, 9)
    assert ranges["legs"] == (1, 6)
    assert {name.name: name.range for name in sp.names(parse(TABLE))}["inset"] is None


def test_ranges_are_in_the_unit_of_the_text() -> None:
    program = parse(ROUND_LEGS)
    cells, metres = (
        {named.name: named.range for named in sp.names(each)}
        for each in (program, sp.in_unit(program, sp.Unit("m", 0.5)))
    )
    for name, (low, high) in cells.items():
        factor = 1 if name == "legs" else 0.5
        assert metres[name] == pytest.approx((factor * low, factor * high), rel=1e-3)


def test_the_ends_of_ranges_are_programs_in_one_piece() -> None:
    for path in sorted((Path(__file__).parents[1] / "examples" / "pieces").glob("[cls]*.shape")):
        program = sp.load(path)
        for named in sp.names(program):
            for value in named.range or ():
                edited = sp.unroll([sp.set(program, {named.name: value})])
                assert edited.mask.any()
                assert contact_groups(edited) == [1], (path.name, named.name, value)

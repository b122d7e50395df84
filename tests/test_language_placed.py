"""Parts placed from the sides of a box: where every form of the language draws, and what is refused where."""

from __future__ import annotations

from pathlib import Path

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from placed import placed_text

import shapeprog as sp
from shapeprog.errors import ProgramError
from shapeprog.geometry.primitives import KINDS
from shapeprog.language.parser import parse
from shapeprog.language.printer import format_program

WHOLE = "width, depth, height = 100, 60, 80\n"
"""From -50 to 50 left-right, from -30 to 30 front-rear, from 0 to 80 vertically."""

X, Y, Z = (-50, 50), (-30, 30), (0, 80)
PIECES = sorted((Path(__file__).parents[1] / "examples" / "pieces").glob("*.shape"))
SEEDS = st.integers(0, 1 << 30)


def bounds(program: sp.Program) -> torch.Tensor:
    """Bounding boxes (N, 3, 2) of the primitives along x, y and z, in the unit of the text."""
    scene, scale = sp.unroll(sp.encode(program, dtype=torch.float64)), program.source.scale
    names = {KINDS[name]: name for name in ("cuboid", "rounded_box", "cylinder", "frustum", "arc")}
    result = []
    for kind, size, centre, turn in zip(scene.kind, scene.size, scene.centre, scene.rotation, strict=True):
        name = names[int(kind)]
        if name in ("cuboid", "rounded_box"):
            edge = float(size[3]) if name == "rounded_box" else 0.0
            edge = min(edge, float(size[:3].min()))
            half = turn * (size[:3] - edge)
            if name == "cuboid":  # the fourth size shears axis 1 along axis 0
                half[:, 0] += turn[:, 1] * size[3] / 2
            reach = half.abs().sum(1) + edge
            low, high = centre - reach, centre + reach
        else:
            half, radius, third = size[:3].tolist()
            discs = [(-half, 0.0, radius), (half, 0.0, third if name == "frustum" else radius)]
            points = torch.tensor([[along, 0.0, 0.0] for along, _, _ in discs], dtype=torch.float64)
            normals = torch.tensor([[1.0, 0.0, 0.0]] * 2, dtype=torch.float64)
            if name == "arc":  # half a chord and the sagitta
                around = (half**2 + third**2) / (2 * third)
                sweep = 2 * torch.atan2(torch.tensor(third), torch.tensor(half))
                angle = torch.linspace(-1, 1, 20_001, dtype=torch.float64) * sweep
                zero = torch.zeros_like(angle)
                points = torch.stack([around * angle.sin(), around * (angle.cos() - 1) + third / 2, zero], 1)
                normals = torch.stack([angle.cos(), -angle.sin(), zero], 1)
            radii = torch.tensor([radius if name == "arc" else disc[2] for disc in discs][: len(points)])
            radii = radii[:1] if name == "arc" else radii
            reach = radii[:, None] * (1 - (normals @ turn.T) ** 2).clamp(min=0).sqrt()
            middle = points @ turn.T + centre
            low, high = (middle - reach).amin(0), (middle + reach).amax(0)
        up, depth, side = torch.stack([low, high], 1)  # the third axis of the grid points to the left
        result.append(torch.stack([-side.flip(0), depth, up - scale.floor]) / scale.cells_per_unit)
    return torch.stack(result) if result else torch.zeros(0, 3, 2, dtype=torch.float64)


def drawn(body: str, **numbers: float) -> list[list[list[float]]]:
    return bounds(sp.set(parse(WHOLE + body), numbers)).tolist()


def same(one: object, other: object) -> None:
    expected = torch.tensor(other, dtype=torch.float64)
    assert torch.as_tensor(one, dtype=torch.float64).reshape(expected.shape) == pytest.approx(expected, abs=1e-4)


# ---------------------------------------------------------------- one part

ALONG = {  # keywords of one axis, and the interval that they describe
    0: {
        "": X,
        "width=20": (-10, 10),
        "left=7": (-43, 50),
        "right=7": (-50, 43),
        "left=7, width=20": (-43, -23),
        "right=7, width=20": (23, 43),
        "left=7, right=30": (-43, 20),
        "x=5, width=20": (-5, 15),
        "left=-7, right=-1": (-57, 51),
    },
    1: {
        "": Y,
        "depth=20": (-10, 10),
        "front=7": (-23, 30),
        "rear=7": (-30, 23),
        "front=7, depth=20": (-23, -3),
        "rear=7, depth=20": (3, 23),
        "front=7, rear=30": (-23, 0),
        "y=5, depth=20": (-5, 15),
        "rear=-7, depth=20": (17, 37),
    },
    2: {
        "": Z,
        "height=20": (0, 20),
        "bottom=7": (7, 80),
        "top=7": (0, 73),
        "bottom=7, height=20": (7, 27),
        "top=7, height=20": (53, 73),
        "bottom=7, top=30": (7, 50),
        "z=5, height=20": (35, 55),
        "bottom=-7, height=20": (-7, 13),
    },
}


@pytest.mark.parametrize(("axis", "words"), [(axis, words) for axis in ALONG for words in ALONG[axis]])
@pytest.mark.parametrize("form", ["box({})", "drawer({})", "leg(box({}))", "seat(cushion({}{}edge=2))"])
def test_keywords_of_an_axis_describe_an_interval(axis: int, words: str, form: str) -> None:
    expected = [X, Y, Z]
    expected[axis] = ALONG[axis][words]
    same(drawn(form.format(words, ", " if words else "")), [expected])


SOLIDS = {
    # A tilt of 90 degrees about the bottom front edge takes the top to the rear and the rear below the floor.
    "box(width=20, front=0, depth=10, height=30, tilt=90)": ((-10, 10), (-30, 0), (-10, 0)),
    "box(front=0, depth=10, height=30, tilt=-90)": (X, (-60, -30), (0, 10)),
    "box(front=2, depth=10, bottom=5, height=30, tilt=90)": (X, (-28, 2), (-5, 5)),
    "leg(front=0, depth=10, height=20, tilt=30)": (X, (-30, -30 + 10 * 0.75**0.5 + 10), (-5, 20 * 0.75**0.5)),
    "box(depth=10, height=30, lean=6)": (X, (-5, 11), (0, 30)),
    "back(depth=10, height=30, lean=-6)": (X, (-11, 5), (0, 30)),
    "box(front=0, depth=10, height=30, lean=6, tilt=90)": (X, (-30, 0), (-16, 0)),
    "cushion(height=10, edge=50)": (X, Y, (0, 10)),
    "seat(cushion(front=0, depth=10, height=20, edge=1, tilt=90))": (X, (-30, -10), (-10, 0)),
    # Upright round solids.
    "cylinder(radius=6)": ((-6, 6), (-6, 6), Z),
    "cylinder(left=3, radius=6, height=9)": ((-47, -35), (-6, 6), (0, 9)),
    "cylinder(right=3, front=1, radius=6, top=2)": ((35, 47), (-29, -17), (0, 78)),
    "cylinder(x=-20, rear=10, radius=6, z=1, height=4)": ((-26, -14), (8, 20), (39, 43)),
    "cylinder(width=28)": ((-14, 14), (-14, 14), Z),
    "top_circle(cylinder(depth=20, right=5, top=0, height=4))": ((25, 45), (-10, 10), (76, 80)),
    "cylinder(left=20, right=60, y=3)": ((-30, -10), (-7, 13), Z),
    "cylinder(left=1, width=12, rear=2, depth=12)": ((-49, -37), (16, 28), Z),
    "cylinder(left=20, right=20)": ((-30, 30), (-30, 30), Z),
    "cylinder(front=0, radius=6, height=20, tilt=90)": ((-6, 6), (-30, -10), (-12, 0)),
    "post(rod(left=4, front=4, radius=2, bottom=6))": ((-46, -42), (-26, -22), (6, 80)),
    "rod(depth=8, height=7)": ((-4, 4), (-4, 4), (0, 7)),
    "leg(taper(left=12, rear=4, radius=(1, 3)))": ((-38, -32), (20, 26), Z),
    "taper(radius=(0, 5), height=9)": ((-5, 5), (-5, 5), (0, 9)),
    # Between points: by default the middle of the bottom; a later point takes what it does not give from the first.
    "rod(start=at(), end=at(top=10), radius=3)": ((-3, 3), (-3, 3), (0, 70)),
    "line(rod(start=at(left=10, bottom=20), end=at(right=15), radius=2))": ((-40, 35), (-2, 2), (18, 22)),
    "rod(start=at(x=7, front=4, z=-10), end=at(rear=6), radius=1)": ((6, 8), (-26, 24), (29, 31)),
    "rod(start=at(y=7, top=4), end=at(bottom=2), radius=1)": ((-1, 1), (6, 8), (2, 76)),
    "taper(start=at(left=3), end=at(right=3), radius=(1, 4))": ((-47, 47), (-4, 4), (-4, 4)),
    # 30 right and 40 up: the ends of a rod of radius 5 reach 4 beyond left-right, and 3 vertically.
    "rod(start=at(), end=at(x=30, bottom=40), radius=5)": ((-4, 34), (-5, 5), (-3, 43)),
    # Half a ring, whose ends are level; then a quarter.
    "bent_rod(start=at(x=-20, bottom=10), through=at(x=0, bottom=30), end=at(x=20), radius=3)": (
        (-23, 23),
        (-3, 3),
        (10, 33),
    ),
    "bent_rod(start=at(front=10), through=at(x=20, y=0), end=at(rear=10), radius=2)": ((-0, 22), (-22, 22), (-2, 2)),
    # Bars name their sizes across.
    "bar(start=at(left=20, bottom=10), end=at(bottom=50), width=4, depth=6)": ((-32, -28), (-3, 3), (10, 50)),
    "bar(start=at(left=10, bottom=20), end=at(right=15), depth=6, height=4)": ((-40, 35), (-3, 3), (18, 22)),
    "bar(start=at(front=1, bottom=20), end=at(rear=2), width=6, height=4)": ((-3, 3), (-29, 28), (18, 22)),
    "bar(start=at(), end=at(top=0), width=4, depth=6, turn=90)": ((-3, 3), (-2, 2), Z),
    "bar(start=at(left=0, bottom=9), end=at(right=0), depth=6, height=4, turn=90)": (X, (-2, 2), (6, 12)),
    "rail(bar(start=at(front=0, bottom=9), end=at(rear=0), width=6, height=4, turn=90))": ((-2, 2), Y, (6, 12)),
    "brace(bar(start=at(), end=at(x=30, bottom=40), width=10, depth=4))": ((-4, 34), (-2, 2), (-3, 43)),
    "brace(bar(start=at(), end=at(x=30, bottom=40), depth=4, height=10))": ((-4, 34), (-2, 2), (-3, 43)),
}


@pytest.mark.parametrize("text", SOLIDS)
def test_a_solid_lies_where_its_keywords_say(text: str) -> None:
    same(drawn(text), [SOLIDS[text]])


def test_a_large_edge_counts_as_half_of_the_least_size() -> None:
    assert parse(str(parse(WHOLE + "cushion(cushion(edge=1))"))) == parse(WHOLE + "cushion(cushion(edge=1))")
    program = parse(WHOLE + "cushion(height=10, edge=50)")
    corner = torch.tensor([[10.0 - 40, 30, -50]]) * 24 / 100  # up, depth, side
    distance = sp.unroll(program).distance(corner).item()
    assert distance == pytest.approx(5 * (3**0.5 - 1) * 24 / 100, abs=1e-4)


def test_a_turned_bar_is_turned_counter_clockwise_seen_from_the_positive_end_of_its_axis() -> None:
    """A square of 10 by 0.1, turned by 30 degrees, has its long side along (cos 30, sin 30) of the axes that follow."""
    for axis, (text, first, second) in enumerate(
        (
            ("bar(start=at(left=0, bottom=40), end=at(right=0), depth=10, height=0.1, turn=30)", 1, 2),
            ("bar(start=at(front=0, bottom=40), end=at(rear=0), height=10, width=0.1, turn=30)", 2, 0),
            ("bar(start=at(), end=at(top=0), width=10, depth=0.1, turn=30)", 0, 1),
        )
    ):
        program = parse(WHOLE + text)
        scene, cells = sp.unroll(sp.encode(program, dtype=torch.float64)), program.source.scale.cells_per_unit
        vertices = torch.tensor([[up, depth, side] for up in (-1, 1) for depth in (-1, 1) for side in (-1, 1)]).double()
        grid = (vertices * scene.size[0, :3]) @ scene.rotation[0].T / cells
        corners = torch.stack([-grid[:, 2], grid[:, 1], grid[:, 0]], 1)
        assert (corners[:, first] * corners[:, second]).sum() > 0, axis
        assert corners[:, first].max() == pytest.approx(5 * 0.75**0.5 + 0.05 * 0.5, abs=1e-4)


# ---------------------------------------------------------------- groups, functions, loops

GROUPS = {
    "with inside(left=10, width=40, bottom=20, height=30):\n    box(width=width / 4, height=height / 3)": [
        ((-25, -15), Y, (20, 30))
    ],
    "with inside(right=10, rear=6):\n    with inside(left=5, top=8):\n        leg(right=0, width=2, rear=0)": [
        ((38, 40), (-30, 24), (0, 72))
    ],
    "with inside(front=0, depth=10, height=30, tilt=90):\n    box(top=0, height=2)": [(X, (-2, 0), (-10, 0))],
    "with inside(width=10):\n    box()\nbox(width=width)": [((-5, 5), Y, Z), (X, Y, Z)],
    # A function draws in the box of its call, or in that of the caller.
    "def f(a, b=2):\n    c = a * b\n    box(left=c, height=height / 4)\nf(a=3)\nf(a=3, b=4, right=60, top=40)": [
        ((-44, 50), Y, (0, 20)),
        ((-38, -10), Y, (0, 10)),
    ],
    "inset = 5\ndef f(inset=inset):\n    box(left=inset)\nwith inside(right=10):\n    f()\n    f(inset=1)": [
        ((-45, 40), Y, Z),
        ((-49, 40), Y, Z),
    ],
    "def f():\n    box(left=5)\ndef g():\n    f(right=1)\ng(front=0, depth=10, height=30, tilt=90)": [
        ((-45, 49), (-30, 0), (-10, 0))
    ],
    "radius = 4\ndef f(gap=1):\n    cylinder(radius=radius, height=gap)\nf(gap=2)": [((-4, 4), (-4, 4), (0, 2))],
    # divide
    "for _ in divide(4, z, gap=4):\n    drawer()": [(X, Y, span) for span in ((0, 17), (21, 38), (42, 59), (63, 80))],
    "for _ in divide(2, x, gap=2, left=10, top=70):\n    box(width=width / 2)": [
        ((-29, -7), Y, (0, 10)),
        ((17, 39), Y, (0, 10)),
    ],
    "for _ in divide(2.5, y):\n    box()": [(X, (-30, 0), Z), (X, (0, 30), Z)],
    "for _ in divide(7 / 2, y):\n    leg(height=1)": [(X, (start, start + 15), (0, 1)) for start in (-30, -15, 0, 15)],
    "for _ in divide(2, z, front=0, depth=10, height=40, tilt=90):\n    box()": [
        (X, (-30, -10), (-10, 0)),
        (X, (-10, 10), (-10, 0)),
    ],
    "for _ in divide(0, x):\n    box()\nleg()": [(X, Y, Z)],
    # mirror: the plane is where a point keyword says
    "for _ in mirror(x=0):\n    leg(left=1, width=4)": [((-49, -45), Y, Z), ((45, 49), Y, Z)],
    "for _ in mirror(left=10):\n    leg(left=1, width=4)": [((-49, -45), Y, Z), ((-35, -31), Y, Z)],
    "for _ in mirror(y=2):\n    leg(front=1, depth=4)": [(X, (-29, -25), Z), (X, (29, 33), Z)],
    "for _ in mirror(rear=0):\n    leg(front=1)": [(X, (-29, 30), Z), (X, (30, 89), Z)],
    "for _ in mirror(z=0):\n    shelf(height=2)": [(X, Y, (0, 2)), (X, Y, (78, 80))],
    "for _ in mirror(x=0):\n    shelf()": [(X, Y, Z), (X, Y, Z)],
    "for _ in mirror(x=0, y=0):\n    leg(left=0, width=4, front=0, depth=3)": [
        (x, y, Z) for y in ((-30, -27), (27, 30)) for x in ((-50, -46), (46, 50))
    ],
    "for _ in mirror(x=0, y=0, top=40):\n    leg(left=0, width=4, front=0, depth=3, height=2)": [
        (x, y, z) for z in ((0, 2), (78, 80)) for y in ((-30, -27), (27, 30)) for x in ((-50, -46), (46, 50))
    ],
    # rotate: counter-clockwise as seen from above, from front to right
    "for _ in rotate(4):\n    foot(width=4, front=0, depth=10, height=5)": [
        ((-2, 2), (-30, -20), (0, 5)),
        ((20, 30), (-2, 2), (0, 5)),
        ((-2, 2), (20, 30), (0, 5)),
        ((-30, -20), (-2, 2), (0, 5)),
    ],
    "for _ in rotate(2, step=90, left=10, front=10):\n    foot(left=0, width=4, front=0, depth=6)": [
        ((-50, -46), (-30, -24), Z),
        ((-36, -30), (-30, -26), Z),
    ],
    "for _ in rotate(2, step=-90):\n    foot(width=4, front=0, depth=10)": [
        ((-2, 2), (-30, -20), Z),
        ((-30, -20), (-2, 2), Z),
    ],
    "for _ in translate(3, x=10, y=-1, z=2.5):\n    block(width=4, depth=6, height=5)": [
        ((-2 + 10 * k, 2 + 10 * k), (-3 - k, 3 - k), (2.5 * k, 5 + 2.5 * k)) for k in range(3)
    ],
    "for _ in translate(-1, x=10):\n    block()": [],
    # row: the last copy of the first element is where `last` says
    "for _ in row(3, last=at(top=0)):\n    shelf(bottom=10, height=4)": [
        (X, Y, (10, 14)),
        (X, Y, (43, 47)),
        (X, Y, (76, 80)),
    ],
    "for _ in row(2, last=at(x=20, front=3, z=0)):\n    leg(left=0, width=4, rear=0, depth=6, top=0, height=2)": [
        ((-50, -46), (24, 30), (78, 80)),
        ((18, 22), (-27, -21), (39, 41)),
    ],
    "for _ in row(2, last=at(right=2)):\n    with inside(left=0, width=10):\n        leg(width=2)\n    leg(width=1)": [
        ((-46, -44), Y, Z),
        ((-0.5, 0.5), Y, Z),
        ((42, 44), Y, Z),
        ((87.5, 88.5), Y, Z),
    ],
    "for _ in row(3, last=at(right=5)):\n    slat(rod(start=at(left=5, bottom=0), end=at(top=0), radius=1))": [
        ((x - 1, x + 1), (-1, 1), Z) for x in (-45, 0, 45)
    ],
    "for _ in row(2, last=at(top=0)):\n    for _ in row(2, last=at(right=0)):\n        leg(left=0, width=4, top=78)": [
        (x, Y, z) for z in ((0, 2), (78, 80)) for x in ((-50, -46), (46, 50))
    ],
    "for _ in row(2, last=at(rear=0)):\n    box(front=0, depth=10, height=30, tilt=90)": [
        (X, (-30, 0), (-10, 0)),
        (X, (20, 50), (-10, 0)),
    ],
    "for _ in row(1, last=at(top=0)):\n    shelf(height=2)": [(X, Y, (0, 2))],
    "pass": [],
}


@pytest.mark.parametrize("text", GROUPS)
def test_groups_functions_and_loops_draw_where_their_keywords_say(text: str) -> None:
    found = sorted(drawn(text))
    assert len(found) == len(GROUPS[text])
    same(found, sorted(GROUPS[text]))


def test_a_role_around_a_call_is_that_of_solids_without_one() -> None:
    text = WHOLE + "def f():\n    cylinder(radius=1)\n    handle(height=1)\ndrawer(f())\nf()"
    found = [node for node in parse(text).walk() if isinstance(node, sp.Draw)]
    assert [node.role for node in found] == ["drawer", "handle", "", "handle"]


def test_the_longest_side_as_written_is_24_cells_whatever_is_set() -> None:
    program = parse("# unit: mm\nwide = 100\nwidth, depth, height = wide, 60, 80\nbox(height=5)")
    assert program.source.scale.cells_per_unit == 24 / 100
    assert program.unit.name == "mm"
    changed = sp.set(program, wide=200)
    assert changed.source.scale == program.source.scale
    same(bounds(changed), [((-100, 100), Y, (0, 5))])
    assert parse(format_program(changed)).source.scale.cells_per_unit == 24 / 200


def test_left_is_on_the_positive_third_axis_of_the_grid() -> None:
    scene = sp.unroll(parse(WHOLE + "leg(left=0, width=10, front=0, depth=10, height=10)"))
    cells = 24 / 100
    assert scene.centre[0].tolist() == pytest.approx([(5 - 40) * cells, -25 * cells, 45 * cells])


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("plinth = 3\nbox()", "line 2: unused name 'plinth'"),
        ("def f(a=1):\n    box()\nf()", "line 2: unused name 'a'"),
        ("def f():\n    box()", "line 2: unused name 'f'"),
        ("def f():\n    a = 1\n    box()\nf()", "line 3: unused name 'a'"),
    ],
)
def test_names_that_nothing_uses_are_warned_about(text: str, words: str) -> None:
    assert parse(WHOLE + text).source.warnings == (words,)


# ---------------------------------------------------------------- wrong programs

WRONG = [  # the place of the mistake is behind ^, and a word of the message or of the hint follows
    # keywords of an axis
    ("box(left=1, right=2, ^width=3)", "exclude"),
    ("box(width=3, left=1, ^right=2)", "exclude"),
    ("box(^z=2)", "height"),
    ("box(z=2, ^bottom=1)", "exclude"),
    ("box(y=2, depth=3, ^rear=1)", "exclude"),
    ("box(top=1, bottom=1, ^height=2)", "exclude"),
    ("seat(cushion(front=1, rear=1, ^depth=3, edge=1))", "exclude"),
    ("with inside(front=1, rear=1, ^depth=3):\n    box()", "exclude"),
    ("for _ in divide(2, x, left=1, right=1, ^width=3):\n    box()", "exclude"),
    ("def f():\n    box()\nf(x=1, ^left=2)", "exclude"),
    # sizes
    ("box(^width=0)", "positive"),
    ("box(height=2, ^depth=-3)", "depth is -3"),
    ("box(left=60, ^right=40)", "width is 0"),
    ("box(^bottom=80)", "height is 0"),
    ("box(^top=2 * 50)", "height is -20"),
    ("with inside(left=60, ^right=60):\n    box()", "width"),
    ("for _ in divide(2, z, ^top=90):\n    box()", "height"),
    ("cylinder(^radius=-1)", "negative"),
    ("cylinder(^radius=0)", "radius is 0"),
    ("taper(^radius=(0, 0))", "radius"),
    ("seat(cushion(^edge=-1))", "edge is -1"),
    ("bar(start=at(), end=at(top=0), ^width=0, depth=1)", "width"),
    # words
    ("box(^lefft=1)", "did you mean left"),
    ("drawer(box(^wdith=1))", "width"),
    ("^draver(left=1)", "did you mean drawer"),
    ("^leg", "statement"),
    ("leg(^post(width=1))", "only one"),
    ("leg(^seat(cushion(edge=1)))", "only one"),
    ("box(left=1, ^left=2)", "twice"),
    ("box(^3)", "without a keyword; write width"),
    ("def f(a):\n    box(width=a)\nf(^3)", "without a keyword; write a=..."),
    ("leg(^cylinder(radius=1), left=3)", "write the keywords inside it: leg(cylinder(...))"),
    ("^at(left=3)", "a point is no part"),
    ("leg(cylinder(^rod(radius=1)))", "keyword"),
    ("box(^edge=1)", "edge"),
    ("seat(cushion(edge=1, ^lean=3))", "lean"),
    ("box(^**a)", "keyword"),
    # solids
    ("^support_cylinder(radius=3)", "needs a solid"),
    ("^line(width=3)", "needs a solid"),
    ("^post(radius=3)", "needs a solid"),
    ("^leg(start=at(), end=at(top=0))", "needs a solid"),
    ("seat(^cushion(height=3))", "edge"),
    ("^taper(height=3)", "radius"),
    ("taper(^radius=2)", "two radii"),
    ("cylinder(^width=3, radius=1)", "exclude"),
    ("cylinder(left=1, ^x=2, radius=1)", "exclude"),
    ("cylinder(^y=2)", "depth"),
    ("^cylinder(width=3, depth=4)", "differ"),
    ("^cylinder(top=1)", "differ"),
    # points
    ("rod(start=at(top=1, ^bottom=1), end=at(left=0), radius=1)", "exclude"),
    ("rod(start=at(^height=1), end=at(left=0), radius=1)", "height"),
    ("rod(^start=3, end=at(left=0), radius=1)", "point"),
    ("rod(^start=at(1), end=at(left=0), radius=1)", "point"),
    ("^rod(start=at(), end=at(left=0))", "radius"),
    ("^rod(end=at(left=0), radius=1)", "start"),
    ("rod(start=at(), ^end=at(bottom=0), radius=1)", "same point"),
    ("bent_rod(start=at(left=1), ^through=at(), end=at(right=1), radius=1)", "start and through are the same point"),
    ("bent_rod(start=at(left=1), through=at(right=1), ^end=at(right=1), radius=1)", "through and end are the same"),
    ("rod(start=at(), end=at(top=0), radius=1, ^tilt=3)", "tilt"),
    ("^bent_rod(start=at(), end=at(top=0), radius=1)", "through"),
    ("^bar(start=at(), end=at(top=0), depth=1)", "two sizes"),
    ("^bar(start=at(), end=at(top=0), width=1, depth=1, height=1)", "two sizes"),
    ("^bar(start=at(), end=at(top=0), depth=1, height=1)", "runs left-right"),
    ("^bar(start=at(), end=at(x=40, bottom=10), width=1, depth=1)", "runs upwards"),
    ("bar(start=at(), end=at(top=0), width=1, depth=1, ^tilt=1)", "tilt"),
    # names
    ("^drawer = 3", "word of the language"),
    ("^y = 3", "word of the language"),
    ("^inside = 3", "word of the language"),
    ("^height = 3", "twice"),
    ("a = 1\n^a = 2", "twice"),
    ("a = 1\nb, ^a = 2, 3", "twice"),
    ("^a, b = 1", "2 names"),
    ("a = ^b = 1", "two"),
    ("box(left=^thick)", "unknown name"),
    ("thick = 1\nbox(left=^thik)", "did you mean thick"),
    ("box(left=^bottom)", "bottom is a word of the language, not a number"),
    ("box(left=^depth ** 2)", "number"),
    ("box(left=^None)", "number"),
    ("box(left=^'2')", "number"),
    ("box(left=^(1, 2))", "number"),
    ("box(left=^1 / (depth - 60))", "zero"),
    ("box(left=^1e9 * 1e9)", "large"),
    ("for _ in mirror(x=0):\n    ^a = 1\n    box()", "inside a loop"),
    ("with inside(left=1):\n    ^a = 1\n    box()", "inside a loop"),
    # functions
    ("def f(^left):\n    box()", "word of the language"),
    ("def f(^tilt=1):\n    box()", "word of the language"),
    ("def f(a, ^a):\n    box()", "twice"),
    ("^def f(*a):\n    box()", "parameters"),
    ("^def f(a: 3):\n    box()", "parameters"),
    ("^def edge():\n    box()", "meaning"),
    ("^def seat():\n    box()", "meaning"),
    ("a = 1\n^def a():\n    box()", "meaning"),
    ("def f():\n    box()\n^def f():\n    box()", "meaning"),
    ("def f(a=^height / 2):\n    box(left=a)", "not to defaults"),
    ("def f():\n    ^f()\nf()", "calls itself"),
    ("^f()\ndef f():\n    box()", "functions stand above calls"),
    ("def f(a):\n    box(left=a)\n^f()", "needs a"),
    ("def f(a):\n    box(left=a)\nf(a=1, ^b=2)", "unknown keyword"),
    ("def f(a):\n    box(width=5, ^height=a)\nf(a=0)", "height is 0"),
    ("def f():\n    ^def g():\n        box()\nf()", "inside another"),
    ("for _ in mirror(x=0):\n    ^def g():\n        box()", "inside another"),
    # loops and groups
    ("for _ in ^repeat(3):\n    box()", "unknown loop"),
    ("for _ in ^[1, 2]:\n    box()", "loop"),
    ("for _ in ^inside(left=3):\n    box()", "write with inside("),
    ("with ^divide(3, x):\n    box()", "write for _ in divide("),
    ("^for i, j in mirror(x=0):\n    box()", "one variable"),
    ("^for _ in mirror(x=0):\n    box()\nelse:\n    box()", "else"),
    ("for i in mirror(x=0):\n    box(left=^i)", "unknown name"),
    ("with ^outside(left=1):\n    box()", "group"),
    ("^with inside(left=1) as a:\n    box()", "no name"),
    ("with ^inside(3):\n    box()", "inside takes no number"),
    ("for _ in ^mirror():\n    box()", "keyword"),
    ("for _ in mirror(x=0, ^left=1):\n    box()", "exclude"),
    ("for _ in mirror(^width=1):\n    box()", "width"),
    ("for _ in ^rotate():\n    box()", "count"),
    ("for _ in rotate(3, ^bottom=1):\n    box()", "bottom"),
    ("for _ in rotate(3, left=1, ^x=1):\n    box()", "exclude"),
    ("for _ in ^translate(3):\n    box()", "keyword"),
    ("for _ in translate(3, ^left=2):\n    box()", "left"),
    ("for _ in ^row(3):\n    box()", "last"),
    ("for _ in row(3, ^left=2):\n    box()", "last=at(left"),
    ("for _ in row(3, last=^at()):\n    box()", "last"),
    ("for _ in row(3, ^last=2):\n    box()", "point"),
    ("for _ in row(3, last=at(x=0, ^right=0)):\n    box()", "exclude"),
    ("for _ in ^row(3, last=at(x=0)):\n    pass", "draws nothing"),
    ("for _ in row(^1e6, last=at(x=0)):\n    leg(width=1)", "too large"),
    ("for _ in ^divide(3):\n    box()", "axis"),
    ("for _ in divide(3, ^width):\n    box()", "axis"),
    ("for _ in ^divide(3, x, gap=50):\n    box()", "fit"),
    ("^divide(3, x)", "draws nothing itself"),
    ("^inside(left=3)", "draws nothing itself"),
    ("^while 1:\n    box()", "statement"),
    ("^import os", "statement"),
    ("box^(left=1", "syntax"),
    # the characters of a line count, not their bytes
    ("bär = 1\nbox(left=bär, ^left=2)", "twice"),
]


def place_of(text: str) -> tuple[str, int, int]:
    """The text without its mark, and line and column that the mark points at."""
    before, _, after = text.partition("^")
    return before + after, before.count("\n") + 1, len(before) - (before.rfind("\n") + 1) + 1


@pytest.mark.parametrize(("text", "words"), WRONG)
def test_what_is_wrong_is_refused_at_its_place(text: str, words: str) -> None:
    text, line, column = place_of(WHOLE + text)
    with pytest.raises(ProgramError) as caught:
        parse(text, "chair.shape")
    assert words in f"{caught.value.message}; {caught.value.hint}"
    assert (caught.value.line, caught.value.column) == (line, column)
    assert f"chair.shape, line {line}, column {column}: " in str(caught.value)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("^seat()", "size is not declared"),
        ("^top(height=3)", "size is not declared"),
        ("# unit: cm\n^leg(width=5, depth=5)", "size is not declared"),
        ("^cylinder(radius=3, height=3)", "size is not declared"),
        ("^taper(radius=(1, 2), height=3)", "size is not declared"),
        ("^for _ in mirror(x=0):\n    leg(width=3)", "size is not declared"),
        ("^width, depth = 3, 4\nleg(width=5)", "is one line"),
        ("^[width, depth, height] = 1, 2, 3\n", "without brackets"),
        ("^a = 3\n", "declare its size"),
        ("^depth = 3\nwidth, height = 4, 5\n", "one line"),
        ("^width, depth, height = 1, -2, 3\n", "depth of the whole is -2"),
        ("# unit: ^feet\nwidth, depth, height = 1, 2, 3\n", "unit"),
        ("width, depth, height = 1, 2, ^long\n", "unknown name"),
    ],
)
def test_a_text_begins_with_its_size(text: str, words: str) -> None:
    text, line, column = place_of(text)
    with pytest.raises(ProgramError) as caught:
        parse(text)
    assert words in f"{caught.value.message}; {caught.value.hint}"
    assert (caught.value.line, caught.value.column) == (line, column)


# ---------------------------------------------------------------- properties


@given(SEEDS)
def test_programs_print_and_read_back(seed: int) -> None:
    program = parse(placed_text(seed))
    text = format_program(program)
    assert parse(text) == program
    assert format_program(parse(text)) == text


@pytest.mark.parametrize(
    "text", ["# unit: cm\n# unit: m\n{}", "# unit: with three doors\n{}", "{}# unit: mm\n", "  # unit: cm\n{}"]
)
def test_comments_about_units_print_and_read_back(text: str) -> None:
    program = parse(text.format(WHOLE) + "box()")
    assert parse(format_program(program)) == program
    assert program.source.unit.name == ("cm" if "cm" in text else "")


@given(SEEDS, st.floats(0.9, 1.3))
def test_a_name_that_is_set_keeps_the_scale_and_draws_what_its_text_says(seed: int, factor: float) -> None:
    program = parse(placed_text(seed))
    for name in sp.names(program):
        if not name.free:
            continue
        changed = sp.set(program, {name.name: name.value * factor})
        again = parse(format_program(changed))
        assert changed.source.scale == program.source.scale
        assert len(bounds(changed)) == len(bounds(program))
        same(bounds(changed), bounds(again).tolist())


def moved(program: sp.Program, name: str, value: float) -> torch.Tensor:
    scene = sp.unroll(sp.encode(sp.set(program, {name: value}), dtype=torch.float64))
    return torch.cat([scene.centre, scene.size], 1)


@given(SEEDS)
def test_gradients_are_finite_differences_for_every_name(seed: int) -> None:
    program = parse(placed_text(seed))
    chair = sp.Parametric(program)
    assert set(chair.names) == {name.name for name in sp.names(program) if name.free}

    def scene(values: torch.Tensor) -> torch.Tensor:
        drawn = sp.unroll(chair.at(values))
        return torch.cat([drawn.centre, drawn.size], 1)

    slopes = torch.autograd.functional.jacobian(scene, chair.values, vectorize=True)
    for place, (name, value) in enumerate(zip(chair.names, chair.values.tolist(), strict=True)):
        step = value / 100
        difference = (moved(program, name, value + step) - moved(program, name, value - step)) / (2 * step)
        assert torch.allclose(slopes[..., place], difference, rtol=0.02, atol=0.02)


@given(SEEDS)
def test_symbolic_evaluation_is_the_exact_one(seed: int) -> None:
    program = parse(placed_text(seed))
    chair = sp.Parametric(program)
    exact = sp.encode(program, dtype=torch.float64).parameters
    assert torch.allclose(chair.at(chair.values).parameters, exact, rtol=1e-5, atol=1e-5)
    other = chair.values * 1.1
    changed = sp.encode(sp.set(program, dict(zip(chair.names, other.tolist(), strict=True))), dtype=torch.float64)
    assert torch.allclose(chair.at(other).parameters, changed.parameters, rtol=1e-5, atol=1e-5)


# ---------------------------------------------------------------- the pieces


@pytest.mark.parametrize("path", PIECES, ids=lambda path: path.stem)
def test_a_piece_is_short_and_written_as_it_is_printed(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    program = parse(text)
    assert program.source.warnings == ()
    assert len(text.splitlines()) <= 28
    assert format_program(program) == text


@pytest.mark.parametrize("size", ["width", "depth", "height"])
@pytest.mark.parametrize("path", PIECES, ids=lambda path: path.stem)
def test_a_piece_grows_with_its_size_and_stays_on_the_floor(path: Path, size: str) -> None:
    program = sp.load(path)
    known = {name.name: name for name in sp.names(program)}
    word = size if known[size].free else known[size].text
    changed = sp.set(program, {word: known[size].value * 1.25})
    before, after = (bounds(each) for each in (program, changed))
    axis = ["width", "depth", "height"].index(size)
    grown = [(each[:, axis, 1].amax() - each[:, axis, 0].amin()).item() for each in (before, after)]
    assert grown[1] == pytest.approx(1.25 * grown[0], rel=0.02)
    assert after[:, 2, 0].amin().item() == pytest.approx(before[:, 2, 0].amin().item(), abs=1e-4)

"""Structure from the surface: candidates from pieces, loops over copies, and programs of planted furniture."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from declared import LANGUAGE, without_the_paper

import shapeprog as sp
from shapeprog.data import load
from shapeprog.data.placement import shape_from_mesh, shape_from_points
from shapeprog.data.remarks import remark_on_size
from shapeprog.data.shape import Shape
from shapeprog.evaluation.metrics import evaluate_program
from shapeprog.formats.parts import parts, solid
from shapeprog.geometry.batch import Solids
from shapeprog.inference.assembly import Assembly, _pruned, _unharmed, assemble
from shapeprog.inference.candidates.drawings import canonical_side, simplest
from shapeprog.inference.candidates.loops import distinct, images, profiles, repeated
from shapeprog.inference.choice.coverage import Coverage, Prices
from shapeprog.inference.surface.evidence import evidence_of, evidence_of_program
from shapeprog.language import Draw, Language, Loop, Program, language, standard, statement, using
from shapeprog.language.hints import Box
from shapeprog.language.parameters import Length, Position, Radius
from shapeprog.language.parser import parse
from shapeprog.language.program import Node
from shapeprog.language.shapes import disc
from shapeprog.language.unroll import unroll

EXAMPLES = Path(__file__).parent.parent / "examples"

SPLAYED = """\
box(at=(3, -7, -7), size=(1, 14, 14))
for i in mirror(side):
    for j in mirror(depth):
        bar(start=(-12, 7, 7), end=(3, 5, 5), section=(1.5, 1.5))
"""

SLATS = """\
for i in translate(2, by=(0, 10, 0)):
    for j in translate(5, by=(0, 0, 5)):
        box(at=(-6, -6, -11.5), size=(12, 1, 2))
box(at=(6, -6, -12), size=(1.5, 12, 24))
"""


def whole(text: str) -> Shape:
    """A program as the mesh of the union of its parts."""
    return shape_from_mesh(*solid(parse(text)), name="planted", axes=np.eye(3))


def assembled(shape: Shape, **options) -> Assembly:
    """A program for a shape, from its own surface."""
    return assemble(Coverage(evidence_of(shape, options.get("seed", 0))), **options)


def apart(text: str) -> Shape:
    """A program as a soup of its parts."""
    drawn = parts(parse(text))
    starts = np.cumsum([0, *(len(part.vertices) for part in drawn)])
    vertices = np.concatenate([part.vertices for part in drawn])
    faces = np.concatenate([part.faces + start for part, start in zip(drawn, starts, strict=False)])
    return shape_from_mesh(vertices, faces, name="planted", axes=np.eye(3))


def unrolled(text: str) -> list[Node]:
    """The single solids of a program of boxes and bars, each as a statement of its own."""
    drawn: list[Node] = []
    for node in parse(text).flat().body:
        drawn += _copies(node)
    return drawn


def _copies(node: Node) -> list[Node]:
    if isinstance(node, Draw):
        return [node]
    assert node.name == "translate"
    step = np.array(node.values[1:])
    found: list[Node] = []
    for inner in (each for body in node.body for each in _copies(body)):
        for copy in range(node.count):
            at = tuple(float(value) for value in np.array(inner.values[:3]) + copy * step)
            found.append(Draw(inner.name, (*at, *inner.values[3:])))
    return found


def words(program: Program) -> Counter[str]:
    return Counter(node.name for node in program.walk())


@pytest.mark.parametrize("given", [whole, apart])
def test_splayed_legs_are_one_bar_in_two_mirrors(given):
    shape = given(SPLAYED)
    found = assembled(shape)
    assert words(found.program) == Counter(mirror=2, box=1, bar=1)
    measured = evaluate_program(found.program, shape, looks=True)
    assert measured.f1_percent > 0.97
    assert measured.silhouette > 0.95
    assert found.explained > 0.95


def test_slats_are_loops_in_loops():
    found = assembled(apart(SLATS)).program
    assert found.blocks == 2
    assert found.size == 11
    assert found.statements == 4  # two loops around the slats


def test_a_grid_of_boxes_is_rolled_up_whole():
    singles = unrolled(SLATS)
    nested = [node for node in repeated(singles) if Program((node,)).size == 10]
    assert nested
    expected = sp.unroll(Program(tuple(singles[:10]))).centre
    for node in nested:
        centres = sp.unroll(Program((node,))).centre
        gaps = torch.cdist(expected, centres).amin(1)
        assert gaps.max() < 1e-3


@pytest.mark.parametrize("missing", [1, 2, 3, 4])
def test_a_run_with_a_missing_copy_is_written_as_one_loop(missing):
    copies: list[Node] = [Draw("box", (-12.0, 0.0, -11.0 + 4 * k, 20.0, 1.0, 2.0)) for k in range(6) if k != missing]
    found = [node for node in repeated(copies) if isinstance(node, Loop) and node.count == 6]
    assert found == [Loop("translate", (6.0, 0.0, 0.0, 4.0), (copies[0],))]


def test_three_copies_are_no_run_of_four():
    copies: list[Node] = [Draw("box", (-12.0, 0.0, -11.0 + 4 * k, 20.0, 1.0, 2.0)) for k in (0, 1, 3)]
    assert all(node.count < 4 for node in repeated(copies) if isinstance(node, Loop))


def test_a_copy_that_is_no_candidate_is_found_on_the_surface():
    surface = evidence_of_program(parse(SPLAYED)).surface
    top, leg = Draw("box", (3, -7, -7, 1, 14, 14)), Draw("bar", (-12, 7, 7, 3, 5, 5, 1.5, 1.5, 0))
    turned = Draw("bar", (-12, 5, 5, 3, 7, 7, 1.5, 1.5, 0))

    def mirrored(axis: int, node: Node) -> Node:
        return Loop("mirror", (2.0, float(axis), 0.0), (node,))

    assert images([top, leg, turned], surface) == [mirrored(2, leg), mirrored(1, leg), mirrored(2, mirrored(1, leg))]
    assert images([leg], surface[surface[:, 2] > 0]) == [mirrored(1, leg)]
    assert not images([leg], surface[(surface[:, 1:] > 0).all(1)])
    assert not images([], surface)


def test_a_tapered_leg_is_no_mirror_image_of_one_that_stands_on_its_head():
    one = Draw("taper", (-12.0, 1.0, 6.0, 2.0, 1.0, 6.0, 0.5, 1.0))
    other = Draw("taper", (-12.0, 1.0, -6.0, 2.0, 1.0, -6.0, 1.0, 0.5))
    assert repeated([one, other]) == []


def spokes(count):
    """Rods around the middle, one by one."""
    text = f"for i in rotate({count}, step=1):\n    rod(start=(-12, 7, 1), end=(2, 3, 1), radius=0.8)\n"
    scene = sp.unroll(parse(text))
    ends = [scene.centre + sign * scene.rotation[..., 0] * scene.size[..., :1] for sign in (-1, 1)]
    return scene, [Draw("rod", (*a, *b, 0.8)) for a, b in zip(*(each.tolist() for each in ends), strict=True)]


@pytest.mark.parametrize("count", [3, 4, 5, 6])
def test_legs_around_the_middle_are_turned(count):
    scene, singles = spokes(count)
    surface = evidence_of_program(Program(tuple(singles))).surface
    found = [node for node in images(singles, surface) if node.name == "rotate" and node.values[0] == count]
    assert any(torch.cdist(sp.unroll(Program((node,))).centre, scene.centre).amin(1).max() < 1e-3 for node in found)


def test_single_parts_are_turned_whatever_stands_before_them_and_pairs_never():
    _, singles = spokes(3)
    surface = evidence_of_program(Program(tuple(singles))).surface
    pairs = [Loop("translate", (2.0, 0.01, 0.0, 0.0), (spoke,)) for spoke in singles]
    for nodes in ([*pairs, *singles], [*singles, *pairs]):
        turned = [node for node in images(nodes, surface) if node.name == "rotate"]
        assert turned
        assert all(isinstance(node.body[0], Draw) for node in turned)


def test_parts_of_a_round_surface_are_not_turned():
    surface = evidence_of_program(parse("cylinder(at=(0, 0, 0), height=1, radius=8)")).surface
    assert {node.name for node in images([Draw("box", (0.0, 1.5, -1.0, 1.0, 6.0, 2.0))], surface)} == {"mirror"}


STAR = """\
cylinder(at=(-8, 1.5, 0), height=20, radius=1)
for i in rotate_about(5, step=72, at=(1.5, 0)):
    box(at=(-9, 2, -0.5), size=(1, 10, 1))
"""


def test_the_arms_of_a_star_are_turned_about_its_column_though_that_is_not_the_middle():
    program = parse(STAR)
    column, star = program.body
    assert images([column, star.body[0]], evidence_of_program(program).surface) == [star]
    found = assembled(apart(STAR)).program
    (arms,) = (node for node in found.body if isinstance(node, Loop))
    (middle,) = (node.values[1:3] for node in found.body if node.name in ("cylinder", "support_cylinder"))
    assert arms.values == pytest.approx((5, 72, *middle), abs=0.1)
    assert found.size == 6


def test_a_block_is_written_by_the_plainest_statement_that_draws_it():
    back = Loop("translate", (2.0, 0.0, 0.0, 8.0), (Draw("back", (3.0, 3.0, -5.0, 2.0, 1.0, 8.0, 0.0)),))
    box = Loop("translate", (2.0, 0.0, 0.0, 8.0), (Draw("box", (3.0, 3.0, -5.0, 2.0, 1.0, 8.0)),))
    leaning = Draw("back", (3.0, 3.0, -5.0, 8.0, 1.0, 8.0, 2.0))
    spoke = Loop("rotate", (5.0, 1.0), (Draw("line", (0.0, 0.0, 0.0, 0.0, 6.0, 0.0, 1.0)),))
    assert simplest(Program((leaning, back, spoke))) == Program((leaning, box, spoke))


@pytest.mark.parametrize(
    ("loops", "left", "right"),
    [
        ("mirror(side)", "box(at=(-12, 3, -9), size=(10, 2, 1))", "box(at=(-12, 3, 8), size=(10, 2, 1))"),
        ("mirror(depth)", "box(at=(0, -9, -9), size=(1, 2, 3))", "box(at=(0, 7, -9), size=(1, 2, 3))"),
        (
            "mirror(side) mirror(depth)",
            "bar(start=(-12, -7, -8), end=(3, -5, -5), section=(1, 2), turn=10)",
            "bar(start=(-12, 7, 8), end=(3, 5, 5), section=(1, 2), turn=10)",
        ),
        ("mirror(side)", "rod(start=(-12, 7, -8), end=(3, 5, -5), radius=1)",
         "rod(start=(-12, 7, 8), end=(3, 5, 5), radius=1)"),
        ("mirror(side, at=1)", "box(at=(0, 3, -9), size=(1, 2, 3))", None),
        ("translate(2, by=(0, 2, 1)) mirror(side)", "box(at=(0, 3, -9), size=(1, 2, 3))", None),
    ],
)  # fmt: skip
def test_what_is_mirrored_is_drawn_on_the_left_and_at_the_rear(loops, left, right):
    heads = loops.replace(") mirror", ");mirror").split(";")
    text = "".join(f"{'    ' * depth}for {'ij'[depth]} in {head}:\n" for depth, head in enumerate(heads))
    text += "    " * len(heads)
    assert canonical_side(parse(f"{text}{left}\n")).body == parse(f"{text}{right or left}\n").body


def test_looks_do_not_depend_on_how_a_solid_is_written():
    upright = Draw("box", (-2.0, -1.0, -0.5, 4.0, 2.0, 1.0))
    as_bar = Draw("bar", (-2.0, 0.0, 0.0, 2.0, 0.0, 0.0, 2.0, 1.0, 0.0))
    other_way = Draw("bar", (0.0, -1.0, 0.0, 0.0, 1.0, 0.0, 4.0, 1.0, 0.0))
    seen = profiles([upright, as_bar, other_way])
    np.testing.assert_allclose(seen.half[1:], seen.half[:1].repeat(2, 0), atol=1e-5)
    np.testing.assert_allclose(seen.distance[1:], seen.distance[:1].repeat(2, 0), atol=1e-5)
    assert distinct([upright, as_bar, as_bar]) == [upright, as_bar]


def test_solids_with_others_inside_are_not_drawn_as_hollow():
    found = assembled(load(EXAMPLES / "armchair_kaykit.obj")).program
    assert found.blocks <= 7
    assert unroll(found).bounds.amin() > 0.2  # half of the thinnest part: walls of the arms would be of .1 cells


def test_a_thick_seat_with_bevelled_edges_is_a_cushion():
    found = assembled(load(EXAMPLES / "stool_kaykit.obj")).program
    seat = next(node for node in found.walk() if isinstance(node, Draw) and node.values[4] > 20)
    assert seat.name == "cushion"
    assert seat.values == pytest.approx([1.6, -12, -12, 6.4, 24, 24, 1.7], abs=0.3)


def test_a_row_ends_before_the_board_that_its_last_copy_would_lie_in():
    top = "locker(at=(11, -4, -12), size=(1, 8, 24))\n"
    shelves = "for i in translate(4, by=(7.7, 0, 0)):\n    box(at=(-12, -3.5, -11.5), size=(0.8, 7, 23))\n"
    program = parse(top + shelves)
    found = _unharmed(program, program, Coverage(evidence_of(whole(top + shelves))))
    assert [node.count for node in found.body if isinstance(node, Loop)] == [3]
    assert found.body[0] == program.body[0]


@pytest.mark.parametrize("width", [0.45, 0.9])
def test_thin_square_legs_are_square_and_in_mirrors(width):
    leg = f"leg(at=(-5.6, {6 - width}, {12 - width}), size=(10.8, {width}, {width}))\n"
    mirrors = "for i in mirror(side):\n    for j in mirror(depth):\n        "
    found = assembled(whole("box(at=(5.2, -6, -12), size=(0.45, 12, 24))\n" + mirrors + leg)).program
    assert [node.name for node in found.walk()] == ["box", "mirror", "mirror", "leg"]


def test_the_same_seed_gives_the_same_program():
    assert assembled(whole(SPLAYED), seed=3) == assembled(whole(SPLAYED), seed=3)


def test_no_more_blocks_than_allowed_are_chosen():
    found = assembled(apart(SLATS), blocks=1)
    assert found.program.blocks == 1
    assert "maximum" in found.reason


def test_a_statement_of_a_users_own_is_proposed_by_its_hint():
    own = Language()
    for declared in standard:
        if declared.name in ("translate", "rotate", "mirror"):
            own.register(declared)
    with using(own):

        @statement("drum", hint=lambda box: [_drum(box)])
        def drum(at: Position, height: Length, radius: Radius) -> Solids:
            """A drum on the middle of its bottom."""
            return disc(at, height, radius)

        text = "for i in mirror(side):\n    drum(at=(-6, 0, 6), height=12, radius=3)\n"
        found = assembled(whole(text)).program
        assert words(found)["drum"] == 1
        assert found.size == 2
        assert sorted(set(words(found)) - {"drum"})[0] in ("mirror", "translate")
        # No placed form: the numbers are hundredths of cells.
        program = sp.infer(whole(text)).program
        assert program.scale is None
        values = [value for node in program.walk() for value in node.values]
        assert np.allclose(values, np.round(values, 2), atol=1e-5)
    assert "drum" not in language()


def test_two_fronts_on_a_case_are_two_parts_though_the_gap_between_them_is_narrow():
    text = "locker(at=(-12, -6, -8), size=(24, 12, 16))\n"
    text += "for i in translate(2, by=(0, 0, 8.1)):\n    layer(at=(-12, -6.5, -4.05), thickness=24, half=(0.5, 3.95))\n"
    found = assembled(apart(text)).program
    assert sorted(len(scene) for scene in found.chains) == [1, 2]
    assert found.size == 3


def test_the_legs_of_a_real_table_are_written_with_the_cone_leg_of_the_examples():
    with using(without_the_paper()) as own:
        own.register(LANGUAGE["cone_leg"])
        found = assembled(load(EXAMPLES / "cabinet_quaternius_night_stand.obj"), seed=5).program
        legs = next(chain for chain in found.chains if chain[-1].name == "cone_leg")
        assert [loop.name for loop in legs[:-1]] == ["mirror", "mirror"]
        height, bottom, top = legs[-1].values[3:]
        assert height == pytest.approx(3.9, abs=0.2)  # that of its component
        assert (bottom, top) == pytest.approx((0.8, 1.5), abs=0.2)


def _drum(box: Box) -> list[float]:
    rising = int(np.abs(box.rotation[0]).argmax())
    height, radius = float(2 * box.half[rising]), float(np.delete(box.half, rising).mean())
    up, depth, side = box.centre.tolist()
    return [up - height / 2, depth, side, height, radius]


def test_noise_is_a_program_of_finite_numbers():
    points = np.random.default_rng(0).random((300, 3))
    found = sp.infer(shape_from_points(points, name="noise", axes=np.eye(3)), blocks=2)
    assert found.program.blocks >= 1
    assert all(np.isfinite(node.values).all() for node in found.program.walk())


def test_where_nothing_is_worth_its_price_the_program_is_empty():
    assert sp.infer(EXAMPLES / "chair_kenney.obj", detail=1e-4).program.size == 0


def test_inference_tells_what_it_explains_and_what_more_would_cost():
    shape = whole(SPLAYED)
    found = sp.infer(shape)
    assert found.snapped is None
    assert found.scores["explained"] > 0.95
    assert found.reason.startswith(f"{found.program.blocks} drawing statements cover")
    assert {node.word for node in found.program.walk() if isinstance(node, Draw)} >= {"leg"}
    published = sp.infer(shape, statements="paper")
    assert published.snapped is not None
    assert all(language()[node.name].taught for node in published.program.walk())


def test_blocks_inside_others_and_copies_are_pruned_but_not_what_connects() -> None:
    whole = parse("box(at=(6, -6, -12), size=(1, 12, 24))\nbox(at=(-12, -1, -1), size=(18, 2, 2))")
    inner = parse("box(at=(6.3, -4, -8), size=(0.4, 8, 16))")
    coverage = Coverage(evidence_of_program(whole))
    longer = Program((*whole.body, *inner.body, whole.body[0]))
    assert sorted(map(str, _pruned(longer, coverage).body)) == sorted(map(str, whole.body))
    assert _pruned(whole, coverage) == whole


def test_slats_inside_a_thin_seat_are_pruned_though_points_of_the_target_lie_on_them() -> None:
    slats = parse("for i in translate(4, by=(0, 6, 0)):\n    box(at=(0, -11, -12), size=(0.4, 4, 24))")
    seat = parse("box(at=(0, -11, -12), size=(0.4, 22, 24))")
    both = Program((*seat.body, *slats.body))
    assert _pruned(both, Coverage(evidence_of_program(slats))) == seat
    assert _pruned(Program((*seat.body, *seat.body)), Coverage(evidence_of_program(seat))) == seat


TABLE = "box(at=(2, -8, -12), size=(1, 16, 24))\nfor i in mirror(side):\n    box(at=(-12, -1, 8), size=(14, 2, 2))"


def with_stretcher(low: float, high: float) -> Program:
    """A table with two legs and a stretcher that ends at these sides."""
    return parse(f"{TABLE}\nbox(at=(-6, -0.5, {low}), size=(1, 1, {high - low}))")


@pytest.mark.parametrize(("low", "high"), [(-8, 9.5), (-9, 8.1), (-8, 7.3)])
def test_a_part_with_an_end_inside_another_or_too_short_is_centred_and_reaches_the_legs(low: float, high: float):
    uneven, coverage = with_stretcher(low, high), Coverage(evidence_of_program(with_stretcher(-8, 8)))
    scene = unroll(_unharmed(uneven, uneven, coverage))
    assert scene.centre[-1].tolist() == [-5.5, 0, 0]
    assert 7.9 < scene.reach[-1, 2] < 10


def test_a_part_of_one_side_stays_there():
    uneven = with_stretcher(-8, 6)
    assert _unharmed(uneven, uneven, Coverage(evidence_of_program(uneven))) == uneven


def test_a_ladder_of_thirty_rungs_has_each_rung_once() -> None:
    rungs = "for i in translate(30, by=(0.774, 0, 0)):\n    box(at=(-11.226, -0.05, -0.6), size=(0.0774, 0.1, 1.18))"
    ladder = f"{rungs}\nfor i in mirror(side):\n    box(at=(-12, -0.05, 0.59), size=(24, 0.1, 0.103))"
    assert assembled(apart(ladder)).program.size == 32


def test_what_is_left_out_at_a_side_of_the_target_is_chosen_in_a_second_run() -> None:
    legs = (
        "for i in mirror(side):\n    for j in mirror(depth):\n        cylinder(at=(-12, 5, 10), height=18, radius=0.08)"
    )
    evidence = evidence_of(whole(f"box(at=(6, -6, -12), size=(1.5, 12, 24))\n{legs}"))
    prices = Prices(statement=0.05)  # more than legs of little surface are worth
    alone = assemble(Coverage(evidence, replace(prices, side=1e-9))).program  # has no second run
    again = assemble(Coverage(evidence, prices)).program
    assert "is 8% as high as the input" in remark_on_size(unroll(alone), evidence.surface)
    assert not remark_on_size(unroll(again), evidence.surface)
    assert again.size == 5

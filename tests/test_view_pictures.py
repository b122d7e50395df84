"""Pictures: what is nearest shows, what is lit is bright, and files are whole."""

from __future__ import annotations

import base64
import io
import itertools
import json
import re
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from shapeprog.data import shape_from_mesh
from shapeprog.data.shape import Shape
from shapeprog.data.synthetic import furniture
from shapeprog.errors import OutputError
from shapeprog.formats.colours import colour
from shapeprog.formats.parts import parts
from shapeprog.geometry.primitives.cuboid import mesh as box_mesh
from shapeprog.inference.infer import Result
from shapeprog.language.dimensions import in_unit
from shapeprog.language.named import set as set_names
from shapeprog.language.parser import parse
from shapeprog.language.printer import format_program
from shapeprog.language.program import Loop, Program
from shapeprog.language.unit import Unit
from shapeprog.view import Item, contact_sheet, picture, viewer
from shapeprog.view import raster_kernels as kernels
from shapeprog.view.listing import listing, parted, wrapped
from shapeprog.view.model import of_cells, of_mesh, of_parts, of_points, of_shape
from shapeprog.view.render import camera_for, render
from shapeprog.view.viewer import PAGE, corners_of, sliders

TEXT = """
top_rectangle(at=(4, 0, 0), thickness=2, half=(9, 11))
for i in translate(2, by=(0, 0, 18)):
    for j in translate(2, by=(0, 14, 0)):
        leg(at=(-12, -8, -10), size=(16, 2, 2))
    horizontal_bar(at=(-8, -7, -10), size=(1.237, 14, 1))
"""
PROGRAM = parse(TEXT)

PLACED = """\
# unit: cm
width, depth, height = 140, 60.12345, 74
drawers = 3  # in the pedestal

def upright(size):
    box(width=size, top=2)

top(top=0, height=2)
for _ in mirror(y=0):
    leg(cylinder(left=0, radius=3, front=0, top=2))
leg(upright(size=4))
upright(size=2, tilt=3)
with inside(right=0, width=40):
    for _ in divide(drawers, z, gap=0.5):
        box(tilt=3)
        bar(start=at(left=0), end=at(top=0), width=1, depth=1)
for _ in row(0, last=at(top=0)):
    handle(height=1)
"""


def size_of(path: Path) -> tuple[int, int]:
    with Image.open(path) as image:
        return image.size


def box_shape() -> Shape:
    vertices, faces = box_mesh(np.array([3.0, 2.0, 1.0, 0.0]))
    return shape_from_mesh(vertices, faces, name="box")


def test_the_nearest_face_shows_as_in_a_slow_twin():
    generator = np.random.default_rng(0)
    points = generator.uniform([-4, -4, 0.1], [36, 28, 1], (60, 3))
    faces = generator.permutation(60).reshape(20, 3)
    face, depth = np.full((24, 32), kernels.BACKGROUND, np.int32), np.zeros((24, 32))
    kernels.nearest_faces(points, faces, 1e-6, face, depth)
    best, wanted = np.full((24, 32), -1), np.zeros((24, 32))
    centre = np.stack(np.meshgrid(np.arange(32) + 0.5, np.arange(24) + 0.5), -1)
    for number, (a, b, c) in enumerate(points[faces]):
        solve = np.linalg.inv(np.stack([b[:2] - a[:2], c[:2] - a[:2]], 1))
        w = (centre - a[:2]) @ solve.T
        near = a[2] + w @ np.array([b[2] - a[2], c[2] - a[2]])
        shown = (w >= 0).all(-1) & (w.sum(-1) <= 1) & (near > wanted)
        best[shown], wanted[shown] = number, near[shown]
    assert (face == best).all()
    np.testing.assert_allclose(depth, wanted, atol=1e-9)


def test_of_faces_in_one_place_the_first_shows_without_speckles():
    board = "top_rectangle(at=(0, 0, 0), thickness=2, half=(8, 8))\n"
    model = of_parts(parts(parse(board + "leg(at=(-1, -4, -4), size=(3, 4, 4))")))
    image = render(model, camera_for([model]), 96, 96)
    blue = (image[..., 2].astype(int) - image[..., 0]) > 25
    assert not blue[:60].any(), "the leg ends flush with the top, which comes first in the program"


def test_everything_fits_the_frame_and_both_share_a_camera():
    one, two = of_parts(parts(PROGRAM)), of_cells(np.ones((32, 32, 32), bool))
    camera = camera_for([one, two], 1.5)
    pixels = camera.project(two.vertices, 300, 200)
    assert pixels[:, 0].min() >= 15
    assert pixels[:, 0].max() <= 285
    assert pixels[:, 1].min() >= 10
    assert pixels[:, 1].max() <= 190
    top, floor = camera.project(np.array([[10.0, 0, 0], [-10.0, 0, 0]]), 300, 200)
    front, rear = camera.project(np.array([[0.0, -10, 0], [0.0, 10, 0]]), 300, 200)
    assert top[1] < floor[1], "up is up in the picture"
    assert front[2] > rear[2], "the front is nearer"


def test_shape_comes_in_colour_on_white_with_a_shadow():
    model = of_parts(parts(parse("top_rectangle(at=(0, 0, 0), thickness=2, half=(9, 9))")))
    lifted = of_parts(parts(parse("leg(at=(-12, 0, 0), size=(1, 1, 1))")))
    image = render(model, camera_for([model, lifted]), 160, 160).astype(float)
    assert (image[:4] == 255).all()
    gold = np.array(colour("top_rectangle"), float)
    close = np.abs(image / image.max(-1, keepdims=True) - gold / gold.max()).max(-1) < 0.15
    assert close.mean() > 0.15
    grey = (np.ptp(image, axis=-1) < 3) & (image[..., 0] < 250)
    assert grey.mean() > 0.02, "a shadow lies on the ground"


def test_cells_points_and_meshes_become_models():
    cells = np.zeros((32, 32, 32), bool)
    cells[16, 16, 16:18] = True
    model = of_cells(cells)
    corners = model.vertices[model.faces]
    area = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) / 2
    assert np.linalg.norm(area, axis=1).sum() == pytest.approx(10)
    assert np.einsum("fc,fc->", area, corners.mean(1)) / 3 == pytest.approx(2), "faces look outwards"
    assert model.vertices.min(0).tolist() == [0, 0, 0]
    np.testing.assert_allclose(np.einsum("fc,fc->f", area, model.normals[:, 0]), 0.5)
    assert len(of_points(np.zeros((9000, 3))).faces) <= 2500 * 20
    shape = box_shape()
    assert len(of_shape(shape).faces) == 12
    assert shape.vertices is not None
    assert shape.faces is not None
    assert len(of_mesh(shape.vertices, shape.faces).normals) == 12


def test_pictures_are_written_with_and_without_an_input(tmp_path: Path):
    both = picture(box_shape(), PROGRAM, tmp_path / "both.png", scores={"iou": 0.9, "cd": 0.0004}, view=120)
    alone = picture(None, PROGRAM, tmp_path / "alone.jpg", view=120)
    nothing = picture(None, Program(), tmp_path / "nothing.png", view=120)
    named = picture(None, Program(), tmp_path / "named.png", view=120, title="stool")
    assert named.read_bytes() != nothing.read_bytes()
    sizes = [size_of(path) for path in (both, alone, nothing)]
    assert sizes[0][0] - sizes[1][0] == 120
    assert sizes[1] == sizes[2]
    assert not list(tmp_path.glob(".*"))


def test_programs_and_results_show_themselves_in_text_and_in_notebooks():
    program = parse(PLACED)
    assert f"{program}\n" == PLACED
    scores = {"explained": 0.934, "numbers": 12.0}
    result = Result(program, None, scores, "The search ended: nothing more to gain.", (), seconds=2.5)
    assert str(result) == (
        "7 blocks, 11 statements, 11 solids, 12 free numbers, 93.4% of the surface explained\n"
        "The search ended: nothing more to gain.\n2.5 s; its program is .program"
    )
    assert repr(program) == "<Program: 7 blocks, 11 statements, 11 solids>"
    assert repr(result).startswith("Result(program=<Program: 7 blocks")
    assert "ended" not in repr(result)
    for shown in (program, result, Program()):
        with Image.open(io.BytesIO(shown._repr_png_())) as image:
            assert image.size[0] > image.size[1] > 400


def test_a_long_program_still_fits(tmp_path: Path):
    path = picture(None, parse("leg(at=(0, 0, 0), size=(1, 1, 1))\n" * 90), tmp_path / "long.png", view=120)
    assert size_of(path)[1] == 184


def test_contact_sheets_hold_every_item(tmp_path: Path):
    items = [Item(f"item {k}", box_shape() if k % 2 else None, PROGRAM, "IoU 0.9") for k in range(5)]
    one = size_of(contact_sheet(items[:1], tmp_path / "one.png"))
    many = size_of(contact_sheet(items, tmp_path / "many.png", title="many", columns=2))
    assert many[0] > one[0]
    assert many[1] > 2.5 * (one[1] - 60)


def test_errors_name_the_cure(tmp_path: Path):
    with pytest.raises(OutputError, match=r"\.png"):
        picture(None, PROGRAM, tmp_path / "a.bmpx")
    with pytest.raises(OutputError, match="nothing to put"):
        contact_sheet([], tmp_path / "a.png")
    with pytest.raises(OutputError, match="make the folder"):
        picture(None, PROGRAM, tmp_path / "no" / "a.png", view=60)


def test_listing_knows_which_line_draws_what():
    lines = listing(PROGRAM, None)
    assert "\n".join(line.text for line in lines) + "\n" == format_program(PROGRAM)
    assert [line.blocks for line in lines] == [(0,), (1, 2), (1,), (1,), (2,)]
    assert [line.role for line in lines] == ["top_rectangle", "", "", "leg", "horizontal_bar"]
    assert ["".join(parted(line)) for line in lines] == [line.text for line in lines]
    assert all(parted(line)[1] == line.word for line in lines)
    assert "size=(1.24, 14, 1)" in listing(PROGRAM)[-1].text
    empty = Program((Loop("rotate", (2.0, 1.0), ()),))
    assert [line.blocks for line in listing(empty)] == [(), ()]


def test_rows_of_placed_text_know_what_they_draw_and_in_which_colour():
    program = parse(PLACED)
    rows, drawn = listing(program, None), parts(program)
    assert "\n".join(row.text for row in rows) + "\n" == format_program(program) == PLACED
    assert ["".join(parted(row)) for row in rows] == [row.text for row in rows]
    assert all(parted(row)[1] == row.word for row in rows)
    found = [(row.word, row.blocks, row.role != "") for row in rows if row.word]
    assert found == [
        ("upright", (2, 3), False), ("box", (2, 3), True), ("top", (0,), True), ("mirror", (1,), False),
        ("leg", (1,), True), ("leg", (2,), True), ("upright", (3,), False), ("inside", (4, 5), False),
        ("divide", (4, 5), False), ("box", (4,), True), ("bar", (5,), True), ("row", (6,), False),
        ("handle", (6,), True),
    ]  # fmt: skip
    for row in rows:
        if row.role:
            colours = {part.word for part in drawn if part.block in row.blocks[:1]}
            assert colours <= {row.role}, "a line has the colour of its parts"
    assert "60.12," in listing(program)[1].text


TOGETHER = (
    "seat back leg arm arm_post post slat rail stretcher apron brace cushion foot base pedestal block",
    "headboard footboard mattress pillow cushion side slat rail leg post foot panel drawer base",
    "top side panel shelf drawer door handle body base foot leg apron block back",
    "top leg apron stretcher brace foot pedestal base block drawer handle shelf panel",
    "seat back arm cushion pillow base foot leg body side block apron",
)
"""Roles that occur together in chairs, beds, cabinets, tables and sofas."""


def lab(rgb: tuple[int, int, int]) -> np.ndarray:
    """CIE Lab coordinates of a colour in sRGB, under D65."""
    channels = np.asarray(rgb) / 255
    linear = np.where(channels <= 0.04045, channels / 12.92, ((channels + 0.055) / 1.055) ** 2.4)
    to_xyz = [[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.072175], [0.0193339, 0.119192, 0.9503041]]
    x, y, z = np.cbrt(to_xyz @ linear / [0.95047, 1, 1.08883])  # none of the colours is nearly black
    return np.array([116 * y - 16, 500 * (x - y), 200 * (y - z)])


def test_roles_that_occur_together_have_distinct_colours():
    families = [words.split() for words in TOGETHER]
    drawn = [[part.word for part in parts(furniture(number, 0))] for number in range(20)]
    for words in (*families, *drawn):
        for one, two in itertools.combinations(sorted(set(words)), 2):
            apart = np.linalg.norm(lab(colour(one)) - lab(colour(two)))
            assert apart > 25, (one, two, apart)


def test_the_page_needs_nothing_else_and_escapes_what_it_is_told(tmp_path: Path):
    path = viewer(PROGRAM, tmp_path / "view.html", shape=box_shape(), title="</script><b>&", scores={"iou": 0.5})
    text = path.read_text()
    assert not re.search(r"""(src|href)="|https?://|@import|fetch\(""", text)
    assert text.count("</script>") == 2
    data = json.loads(re.search(r'id="data">(.*?)</script>', text, re.DOTALL).group(1))  # type: ignore[union-attr]
    assert data["title"] == "</script><b>&"
    assert [part["name"] for part in data["parts"]][:3] == ["top_rectangle_1", "leg_1", "leg_2"]
    triangles = np.frombuffer(base64.b64decode(data["parts"][0]["triangles"]), "<f4").reshape(-1, 6)
    assert triangles.shape == (36, 6)
    assert triangles[:, :3].max(0).tolist() == [11, 6, 9], "right, up, towards the viewer"
    creases = np.frombuffer(base64.b64decode(data["parts"][0]["creases"]), "<u4").reshape(-1, 2)
    assert len(creases) == 12, "a box has twelve edges"
    assert data["input"] is not None
    assert [part["block"] for part in data["parts"]] == [0, 1, 1, 1, 1, 2, 2]


DRAGGED = """
width, depth, height = 10, 6, 8
lean = 10  # degrees
count = 3
seat(bottom=height / 2, height=1)
back(rear=0, depth=1, bottom=4, height=6, tilt=lean)
for _ in translate(count, x=width / 4):
    rod(start=at(left=2), end=at(x=width / 3, y=1, bottom=4), radius=0.4)
"""


def test_corners_go_where_the_program_with_another_number_has_them():
    program = parse(DRAGGED)
    drawn = parts(program, PAGE)
    start, found = corners_of(drawn), {slider.name: slider for slider in sliders(program, drawn)}
    assert list(found) == ["width", "depth", "height", "lean"], "a count changes how many parts there are"
    for name, slider in found.items():
        for at, places in slider.ends.items():
            expected = corners_of(parts(set_names(program, {name: at}), PAGE))
            for before, there, wanted in zip(start, places, expected, strict=True):
                np.testing.assert_allclose(before if there is None else there, wanted, atol=1e-3)
    far = max(found["height"].ends)
    half = corners_of(parts(set_names(program, height=(8 + far) / 2), PAGE))
    for before, there, wanted in zip(start, found["height"].ends[far], half, strict=True):
        np.testing.assert_allclose(before if there is None else (before + there) / 2, wanted, atol=1e-3)


def test_numbers_of_a_program_in_a_unit_are_dragged_in_it(tmp_path: Path):
    program = in_unit(parse(DRAGGED), Unit("m", 0.04))
    cells = parse(DRAGGED)
    found = {slider.name: slider for slider in sliders(program, parts(program, PAGE))}
    plain = {slider.name: slider for slider in sliders(cells, parts(cells, PAGE))}
    assert {name: slider.unit for name, slider in found.items()} == {
        "width": "m", "depth": "m", "height": "m", "lean": "",
    }  # fmt: skip
    for name, slider in found.items():
        by = 0.04 * 24 / 10 if slider.unit else 1.0
        np.testing.assert_allclose(list(slider.ends), [end * by for end in plain[name].ends], rtol=1e-5)
    page = viewer(program, tmp_path / "page.html").read_text()
    content = json.loads(re.search(r'id="data">(.*?)</script>', page)[1])
    assert [slider["unit"] for slider in content["sliders"]] == ["m", "m", "m", ""]
    assert content["digits"] == 4
    assert content["scale"] == pytest.approx(40), "saved STL files are in millimetres"
    assert content["lines"][0]["before"] == "# unit: m"


def test_sliders_end_where_parts_come_apart():
    program = parse(
        "width, depth, height = 20, 10, 24\nleg_height, thickness = 22, 4\n"
        "top(top=0, height=thickness)\nleg(left=0, width=2, height=leg_height)\n"
    )
    found = {slider.name: slider for slider in sliders(program, parts(program, PAGE))}
    assert list(found["leg_height"].ends) == pytest.approx([20, 33], abs=0.5)
    assert list(found["thickness"].ends) == pytest.approx([2, 6], abs=0.1)
    assert list(found["width"].ends) == pytest.approx([10, 30])


def test_listing_shows_the_unit_and_as_many_decimals_as_it_needs():
    text = "width, depth, height = {0}, {0}, {0}\nbox(left=0.123456, width=2.00004)"
    for name, side, number in (("", 24, "0.12"), ("cm", 90, "0.12"), ("mm", 900, "0.1"), ("m", 0.9, "0.1235")):
        head = [f"# unit: {name}"] if name else []
        found = [line.text for line in listing(parse("\n".join([*head, text.format(side)])))]
        assert found[:-2] == head
        assert found[-1] == f"box(left={number}, width=2)"


def test_plain_programs_and_programs_of_very_many_parts_have_nothing_to_drag():
    assert sliders(PROGRAM, parts(PROGRAM)) == []
    many = parse(
        "width, depth, height = 9, 9, 9\n"
        "for _ in translate(2000, z=0.01):\n    rod(start=at(), end=at(x=1, y=1, bottom=width), radius=1)"
    )
    assert sliders(many, parts(many)) == []


def test_lines_that_assign_numbers_know_their_names_and_values():
    rows = listing(
        parse("width, depth, height = 10.5, 8, 24  # all\ntall = -0.5\nfloor = -tall / 2\nbox(height=floor)")
    )
    assert [row.numbers for row in rows] == [
        (("width", "10.5"), ("depth", "8"), ("height", "24")), (("tall", "-0.5"),), (("floor", "-tall / 2"),), (),
    ]  # fmt: skip


def test_listing_shows_programs_as_they_are_written():
    text = (
        "# a table\nwidth, depth, height = 10.004, 10, 5\n\ndef pair(far):  # of legs\n    for _ in mirror(x=0):\n"
        "        leg(left=far, width=1, height=4)\n    # no more\n\n"
        "top(width=width / 2.0001, top=0, height=1)\npair(far=width / 4)\npair(far=1)\n"
    )
    lines = listing(parse(text), None)
    assert "\n".join(line.text for line in lines) + "\n" == text
    assert [(line.word, line.blocks) for line in lines if line.blocks] == [
        ("pair", (1, 2)), ("mirror", (1, 2)), ("leg", (1, 2)), ("top", (0,)), ("pair", (1,)), ("pair", (2,)),
    ]  # fmt: skip
    assert ["".join(parted(line)) for line in lines] == [line.text for line in lines]
    assert [line.text for line in listing(parse(text))][-1] == "pair(far=1)"
    assert "width=width / 2," in listing(parse(text))[8].text


def test_long_lines_are_broken_and_nothing_is_lost():
    program = parse(
        "width, depth, height = 10, 10, 10\nleg_thickness = 2\n"
        "for _ in mirror(x=0):\n"
        "    leg(left=leg_thickness - 1, width=width - 2 * leg_thickness, front=leg_thickness / 4)\n"
    )
    for line in listing(program):
        for most in (40, 60, 200):
            parts = wrapped(line, most)
            assert all(len(part.text) <= most for part in parts)
            assert "".join(part.text for part in parts).replace(" ", "") == line.text.replace(" ", "")
            assert [part.word for part in parts] == [line.word] + [""] * (len(parts) - 1)


def test_a_name_that_is_longer_than_the_picture_is_wide_is_broken_as_well(tmp_path: Path):
    name = "f" * 150
    program = parse(f"width, depth, height = 10, 10, 10\ndef {name}(a):\n    box(height=a)\n{name}(a=2)\n")
    for line in listing(program):
        parts = wrapped(line, 40)
        assert "".join(part.text for part in parts).replace(" ", "") == line.text.replace(" ", "")
        assert ["".join(parted(part)) for part in parts] == [part.text for part in parts]
    picture(None, program, tmp_path / "a.png")

"""A figure like the paper's: targets, programs, hard voxels of the programs, and 5,000 points on their surfaces."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch

from benchmarks.experiment.measuring import decoded
from benchmarks.experiment.recipes import CATEGORIES
from benchmarks.experiment.stages import Experiment
from shapeprog.evaluation.generated import Written, measured

QUANTILES = (0.1, 0.3, 0.5)
"""Which shapes of each category are shown: at these quantiles of CD, so that nobody picked them."""

POINTS = 5000
SCALE = 2
"""Pixels of the picture for each pixel of its layout."""

VIEW, TEXT, PAD, HEAD, LINE = 194, 400, 14, 34, 17
"""Sides of a view, width of a program, gaps, heights of the headings and of a line, in pixels of the layout."""

LARGEST, SMALLEST = 10.0, 5.0
"""Sizes of type for programs."""

INK, FAINT, RULE = (38, 40, 44), (124, 128, 136), (222, 224, 228)
HEADINGS = ("target", "program", "hard voxels", f"{POINTS:,} surface points")


def chosen(experiment: Experiment, category: str) -> list[tuple[Any, Written, Any]]:
    """Test shapes at the quantiles of CD of the best generator, its single-pass programs, and their measures."""
    from shapeprog.data import read_pack

    best = experiment.best(category)
    shapes = list(read_pack(experiment.pack(category, "test")))[: experiment.shapes]
    written, _ = decoded(experiment.start if best is None else str(experiment.made(best)), shapes)
    found = [measured(each, shape) for each, shape in zip(written, shapes, strict=True)]
    order = np.argsort([each.cd for each in found])
    places = [int(order[round(each * (len(order) - 1))]) for each in QUANTILES]
    return [(shapes[place], written[place], found[place]) for place in places]


def draw(experiment: Experiment, picture: Path) -> None:
    """Draw the figure: a row for each shape."""
    from PIL import Image, ImageDraw

    from shapeprog.view.page import typeface

    rows = [row for category in CATEGORIES for row in chosen(experiment, category)]
    left = [0, VIEW + PAD, VIEW + TEXT + 2 * PAD, 2 * VIEW + TEXT + 2 * PAD]
    width = left[-1] + VIEW + PAD
    page = Image.new("RGB", (SCALE * width, SCALE * (HEAD + VIEW * len(rows) + PAD)), "white")
    pen = ImageDraw.Draw(page)
    for place, wide, heading in zip(left, (VIEW, TEXT, VIEW, VIEW), HEADINGS, strict=True):
        pen.text((SCALE * (place + wide / 2), SCALE * 9), heading, font=typeface(SCALE * 12), fill=FAINT, anchor="ma")
    for number, (shape, written, scores) in enumerate(rows):
        top = HEAD + number * VIEW
        pen.line([(SCALE * PAD, SCALE * top), (SCALE * (width - PAD), SCALE * top)], fill=RULE, width=SCALE)
        for place, view in zip((left[0], left[2], left[3]), views(shape, written), strict=True):
            page.paste(Image.fromarray(view), (SCALE * place, SCALE * (top + LINE)))
        told = f"IoU {scores.iou:.2f}, CD {scores.cd:.4f}"
        pen.text((SCALE * PAD, SCALE * (top + 7)), told, font=typeface(SCALE * 8), fill=FAINT)
        _write(pen, written.program, left[1], top, VIEW)
    picture.parent.mkdir(parents=True, exist_ok=True)
    page.save(picture, optimize=True)


def views(shape: Any, written: Written) -> list[np.ndarray]:
    """Target cells, drawn cells and surface points of a program, from one camera, in the colours of its statements."""
    from shapeprog.geometry.surface import sample_surface
    from shapeprog.language.unroll import unroll
    from shapeprog.view.model import of_cells
    from shapeprog.view.render import camera_for, render

    size = SCALE * (VIEW - LINE - 4)
    target, cells = of_cells(shape.voxels), _coloured_cells(written.whole)
    camera = camera_for([target, cells])
    sample = sample_surface(unroll(written.program), POINTS, torch.Generator().manual_seed(0))
    points, towards = sample.points.double().numpy(), sample.normals.double().numpy()
    seen = ((camera.eye - points) * towards).sum(-1) > 0
    dots = _dots(points, unroll(written.program).statement[sample.slot].tolist(), seen, camera, size)
    return [render(target, camera, size, size), render(cells, camera, size, size), dots]


def _coloured_cells(program: Any) -> Any:
    """The cells of a program of whole numbers, each in the colour of the last statement that draws it."""
    from dataclasses import replace

    from shapeprog.formats.colours import colour
    from shapeprog.geometry.cells import unpack
    from shapeprog.language.tensors import encode
    from shapeprog.language.unroll import draw_blocks
    from shapeprog.view.model import of_cells

    whole = encode(program.flat())
    blocks = unpack(draw_blocks(whole)).numpy().astype(bool)
    owner = np.zeros(blocks.shape[1:], np.int64)
    for ids, cells in zip(whole.ids.tolist(), blocks, strict=True):
        owner[cells] = next(number for number in reversed(ids) if number)
    model = of_cells(owner > 0)
    inside = model.vertices[model.faces].mean(1) - 0.3 * model.normals[:, 0]
    index = np.floor(inside + owner.shape[0] / 2).astype(int)
    statements = owner[tuple(index.T)]
    return replace(model, colours=np.array([colour(each) for each in statements]), group=statements)


def _dots(points: np.ndarray, statements: Sequence[int], seen: np.ndarray, camera: Any, size: int) -> np.ndarray:
    """Points as dots in the colours of their statements, near ones over far ones, those on far sides pale."""
    from PIL import Image, ImageDraw

    from shapeprog.formats.colours import colour

    fine = 2
    page = Image.new("RGB", (fine * size, fine * size), "white")
    pen = ImageDraw.Draw(page)
    across, down, near = camera.project(points, fine * size, fine * size).T
    depth = (near - near.min()) / max(float(np.ptp(near)), 1e-9)
    radius = 0.0038 * fine * size
    for place in np.lexsort([near, seen]):
        shade = 0.6 + 0.4 * depth[place] if seen[place] else 0.22
        ink = tuple(int(255 - shade * (255 - 0.88 * part)) for part in colour(statements[place]))
        x, y = across[place], down[place]
        pen.ellipse([x - radius, y - radius, x + radius, y + radius], fill=ink)
    return np.asarray(page.resize((size, size), Image.Resampling.LANCZOS))


def _write(pen: Any, program: Any, left: int, top: int, height: int) -> None:
    """A program in a column, coloured as the views are, as large as it fits."""
    from shapeprog.view.listing import listing, parted
    from shapeprog.view.page import readable, typeface

    lines = listing(program, 1)
    longest = max((len(line.text) for line in lines), default=1)
    most = min((height - 2 * PAD) / max(len(lines), 1) / 1.4, (TEXT - PAD) / longest / 0.602, LARGEST)
    size = max(SMALLEST, most)
    font, bold = (typeface(round(SCALE * size), "Mono", bold=each) for each in (False, True))
    advance, step = font.getlength("m"), SCALE * size * 1.4
    first = SCALE * (top + height / 2) - step * len(lines) / 2
    for number, line in enumerate(lines):
        before, word, after = parted(line)
        shade = FAINT if line.statement is None else readable(line.statement)
        x, y = SCALE * left, first + number * step
        for text, kind, ink in ((before, font, FAINT), (word, bold, shade), (after, font, INK)):
            pen.text((x, y), text, font=kind, fill=ink)
            x += advance * len(text)

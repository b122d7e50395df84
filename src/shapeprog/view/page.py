"""Pictures: input, reconstruction and program side by side, and contact sheets."""

from __future__ import annotations

import io
import os
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from shapeprog.data.shape import Shape
from shapeprog.errors import OutputError
from shapeprog.files import atomic_path
from shapeprog.formats.colours import colour
from shapeprog.formats.parts import Part, parts
from shapeprog.language.program import Program
from shapeprog.view.listing import Row, listing, parted, wrapped
from shapeprog.view.model import of_parts, of_shape
from shapeprog.view.render import camera_for, render

if TYPE_CHECKING:
    from PIL.ImageDraw import ImageDraw

VIEW = 560  # pixels along each side of one view in a picture
IN_NOTEBOOK = 400  # pixels along each side of the view in a notebook
SMALL = (216, 204)  # width and height of one view in a contact sheet
LARGEST, SMALLEST = 17, 9  # sizes of type for the lines of a program

COLUMNS = 4
LEGEND = 160  # width of an entry of the legend of a contact sheet
SUFFIXES = (".png", ".jpg", ".jpeg", ".webp", ".tif", ".tiff", ".pdf")

_INK, _FAINT, _RULE = (38, 40, 44), (124, 128, 136), (222, 224, 228)
_PAD = 28


@dataclass(frozen=True)
class Item:
    """One entry of a contact sheet."""

    name: str  # its caption
    shape: Shape | None  # the input, or None
    program: Program  # its reconstruction
    note: str = ""  # A second line, such as the scores


def picture(
    shape: Shape | None,
    program: Program,
    path: str | os.PathLike[str],
    *,
    title: str = "",
    scores: Mapping[str, float] | None = None,
    view: int = VIEW,
) -> Path:
    """Draw input, reconstruction (same camera, parts coloured by statement) and program side by side.

    Parameters
    ----------
    shape
        The input, or None to show the program alone.
    program
        The reconstruction; its text is shown with numbers rounded to two decimals.
    path
        A file that ends in .png, .jpg, .webp, .tiff or .pdf.
    title
        Title above the input; by default the name of the shape.
    scores
        Numbers to show below the program, such as ``{"iou": 0.93, "cd": 0.0004}``.
    view
        Pixels along each side of a view.

    Raises
    ------
    OutputError
        If the suffix is unknown or the file cannot be written.
    """
    target = _checked(path)
    _save(_picture(shape, program, title, scores, view), target)
    return target


def png(program: Program, scores: Mapping[str, float] | None = None) -> bytes:
    """The same without an input, small, as the bytes of a PNG: notebooks show it for programs and results."""
    content = io.BytesIO()
    _picture(None, program, "", scores, IN_NOTEBOOK).save(content, format="PNG")
    return content.getvalue()


def _picture(shape: Shape | None, program: Program, title: str, scores: Mapping[str, float] | None, view: int) -> Any:
    names = [title or (shape.name if shape is not None else ""), "reconstruction"]
    views = _views(shape, parts(program), view, view)
    head, column = 44, int(view * 1.12)
    page, draw = _sheet(view * len(views) + column + 2 * _PAD, view + head + 20)
    for index, (image, name) in enumerate(zip(views, names, strict=False)):
        page.paste(image, (index * view, head))
        draw.text((index * view + view / 2, 16), _cut(name, 46), _FAINT, typeface(19), "ma")
    _panel(draw, program, scores, (view * len(views) + _PAD, head), (column, view))
    return page


def contact_sheet(
    items: Sequence[Item], path: str | os.PathLike[str], *, columns: int = COLUMNS, title: str = ""
) -> Path:
    """Draw many reconstructions next to their inputs, with a legend of the statements in use.

    Raises
    ------
    OutputError
        If there are no items, the suffix is unknown or the file cannot be written.
    """
    target = _checked(path)
    if not items:
        raise OutputError("there is nothing to put on the contact sheet", "name a folder that holds programs")
    wide, tall = SMALL
    room = wide * (1 + any(item.shape is not None for item in items))  # for inputs only where there are any
    across = min(columns, len(items))
    drawn = [parts(item.program) for item in items]
    words = sorted({part.word for solids in drawn for part in solids})
    width = across * (room + _PAD) + _PAD
    per_row = max(1, (width - 2 * _PAD) // LEGEND)
    top = 54 if title else 14
    head = top + 30 * -(-len(words) // per_row)
    page, draw = _sheet(width, head + (tall + 52) * -(-len(items) // across) + 8)
    draw.text((_PAD, 16), title, _INK, typeface(22, bold=True))
    for number, word in enumerate(words):
        x, y = _PAD + LEGEND * (number % per_row), top + 30 * (number // per_row)
        _swatch(draw, x, y + 4, 13, word)
        draw.text((x + 20, y), word, _INK, typeface(15))
    for number, (item, solids) in enumerate(zip(items, drawn, strict=True)):
        x, y = _PAD + number % across * (room + _PAD), head + number // across * (tall + 52)
        for place, image in enumerate(reversed(_views(item.shape, solids, *SMALL)), 1):
            page.paste(image, (x + room - place * wide, y))
        middle, below = x + room // 2, y + tall + 2
        draw.text((middle, below), _cut(item.name, room // 9), _INK, typeface(14, bold=True), "ma")
        draw.text((middle, below + 19), _cut(item.note, room * 3 // 20), _FAINT, typeface(13), "ma")
    _save(page, target)
    return target


def _panel(
    draw: ImageDraw,
    program: Program,
    scores: Mapping[str, float] | None,
    corner: tuple[int, int],
    extent: tuple[int, int],
) -> None:
    """Draw the text of a program into a rectangle, in the largest type in which all of it fits, with its scores."""
    (x, y), (width, height) = corner, extent
    rows, room = listing(program), height - 84
    for size in range(LARGEST, SMALLEST - 1, -1):
        step, advance = int(size * 1.55), typeface(size, "Mono").getlength("m" * 10) / 10
        lines = [part for line in rows for part in wrapped(line, int((width - 30) / advance))]
        if len(lines) * step <= room:
            break
    fits = max(1, room // step)
    shown = lines if len(lines) <= fits else lines[: fits - 1]
    top = y + max(0, (room - step * len(lines)) // 2)
    for number, line in enumerate(shown):
        start = (x + 24, top + number * step)
        if line.role and line.word:
            _swatch(draw, x, start[1] + size * 0.28, int(size * 0.72), line.role)
        _line(draw, start, line, size, advance)
    if len(shown) < len(lines):
        remainder = f"... and {len(lines) - len(shown)} more lines"
        draw.text((x + 24, top + len(shown) * step), remainder, _FAINT, typeface(size, "Mono"))
    foot = y + height - 62
    draw.line([(x, foot), (x + width - 8, foot)], fill=_RULE, width=1)
    for number, text in enumerate(scores_text(scores, program)):
        draw.text((x, foot + 12 + 24 * number), text, _INK if number == 0 else _FAINT, typeface(16))


def scores_text(scores: Mapping[str, float] | None, program: Program) -> list[str]:
    """Scores and size of a program as one or two short lines."""
    parts, blocks = program.size, program.blocks
    size = f"{parts} part{'s' * (parts != 1)} · {blocks} drawing statement{'s' * (blocks != 1)}"
    if not scores:
        return [size]
    labels = {"iou": "IoU", "cd": "CD", "f1_half_percent": "F1@.5%", "silhouette": "silhouette", "seconds": "time"}
    words = []
    for key, label in labels.items():
        if key in scores and np.isfinite(scores[key]):
            value = scores[key]
            text = {"cd": f"{value:.5f}", "seconds": f"{value:.1f} s"}.get(key, f"{value:.3f}")
            words.append(f"{label} {text}")
    return [" · ".join(words), size] if words else [size]


def _views(shape: Shape | None, drawn: Sequence[Part], width: int, height: int) -> list[Any]:
    """The input if there is one, and the parts, from the same camera; kernels hold no lock, so threads help."""
    from PIL import Image

    models = [*([] if shape is None else [of_shape(shape)]), of_parts(drawn)]
    camera = camera_for(models, width / height)
    with ThreadPoolExecutor(2) as pool:
        return [Image.fromarray(view) for view in pool.map(lambda model: render(model, camera, width, height), models)]


def _line(draw: ImageDraw, corner: tuple[float, float], line: Row, size: int, advance: float) -> None:
    before, word, after = parted(line)
    x, y = corner
    shade = readable(line.role) if line.role else _FAINT
    draw.text((x, y), before, _FAINT, typeface(size, "Mono"))
    draw.text((x + advance * len(before), y), word, shade, typeface(size, "Mono", bold=bool(line.role)))
    draw.text((x + advance * (len(before) + len(word)), y), after, _INK, typeface(size, "Mono"))


def readable(word: str) -> tuple[int, int, int]:
    """The colour of a role or statement, dark enough for text on white."""
    red, green, blue = colour(word)
    light = (0.3 * red + 0.59 * green + 0.11 * blue) / 255
    scale = min(1.0, 0.46 / max(light, 1e-6))
    return (int(red * scale), int(green * scale), int(blue * scale))


@lru_cache(maxsize=64)
def typeface(size: int, face: str = "", bold: bool = False) -> Any:
    """DejaVu Sans, reduced to European letters and signs; ``face`` is Mono or nothing."""
    from PIL import ImageFont

    font = Path(__file__).parent / "fonts" / f"DejaVuSans{face}{'-Bold' if bold else ''}.ttf"
    return ImageFont.truetype(str(font), size)


def _swatch(draw: ImageDraw, x: float, y: float, size: int, word: str) -> None:
    draw.rounded_rectangle([x, y, x + size, y + size], 3, fill=colour(word))


def _cut(text: str, length: int) -> str:
    return text if len(text) <= length else text[: length - 1] + "…"


def _sheet(width: int, height: int) -> tuple[Any, ImageDraw]:
    from PIL import Image, ImageDraw

    page = Image.new("RGB", (width, height), "white")
    return page, ImageDraw.Draw(page)


def _checked(path: str | os.PathLike[str]) -> Path:
    target = Path(path)
    if target.suffix.lower() not in SUFFIXES:
        raise OutputError(f"unknown picture suffix {target.suffix!r}", f"known: {' '.join(SUFFIXES)}")
    return target


def _save(page: Any, target: Path) -> None:
    with atomic_path(target) as temporary:
        page.save(temporary, **({"compress_level": 4} if target.suffix.lower() == ".png" else {}))

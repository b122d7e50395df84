"""The same edits of programs with named numbers and of the same programs with plain numbers, side by side.

    python -m benchmarks.edits docs/edits.png examples/chair_kenney.obj seat_bottom=12.5 \\
        examples/bookcase_kenney_open.obj 'height*=0.7' examples/table_polyhaven_wooden.obj 'width*=1.5'

Above, each change is made to the name.  Below, it is made to the plain number that is nearest to the named one, the
first in the text.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

VIEW, CAPTION = 300, 40
INK, FAINT = (38, 40, 44), (124, 128, 136)


class Column(NamedTuple):
    """One column of the picture: captions and models above and below, and the camera of both."""

    captions: tuple[str, str]
    models: tuple[Any, Any]
    camera: Any


def main(out: str, *words: str) -> None:
    """Infer a program of every mesh and draw it, and after each of the changes behind it, with and without names."""
    from PIL import Image, ImageDraw

    from shapeprog.view.page import typeface
    from shapeprog.view.render import render

    first = [place for place, word in enumerate(words) if "=" not in word]
    ends = [*first[1:], len(words)]
    columns = [
        column
        for start, end in zip(first, ends, strict=True)
        for column in columns_of(words[start], words[start + 1 : end])
    ]
    page = Image.new("RGB", (VIEW * len(columns), (VIEW + CAPTION) * 2), "white")
    pen = ImageDraw.Draw(page)
    for across, column in enumerate(columns):
        for down, (caption, model) in enumerate(zip(column.captions, column.models, strict=True)):
            place = across * VIEW, down * (VIEW + CAPTION)
            page.paste(Image.fromarray(render(model, column.camera, VIEW, VIEW)), place)
            where = place[0] + VIEW / 2, place[1] + VIEW + 6
            shade = INK if caption in ("named numbers", "plain numbers") else FAINT
            pen.text(where, caption, font=typeface(16), fill=shade, anchor="ma")
    Path(out).parent.mkdir(parents=True, exist_ok=True)
    page.save(out, optimize=True)


def columns_of(mesh: str, changes: tuple[str, ...]) -> list[Column]:
    """The columns of one mesh: its program as it is, then after each change."""
    from shapeprog.cli.changes import changed
    from shapeprog.data import load
    from shapeprog.formats.parts import parts
    from shapeprog.inference import infer
    from shapeprog.language.named import inline, names
    from shapeprog.view.model import of_parts
    from shapeprog.view.render import camera_for

    named = infer(load(mesh), unit="cells").program
    plain = inline(named)
    rows: list[tuple[tuple[str, str], tuple[Any, Any]]] = [(("named numbers", "plain numbers"), (named, plain))]
    before = {each.name: each for each in names(named)}
    for change in changes:
        after, _ = changed(named, [change])
        name = change.partition("=")[0].rstrip("*+-/")
        value = {each.name: each.value for each in names(after)}[name]
        caption, other = without_names(plain, before[name], value)
        rows.append(((change, caption), (after, other)))
    drawn = [tuple(of_parts(parts(program)) for program in pair) for _, pair in rows]
    camera = camera_for([model for pair in drawn for model in pair])
    return [Column(captions, (one, two), camera) for (captions, _), (one, two) in zip(rows, drawn, strict=True)]


def without_names(plain: Any, before: Any, value: float) -> tuple[str, Any]:
    """What is changed in a plain program where a named number gets another value, and the program that this makes."""
    from benchmarks.editing import multiplied
    from shapeprog.language.free import free_values

    numbers = np.array(free_values(plain))
    place = int(np.abs(numbers - before.value).round(3).argmin())
    return f"{numbers[place]:g} -> {value:g}", multiplied(plain, place, value / numbers[place])


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("picture", help="the file to write")
    parser.add_argument("words", nargs="+", metavar="MESH CHANGE ...", help="meshes, each with the changes behind it")
    args = parser.parse_args()
    main(args.picture, *args.words)

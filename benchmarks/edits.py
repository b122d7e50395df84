"""The same edit of a program with named numbers and of the same program with plain numbers, side by side.

    python -m benchmarks.edits examples/chair_kenney.obj docs/edits.png leg_height=15 'width*=1.5'

Above, each change is made to the name.  Below, it is made to the one plain number that reads the same, the first in the
text.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np

VIEW, CAPTION = 300, 40
INK, FAINT = (38, 40, 44), (124, 128, 136)


def main(mesh: str, out: str, *changes: str) -> None:
    """Infer a program and draw it, and after each change, with and without names."""
    from PIL import Image, ImageDraw

    from shapeprog.cli.changes import changed
    from shapeprog.data import load
    from shapeprog.formats.parts import parts
    from shapeprog.inference import infer
    from shapeprog.language.free import free_values, multiplied
    from shapeprog.language.named import inline, names
    from shapeprog.view.model import of_parts
    from shapeprog.view.page import typeface
    from shapeprog.view.render import camera_for, render

    named = infer(load(mesh)).program
    plain = inline(named)
    rows: list[list[tuple[str, Any]]] = [[("named numbers", named)], [("plain numbers", plain)]]
    before = {each.name: each.value for each in names(named)}
    for change in changes:
        after = changed(named, [change])
        name = change.partition("=")[0].rstrip("*+-/")
        value = {each.name: each.value for each in names(after)}[name]
        numbers = np.array(free_values(plain))
        place = int(np.abs(numbers - before[name]).round(3).argmin())
        rows[0].append((change, after))
        rows[1].append((f"{numbers[place]:g} -> {value:g}", multiplied(plain, place, value / numbers[place])))
    models = [[of_parts(parts(program)) for _, program in row] for row in rows]
    camera = camera_for([model for row in models for model in row])
    page = Image.new("RGB", (VIEW * len(rows[0]), (VIEW + CAPTION) * 2), "white")
    pen = ImageDraw.Draw(page)
    for down, (row, drawn) in enumerate(zip(rows, models, strict=True)):
        for across, ((caption, _), model) in enumerate(zip(row, drawn, strict=True)):
            place_of = across * VIEW, down * (VIEW + CAPTION)
            page.paste(Image.fromarray(render(model, camera, VIEW, VIEW)), place_of)
            where = place_of[0] + VIEW / 2, place_of[1] + VIEW + 6
            pen.text(where, caption, font=typeface(16), fill=FAINT if across else INK, anchor="ma")
    Path(out).parent.mkdir(parents=True, exist_ok=True)
    page.save(out, optimize=True)


if __name__ == "__main__":
    main(*sys.argv[1:])

"""Sheets of objects as they were given, rebuilt in the paper's statements, and in all statements.

    python -m benchmarks.structure DATA --split val --sets ikea --methods paper all --out ikea.jsonl
    python -m benchmarks.gallery ikea.jsonl DATA docs/ikea.png --objects 24
    python -m benchmarks.gallery ikea.jsonl DATA docs/failures.png --worst 8

Objects come in the order of their names, or those first whose outlines fit worst.  Below each program: its silhouette,
how many numbers are written, and the blocks.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from benchmarks.rows import read_rows
from benchmarks.structure import Task, given, objects

VIEW, CAPTION, HEAD, PAD = 300, 46, 34, 14
"""Sides of a view, heights of the words below and above, and gaps, in pixels."""

INK, FAINT, RULE = (38, 40, 44), (124, 128, 136), (222, 224, 228)
HEADINGS = ("given", "in the statements of the paper", "in all statements")
METHODS = ("paper", "all")


def read(path: Path) -> dict[tuple[str, str], dict[str, Any]]:
    """For each set and name the rows of the methods, of the most blocks that both have."""
    found: dict[tuple[str, str], dict[str, Any]] = {}
    for row in read_rows(path):
        known = found.setdefault((row["set"], row["name"]), {})
        if row["method"] not in known or known[row["method"]]["allowed"] < row["allowed"]:
            known[row["method"]] = row
    return {key: rows for key, rows in found.items() if set(METHODS) <= set(rows)}


def draw(rows: list[dict[str, Any]], tasks: dict[tuple[str, str], Task], out: Path, columns: int) -> None:
    """Draw one cell of three views for each object."""
    from PIL import Image, ImageDraw

    from shapeprog.formats.parts import parts
    from shapeprog.language.parser import parse
    from shapeprog.view.model import of_parts, of_shape
    from shapeprog.view.page import typeface
    from shapeprog.view.render import camera_for, render

    wide, tall = len(HEADINGS) * VIEW + PAD, VIEW + CAPTION
    down = -(-len(rows) // columns)
    page = Image.new("RGB", (columns * wide + PAD, HEAD + down * tall), "white")
    pen = ImageDraw.Draw(page)
    for column in range(min(columns, len(rows))):
        for place, heading in enumerate(HEADINGS):
            middle = PAD + column * wide + (place + 0.5) * VIEW
            pen.text((middle, 10), heading, font=typeface(15), fill=FAINT, anchor="ma")
    for number, methods in enumerate(rows):
        first = methods["all"]
        x, y = PAD + number % columns * wide, HEAD + number // columns * tall
        _, shape = given(tasks[first["set"], first["name"]])
        models = [of_shape(shape)] + [of_parts(parts(parse(methods[each]["program"]))) for each in METHODS]
        camera = camera_for(models[:1])
        for place, model in enumerate(models):
            page.paste(Image.fromarray(render(model, camera, VIEW, VIEW)), (x + place * VIEW, y))
        captions = [first["name"].lower()]
        for each in METHODS:
            row = methods[each]
            captions.append(f"{row['silhouette']:.2f} · {row['numbers']} numbers · {row['blocks']} blocks")
        for place, caption in enumerate(captions):
            ink = FAINT if place else INK
            pen.text((x + (place + 0.5) * VIEW, y + VIEW + 4), caption, font=typeface(15), fill=ink, anchor="ma")
        pen.line([(x, y + tall - 8), (x + wide - PAD, y + tall - 8)], fill=RULE)
    out.parent.mkdir(parents=True, exist_ok=True)
    page.save(out, optimize=True)


def main() -> None:
    """Draw a sheet."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("rows", help="rows of benchmarks.structure, of both methods")
    parser.add_argument("data", help="the folder of the data")
    parser.add_argument("out", help="the picture")
    parser.add_argument("--split", default="val", choices=("val", "test"))
    parser.add_argument("--objects", type=int, default=None, help="only the first so many")
    parser.add_argument("--worst", type=int, default=None, help="only so many whose outlines fit worst")
    parser.add_argument("--columns", type=int, default=2)
    args = parser.parse_args()
    known = read(Path(args.rows))
    tasks = {
        (which, name): Task(which, name, files)
        for which in {which for which, _ in known}
        for name, files in objects(Path(args.data), which, args.split)
    }
    chosen = [known[key] for key in sorted(known)][: args.objects]
    if args.worst is not None:
        chosen = sorted(chosen, key=lambda methods: methods["all"]["silhouette"])[: args.worst]
    draw(chosen, tasks, Path(args.out), args.columns)


if __name__ == "__main__":
    main()

"""Programs that somebody wrote: how much of them inference finds in meshes with a closed component for each part.

    python -m benchmarks.written examples/pieces --out written.jsonl

============  ==========================================================================================================
column        what it says
============  ==========================================================================================================
parts         components of the mesh, and of these
exact         those on which a primitive of the program lies: no face of its box is .02 cells from that of the component
values        different numbers of the written program, without counts and steps, and of these
back          those that the program has as well, in the same unit
written       free numbers of the written program, and those that the program has (``free``)
lines         of the written program, and those of the program (``found``)
============  ==========================================================================================================
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from benchmarks.rows import measure_all, read_rows

COLUMNS = "parts", "exact", "values", "back", "written", "free", "lines", "found", "seconds"

EXACT = 0.02
"""Cells by which a face may be off."""


def measure(file: Path) -> dict[str, Any]:
    """The row of one written program."""
    import torch

    import shapeprog as sp
    from shapeprog.inference.surface.components import components
    from shapeprog.language.free import free_values
    from shapeprog.language.printer import format_program

    torch.set_num_threads(1)
    given = sp.load(file)
    unit = given.unit.name if given.unit else ""
    with TemporaryDirectory() as folder:
        mesh = Path(folder) / "parts.ply"
        sp.export(given, mesh)
        shape = sp.load_shape(mesh, unit=unit)
    started = time.process_time()
    found = sp.infer(shape, unit=unit).program
    seconds = time.process_time() - started
    assert shape.vertices is not None
    assert shape.faces is not None
    target = components(shape.vertices, shape.faces)
    corners, first = target.vertices[target.faces].reshape(-1, 3), 3 * target.start[:-1]
    boxes = np.concatenate([np.minimum.reduceat(corners, first), np.maximum.reduceat(corners, first)], 1)
    scene = sp.unroll(found)
    centre, reach = scene.centre.numpy(), scene.reach.numpy()
    drawn = np.concatenate([centre - reach, centre + reach], 1)
    off = np.abs(boxes[:, None] - drawn).max(2).min(1, initial=np.inf)
    values, back = ({round(abs(value), 3) for value in free_values(program)} - {0.0} for program in (given, found))
    texts = [format_program(program).strip() for program in (given, found)]
    return {
        "name": file.stem, "parts": len(boxes), "exact": int((off <= EXACT).sum()), "values": len(values),
        "back": len(values & back), "written": len(free_values(given)), "free": len(free_values(found)),
        "lines": texts[0].count("\n") + 1, "found": texts[1].count("\n") + 1, "seconds": seconds, "text": texts[1],
    }  # fmt: skip


def table(rows: list[dict[str, Any]]) -> str:
    """A row for each program and the sums of all, as Markdown."""
    total = {"name": "all"} | {column: sum(row[column] for row in rows) for column in COLUMNS}
    lines = [f"| program | {' | '.join(COLUMNS)} |", "|---" * (len(COLUMNS) + 1) + "|"]
    for row in [*sorted(rows, key=lambda row: row["name"]), total]:
        lines.append(f"| {row['name']} | {' | '.join(f'{row[column]:.3g}' for column in COLUMNS)} |")
    return "\n".join(lines)


def main() -> None:
    """Measure the programs of a folder that have no row yet, and print the table of all rows."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", nargs="?", type=Path, default=Path("examples/pieces"), help="with .shape files")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--out", type=Path, default=Path("written.jsonl"), help="rows, one line of JSON each")
    args = parser.parse_args()
    known = {row["name"] for row in read_rows(args.out)}
    todo = [file for file in sorted(args.folder.glob("*.shape")) if file.stem not in known]
    measure_all(args.out, todo, measure, args.workers)
    print(table(read_rows(args.out)))


if __name__ == "__main__":
    main()

"""What a user waits for: starting up, a program from each example mesh, one picture, a contact sheet of 24; and memory.

Prints one JSON line per figure: name, value, unit, which direction is better, and a bound where there is one.  Kernels
are compiled before anything is timed; times to infer include reading the file.

    python benchmarks/bench_commands.py
"""

from __future__ import annotations

import argparse
import json
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from statistics import median

EXAMPLES = sorted((Path(__file__).parents[1] / "examples").glob("*.obj"))


def row(name: str, value: float, unit: str, better: str, bound: float | None = None) -> None:
    print(
        json.dumps({"name": name, "value": round(value, 4), "unit": unit, "better": better, "bound": bound}), flush=True
    )


def seconds(*command: str, runs: int = 5) -> float:
    """Median time of a whole process."""
    taken = []
    for _ in range(runs):
        started = time.perf_counter()
        subprocess.run([sys.executable, *command], check=True, stdout=subprocess.DEVNULL)
        taken.append(time.perf_counter() - started)
    return median(taken)


def main() -> None:
    row("shapeprog --help", seconds("-m", "shapeprog", "--help"), "s", "lower", 0.4)
    row("import shapeprog", seconds("-c", "import shapeprog"), "s", "lower", 1.5)
    row("import torch", seconds("-c", "import torch"), "s", "lower")
    row(
        "import shapeprog with all it names", seconds("-c", "from shapeprog import infer, unroll, export"), "s", "lower"
    )

    from shapeprog.data import load
    from shapeprog.inference import infer
    from shapeprog.inference.infer import prepare_kernels
    from shapeprog.view import Item, contact_sheet, picture

    prepare_kernels(cells=True)
    load(EXAMPLES[0])
    times, results = [], []
    for path in EXAMPLES:
        started = time.perf_counter()
        shape = load(path)
        result = infer(shape, statements="paper")
        times.append(time.perf_counter() - started)
        results.append((shape, result))
    row("infer, median of the example meshes", median(times), "s", "lower", 4.0)
    row("infer, slowest of the example meshes", max(times), "s", "lower")
    row("memory, peak", resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20, "GB", "lower", 1.5)
    with tempfile.TemporaryDirectory() as folder:
        drawn = []
        for shape, result in [results[0], *results]:  # the first loads kernels and fonts
            started = time.perf_counter()
            picture(shape, result.program, Path(folder) / "one.png")
            drawn.append(time.perf_counter() - started)
        row("one picture, median", median(drawn[1:]), "s", "lower", 1.0)
        started = time.perf_counter()
        contact_sheet([Item(s.name, s, r.program) for s, r in results[:24]], Path(folder) / "sheet.png")
        row("contact sheet of 24", time.perf_counter() - started, "s", "lower", 10.0)


if __name__ == "__main__":
    argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter).parse_args()
    main()

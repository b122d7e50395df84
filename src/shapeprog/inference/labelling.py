"""Labelling: programs for all shapes of a pack by search, several at a time, for generators to learn from.

Labels are lines of JSON, in the order of the pack: ``name``, ``program`` and ``snapped`` as text, the scores of the
search, and in ``cut`` what the time budget cut short.  A file that is not complete is gone on with.
"""

from __future__ import annotations

import json
import os
import signal
from collections.abc import Iterator, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any

from shapeprog.data.packs import Pack, read_pack
from shapeprog.errors import InputError
from shapeprog.files import output_error, write_text
from shapeprog.inference.budget import BUDGET


def label(
    pack: Path,
    out: Path,
    *,
    blocks: int = 10,
    budget: float = BUDGET,
    seed: int = 0,
    processes: int | None = None,
    modules: Sequence[Path] = (),
) -> Iterator[tuple[int, int, int]]:
    """Label the shapes of a pack, in its order.

    Yields, at first and after each, how many are done, how many there are, and how many of those done the time budget
    cut short.

    Parameters
    ----------
    pack
        File of the shapes.
    out
        File of the labels; shapes that it holds are not labelled again, and nothing else in it is touched.
    blocks, budget, seed
        As those of :func:`shapeprog.inference.infer`.
    processes
        Shapes at a time; by default as many as there are cores.
    modules
        Files that declare statements.

    Raises
    ------
    InputError
        If the pack cannot be read, or ``out`` holds something else.
    OutputError
        If the labels cannot be written.
    """
    from concurrent.futures import ProcessPoolExecutor
    from multiprocessing import get_context

    shapes = read_pack(pack)
    done = _done(out)
    left = [place for place, name in enumerate(shapes.ids) if str(name) not in done]
    count, cut = len(shapes), sum(done.get(str(name), False) for name in shapes.ids)
    yield count - len(left), count, cut
    if not left:
        return
    workers = min(processes or os.cpu_count() or 1, len(left))
    words = (str(pack), blocks, budget, seed)
    try:
        stream = out.open("a", encoding="utf-8")
    except OSError as error:
        raise output_error(out, error) from error
    # Spawned, not forked: kernels of numba that have run with threads do not survive a fork.
    with stream, ProcessPoolExecutor(workers, get_context("spawn"), _begin, (list(modules),)) as pool:
        waiting = [pool.submit(_labelled, place, *words) for place in left]
        try:
            for number, future in enumerate(waiting, 1):
                row = future.result()
                cut += bool(row["cut"])
                try:
                    stream.write(json.dumps(row, allow_nan=False) + "\n")
                    stream.flush()
                except OSError as error:
                    raise output_error(out, error) from error
                yield count - len(left) + number, count, cut
        finally:
            for future in waiting:
                future.cancel()


def _done(out: Path) -> dict[str, bool]:
    """The shapes that a file of labels holds, and which of them the time budget cut short.

    A last line that is incomplete is taken off the file.
    """
    if not out.exists():
        return {}
    try:
        lines = out.read_text(encoding="utf-8").splitlines(keepends=True)
    except (OSError, ValueError) as error:
        raise InputError(f"cannot read {out}: {error}", "give another --out") from error
    found = {}
    for number, line in enumerate(lines):
        try:
            row = json.loads(line)
            found[str(row["name"])] = bool(row.get("cut"))
        except (ValueError, KeyError, TypeError) as error:
            if number < len(lines) - 1 or line.endswith("\n"):
                raise InputError(f"line {number + 1} of {out} is no label", "give another --out") from error
            write_text(out, "".join(lines[:-1]))
    return found


def _begin(modules: list[Path]) -> None:
    """Make a worker ready: interruptions are for the process that asked, which then ends the others."""
    import torch

    from shapeprog.formats.plugins import load_statements

    signal.signal(signal.SIGINT, signal.SIG_IGN)
    torch.set_num_threads(1)
    for module in modules:
        load_statements(module)


@lru_cache(1)
def _pack(path: str) -> Pack:
    return read_pack(path)


def _labelled(place: int, path: str, blocks: int, budget: float, seed: int) -> dict[str, Any]:
    from shapeprog.inference.infer import infer
    from shapeprog.language.text import format_program

    shape = _pack(path)[place]
    found = infer(shape, blocks=blocks, budget=budget, seed=seed, generator=None)  # labels owe nothing to any weights
    return {
        "name": shape.name, "program": format_program(found.program), "snapped": format_program(found.snapped),
        **found.scores, "cut": found.cut,
    }  # fmt: skip

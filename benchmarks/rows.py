"""Rows of measures in a file, one line of JSON each: read, and measured as far as they are not there yet."""

from __future__ import annotations

import json
import multiprocessing
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, TypeVar

Row = dict[str, Any]
Work = TypeVar("Work")


def read_rows(path: Path) -> list[Row]:
    """All rows of a file; none where there is no file."""
    return [json.loads(line) for line in path.read_text().splitlines()] if path.exists() else []


def measure_all(out: Path, todo: Sequence[Work], measure: Callable[[Work], Row | list[Row]], workers: int) -> None:
    """Append the row or rows of each piece of work to a file, as they come, from several processes."""
    out.parent.mkdir(parents=True, exist_ok=True)
    with multiprocessing.get_context("spawn").Pool(workers) as pool, out.open("a") as file:
        for number, found in enumerate(pool.imap_unordered(measure, todo), 1):
            file.writelines(json.dumps(row) + "\n" for row in (found if isinstance(found, list) else [found]))
            file.flush()
            print(f"\r{number}/{len(todo)}", end="", flush=True)
    print()

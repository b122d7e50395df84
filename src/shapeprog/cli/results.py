"""Results as files: their scores, their names, and their contents."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from shapeprog.data.loading import path_of
from shapeprog.data.shape import Shape
from shapeprog.errors import ShapeProgError
from shapeprog.evaluation.metrics import evaluate_program
from shapeprog.files import atomic_path
from shapeprog.formats import export
from shapeprog.formats.json_form import program_to_json, read_result
from shapeprog.formats.shape import program_text, read_text
from shapeprog.inference.infer import Result
from shapeprog.language.printer import format_program

MEASURES = (
    "iou", "cd", "cd_floor", "f1_half_percent", "f1_percent", "silhouette", "blocks", "statements", "primitives",
)  # fmt: skip  # scores of every result

_SUFFIXES = (".json", ".shape", ".glb", ".png")
_LONGEST = 120  # letters of the name of a file


def measured(result: Result, shape: Shape, seed: int) -> Result:
    """The result with the distance to the input and the size of the program among its scores."""
    row = evaluate_program(result.program, shape, result.snapped, seed=seed, iou=result.scores.get("iou"), looks=True)
    scores = {**result.scores, **{name: getattr(row, name) for name in MEASURES}}
    return replace(result, scores={name: value for name, value in scores.items() if math.isfinite(value)})


def document(result: Result, shape: Shape) -> str:
    """The JSON of a result; without its seconds, so that the same seed writes the same bytes."""
    extra: dict[str, Any] = {} if result.snapped is None else {"snapped": format_program(result.snapped)}
    return program_to_json(result.program, scores=result.scores, reason=result.reason, source=path_of(shape), **extra)


def write(result: Result, shape: Shape, folder: Path, stem: str) -> list[str]:
    """Write a result as JSON and text, and its solids as GLB; returns the names of the files.

    Wherever this is interrupted, no text is left beside the JSON of another run, as if it had been edited.
    """
    text = folder / f"{stem}.shape"
    with atomic_path(text) as new_text, atomic_path(folder / f"{stem}.json") as new_json:
        new_text.write_bytes(program_text(result.program).encode("utf-8", "surrogateescape"))
        new_json.write_bytes(document(result, shape).encode("utf-8", "surrogateescape"))
        text.unlink(missing_ok=True)  # the JSON, which holds it too, is renamed first
    if result.program.size:
        export(result.program, folder / f"{stem}.glb")
    return [f"{stem}{suffix}" for suffix in (".json", ".shape", *([".glb"] if result.program.size else []))]


def free_stem(shape: Shape, stems: set[str], folder: Path, overwrite: bool = False) -> str:
    """A file name that neither another shape, of this run or an earlier one, nor another file has.

    The same input may replace its own results, which are known by their .json; a ``ShapeProgError`` if their .shape
    differs from the text in it, unless ``overwrite``.
    """
    stem = unused_stem(shape.name, lambda stem: stem in stems or not _replaceable(shape, folder, stem, overwrite))
    stems.add(stem)
    return stem


def unused_stem(name: str, is_used: Callable[[str], bool]) -> str:
    """The name of a shape as that of a file, with a number behind it where it is used."""
    base = re.sub(r"[^\w.\-]+", "_", name).strip("._")[:_LONGEST] or "shape"
    stem, number = base, 1
    while is_used(stem):
        number += 1
        stem = f"{base}_{number}"
    return stem


def _replaceable(shape: Shape, folder: Path, stem: str, overwrite: bool) -> bool:
    """Whether there are no files of that name, or only earlier results of the same shape, with their .json; an error if
    their text may be edited, unless ``overwrite``."""
    if shape.source is not None and shape.source.resolve() == (folder / f"{stem}{shape.source.suffix}").resolve():
        return False
    if not any((folder / f"{stem}{suffix}").exists() for suffix in _SUFFIXES):
        return True
    text, result = folder / f"{stem}.shape", folder / f"{stem}.json"
    if not result.exists():
        return False
    try:
        if read_result(result).source != path_of(shape):
            return False
    except ShapeProgError:
        return False
    if overwrite or not text.exists():
        return True
    if read_text(text).splitlines() == json.loads(read_text(result))["text"].splitlines():
        return True
    cure = "it may have been edited: --overwrite replaces it, --out FOLDER writes to another folder"
    raise ShapeProgError(f"{text} is not replaced: it differs from the text in {result.name}", cure)

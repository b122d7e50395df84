"""Results as files: their scores, their names, and their contents."""

from __future__ import annotations

import json
import math
import re
from dataclasses import replace
from pathlib import Path

from shapeprog.data.loading import ARRAY_SUFFIXES
from shapeprog.data.shape import Shape
from shapeprog.errors import ShapeProgError
from shapeprog.evaluation.metrics import evaluate_program
from shapeprog.files import write_text
from shapeprog.formats import export
from shapeprog.formats.json_form import program_to_json, read_result
from shapeprog.formats.shape import read_text
from shapeprog.inference.infer import Result
from shapeprog.language.printer import format_program

MEASURES = (
    "iou", "cd", "noise_floor", "f1_half_percent", "f1_percent", "silhouette", "blocks", "statements", "primitives",
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
    extra = {} if result.snapped is None else {"snapped": format_program(result.snapped)}
    return program_to_json(
        result.program, shape.frame, scores=result.scores, reason=result.reason, source=_source(shape), **extra
    )


def write(result: Result, shape: Shape, folder: Path, stem: str) -> list[str]:
    """Write a result as JSON and text, and its solids as GLB; returns the names of the files."""
    write_text(folder / f"{stem}.json", document(result, shape))
    suffixes = (".shape", ".glb") if result.program.size else (".shape",)
    written = [export(result.program, folder / f"{stem}{suffix}", shape.frame) for suffix in suffixes]
    return [f"{stem}.json", *(path.name for path in written)]


def free_stem(shape: Shape, stems: set[str], folder: Path, overwrite: bool = False) -> str:
    """A file name that neither another shape, of this run or an earlier one, nor another file has.

    The same input may replace its own results; a ``ShapeProgError`` if their text was edited, unless ``overwrite``.
    """
    base = re.sub(r"[^\w.\-]+", "_", shape.name).strip("._")[:_LONGEST] or "shape"
    stem, number = base, 1
    while stem in stems or not _replaceable(shape, folder, stem, overwrite):
        number += 1
        stem = f"{base}_{number}"
    stems.add(stem)
    return stem


def _replaceable(shape: Shape, folder: Path, stem: str, overwrite: bool) -> bool:
    """Whether there are no files of that name, or only earlier results of the same shape; an error if these may be
    edited, unless ``overwrite``."""
    if shape.source is not None and shape.source.resolve() == (folder / f"{stem}{shape.source.suffix}").resolve():
        return False
    if not any((folder / f"{stem}{suffix}").exists() for suffix in _SUFFIXES):
        return True
    text, result, written = folder / f"{stem}.shape", folder / f"{stem}.json", None
    if result.exists():
        try:
            if read_result(result).source != _source(shape):
                return False
        except ShapeProgError:
            return False
        written = json.loads(read_text(result))["text"].splitlines()
    if not text.exists():
        return written is not None
    if overwrite or read_text(text).splitlines() == written:
        return True
    cause = f"has no {result.name} beside it" if written is None else f"differs from the text in {result.name}"
    cure = "it may have been edited: --overwrite replaces it, --out FOLDER writes to another folder"
    raise ShapeProgError(f"{text} is not replaced: it {cause}", cure)


def _source(shape: Shape) -> str | None:
    """The file, and in a file of many the name of the shape, as :func:`shapeprog.data.load` finds it again."""
    if shape.source is None:
        return None
    path = str(shape.source.absolute())
    if shape.source.suffix.lower() not in ARRAY_SUFFIXES or shape.name == shape.source.stem:
        return path
    return f"{path}#{shape.name.removeprefix(f'{shape.source.stem}#')}"

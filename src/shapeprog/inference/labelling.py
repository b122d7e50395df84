"""Labelling: programs for all shapes of a pack by search, several at a time, for generators to learn from.

Labels are lines of JSON, in the order of the pack: ``name``, ``program`` and ``snapped`` as text, the scores of the
search, and in ``cut`` what the time budget cut short.  A file that is not complete is gone on with.  The search runs in
processes of its own, which end with this one.
"""

from __future__ import annotations

import json
import os
from collections.abc import Generator, Sequence
from contextlib import closing
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from shapeprog.data.packs import Pack, read_pack
from shapeprog.errors import InputError, ShapeProgError
from shapeprog.files import append_line, remove_unfinished, write_text
from shapeprog.inference.budget import BUDGET
from shapeprog.processes import Answer, answers, serve


@dataclass(frozen=True)
class Labelled:
    """How far the labels of a pack are.

    Parameters
    ----------
    done, total
        How many shapes have a label, of how many.
    cut
        How many of those done the time budget cut short.
    name
        The shape just searched; empty in the first record, which tells what the file held before.
    error
        Why it got no label, if it got none.
    """

    done: int
    total: int
    cut: int
    name: str = ""
    error: ShapeProgError | None = None


def label(
    pack: Path,
    out: Path,
    *,
    blocks: int = 10,
    budget: float = BUDGET,
    seed: int = 0,
    processes: int | None = None,
    modules: Sequence[Path] = (),
) -> Generator[Labelled, None, None]:
    """Label the shapes of a pack in its order, yielding one record at first and one after each.

    A shape that cannot be labelled is told and stops nothing.  Closing the iterator ends the search; what is in the
    file stays.

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
    names = [str(name) for name in read_pack(pack, whole=False).ids]
    remove_unfinished(out.parent)
    held = _held(out)
    left = [place for place, name in enumerate(names) if name not in held]
    done, cut = len(names) - len(left), sum(held.get(name, False) for name in names)
    yield Labelled(done, len(names), cut)
    task = {"pack": str(pack), "blocks": blocks, "budget": budget, "seed": seed, "modules": [str(m) for m in modules]}
    tasks = [json.dumps({**task, "place": place}) for place in left]
    with closing(answers(__name__, tasks, min(processes or os.cpu_count() or 1, len(left)))) as found:
        for place, answer in zip(left, found, strict=True):
            error = _error_of(answer)
            if isinstance(answer, str) and error is None:
                append_line(out, answer)
                row = _label_in(answer)
                done, cut = done + 1, cut + (row is not None and row[1])
            yield Labelled(done, len(names), cut, names[place], error)


def _held(out: Path) -> dict[str, bool]:
    """The shapes that a file of labels holds, and which of them the time budget cut short.

    The last line of the file is mended: given its end, or taken off if it is incomplete.
    """
    from shapeprog.formats.shape import read_text

    if not out.exists():
        return {}
    if not out.is_file():
        raise InputError(f"{out} is not a file", "give another --out")
    text = read_text(out)
    *lines, last = text.split("\n")
    held = [_label_in(line) for line in lines]
    for number, (line, label) in enumerate(zip(lines, held, strict=True), 1):
        if label is None and line.strip():
            raise InputError(f"line {number} of {out} is no label", "mend that line, or give another --out")
    if last:
        held.append(_label_in(last))
        write_text(out, text.removesuffix(last) if held[-1] is None else f"{text}\n")
    return dict(label for label in held if label is not None)


def _label_in(line: str) -> tuple[str, bool] | None:
    """The name of the shape that a line labels and whether the label was cut short, if it is a label."""
    try:
        row = json.loads(line)
        return str(row["name"]), bool(row.get("cut"))
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return None


def _error_of(answer: Answer) -> ShapeProgError | None:
    """Why a shape got no label, if the answer is none."""
    if isinstance(answer, ShapeProgError):
        return answer
    told = json.loads(answer)
    return ShapeProgError(told["error"], told["hint"]) if "error" in told else None


def _labelled(task: str) -> str:
    """What a process that labels answers: the line of a label, or the error."""
    from shapeprog.inference.infer import infer
    from shapeprog.language.text import format_program

    told = json.loads(task)
    try:
        _make_ready(*told["modules"])
        shape = _pack(told["pack"])[told["place"]]
        words = {name: told[name] for name in ("blocks", "budget", "seed")}
        # Labels owe nothing to any weights, and are of statements that generators can be taught.
        found = infer(shape, **words, generator=None, statements="paper")
    except ShapeProgError as error:
        return json.dumps({"error": error.message, "hint": error.hint})
    except Exception:  # a fault of ours with this shape costs its label, not those of the others
        cause = "the search failed: a fault of shapeprog, not of the shape"
        again = f"shapeprog infer {told['pack']}#{told['place']} --paper --weights none --debug"
        return json.dumps({"error": cause, "hint": f"report it, with what this says: {again}"})
    assert found.snapped is not None
    texts = {"program": format_program(found.program), "snapped": format_program(found.snapped)}
    return json.dumps({"name": shape.name, **texts, **found.scores, "cut": found.cut}, allow_nan=False)


@lru_cache(1)
def _make_ready(*modules: str) -> None:
    """Let the processes share the cores, and declare a user's statements."""
    import torch

    from shapeprog.formats.plugins import load_statements

    torch.set_num_threads(1)
    for module in modules:
        load_statements(Path(module))


@lru_cache(1)
def _pack(path: str) -> Pack:
    return read_pack(path, whole=False)


if __name__ == "__main__":
    serve(_labelled)

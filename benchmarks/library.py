"""Programs written with a library: how many statements are left, and the same for Stitch (Bowers et al., POPL 2023).

    python -m benchmarks.library LEARN VAL --stitch PYTHON

LEARN and VAL are folders of programs, such as ``shapeprog infer`` writes: a library is learned from the first, the
second is written with it.  PYTHON is an interpreter that has ``stitch-core`` (pip install stitch-core into an
environment of its own), which is no dependency of the package; without it only our own search is measured.

Stitch sees a program as one expression, ``(seq (leg_of (box floor (- width thick) ...)) (mirror 2 side 0 ...))``, and
what it calls by a name of its own counts as one statement wherever it holds any, otherwise as none.  With ``--whole``
it sees every number or expression as one word, and so cannot abstract from arithmetic alone.
"""

from __future__ import annotations

import argparse
import json
import re
import subprocess
import time
from collections.abc import Sequence
from pathlib import Path

from shapeprog.formats import load
from shapeprog.language.ast import Draw, Line, Loop
from shapeprog.language.expression import Binary, Name, Negative, Value, text_of
from shapeprog.language.printer import source_of
from shapeprog.language.program import Program
from shapeprog.language.statement import language
from shapeprog.library import learn, with_library
from shapeprog.library.length import statements
from shapeprog.space import AXES

STITCH = """
import json, sys, stitch_core
given = json.load(sys.stdin)
found = stitch_core.compress(given["learn"], iterations=given["most"], max_arity=given["arity"], threads=1)
written = stitch_core.rewrite(given["val"], found.abstractions)
print(json.dumps({
    "functions": [[each.name, each.body] for each in found.abstractions],
    "learn": found.rewritten, "val": written.rewritten,
}))
"""


def expression(lines: Sequence[Line], whole: bool) -> str:
    """The lines of a program or loop as one expression of Stitch; named numbers are left to their names."""
    parts = [_line(line, whole) for line in lines if isinstance(line, Draw | Loop)]
    found = parts.pop() if parts else "nothing"
    while parts:
        found = f"(seq {parts.pop()} {found})"
    return found


def _line(line: Draw | Loop, whole: bool) -> str:
    declared = language()[line.name]
    words = [
        AXES[int(value)] if quantity.kind == "axis" and isinstance(value, float)
        else re.sub(r"[\s()]", "", text_of(value)) if whole else _number(value)
        for value, quantity in zip(line.values, declared.quantities, strict=True)
    ]  # fmt: skip
    if isinstance(line, Loop):
        return f"({line.name} {' '.join(words)} {expression(line.body, whole)})"
    drawn = f"({line.name} {' '.join(words)})"
    return f"({line.role}_of {drawn})" if line.role else drawn


def _number(value: Value) -> str:
    match value:
        case Name(name):
            return name
        case Negative(inner):
            return f"(neg {_number(inner)})"
        case Binary(operator, left, right):
            return f"({operator} {_number(left)} {_number(right)})"
    return text_of(value)


def statements_of_stitch(text: str, functions: Sequence[tuple[str, str]]) -> int:
    """Statements, loops and calls of an expression; calls of what holds none are none."""
    holding = {each.name for each in language()}
    for name, body in functions:
        if holding & {*_words(body)}:
            holding.add(name)
    return sum(word in holding for word in _words(text))


def _words(text: str) -> list[str]:
    return re.findall(r"[^\s()]+", text)


def measure_stitch(
    learned: Sequence[Program], val: Sequence[Program], python: str, arity: int, most: int, whole: bool
) -> None:
    """One row for Stitch with functions of at most ``arity`` parameters."""
    given = {
        "learn": [expression(source_of(each).lines, whole) for each in learned],
        "val": [expression(source_of(each).lines, whole) for each in val],
        "arity": arity,
        "most": most,
    }
    started = time.perf_counter()
    done = subprocess.run([python, "-c", STITCH], input=json.dumps(given), capture_output=True, text=True, check=True)
    found = json.loads(done.stdout)
    counts = [sum(statements_of_stitch(text, found["functions"]) for text in found[part]) for part in ("learn", "val")]
    _row(
        f"stitch, arity {arity}{', whole' if whole else ''}",
        learned,
        val,
        (counts[0], counts[1]),
        time.perf_counter() - started,
    )
    for name, body in found["functions"]:
        print(f"    {name}: {body}")


def measure_ours(learned: Sequence[Program], val: Sequence[Program], most: int) -> None:
    """The row of our own search."""
    started = time.perf_counter()
    library = learn(learned, most)
    seconds = time.perf_counter() - started
    counts = [sum(statements(with_library(each, library)) for each in part) for part in (learned, val)]
    _row("shapeprog", learned, val, (counts[0], counts[1]), seconds)
    for function in library.source.functions.values():
        print(f"    {function.name}({', '.join(name for name, _ in function.parameters)})")


def _row(name: str, learned: Sequence[Program], val: Sequence[Program], after: tuple[int, int], seconds: float) -> None:
    words = []
    for part, label, count in zip((learned, val), ("learned from", "val"), after, strict=True):
        before = sum(map(statements, part))
        words.append(f"{label} {before} -> {count} ({count / before:.3f})")
    print(f"{name}: {', '.join(words)}, {seconds:.0f} s", flush=True)


def main() -> None:
    """Print a row for each engine, and its functions."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("learn", type=Path)
    parser.add_argument("val", type=Path)
    parser.add_argument("--stitch", default="", help="an interpreter that has stitch-core")
    parser.add_argument("--arity", type=int, nargs="+", default=[3, 6])
    parser.add_argument("--whole", action="store_true", help="numbers and expressions are single words for Stitch")
    parser.add_argument("--most", type=int, default=12)
    options = parser.parse_args()
    learned, val = ([load(path) for path in sorted(folder.glob("*.shape"))] for folder in (options.learn, options.val))
    measure_ours(learned, val, options.most)
    for arity in options.arity if options.stitch else ():
        measure_stitch(learned, val, options.stitch, arity, options.most, options.whole)


if __name__ == "__main__":
    main()

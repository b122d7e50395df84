"""Many cases through child processes: one that dies is replaced, and files that fail are kept."""

from __future__ import annotations

import datetime
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from .verdict import innermost

ROOT = Path(__file__).parents[2]
KEPT = ROOT / "fuzz-failures"
"""Folder of files that fail; git ignores it."""

SECONDS = 20.0
"""Time of the processor for one way of using a case: what a command does with a file."""

_DOUBTFUL = ("crash", "hang")
"""Faults that count only if they come again in a fresh process."""

_FRAME = re.compile(r'File "([^"]+)", line \d+ in (\S+)')
_ONE_THREAD = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "NUMBA_NUM_THREADS": "1", "MPLBACKEND": "agg"}


@dataclass(frozen=True)
class Failure:
    """A case that ended neither in a result nor in good words.

    Parameters
    ----------
    kind, seed, index
        Which case.
    reason
        Sort of the fault: foreign exception, raw Python text, memory, crash, hang, touched, printed...
    detail, place
        What was said, and the innermost functions.
    file
        Its bytes, kept.
    """

    kind: str
    seed: int
    index: int
    reason: str
    detail: str
    place: str
    file: Path

    @property
    def cause(self) -> tuple[str, ...]:
        """What failures of one cause have in common."""
        sort = self.detail.split(": ")[1:2] if self.reason == "foreign exception" else []
        return self.reason, *sort, self.place

    @property
    def command(self) -> str:
        """What shows it again."""
        return f"python -m tests.fuzz --kind {self.kind} {self.file}"

    def __str__(self) -> str:
        return f"{self.reason} in {self.place or 'no place of Python'}\n    {self.detail}\n    {self.command}"


def tonight() -> tuple[int, ...]:
    """Three seeds that nobody has seen before today."""
    day = datetime.date.today().toordinal()
    return tuple(3 * day + each for each in range(3))


def summary(failures: Sequence[Failure]) -> str:
    """How often each cause of failure came, each with one file that shows it."""
    causes = Counter(each.cause for each in failures)
    first = {each.cause: each for each in reversed(failures)}
    rows = [f"{count} x {first[cause]}" for cause, count in causes.most_common()]
    return "\n".join([*rows, f"{len(failures)} failures of {len(causes)} causes"])


def run(
    kind: str,
    seed: int,
    cases: int,
    *,
    start: int = 0,
    files: Sequence[Path] = (),
    keep: Path = KEPT,
    seconds: float = SECONDS,
    stop_after: int = 1000,
) -> list[Failure]:
    """Every failure among ``cases`` cases of a kind, number ``start`` first.

    Parameters
    ----------
    files
        Take these files as the cases instead.
    keep
        Folder for the files of cases that fail.
    seconds
        Time of the processor for one way of using a case.
    stop_after
        Failures after which no further case is taken.
    """
    found: list[Failure] = []
    index, stop, doubted = start, start + (len(files) or cases), -1
    keep = keep / f"{kind}-{seed}"
    keep.mkdir(parents=True, exist_ok=True)
    asked = {"kind": kind, "seed": seed, "stop": stop, "seconds": seconds, "keep": str(keep.resolve())}
    asked["files"] = [str(each.resolve()) for each in files]
    with tempfile.TemporaryDirectory() as folder:
        while index < stop and len(found) < stop_after:
            for told in _reports({**asked, "start": index, "folder": os.path.realpath(folder)}):
                if doubted != index and any(failure[0] in _DOUBTFUL for failure in told["failures"]):
                    doubted = index  # it may be the load of the machine
                    break
                file = keep / f"{index}-{told['name']}"
                found += [Failure(kind, seed, index, *failure, file) for failure in told["failures"]]
                index += 1
                if len(found) >= stop_after:
                    break
    return found


def _reports(asked: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """What one child tells of its cases, and what its death tells of the case that it died of."""
    folder, index = Path(asked["folder"]), asked["start"]
    words = [sys.executable, "-m", "tests.fuzz.child", json.dumps(asked)]
    with subprocess.Popen(words, stdout=subprocess.PIPE, text=True, cwd=ROOT, env=os.environ | _ONE_THREAD) as child:
        assert child.stdout is not None
        try:
            ready = child.stdout.readline()
            for line in child.stdout:
                yield json.loads(line)
                index += 1
            code = child.wait()
        finally:
            child.kill()
    last = (folder / "log").read_text(errors="replace")
    hang = code == -signal.SIGPROF or "Timeout (" in last
    if not ready or (code > 0 and not hang):
        raise RuntimeError(f"a fault of the suite itself:\n{last[-3000:]}")
    if code:
        reason = "hang" if hang else "crash"
        name = next(each.name for each in (folder / "case").iterdir() if each.is_file())
        shutil.copy(folder / "case" / name, Path(asked["keep"]) / f"{index}-{name}")
        detail = f"more than {asked['seconds']} s" if reason == "hang" else f"exit status {code}: {last[-200:]}"
        yield {"name": name, "failures": [(reason, detail, innermost(_FRAME.findall(last)[::-1]))]}

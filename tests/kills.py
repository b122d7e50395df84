"""A task that is killed at random moments, again and again: it ends as one that never was, and leaves nothing behind.

    python tests/kills.py TASK FOLDER KILLS SEED

Each attempt is a fork of this process, which has imported everything and started no threads, so that many fit into a
minute.  After a kill the task is begun again in the same folder, as a user would.
"""

from __future__ import annotations

import contextlib
import importlib
import json
import os
import random
import shutil
import signal
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch

from shapeprog.data.preparation import prepare
from shapeprog.formats import export
from shapeprog.language.parser import parse

TEXTS = (
    "leg(at=(-12, -4, -6), size=(24, 8, 12))\n",
    "leg(at=(-6, -10, -12), size=(9, 20, 24))\n",
    "leg(at=(-4, -5, -12), size=(8, 10, 24))\n",
)
PATIENCE = 60.0
"""Seconds after which a process that a killed task has started is taken to go on for ever."""


@dataclass(frozen=True)
class Task:
    """What is run, given the folder of its inputs and an empty one for its outputs, and what counts of these.

    The libraries are those that every attempt would have to import.
    """

    work: Callable[[Path, Path], None]
    outcome: Callable[[Path], Any]
    libraries: tuple[str, ...]


def make_packs(inputs: Path, folder: Path) -> None:
    for _ in prepare(inputs / "models", folder, points=200):
        pass


def packed(folder: Path) -> Any:
    found: dict[str, Any] = {}
    for path in folder.iterdir():
        with np.load(path) as arrays:
            found[path.name] = {name: arrays[name].tolist() for name in arrays}
    return found


TASKS = {
    "prepare": Task(make_packs, packed, ("trimesh", "numba")),
}


def make_inputs(inputs: Path) -> None:
    for number, text in enumerate(TEXTS):
        program = parse(text)
        for category in ("one", "two"):
            (inputs / "models" / category).mkdir(parents=True, exist_ok=True)
            export(program, inputs / "models" / category / f"{number}.obj")


def started(task: Task, inputs: Path, folder: Path) -> int:
    """The number of a new process that does a task."""
    child = os.fork()
    if child:
        return child
    code = 1
    try:
        task.work(inputs, folder)
        code = 0
    except BaseException:
        sys.excepthook(*sys.exc_info())
    finally:
        os._exit(code)


def ended(child: int) -> bool:
    """Whether a process did its task, else it was killed; one that failed ends the sweep."""
    status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    assert status in (0, -signal.SIGKILL), "the task failed instead of going on"
    return status == 0


def helpers(mark: str) -> list[int]:
    """The processes that bear a mark in their environment, beside this one."""
    found = []
    for path in Path("/proc").glob("[0-9]*/environ"):
        with contextlib.suppress(OSError):
            if mark.encode() in path.read_bytes():
                found.append(int(path.parent.name))
    return [number for number in found if number != os.getpid()]


def main(name: str, folder: Path, kills: int, seed: int) -> dict[str, float]:
    """Kill a task that often, and compare each time it could end; figures of the sweep."""
    torch.set_num_threads(1)
    os.environ["KILLED_TASK"] = mark = f"{name} in {folder}"
    task, chance = TASKS[name], random.Random(seed)
    for library in task.libraries:
        importlib.import_module(library)
    inputs, whole, broken = folder / "inputs", folder / "whole", folder / "broken"
    make_inputs(inputs)
    whole.mkdir()
    clock = time.monotonic()
    assert ended(started(task, inputs, whole))
    lasts, expected = time.monotonic() - clock, task.outcome(whole)
    broken.mkdir()
    done = finished = unfinished = 0
    begun = False
    longest = 0.0
    while done < kills or begun:
        child = started(task, inputs, broken)
        if done < kills:
            time.sleep(chance.uniform(0, lasts))
            os.kill(child, signal.SIGKILL)
        if ended(child):
            assert task.outcome(broken) == expected, "the outcome differs"
            shutil.rmtree(broken)
            broken.mkdir()
            finished, begun = finished + 1, False
            continue
        done, begun = done + 1, True
        unfinished += any("~" in path.name for path in broken.iterdir())
        clock = time.monotonic()
        while helpers(mark):
            assert time.monotonic() - clock < PATIENCE, "a process outlives the one that started it"
            time.sleep(0.01)
        longest = max(longest, time.monotonic() - clock)
    return {
        "kills": done,
        "finished": finished,
        "kills that left an unfinished file": unfinished,
        "slowest end of helpers": longest,
    }


if __name__ == "__main__":
    print(json.dumps(main(sys.argv[1], Path(sys.argv[2]), int(sys.argv[3]), int(sys.argv[4]))))

"""The process that does the dangerous things: case after case under limits, one line of JSON to its parent for each."""

from __future__ import annotations

import contextlib
import faulthandler
import importlib
import itertools
import json
import os
import resource
import shutil
import signal
import sys
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

from shapeprog.errors import ShapeProgError

from . import verdict
from .uses import uses

ROOT = Path(__file__).parents[2]
MEMORY = 2 << 30
"""Bytes of data that the process may hold, its libraries included (0.35 GB): what Linux counts as VmData."""

LEFTOVER = 200 << 20
"""Bytes that cases may leave behind before another process takes the next."""

PATIENCE = 5
"""The time of a use is that of the processor; so many times as long on the clock ends it too: it may wait for ever."""

KINDS = {
    "loaders": "tests.fuzz.loaders",
    "programs": "tests.fuzz.programs",
    "everything": "tests.fuzz.everything",
    "faults": "tests.fuzz.faults",
}
"""Modules of the kinds: ``cases(seed)`` gives names and contents without an end, ``seeds()`` those that are valid."""

_WRITES = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND
_CHANGES = ("os.mkdir", "os.rename", "os.remove", "os.rmdir", "os.symlink", "os.link", "os.truncate", "os.chmod")
_FORBIDDEN = (
    "subprocess.Popen",
    "os.system",
    "os.exec",
    "os.posix_spawn",
    "os.fork",
    "socket.connect",
    "socket.getaddrinfo",
)


class Watch:
    """What Python does to files, processes and the network while ``on``: all but files in ``folder`` is noted."""

    def __init__(self, folder: Path) -> None:
        self.on, self.seen = False, list[str]()
        self._inside = (str(folder) + os.sep, os.devnull)
        self._readable = (*self._inside, str(ROOT), sys.prefix, sys.base_prefix, "/proc", "/sys", "/usr", "/etc/ld.so")
        sys.addaudithook(self._note)

    def _note(self, event: str, details: tuple[Any, ...]) -> None:
        if not self.on or not details:
            return
        if event in _FORBIDDEN:
            self.seen.append(f"{event} {details[0]}"[:200])
        elif event in _CHANGES or event == "open":
            place = details[0]
            if not isinstance(place, (str, bytes, os.PathLike)):
                return  # a file that is open already
            wanted = self._inside if event != "open" or int(details[2] or 0) & _WRITES else self._readable
            where = os.path.abspath(os.fsdecode(place))
            if not where.startswith(wanted):
                self.seen.append(f"{event} {where}")


def main(argument: str) -> None:
    """Take the cases that the parent asks for; see :func:`tests.fuzz.campaign.run`."""
    asked = json.loads(argument)
    folder = Path(asked["folder"])
    report = os.fdopen(os.dup(1), "w", buffering=1)
    log = (folder / "log").open("w+b", buffering=0)
    os.dup2(log.fileno(), 1)
    os.dup2(log.fileno(), 2)
    source = importlib.import_module(KINDS[asked["kind"]])
    if hasattr(source, "seeds"):
        _warm_up(source.seeds(), folder)
    resource.setrlimit(resource.RLIMIT_DATA, (MEMORY, MEMORY))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    faulthandler.enable(log)
    faulthandler.register(signal.SIGPROF, log, chain=True)  # which ends the process
    watch = Watch(folder / "case")
    usual = _data()
    report.write('"ready"\n')
    start, stop = asked["start"], asked["stop"]
    files = [Path(each) for each in asked["files"]][start:stop]
    drawn = itertools.islice(source.cases(asked["seed"]), start, stop)
    given = ((path.name, path.read_bytes()) for path in files) if files else drawn
    for index, (name, content) in enumerate(given, start):
        log.seek(0)
        log.truncate()
        path = _fresh(folder / "case") / name
        path.write_bytes(content)
        failures = _tried(path, watch, lambda: _timed(asked["seconds"], log))
        faulthandler.cancel_dump_traceback_later()
        signal.setitimer(signal.ITIMER_PROF, 0)
        sys.stdout.flush()
        if log.tell():
            failures.append(("printed", _text(log), ""))
        if failures:
            shutil.copy(path, Path(asked["keep"]) / f"{index}-{name}")
        report.write(json.dumps({"name": name, "failures": failures}) + "\n")
        if _data() > usual + LEFTOVER:
            break  # another process begins with a clean memory


def _timed(seconds: float, log: Any) -> None:
    """From now on, end the process after so much time of the processor, or :data:`PATIENCE` times that on the clock."""
    signal.setitimer(signal.ITIMER_PROF, seconds)
    faulthandler.dump_traceback_later(PATIENCE * seconds, exit=True, file=log)


def _tried(path: Path, watch: Watch, start: Callable[[], None]) -> list[tuple[str, str, str]]:
    """What went wrong with a file in any way of using it: reason, detail and place; ``start`` comes before each."""
    found: list[tuple[str, str, str]] = []
    out = path.parent / "out"
    content = path.read_bytes()
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        watch.seen.clear()
        watch.on = True
        steps = uses(path, out)
        step = "reading"
        while True:
            try:
                start()
                following = next(steps, None)
                if following is None:
                    break
                step, call = following
                start()
                call()
            except KeyboardInterrupt:
                raise
            except BaseException as error:  # a panic of compiled code, and what asks to leave, are none of Exception
                reason = verdict.complaint(error, path)
                if reason:
                    said = f"{step}: {type(error).__name__}: {error}"[:600]
                    found.append((reason, said, verdict.place(error)))
        watch.on = False
    warned = [(f"{each.category.__name__}: {each.message}"[:300], f"{each.filename}:{each.lineno}") for each in told]
    found += [("warning", *each) for each in dict.fromkeys(warned)]
    found += [("touched", each, "") for each in watch.seen]
    if path.read_bytes() != content or len(list(path.parent.iterdir())) != 2:
        found.append(("touched", f"something beside {path.name}", ""))
    return found


def _warm_up(seeds: dict[str, bytes], folder: Path) -> None:
    """Load all libraries and kernels, as valid files need them, before anything is timed or limited."""
    import torch

    from shapeprog.kernels.compile import modules_of, prepare

    torch.set_num_threads(1)
    prepare(modules_of("data/", "geometry/"))
    for name in {name.rpartition(".")[2]: name for name in seeds}.values():  # one of each format
        path = _fresh(folder / "case") / name
        path.write_bytes(seeds[name])
        for _, call in uses(path, path.parent / "out"):
            with contextlib.suppress(ShapeProgError):  # a reader of another kind of such files
                call()


def _data() -> int:
    """Bytes of data that the process holds, as the limit counts them."""
    return int(Path("/proc/self/statm").read_text().split()[5]) * resource.getpagesize()


def _fresh(folder: Path) -> Path:
    shutil.rmtree(folder, ignore_errors=True)
    (folder / "out").mkdir(parents=True)
    return folder


def _text(log: Any) -> str:
    log.seek(0)
    found: str = log.read().decode(errors="replace")
    return found[-1000:]


if __name__ == "__main__":
    main(sys.argv[1])

"""Other processes: they answer, their end is told, and they end with the one that asks."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from shapeprog.errors import ShapeProgError
from shapeprog.processes import Worker

Module = Callable[[str], str]
SOURCE = Path(__file__).parents[1] / "src"
ASKS = """
import sys
from shapeprog.processes import Worker
Worker(sys.argv[1]).ask("1")
"""


@pytest.fixture
def module(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Module:
    """A module whose function ``answer`` has a given body, by its name."""
    monkeypatch.syspath_prepend(tmp_path)

    def write(body: str) -> str:
        text = f"import os, sys, time\nfrom shapeprog.processes import serve\ndef answer(line):\n    {body}\n"
        (tmp_path / "answering.py").write_text(f"{text}serve(answer)\n")
        return "answering"

    return write


def test_lines_are_answered_whatever_is_printed_besides(module: Module):
    worker = Worker(module("print('noise'); return line + 'ä'"), quiet=True)
    assert [worker.ask(line) for line in "12"] == ["1ä", "2ä"]
    worker.close()


@pytest.mark.parametrize(("end", "told"), [("os.kill(os.getpid(), 9)", "SIGKILL"), ("os._exit(7)", "code 7")])
def test_a_process_that_ends_is_told(module: Module, end: str, told: str):
    worker = Worker(module(end))
    with pytest.raises(ShapeProgError, match=told):
        worker.ask("1")
    worker.close()


def test_a_process_that_cannot_be_started_is_told(module: Module, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(sys, "executable", "no-such-program")
    with pytest.raises(ShapeProgError, match="cannot start"):
        Worker(module("return line"))


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM])
def test_they_end_with_the_process_that_asks_however_it_ends(module: Module, tmp_path: Path, number: signal.Signals):
    name = module("print('at work', flush=True); time.sleep(60)")
    words = [sys.executable, "-c", ASKS, name]
    env = {**os.environ, "PYTHONPATH": os.pathsep.join([str(tmp_path), str(SOURCE)])}
    with subprocess.Popen(words, stderr=subprocess.PIPE, text=True, env=env) as process:
        assert process.stderr is not None
        assert process.stderr.readline() == "at work\n"
        process.send_signal(number)
        process.communicate(timeout=30)  # all who could write to it have gone
    assert process.returncode

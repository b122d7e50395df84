"""Other processes: they answer in order, their end is told, and they end with the one that asks."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from shapeprog.errors import ShapeProgError
from shapeprog.processes import answers

Module = Callable[[str], str]
SOURCE = Path(__file__).parents[1] / "src"
ASKS = """
import sys
from shapeprog.processes import answers
list(answers(sys.argv[1], ["1", "2"], 2))
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


def test_answers_come_in_the_order_of_the_lines_whatever_is_printed_besides(module: Module):
    name = module("print('noise'); time.sleep(0.05 * (line == '0')); return line + 'ä'")
    lines = [str(number) for number in range(20)]
    assert list(answers(name, lines, 3)) == [f"{line}ä" for line in lines]
    assert list(answers(name, [], 3)) == []


def test_a_process_that_ends_is_told_and_replaced(module: Module):
    name = module("line == '2' and os.kill(os.getpid(), 9); line == '3' and os._exit(7); return line")
    found = list(answers(name, ["1", "2", "3", "4"], 1))
    assert (found[0], found[3]) == ("1", "4")
    assert "by the signal SIGKILL" in str(found[1])
    assert "with exit code 7" in str(found[2])


def test_a_process_that_cannot_be_started_is_told(module: Module, monkeypatch: pytest.MonkeyPatch):
    name = module("return line")
    monkeypatch.setattr(sys, "executable", "no-such-program")
    (error,) = answers(name, ["1"], 1)
    assert isinstance(error, ShapeProgError)
    assert "cannot start" in error.message


def test_who_stops_listening_ends_them_at_once(module: Module):
    clock = time.monotonic()
    asked = answers(module("time.sleep(60 * (line != '0')); return line"), [str(number) for number in range(9)], 2)
    assert next(asked) == "0"
    asked.close()
    assert time.monotonic() - clock < 30


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM])
def test_they_end_with_the_process_that_asks_however_it_ends(module: Module, tmp_path: Path, number: signal.Signals):
    name = module("print('at work', flush=True); time.sleep(60)")
    words = [sys.executable, "-c", ASKS, name]
    env = {**os.environ, "PYTHONPATH": os.pathsep.join([str(tmp_path), str(SOURCE)])}
    with subprocess.Popen(words, stderr=subprocess.PIPE, text=True, env=env) as process:
        assert process.stderr is not None
        assert [process.stderr.readline() for _ in range(2)] == ["at work\n"] * 2
        process.send_signal(number)
        process.communicate(timeout=30)  # all who could write to it have gone
    assert process.returncode

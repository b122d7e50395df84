"""Ctrl-C: no traceback and exit code 130, from the first moment of a command to its last."""

from __future__ import annotations

import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

WHILE_IMPORTING = """
import signal, sys
class Moment:
    def find_spec(self, name, *_):
        if name == {name!r}:
            signal.raise_signal(signal.SIGINT)
sys.meta_path.insert(0, Moment())
sys.argv = {words!r}
from shapeprog.__main__ import main
main()
"""


@pytest.fixture(autouse=True)
def interruptible() -> Iterator[None]:
    """Interruptions interrupt, here and in other processes, even where the suite runs in the background of a script."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def interrupted_while_importing(name: str, *words: str) -> subprocess.CompletedProcess[str]:
    code = WHILE_IMPORTING.format(name=name, words=["shapeprog", *words])
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)


@pytest.mark.parametrize("name", ["shapeprog.cli", "typer", "shapeprog.cli.writing", "rich.progress"])
def test_an_interruption_while_the_command_starts_is_told_in_a_line(name: str, tmp_path: Path):
    (tmp_path / "empty.obj").touch()  # absent inputs end before most imports
    ended = interrupted_while_importing(name, "infer", str(tmp_path / "empty.obj"), "--out", str(tmp_path))
    assert ended.returncode == 130
    assert ended.stderr.startswith("Interrupted")
    assert ended.stderr.count("\n") == 1


def test_an_interruption_that_is_ignored_stays_so():
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    ended = interrupted_while_importing("typer", "--version")
    assert ended.returncode == 0
    assert ended.stdout.startswith("shapeprog ")

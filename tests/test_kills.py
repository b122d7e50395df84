"""Tasks that are killed at random moments end as those that never were, and leave nothing behind."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

SCRIPT = Path(__file__).with_name("kills.py")

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="looks for processes where Linux lists them")


def survived(task: str, kills: int, folder: Path) -> int:
    """How many kills a task survived."""
    words = [sys.executable, str(SCRIPT), task, str(folder), str(kills), "0"]
    ended = subprocess.run(words, capture_output=True, text=True, check=False)
    assert ended.returncode == 0, ended.stderr
    return int(json.loads(ended.stdout)["kills"])


def test_a_few_kills_change_nothing(tmp_path: Path):
    assert survived("prepare", 2, tmp_path) == 2


@pytest.mark.nightly
def test_a_hundred_kills_change_nothing(tmp_path: Path):
    assert survived("prepare", 100, tmp_path) == 100

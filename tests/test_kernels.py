"""Kernels: compiled once, compiled again when anything they are made of changes, and within the bounds of arrays."""

from __future__ import annotations

import importlib
import os
import shutil
import subprocess
import sys
from pathlib import Path
from types import FunctionType

import numpy as np
import pytest

from shapeprog.kernels import compile as compiling

ROOT = Path(__file__).parents[1]

HELPERS = """
from shapeprog.kernels.compile import helper
FACTOR = 3
@helper
def scaled(x):
    return FACTOR * x
"""
KERNELS = """
from shapeprog.kernels.compile import kernel
from {name}_helpers import scaled
@kernel("void(f8[::1])")
def scale(values):
    for k in range(len(values)):
        values[k] = scaled(values[k])
@kernel("i8(i8)")
def next_one(value):
    return value + 1
"""


@pytest.fixture
def declare(tmp_path, monkeypatch):
    """Two modules in files, helpers and kernels, and a cache of their own."""
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(tmp_path), str(ROOT / "src")]))  # of the second process
    before = set(compiling._kernels)

    def write(name, helpers=HELPERS):
        (tmp_path / f"{name}_helpers.py").write_text(helpers)
        (tmp_path / f"{name}.py").write_text(KERNELS.format(name=name))
        importlib.invalidate_caches()
        return importlib.import_module(name)

    yield write
    for name in set(compiling._kernels) - before:
        del compiling._kernels[name]


def again(module):
    """The kernels of a module as another process declares them."""
    for name in (f"{module.__name__}_helpers", module.__name__):
        del sys.modules[name]
    return importlib.import_module(module.__name__)


def test_a_kernel_runs_is_kept_and_takes_one_signature(declare):
    first = declare("kept")
    assert isinstance(first.scaled, FunctionType)
    assert first.scaled(2) == 6
    assert not first.scale.load()
    values = np.arange(3.0)
    first.scale(values)
    assert values.tolist() == [0, 3, 6]
    with pytest.raises(TypeError, match="No matching definition"):
        first.scale(np.arange(3))
    assert again(first).scale.load()


@pytest.mark.parametrize(("old", "new"), [("FACTOR = 3", "FACTOR = 4"), ("* x", "* x + 1")], ids=["constant", "code"])
def test_a_change_in_a_helper_of_another_file_compiles_the_kernel_again(declare, old, new):
    name = f"changed_{abs(hash(new))}"
    first = declare(name)
    first.scale.compile()
    (Path(first.__file__).parent / f"{name}_helpers.py").write_text(HELPERS.replace(old, new) + "\n# longer\n")
    second = again(first)
    assert second.scale.load() is False
    values = np.ones(1)
    second.scale(values)
    assert values[0] == second.scaled(1) != 3


@pytest.mark.parametrize("broken", [False, True], ids=["both processes", "the second fails"])
def test_prepare_compiles_what_is_missing_and_then_loads_it(declare, monkeypatch, broken):
    name = f"prepared_{broken}"
    first, told = declare(name), []
    if broken:
        monkeypatch.setattr(sys, "executable", shutil.which("false"))
    compiling.prepare([name], told.append)
    assert len(told) == 1
    assert first.next_one(1) == 2
    again(first)
    compiling.prepare([name], told.append)
    assert len(told) == 1


def test_another_process_ends_with_the_one_that_started_it(tmp_path):
    (tmp_path / "endless.py").write_text("import sys, time\nprint('at work', file=sys.stderr)\ntime.sleep(60)\n")
    words = [sys.executable, "-m", "shapeprog.kernels.compile", "0/1", "endless"]
    env = {**os.environ, "PYTHONPATH": os.pathsep.join([str(tmp_path), str(ROOT / "src")])}
    with subprocess.Popen(words, stdin=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=env) as other:
        assert other.stderr.readline() == "at work\n"
        other.stdin.close()  # as the system does when a process is killed
        assert other.wait(timeout=30) == 0


def test_no_module_compiles_by_itself():
    for path in (ROOT / "src").rglob("*.py"):
        text = path.read_text()
        if path.parts[-2:] != ("kernels", "compile.py"):
            assert "njit" not in text, path
            assert "import numba" not in text, path
            assert "from numba" not in text, path

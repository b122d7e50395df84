"""What is drawn without torch: the same as with it."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from shapeprog.language.statement import standard
from shapeprog.language.trial import check_declaration

PROGRAM = """width, depth, height = 9, 10, 24
n = 3
for _ in rotate(n):
    for _ in mirror(x=0):
        leg(taper(start=at(left=0, rear=3), end=at(left=-1, rear=2, top=8), radius=(0.5, 1)))
seat(bottom=16, height=2)
"""

BOTH_WAYS = """
import sys
import numpy as np
from shapeprog.errors import ShapeProgError
from shapeprog.formats.cuts import cut_list
from shapeprog.formats.openscad import scad_text
from shapeprog.formats.parts import parts, solid
from shapeprog.language import Draw, Loop, Program, language
from shapeprog.space import Frame
from pathlib import Path

def values(declared, random):
    return tuple(
        float(np.float32(q.nearest(random.uniform(0, min(q.high, 5))) if q.discrete else random.uniform(q.low, q.high)))
        for q in declared.quantities
    )

def programs(seed):
    random = np.random.default_rng(seed)
    loops = [each for each in language() if each.is_loop]
    for declared in language():
        if not declared.is_loop:
            node = Draw(declared.name, values(declared, random))
            for number in random.integers(0, len(loops), seed):
                node = Loop(loops[number].name, values(loops[number], random), (node,))
            yield Program((node,))

def drawn():
    for program in [each for seed in range(3) for each in programs(seed)]:
        for each in parts(program):
            yield each.name, each.vertices, each.faces
        try:
            yield "solid", *solid(program)
        except ShapeProgError as error:
            yield error.message, np.zeros(0), np.zeros(0)
        yield scad_text(program, Frame()), np.zeros(0), np.zeros(0)
        yield str(cut_list(program, Frame())), np.zeros(0), np.zeros(0)

light = list(drawn())
assert "torch" not in sys.modules
import torch
for one, two in zip(light, drawn(), strict=True):
    assert one[0] == two[0]
    np.testing.assert_allclose(one[1], two[1], rtol=1e-12, atol=1e-12)
    np.testing.assert_array_equal(one[2], two[2])
print(len(light), "alike")
"""


def test_every_statement_that_ships_draws_alike_without_torch(tmp_path: Path) -> None:
    done = subprocess.run([sys.executable, "-c", BOTH_WAYS], capture_output=True, text=True, cwd=tmp_path, check=False)
    assert (done.returncode, "alike" in done.stdout) == (0, True), done.stderr


@pytest.mark.parametrize(
    "words",
    [
        ["statements"],
        [
            "export",
            "a.shape",
            *(f"b.{suffix}" for suffix in ("shape", "json", "stl", "3mf", "glb", "obj", "ply", "scad", "py", "csv")),
        ],
        ["export", "a.shape", "b.stl", "--set", "width=7"],
        ["show", "a.shape"],
        ["render", "a.shape", "a.png"],
    ],
)
def test_commands_on_program_text_start_without_torch(tmp_path: Path, words: list[str]) -> None:
    (tmp_path / "a.shape").write_text(PROGRAM)
    code = (
        f"import sys\nfrom shapeprog.cli import main\ntry: main({words})\n"
        "except SystemExit as end: print(end.code, 'torch' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=tmp_path, check=False)
    assert done.stdout.splitlines()[-1] == "0 False", done.stderr


def test_a_thread_that_loads_torch_does_not_change_it_for_one_that_draws_without(tmp_path: Path) -> None:
    code = """
import threading
import numpy as np
from shapeprog.lazy_torch import on_numpy, torch
with on_numpy(True):
    thread = threading.Thread(target=lambda: print(torch.eye(2).requires_grad_()))
    thread.start()
    thread.join()
    print(torch.eye(2) @ np.ones(2))
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=tmp_path, check=False)
    assert (done.returncode, done.stdout.splitlines()[-1:]) == (0, ["[1. 1.]"]), done.stderr


def test_declarations_that_ship_pass_the_trial_that_those_of_users_do() -> None:
    for declared in standard:
        check_declaration(declared)

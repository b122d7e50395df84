"""Broken files and programs by the thousand: each ends in a result or in words, whatever it holds."""

from __future__ import annotations

from itertools import islice
from pathlib import Path

import pytest

from shapeprog.data import load_all
from shapeprog.data.loading import ARRAY_SUFFIXES
from shapeprog.data.meshes import COMMON
from shapeprog.data.shape import Shape
from shapeprog.formats.format import program_suffixes
from tests.fuzz import by_hand, faults, loaders, programs
from tests.fuzz.campaign import run, summary, tonight
from tests.fuzz.mutations import mutants_of

NIGHTLY = {"loaders": 30_000, "programs": 10_000}
"""Cases of one night."""


@pytest.mark.nightly
def test_there_is_a_valid_file_of_every_format_that_is_read(tmp_path: Path) -> None:
    read_here = {f".{suffix}" for suffix in COMMON} | ARRAY_SUFFIXES | {".binvox"}  # trimesh may read others besides
    assert read_here <= {Path(name).suffix for name in loaders.seeds()}
    assert set(program_suffixes()) - {".txt"} <= {Path(name).suffix for name in programs.seeds()}
    for name, content in loaders.seeds().items():
        (tmp_path / name).write_bytes(content)
    shapes = [tmp_path / name for name in loaders.seeds()]
    assert {path.name: found for path, found in load_all(shapes) if not isinstance(found, Shape)} == {}


def test_a_seed_and_a_number_say_which_case_it_is() -> None:
    valid = {"a.obj": by_hand.OBJ, "a.off": by_hand.OFF, "a.ply": by_hand.RAGGED_PLY, "a.glb": by_hand.glb()}
    first = list(islice(mutants_of(valid, loaders.WAYS, 5), 30))
    assert list(islice(mutants_of(valid, loaders.WAYS, 5), 30)) == first
    assert len({content for _, content in first} - {*valid.values()}) > 20


def test_faults_are_seen(tmp_path: Path) -> None:
    inside = next(number for number, name in enumerate(faults.FAULTS) if name == "memory")
    found = run("faults", 0, inside, keep=tmp_path)
    assert [(each.index, each.reason) for each in found] == expected(inside)
    again = run("faults", 0, 0, files=[each.file for each in found], keep=tmp_path)
    assert [each.reason for each in again] == [each.reason for each in found]


def test_a_little_of_every_kind_ends_in_a_result_or_in_words() -> None:
    found = run("everything", 1, 60)
    assert not found, summary(found)


@pytest.mark.nightly
def test_a_process_that_dies_is_replaced(tmp_path: Path) -> None:
    found = run("faults", 0, len(faults.FAULTS), keep=tmp_path, seconds=1)
    assert [(each.index, each.reason) for each in found] == expected(len(faults.FAULTS))


@pytest.mark.nightly
@pytest.mark.parametrize("kind", NIGHTLY)
@pytest.mark.parametrize("night", range(3))
def test_everything_ends_in_a_result_or_in_words(kind: str, night: int) -> None:
    cases = NIGHTLY[kind] // 3
    start = crafted(kind) if night else 0  # what is crafted is the same for every seed
    found = run(kind, tonight()[night], cases, start=start, stop_after=100)
    assert not found, summary(found)


def crafted(kind: str) -> int:
    """How many cases of a kind are the same for every seed, and come first."""
    return sum(1 for _ in {"programs": programs.crafted}.get(kind, tuple)())


def expected(count: int) -> list[tuple[int, str]]:
    return [(number, reason) for number, (reason, _) in enumerate([*faults.FAULTS.values()][:count]) if reason]

"""A file that cannot be read between two good ones: every command does these, and says which it was and why."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest
from bad_files import BAD, CELLS, PYTHON, npz, written
from commands import Ended, Run, table

from shapeprog.data.folders import files_below
from shapeprog.data.loading import readable_suffixes

BY_DAY = ("npz_encrypted", "glb_accessor_without_a_view", "ply_text_cut_between_faces", "fifo")
KINDS = [pytest.param(kind, marks=() if kind in BY_DAY else pytest.mark.nightly) for kind in BAD]


def names(ended: Ended, *bad: str) -> None:
    """The command went on to its end, and says of each bad one what is wrong and what to do, in plain words."""
    assert ended.code == 1
    told = " ".join(ended.err.split())
    causes = re.findall(r"error: (.+?) hint: \w", told)
    for name in bad:
        assert any(name in cause for cause in causes), told
    assert not PYTHON.search(told), told


@pytest.mark.usefixtures("quick")
@pytest.mark.parametrize("kind", KINDS)
def test_a_bad_file_between_two_good_ones_is_told_at_the_end_by_every_command(run: Run, tmp_path: Path, kind: str):
    if "h5" in kind or kind.startswith("hdf5"):
        pytest.importorskip("h5py")
    folder = tmp_path / "in" / "tables"
    folder.mkdir(parents=True)
    first, last = (table(folder / f"{name}.obj") for name in ("a_good", "z_good"))
    bad = BAD[kind](folder)
    within = bad in files_below(folder, readable_suffixes(), [])  # else it is only there for who names it
    ended = run("infer", first, bad, last, "--out", "res", "--no-picture")
    names(ended, bad.name)
    assert sorted(path.name for path in (tmp_path / "res").glob("*.json")) == ["a_good.json", "z_good.json"]
    ended = run("prepare", "in", "packs")
    assert sum(int(count) for count in re.findall(r": (\d) shapes?", ended.out)) == 2
    if within:
        names(ended, bad.name)
    if bad.exists():  # what is named and is not there is told before anything is measured
        ended = run("evaluate", "in" if within else "res", first, bad, last, "--json", "--points", 50)
        names(ended, f"target {bad}", *([f"prediction {bad.stem}: "] if within else []))
        assert [row["name"] for row in json.loads(ended.out)["rows"]] == ["a_good", "z_good"]


@pytest.mark.usefixtures("quick")
@pytest.mark.wrong_types  # a pack is a sequence, which the checker looks into
def test_bad_shapes_of_a_pack_between_two_good_ones_are_told_and_the_others_inferred(run: Run, tmp_path: Path):
    sides = {"first": 1.0, "hollow": 1.0, "tiny": 5e-324, "vast": 1.7e308, "unknown": np.nan, "last": 1.0}
    voxels = np.stack([np.packbits(CELLS & (name != "hollow")) for name in sides])
    written(tmp_path / "few.npz", npz(ids=np.array([*sides]), voxels=voxels, longest_side=np.array([*sides.values()])))
    ended = run("infer", "few.npz", "--out", "res", "--no-picture")
    names(ended, "hollow", "tiny", "vast", "unknown")
    assert sorted(path.stem for path in (tmp_path / "res").glob("*.json")) == ["first", "last"]

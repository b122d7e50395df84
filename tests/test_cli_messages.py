"""What the commands say of inputs that are read in one of several ways, of changes, and of files that exist."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from commands import Run, table


def cloud(path: Path) -> np.ndarray:
    """Points on the table, in the axes of the mesh that is written to a file."""
    from shapeprog.data import load as load_shape

    shape = load_shape(table(path), up="+y", front="+z")
    assert shape.points is not None
    return shape.frame.to_world(shape.points)


@pytest.mark.usefixtures("quick")
@pytest.mark.parametrize(
    ("name", "assumed", "other"),
    [("a.npy", "+y", "+z"), ("a.npz", "+y", "+z"), ("a.xyz", "+z", "+y"), ("a.ply", "+y", "+z")],
)
def test_an_assumed_up_axis_is_told_with_another_one(run: Run, tmp_path: Path, name: str, assumed: str, other: str):
    points = cloud(tmp_path / name) if name.endswith("ply") else cloud(tmp_path / "table.obj")
    save = {"a.npy": np.save, "a.npz": lambda path, array: np.savez(path, points=array), "a.xyz": np.savetxt}
    save.get(name, lambda *_: None)(tmp_path / name, points)
    said = run("infer", name, "--no-picture").out
    assert f"does not store the up axis: {assumed} is assumed. Another axis: --up {other}, or --up auto" in said
    assert "does not store" not in run("infer", name, "--no-picture", "--up", "+z").out


@pytest.mark.usefixtures("quick")
def test_voxels_in_arrays_have_no_other_up_axis(run: Run, tmp_path: Path):
    np.save(tmp_path / "a.npy", np.ones((32, 32, 32), bool))
    assert "up axis" not in run("infer", "a.npy", "--no-picture").out

"""Which way is up: fits the weights of ``shapeprog.data.uprightness``, or measures them on shapes turned at random.

    python -m benchmarks.uprightness fit DATA       # weights, from ShapeNet and ModelNet40 train voxels
    python -m benchmarks.uprightness measure DATA   # share right on val: with the usual up as a hint, and without

DATA holds ``shapenet/{bench,cabinet}_train.npz``, ``modelnet40_voxels/*.npz``, ``shapenet_meshes/{bench,cabinet}_val``,
``ikea_parts`` and ``cc0_furniture``.  Each shape is turned by one of the six rotations that bring another axis up.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from scipy.optimize import minimize

from shapeprog.data.packs import read_pack
from shapeprog.data.parts import part_files, read_parts
from shapeprog.data.uprightness import WEIGHTS, find_up, measures
from shapeprog.geometry.mesh import joined
from shapeprog.geometry.voxelise import voxelise_mesh
from shapeprog.space import Array, Frame, axis_name

LARGEST = {"bench": 200, "cabinet": 200}
"""Most training shapes of the two large categories; of every other one 80."""

WEIGHT_DECAY = 1e-3
"""Price of a squared weight per standard deviation of its measure."""


def training(data: Path) -> Iterator[list[Array]]:
    """Measures (6, M) of the shapes of each category; the first direction is up."""
    for name, most in LARGEST.items():
        pack = read_pack(data / "shapenet" / f"{name}_train.npz", whole=False)
        yield [measures(pack[k].voxels) for k in range(min(most, len(pack.ids)))]
    for file in sorted((data / "modelnet40_voxels").glob("*.npz")):
        pack = read_pack(file, whole=False)
        mine = [k for k in range(len(pack.ids)) if pack[k].split == "train"][:80]
        yield [measures(pack[k].voxels) for k in mine]


def fit(data: Path) -> None:
    """Print the weights of a conditional logit in which all categories count alike."""
    groups = list(training(data))
    seen = np.array([row for group in groups for row in group])
    share = np.concatenate([np.full(len(group), 1 / len(group) / len(groups)) for group in groups])
    spread = seen.std((0, 1))
    scaled = seen / spread

    def loss(weights: Array) -> tuple[float, Array]:
        score = scaled @ weights
        score -= score.max(1, keepdims=True)
        likely = np.exp(score) / np.exp(score).sum(1, keepdims=True)
        slope = scaled[:, 0] - np.einsum("nk,nkm->nm", likely, scaled)
        total = -(share * np.log(likely[:, 0])).sum() + WEIGHT_DECAY * weights @ weights
        return float(total), -share @ slope + 2 * WEIGHT_DECAY * weights

    found = minimize(loss, np.zeros(len(spread)), jac=True, method="L-BFGS-B").x / spread
    for name, value in zip(WEIGHTS, found, strict=True):
        print(f'    "{name}": {value:.2f},')
    right = ((seen @ found).argmax(1) == 0).astype(float)
    print(f"right on these {len(seen)} shapes, categories alike: {(share * right).sum():.3f}")


def validation(data: Path) -> Iterator[tuple[str, Array, Array]]:
    """Sets, vertices and faces of meshes that are +y up."""
    for name in ("bench", "cabinet"):
        for file in sorted((data / "shapenet_meshes" / f"{name}_val").glob("*.ply")):
            yield name, *joined(read_parts([file]))
    known = part_files(data / "ikea_parts")
    for name in list(known)[::2]:
        yield "ikea", *joined(read_parts(known[name]))
    for file in sorted((data / "cc0_furniture").glob("*/*.obj")):
        yield "cc0", *joined(read_parts([file]))


def measure(data: Path) -> None:
    """Print the share of shapes whose up is found, and of those that are sure."""
    random = np.random.default_rng(0)
    rows: dict[str, list[tuple[bool, bool, bool, bool]]] = {}
    for name, vertices, faces in validation(data):
        turn = np.roll(np.eye(3), random.integers(3), 0)
        if random.integers(2):
            turn = turn * [1, -1, -1]  # half a turn about x: upside down
        placed = vertices @ turn.T
        cells = voxelise_mesh(Frame.around(placed.min(0), placed.max(0)).to_grid(placed), faces)
        true = axis_name(turn @ np.array([0.0, 1.0, 0.0]))
        alone, hinted = find_up(cells), find_up(cells, usual=true)
        misled = find_up(cells, usual="+y")
        rows.setdefault(name, []).append(
            (alone.up == true, hinted.up == true, misled.up == true, alone.probability > 0.9)
        )
    print("set: shapes; right without a hint; with a true one; where +y is always the hint; right where .9 sure")
    for name, found in rows.items():
        table = np.array(found)
        sure = table[table[:, 3], 0]
        told = f"{sure.mean():.3f} ({len(sure)})" if len(sure) else "-"
        print(f"{name}: {len(table)}; " + "; ".join(f"{share:.3f}" for share in table[:, :3].mean(0)) + f"; {told}")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("task", choices=("fit", "measure"))
    parser.add_argument("data", type=Path, help="the folder described above")
    args = parser.parse_args()
    {"fit": fit, "measure": measure}[args.task](args.data)

"""Speed of the renderer and its losses, each beside the baseline it is measured against in the same run.

    OMP_WAIT_POLICY=PASSIVE python benchmarks/bench_geometry.py [--quick] [--threads 2]

Without that setting torch's idle workers spin on the cores that the kernels want, and figures move by a factor of ten.

Prints one JSON object a line: name, value, unit, which direction is better, what the baseline is, its value, and the
ratio.  Values are the best of several repetitions in wall time; ``cpu`` is the processor time of one, which other
load on the machine moves less.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import numpy as np
import torch
from scipy.spatial import cKDTree

from shapeprog.geometry.cells import iou, rasterise, voxels
from shapeprog.geometry.distance import each_distance, signed_distance
from shapeprog.geometry.losses import chamfer, coverage
from shapeprog.geometry.primitives import KINDS
from shapeprog.geometry.scene import Scene
from shapeprog.geometry.surface import sample_surface
from shapeprog.language import Code, Draw, Loop, Program, encode, unroll

POINTS = 5000


Work = Callable[[], torch.Tensor]


class Time(NamedTuple):
    wall: float
    cpu: float


def clock(work: Callable[[], object], repeat: int = 7, warm: bool = True) -> Time:
    """Best wall time and mean processor time in seconds."""
    if warm:
        work()
    walls, start = [], time.process_time()
    for _ in range(repeat):
        begin = time.perf_counter()
        work()
        walls.append(time.perf_counter() - begin)
    return Time(min(walls), (time.process_time() - start) / repeat)


def slopes(work: Work, leaves: list[torch.Tensor]) -> tuple[torch.Tensor, ...]:
    return torch.autograd.grad(work(), leaves)


def mean_distance(scene: Scene, points: torch.Tensor) -> torch.Tensor:
    return signed_distance(scene, points).mean()


def report(
    name: str, took: Time, scale: float, unit: str, baseline: str = "", other: Time | None = None, share: float = 1.0
) -> None:
    """Print one row; ``share`` is what part of the work the baseline did."""
    row: dict[str, object] = {
        "name": name, "value": round(took.wall * scale, 4), "cpu": round(took.cpu * scale, 4), "unit": unit,
        "better": "lower",
    }  # fmt: skip
    if other is not None:
        row |= {
            "baseline": baseline,
            "baseline_value": round(other.wall * scale / share, 3),
            "ratio": round(other.wall / took.wall / share, 1),
            "ratio_cpu": round(other.cpu / took.cpu / share, 1),
        }
    print(json.dumps(row), flush=True)


# ---------------------------------------------------------------- material


def furniture(rng: np.random.Generator) -> Program:
    """A whole-numbered chair or table of 10 blocks, half of them in loops; 15 to 30 primitives."""

    def whole(low: int, high: int) -> float:
        return float(rng.integers(low, high + 1))

    half = whole(6, 11), whole(6, 11)
    height = whole(-2, 6)
    body: list[Draw | Loop] = [Draw("top_rectangle", (height, 0.0, 0.0, whole(1, 3), *half))]

    def four(inner: Draw) -> Loop:
        across = Loop("translate", (2.0, 0.0, 0.0, 2 * half[1] - 2), (inner,))
        return Loop("translate", (2.0, 0.0, 2 * half[0] - 2, 0.0), (across,))

    corner = (-12.0, -half[0], -half[1])
    body.append(four(Draw("leg", (*corner, height + 12, 2.0, 2.0))))
    bar = Draw("horizontal_bar", (whole(-10, -4), -half[0], -half[1], 1.0, 2 * half[0], 1.0))
    body.append(Loop("translate", (2.0, 0.0, 0.0, 2 * half[1] - 1), (bar,)))
    body.append(Draw("back", (height + 2, half[0] - 2, -half[1], whole(6, 10), 2.0, 2 * half[1], whole(0, 3))))
    beam = Draw("chair_beam", (height + 2, -half[0], -half[1], 6.0, 2.0, 2.0))
    body.append(Loop("translate", (2.0, 0.0, 0.0, 2 * half[1] - 2), (beam,)))
    body.append(Draw("layer", (-9.0, 0.0, 0.0, 1.0, half[0] - 1, half[1] - 1)))
    body.append(Draw("support_cylinder", (-12.0, 0.0, 0.0, height + 12, whole(1, 3))))
    body.append(Loop("rotate", (4.0, 1.0), (Draw("base_cross", (-12.0, 0.0, 0.0, 2.0, whole(4, 9), 0.0)),)))
    slat = Draw("vertical_board", (height + 2, half[0] - 2, -half[1], 8.0, 1.0, 1.0))
    body.append(Loop("translate", (whole(3, 5), 0.0, 0.0, 4.0), (slat,)))
    body.append(Draw("locker", (-8.0, -4.0, -4.0, 4.0, 8.0, 8.0)))
    return Program(tuple(body))


def programs(count: int, seed: int = 0) -> Code:
    rng = np.random.default_rng(seed)
    return encode([furniture(rng) for _ in range(count)])


def turned(name: str, count: int, seed: int = 0, batch: int = 1) -> tuple[Scene, list[torch.Tensor]]:
    """Scenes of turned primitives of one name, and their leaves."""
    g = torch.Generator().manual_seed(seed)
    size = torch.rand(batch, count, 4, generator=g) * 3 + 0.3
    if name == "cuboid":
        size[..., 3] = 0  # upright, as most are
    centre = torch.rand(batch, count, 3, generator=g) * 24 - 12
    rotation = torch.linalg.qr(torch.randn(batch, count, 3, 3, generator=g))[0]
    leaves = [leaf.requires_grad_() for leaf in (size, centre, rotation)]
    none = torch.zeros(batch, count, dtype=torch.long)
    return Scene(none + KINDS[name], size, centre, rotation, none == 0, none, none, none), leaves


# ---------------------------------------------------------------- rows


def bench_voxels(batch: int) -> None:
    code = programs(batch)
    scene = unroll(code)
    slices = clock(lambda: _slices(scene), 3)
    per = 1e6 / batch
    assert (_slices(scene) != voxels(scene).numpy()).mean() < 0.01
    base = "numpy slices, one primitive at a time"
    report(f"hard voxels as uint8, batch {batch}, from the scene", clock(lambda: voxels(scene), 15), per, "us/program",
           base, slices)  # fmt: skip
    report(f"hard voxels as bits, batch {batch}, from the scene", clock(lambda: rasterise(scene), 15), per,
           "us/program", base, slices)  # fmt: skip
    both = clock(lambda: voxels(unroll(code)), 7)
    report(f"hard voxels as uint8, batch {batch}, from the program tensors", both, per, "us/program")
    report(f"unroll, batch {batch}", clock(lambda: unroll(code), 7), per, "us/program")
    rows, cells = rasterise(scene), voxels(scene).numpy().astype(bool)
    other = rows.roll(1, 0), np.roll(cells, 1, 0)
    slow = clock(
        lambda: [np.logical_and(a, b).sum() / np.logical_or(a, b).sum() for a, b in zip(cells, other[1], strict=True)],
        2,
    )
    report("IoU of packed grids", clock(lambda: iou(rows, other[0])), per, "us/pair", "numpy bool", slow)


def _slices(scene: Scene) -> np.ndarray:
    """The plain way: one slice for each box, one disc for each upright cylinder."""
    cells = np.zeros((len(scene), 32, 32, 32), np.uint8)
    ticks = np.arange(32) - 15.5
    kind, size, centre, mask = (t.numpy() for t in (scene.kind, scene.size, scene.centre, scene.mask))
    box, turned = KINDS["cuboid"], np.abs(scene.rotation.numpy())
    for b, n in zip(*np.nonzero(mask), strict=True):
        half = turned[b, n] @ (size[b, n, :3] if kind[b, n] == box else size[b, n, [0, 1, 1]])
        low = np.clip(np.rint(centre[b, n] - half) + 16, 0, 32).astype(int)
        high = np.clip(np.rint(centre[b, n] + half) + 16, 0, 32).astype(int)
        if kind[b, n] != box:
            away = (ticks[:, None] - centre[b, n, 1]) ** 2 + (ticks[None] - centre[b, n, 2]) ** 2
            cells[b, low[0] : high[0], away <= (1.01 * size[b, n, 1]) ** 2] = 1
        elif size[b, n, 3] == 0:
            cells[b, low[0] : high[0], low[1] : high[1], low[2] : high[2]] = 1
        else:
            start, lean = centre[b, n, 1] - size[b, n, 1] - size[b, n, 3] / 2, size[b, n, 3]
            for i in range(low[0], high[0]):
                at = int(np.rint(start + lean * (i - low[0]) / (2 * size[b, n, 0]))) + 16
                end = at + int(2 * size[b, n, 1])
                cells[b, i, max(at, 0) : max(end, 0), low[2] : high[2]] = 1
    return cells


def bench_sampling(batch: int) -> None:
    code = programs(batch)
    values = code.parameters.requires_grad_()

    def work() -> None:
        sample = sample_surface(unroll(Code(code.ids, values)), POINTS, torch.Generator().manual_seed(0))
        torch.autograd.grad(((sample.points**2).sum(-1) * sample.weights).mean(), values)

    mean = float(unroll(code).mask.sum()) / batch
    name = f"unroll + {POINTS} surface points, batch {batch} of 10 blocks ({mean:.0f} primitives), forward + backward"
    report(name, clock(work), 1e3, "ms")


def _clouds(scene: Scene, seed: int) -> torch.Tensor:
    return scene.sample(POINTS, torch.Generator().manual_seed(seed))


def _tree_chamfer(one: torch.Tensor, two: torch.Tensor) -> torch.Tensor:
    found = []
    for queries, points in ((one, two), (two, one)):
        arrays = queries.detach().numpy(), points.detach().numpy()
        index = [cKDTree(b).query(a, workers=2)[1] for a, b in zip(*arrays, strict=True)]
        near = points.gather(1, torch.from_numpy(np.stack(index))[..., None].expand(-1, -1, 3))
        found.append(((queries - near) ** 2).sum(-1).mean(-1))
    return found[0] + found[1]


def _pairs_chamfer(one: torch.Tensor, two: torch.Tensor) -> torch.Tensor:
    distance = torch.cdist(one, two)
    return (distance.min(-1)[0] ** 2).mean(-1) + (distance.min(-2)[0] ** 2).mean(-1)


def bench_chamfer(batch: int) -> None:
    with torch.no_grad():
        scene = unroll(programs(batch))
        one = _clouds(scene, 0)
        near = _clouds(scene, 1) + 0.2 * torch.randn(batch, POINTS, 3, generator=torch.Generator().manual_seed(2))
        unrelated = _clouds(unroll(programs(batch, seed=9)), 3)
        turned = (unrelated + 3).roll(1, -1)
    one.requires_grad_()
    for name, two in (("near", near), ("unrelated", unrelated), ("unrelated and turned", turned)):

        def run(chamfer_of: Callable[..., torch.Tensor], two: torch.Tensor = two, count: int = batch) -> torch.Tensor:
            return torch.autograd.grad(chamfer_of(one[:count], two[:count]).sum(), one)[0]

        difference = float((run(chamfer) - run(_tree_chamfer)).abs().max())
        assert difference < 1e-5, difference
        took, tree = clock(lambda: run(chamfer)), clock(lambda: run(_tree_chamfer), 3)
        title = f"chamfer {batch} x ({POINTS} to {POINTS}), {name}, forward + backward"
        report(title, took, 1e3 / batch, "ms/shape", "scipy cKDTree(workers=2), gather", tree)
        if name == "near":
            pairs = clock(lambda: run(_pairs_chamfer, count=1), 2)
            report(title, took, 1e3 / batch, "ms/shape", "torch.cdist, one shape of the batch", pairs, 1 / batch)


def bench_distance() -> None:
    scene, leaves = turned("cuboid", 64)
    target = torch.rand(1, POINTS, 3, generator=torch.Generator().manual_seed(1)) * 24 - 12
    ticks = torch.arange(32) - 15.5
    centres = torch.cartesian_prod(ticks, ticks, ticks)[None]

    def pairs(points: torch.Tensor) -> torch.Tensor:
        return each_distance(scene, points).min(-1)[0]

    rows: dict[str, tuple[Work, Work]] = {
        f"coverage {POINTS} x 64 turned boxes": (
            lambda: coverage(scene, target).sum(), lambda: pairs(target).clamp(min=0).mean(),
        ),
        "signed distance 32^3 x 64 turned boxes": (
            lambda: signed_distance(scene, centres).mean(), lambda: pairs(centres).mean(),
        ),
    }  # fmt: skip
    for name, (fast, slow) in rows.items():
        for got, expected in zip(slopes(fast, leaves), slopes(slow, leaves), strict=True):
            assert float((got - expected).abs().max()) < 1e-5
        took, eager = clock(partial(slopes, fast, leaves)), clock(partial(slopes, slow, leaves), 3)
        report(f"{name}, forward + backward", took, 1e3, "ms", "eager over all pairs", eager)


def bench_primitives(batch: int) -> None:
    """What each built-in primitive costs beside the cuboid, in scenes of 20 turned ones."""
    target = torch.rand(batch, POINTS, 3, generator=torch.Generator().manual_seed(1)) * 24 - 12
    cuboid: dict[str, Time] = {}
    for name in sorted(KINDS, key=lambda one: one != "cuboid"):
        scene, leaves = turned(name, 20, batch=batch)

        def surface(scene: Scene = scene) -> torch.Tensor:
            sample = sample_surface(scene, POINTS, torch.Generator().manual_seed(0))
            return ((sample.points**2).sum(-1) * sample.weights).mean()

        rows: dict[str, Work] = {
            "distance of 5000 points, forward + backward": partial(mean_distance, scene, target),
            "5000 surface points, forward + backward": surface,
            "cells at 32^3": partial(rasterise, scene),
            "cells at 128^3": partial(rasterise, scene, 128),
        }
        for what, work in rows.items():
            took = clock(partial(slopes, work, leaves) if "backward" in what else work)
            cuboid.setdefault(what, took)
            report(f"{name}, 20 of them: {what}", took, 1e3 / batch, "ms/scene", "as many cuboids", cuboid[what])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="smaller batches")
    parser.add_argument("--threads", type=int, default=2)
    options = parser.parse_args()
    torch.set_num_threads(options.threads)
    bench_voxels(64 if options.quick else 256)
    bench_sampling(8 if options.quick else 32)
    bench_chamfer(4 if options.quick else 32)
    bench_distance()
    bench_primitives(2 if options.quick else 16)


if __name__ == "__main__":
    main()

"""Speed of the generators: pretraining and decoding, as ratios to the published form in the same run.

    OMP_WAIT_POLICY=PASSIVE python benchmarks/bench_training.py

``published`` is the network as its authors ran it: every block encoded for every shape, statistics of the batch,
float32.  Weights are random, so decoding is timed with all ten blocks and nothing ends early; ``by drawing`` is timed
on the weights that ship, where there are any.
"""

from __future__ import annotations

import time
from collections.abc import Callable

import torch
from torch import Tensor

from shapeprog.data.synthetic import Stream, prior
from shapeprog.models.checkpoint import SHIPPED, load_generator
from shapeprog.models.decoding import decode
from shapeprog.models.designs import build_generator
from shapeprog.models.generator import Generator
from shapeprog.training.engine import tune_allocator
from shapeprog.training.lessons import Lesson, lesson

BATCH = 32
REPEATS = 3


def seconds(work: Callable[[], object]) -> float:
    """The fastest of several runs, after one that warms up."""
    work()
    times = []
    for _ in range(REPEATS):
        started = time.perf_counter()
        work()
        times.append(time.perf_counter() - started)
    return min(times)


def trained(generator: Generator, taught: Lesson, half: bool) -> float:
    """Seconds of a step of pretraining."""
    generator.train().to(memory_format=torch.channels_last_3d)
    optimiser = torch.optim.Adam(generator.parameters(), 1e-4)
    live = None if generator.by_batch else taught.live

    def step() -> None:
        with torch.autocast("cpu", torch.bfloat16, enabled=half):
            told = generator.predict(taught.target, taught.canvases, taught.code, live)
            loss = sum(generator.losses(told, taught.code).values(), torch.zeros(()))
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()

    return seconds(step)


def alone(generator: Generator, target: Tensor, choose: str = "argmax") -> float:
    """Milliseconds of writing one program as ``shapeprog infer`` does: in float32, on one thread."""
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        return 1000 * decoded(generator, target[:1], False, choose)
    finally:
        torch.set_num_threads(threads)


def decoded(generator: Generator, target: Tensor, half: bool, choose: str = "argmax") -> float:
    """Seconds of writing programs of ten blocks."""
    generator.eval()

    def work() -> object:
        with torch.autocast("cpu", torch.bfloat16, enabled=half):
            return decode(generator, target, blocks=10, choose=choose)  # type: ignore[arg-type]

    return seconds(work)


def endless(generator: Generator) -> Generator:
    """The generator with the chance of stopping taken away, so that all ten blocks are written."""
    with torch.no_grad():
        last = generator.inner_net.logit2 if hasattr(generator, "inner_net") else generator.name[2]  # type: ignore[index]
        last.bias[0] -= 20  # type: ignore[index, operator, union-attr]
    return generator


def main() -> None:
    """Print one line for every figure: name, value, unit, ratio to the published form."""
    tune_allocator()
    torch.manual_seed(0)
    stream = Stream(prior("narrow"), BATCH, seed=0)
    made = stream[0]
    taught = lesson(made.voxels, made.code, "written")
    published = {"statistics": "batch", "legal": False, "padding": 0.1, "unused": 0.1}
    designs = {
        "published": (build_generator("tian2019", published), False),
        "tian2019": (build_generator("tian2019"), True),
        "swift": (build_generator("swift"), True),
        "chained": (build_generator("chained"), True),
    }
    print(f"{torch.get_num_threads()} threads, batch {BATCH}, 10 blocks, narrow prior")
    base = 0.0
    for name, (generator, half) in designs.items():
        rate = BATCH / trained(generator, taught, half)
        base = base or rate
        print(f"pretraining, {name:12} {rate:8.1f} shapes/s  {rate / base:6.1f} x")
    base = 0.0
    for name, (generator, half) in designs.items():
        rate = BATCH / decoded(endless(generator), made.voxels, half)
        base = base or rate
        one = alone(generator, made.voxels)
        print(f"decoding,    {name:12} {rate:8.1f} shapes/s  {rate / base:6.1f} x   one shape {one:6.1f} ms")
    if (SHIPPED / "default.safetensors").exists():
        generator, _ = load_generator("default")
        shapes = Stream(prior("wide"), BATCH, seed=0)[0].voxels
        rate = BATCH / decoded(generator, shapes, True, "drawn")
        one = alone(generator, shapes, "drawn")
        print(f"by drawing,  default      {rate:8.1f} shapes/s  {rate / base:6.1f} x   one shape {one:6.1f} ms")
    for name in ("narrow", "wide"):
        # A stream keeps the group that it drew last, so each batch here is of another one.
        many, places = Stream(prior(name), 2048, seed=1), iter(range(1 << 30))
        each = seconds(lambda many=many, places=places: many[next(places)])
        print(f"synthetic shapes with voxels, {name:8} {2048 / each:8.0f} shapes/s")


if __name__ == "__main__":
    main()

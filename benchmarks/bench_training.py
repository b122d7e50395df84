"""Speed of the generators: a step of pretraining and a single pass, as ratios to the published form in the same run.

    OMP_WAIT_POLICY=PASSIVE python benchmarks/bench_training.py [--device cuda]

``published`` is the network as its authors ran it: every block encoded for every shape, statistics of the batch; the
others learn from live blocks.  All in float32.  Weights are random, and no program ends before ten blocks.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from dataclasses import replace

import torch

from shapeprog.liang2022.decode import decode
from shapeprog.liang2022.fast import Fast, FastSettings
from shapeprog.liang2022.generator import Generator, TeacherForcingBatch
from shapeprog.liang2022.loop import tune_allocator
from shapeprog.liang2022.pretrain import teacher_forcing
from shapeprog.liang2022.prior import PRIORS
from shapeprog.liang2022.tian2019 import PUBLISHED, Tian2019, Tian2019Settings

BATCH, BLOCKS, REPEATS = 32, 10, 3


def seconds(work: Callable[[], object]) -> float:
    """The fastest of several runs, after one that warms up."""
    times = []
    for _ in range(1 + REPEATS):
        start = time.perf_counter()
        work()
        if torch.cuda.is_available():
            torch.cuda.synchronize()
        times.append(time.perf_counter() - start)
    return min(times[1:])


def pretraining(generator: Generator, batch: TeacherForcingBatch) -> float:
    """Seconds of a step of pretraining."""
    generator.train().to(memory_format=torch.channels_last_3d)  # type: ignore[call-overload]
    optimiser = torch.optim.Adam(generator.parameters(), 1e-4)

    def step() -> None:
        loss = sum(generator.losses(generator.predict(batch)).values(), torch.zeros((), device=batch.target.device))
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()

    return seconds(step)


def single_pass(generator: Generator, batch: TeacherForcingBatch) -> float:
    """Seconds of decoding programs of ten blocks by arg-max."""
    generator.eval()
    last = generator.inner_net.logit2 if isinstance(generator, Tian2019) else generator.id_head[2]  # type: ignore[index]
    assert isinstance(last, torch.nn.Linear)
    with torch.no_grad():
        last.bias[0] -= 20

    def work() -> None:
        decode(generator, batch.target, blocks=BLOCKS, decoder="argmax")

    return seconds(work)


def main() -> None:
    """Print a line for each figure: name, shapes per second, ratio to the published form."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--device", default="cpu")
    device = torch.device(parser.parse_args().device)
    tune_allocator()
    torch.manual_seed(0)
    made = PRIORS["narrow"].batch(BATCH, 0, 0)
    live = teacher_forcing(made.voxels, made.code[:, : BLOCKS - 1], "written").to(device)  # and the end
    everything = replace(live, live=torch.ones_like(live.live))
    designs: dict[str, tuple[Generator, TeacherForcingBatch]] = {
        "published": (Tian2019(PUBLISHED).to(device), everything),
        "tian2019": (Tian2019(Tian2019Settings()).to(device), live),
        "fast": (Fast(FastSettings()).to(device), live),
    }
    print(f"{device}, {torch.get_num_threads()} threads, batch {BATCH}, {BLOCKS} blocks, prior narrow")
    for what, work in (("pretraining", pretraining), ("single pass", single_pass)):
        base = 0.0
        for name, setup in designs.items():
            rate = BATCH / work(*setup)
            base = base or rate
            print(f"{what}, {name:9} {rate:8.1f} shapes/s  {rate / base:6.1f} x", flush=True)
    one = teacher_forcing(made.voxels[:1], made.code[:1]).to(device)
    print(f"single pass, fast, one shape {1000 * single_pass(designs['fast'][0], one):8.1f} ms")


if __name__ == "__main__":
    main()

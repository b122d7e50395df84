"""On a GPU: the renderer takes tensors there, and the paper's networks decode and train.  Geometry runs on the CPU."""

from __future__ import annotations

import threading
from pathlib import Path
from typing import Any

import pytest
import torch
from liang2022_toys import same, small, targets, write_targets

import shapeprog as sp
from shapeprog.geometry.losses import excess
from shapeprog.language import Code, unroll
from shapeprog.language.unroll import draw_blocks
from shapeprog.liang2022.adapt import AdaptTask
from shapeprog.liang2022.decode import decode
from shapeprog.liang2022.executor import ExecutorTask
from shapeprog.liang2022.generator import preceding
from shapeprog.liang2022.loop import WEIGHTS, Task, train
from shapeprog.liang2022.pretrain import PretrainTask
from shapeprog.liang2022.prior import PRIORS
from shapeprog.liang2022.settings import AdaptSettings, ExecutorSettings, PretrainSettings, TrainingSettings
from shapeprog.liang2022.weights import load_generator, save_weights

pytestmark = [pytest.mark.paper, pytest.mark.skipif(not torch.cuda.is_available(), reason="needs a GPU")]


def rendered(device: str) -> list[torch.Tensor]:
    """Values and gradients of the renderer's losses for programs on a device."""
    code = PRIORS["narrow"].batch(8, 3, 0).code
    ids, numbers = code.ids.to(device), code.parameters.to(device).requires_grad_()
    points = torch.rand(8, 300, 3, generator=torch.Generator().manual_seed(1)).to(device) * 24 - 12
    scene = unroll(Code(ids, numbers))
    sample = sp.sample(scene, 500, torch.Generator().manual_seed(2))
    losses = {
        "chamfer": sp.chamfer(sample.points, points, weights=sample.weights),
        "coverage": sp.coverage(scene, points),
        "excess": excess(sample.points, points, weights=sample.weights),
        "distance": scene.distance(points).mean(-1),
    }
    gradients = [torch.autograd.grad(value.sum(), numbers, retain_graph=True)[0] for value in losses.values()]
    assert all(value.device.type == device for value in (*losses.values(), *gradients))
    return [value.detach().cpu() for value in (*losses.values(), *gradients, scene.voxels(), sample.normals)]


def test_the_renderer_agrees_with_the_cpu():
    for one, two in zip(rendered("cpu"), rendered("cuda"), strict=True):
        torch.testing.assert_close(two, one, atol=1e-4, rtol=1e-4)


@pytest.mark.parametrize("design", ["fast", "tian2019"])
@pytest.mark.parametrize("decoder", ["argmax", "novel", "select", "sample", "sample-ids"])
def test_programs_are_decoded_on_their_own_canvases(design: str, decoder: str):
    generator, cells = small(design).cuda(), targets().cuda()
    decoded = decode(generator, cells, blocks=4, decoder=decoder, rng=torch.Generator("cuda").manual_seed(0))  # type: ignore[arg-type]
    code = Code(decoded.code.ids.cpu(), decoded.code.parameters.cpu())
    assert torch.equal(decoded.canvases.cpu(), preceding(draw_blocks(code)))
    assert decoded.iou().device.type == "cuda"
    assert len(decoded.programs()) == len(cells)
    assert generator.predict(decoded).numbers.isfinite().all()


def steps(task: Task, settings: TrainingSettings, folder: Path) -> list[dict[str, float]]:
    return list(train(task, settings, folder, device="cuda"))


def test_a_run_resumes_on_the_gpu_and_its_weights_load_on_the_cpu(tmp_path: Path):
    settings = PretrainSettings(num_shapes=32, batch_size=4, design="tian2019", order="written", canvases_per_shape=0)
    stop = threading.Event()
    stop.set()
    first = train(PretrainTask(settings), settings, tmp_path, device="cuda", stop=stop)
    assert [record["step"] for record in first] == [1]
    task = PretrainTask(settings)
    assert [record["step"] for record in steps(task, settings, tmp_path)] == [*range(2, 9)]
    loaded = load_generator(str(tmp_path / WEIGHTS))
    assert same({name: value.cpu() for name, value in task.network.state_dict().items()}, loaded.state_dict())


@pytest.mark.parametrize("design", ["fast", "tian2019"])
@pytest.mark.parametrize(
    "options",
    [
        {"decoder": "argmax", "decoded_ids": 0.0, "kl": 1.0}, {"loss": "chamfer=1,soft_iou=3,coverage=1"},
        {"method": "guided"}, {"method": "hybrid"},
        {"estimator": "nvil", "decoded_ids": 0.0}, {"estimator": "rloo", "decoded_ids": 0.0},
    ],
)  # fmt: skip
def test_every_adaptation_trains(design: str, options: dict[str, Any], tmp_path: Path):
    start = str(tmp_path / "start.safetensors")
    save_weights(start, small(design))
    pack = str(write_targets(tmp_path / "few.npz"))
    settings = AdaptSettings(
        initial=start, train=(pack,), val=(pack,), batch_size=2, num_shapes=6, rehearsal=2, points=200, warm_up=0,
        **options,
    )  # fmt: skip
    records = steps(AdaptTask(settings), settings, tmp_path / "run")
    assert records[-1]["gradient_norm"] > 0
    assert records[-1]["val_few_cd"] > 0
    before, after = (load_generator(path).state_dict() for path in (start, str(tmp_path / "run" / WEIGHTS)))
    assert not same(before, after)


def test_the_executor_trains(tmp_path: Path):
    settings = ExecutorSettings(num_shapes=32, batch_size=16, warm_up=0)
    assert steps(ExecutorTask(settings), settings, tmp_path)[-1]["gradient_norm"] > 0

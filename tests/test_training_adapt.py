"""Adaptation: gradients go where they should, toys get better, runs go on exactly."""

from __future__ import annotations

import threading
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from torch import Tensor

from shapeprog.cli import main
from shapeprog.data.packs import read_pack, write_pack
from shapeprog.data.shape import Shape
from shapeprog.errors import ShapeProgError
from shapeprog.evaluation.generated import evaluate_generator, generated
from shapeprog.geometry.surface import sample_surface
from shapeprog.language.text import parse
from shapeprog.language.unroll import unroll
from shapeprog.models.checkpoint import card_of, load_generator, save_checkpoint
from shapeprog.models.designs import build_generator
from shapeprog.models.executor import NeuralExecutor
from shapeprog.models.generator import Generator
from shapeprog.models.vocabulary import Vocabulary
from shapeprog.training.adapt import Adaptation
from shapeprog.training.adapt_settings import METHODS, AdaptSettings
from shapeprog.training.engine import Engine
from shapeprog.training.folder import BEST, STATE, WEIGHTS, read_log
from shapeprog.training.loop import run

TINY = {"widths": (4, 4, 8), "squeeze": 4, "feature": 32}
TEXTS = (
    "leg(at=(-12, -4, -6), size=(24, 8, 12))\n",
    "leg(at=(-6, -10, -12), size=(9, 20, 24))\n",
    "leg(at=(-12, -12, -5), size=(20, 24, 10))\n",
    "leg(at=(-4, -5, -12), size=(8, 10, 24))\n",
)
LEG = 1


@pytest.fixture(scope="module")
def engine() -> Engine:
    return Engine("cpu", threads=1)


@pytest.fixture(scope="module")
def boxes(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A pack of four boxes, one of the first alone, and a folder of the programs that draw them beside it."""
    folder = tmp_path_factory.mktemp("boxes")
    shapes = []
    (folder / "labels").mkdir()
    for number, text in enumerate(TEXTS):
        scene = unroll(parse(text))
        points = sample_surface(scene, 500, torch.Generator().manual_seed(number)).points
        shapes.append(Shape(f"box{number}", scene.voxels().numpy().astype(np.bool_), points.numpy()))
        (folder / "labels" / f"box{number}.shape").write_text(text)
    write_pack(folder / "box.npz", shapes[:1])
    write_pack(folder / "boxes.npz", shapes)
    return folder / "boxes.npz"


def biased(number: int, chance: float = 8.0) -> Generator:
    """A generator that is almost sure to write one id, with numbers around those of a box in the middle."""
    torch.manual_seed(0)
    generator: Any = build_generator("swift", TINY)
    guess = torch.tensor([-8.0, -8, -8, 16, 16, 16, 0])
    with torch.no_grad():
        generator.name[2].bias[number] += chance
        generator.bins[3].bias -= ((generator.ticks - guess[:, None]) ** 2 / 20).flatten()
    return generator  # type: ignore[no-any-return]


def settings_for(boxes: Path, **more: Any) -> AdaptSettings:
    plain = {
        "packs": (str(boxes),),
        "batch": 4,
        "precision": "float32",
        "points": 200,
        "blocks": 1,
        "visits": 8,
        "choose": "argmax",
    }
    return AdaptSettings(**{**plain, "loss": "chamfer", **more})


def id_gradient(generator: Generator) -> Tensor:
    gradient = generator.name[2].weight.grad  # type: ignore[index, union-attr]
    return torch.zeros(1) if gradient is None else gradient


def terms_of(objective: Adaptation, engine: Engine) -> dict[str, Tensor]:
    return objective.loss(objective.batch(0), 0.0, engine.random(0, 0))


@pytest.mark.parametrize("loss", ["chamfer", "coverage=1,excess=1,volume=1e-4", "soft_iou"])
def test_direct_adaptation_brings_a_box_closer(loss: str, boxes: Path, engine: Engine, tmp_path: Path):
    """From numbers that are up to eight cells off."""
    box = boxes.with_name("box.npz")
    settings = settings_for(box, loss=loss, visits=4 * 30, rate=1.5e-2)
    objective = Adaptation(biased(LEG), settings, val=[box])
    before = objective.validate()
    records = list(run(objective, settings, tmp_path, engine))
    assert records[-1]["loss"] < 0.8 * records[0]["loss"]
    assert records[-1]["val_box_cd"] < 0.6 * before["box_cd"]
    assert float(id_gradient(objective.module.generator).abs().max()) == 0, "direct adaptation leaves ids alone"


def test_offsets_alone_bring_a_surface_closer_and_leave_what_is_drawn(boxes: Path, engine: Engine, tmp_path: Path):
    torch.manual_seed(3)
    generator = build_generator("chained", TINY)
    settings = settings_for(boxes, blocks=3, visits=4 * 40, rate=1e-2, learn="offsets")
    objective = Adaptation(generator, settings, val=[boxes])
    before, scores = generated(generator.eval(), read_pack(boxes)), objective.validate()
    assert any(each.program.blocks for each in before)
    *_, last = run(objective, settings, tmp_path, engine)
    after = generated(generator.eval(), read_pack(boxes))
    assert [each.whole for each in after] == [each.whole for each in before]
    assert last["val_boxes_iou"] == scores["boxes_iou"]
    assert last["val_boxes_cd"] < scores["boxes_cd"]


def test_offsets_of_programs_that_draw_nothing_have_no_gradient(boxes: Path, engine: Engine):
    generator: Any = build_generator("chained", TINY)
    with torch.no_grad():
        generator.name[2].bias[0] += 50
    objective = Adaptation(generator, settings_for(boxes, learn="offsets"))
    terms_of(objective, engine)["chamfer"].backward()
    assert all(weight.grad is not None and not bool(weight.grad.any()) for weight in generator.offset_weights())


def test_a_design_without_offsets_says_so(boxes: Path):
    with pytest.raises(ShapeProgError, match="the design swift says no offsets"):
        Adaptation(biased(LEG), settings_for(boxes, learn="offsets"))


def test_the_gradient_of_guided_adaptation_reaches_ids_and_not_the_executor(boxes: Path, engine: Engine):
    settings = settings_for(boxes, loss="neural=1", executor="given")
    torch.manual_seed(0)
    executor = NeuralExecutor(Vocabulary.current(), width=16)
    objective = Adaptation(biased(LEG, 4.0), settings, executor)
    terms = terms_of(objective, engine)
    assert set(terms) == {"neural"}
    terms["neural"].backward()
    assert float(id_gradient(objective.module.generator).abs().max()) > 0
    assert all(weight.grad is None for weight in executor.parameters())
    assert not executor.training


@pytest.mark.parametrize("ids", ["nvil", "rloo", "expected"])
@pytest.mark.parametrize("cost", ["loss", "iou"])
def test_a_generator_that_draws_nothing_learns_to_draw(
    ids: str, cost: str, boxes: Path, engine: Engine, tmp_path: Path
):
    settings = settings_for(boxes, ids=ids, cost=cost, ids_weight=10.0, tries=4, visits=4 * 20, rate=1e-2)
    objective = Adaptation(biased(0, 1.0), settings, val=[boxes])
    nothing = torch.zeros(4, 32, 32, 32)

    def chance_of_stopping() -> float:
        generator = objective.module.generator.eval()
        with torch.no_grad():
            feature, _ = generator.perceive(objective.batch(0).targets.cells.float(), nothing, None)  # type: ignore[union-attr]
            return float(generator.step(feature, None, 0, None).logits[:, 0].exp().mean())

    before = chance_of_stopping()
    records = list(run(objective, settings, tmp_path, engine))
    assert "choice" in records[0]
    assert chance_of_stopping() < 0.8 * before


def test_programs_that_draw_nothing_have_a_finite_loss_and_measure(boxes: Path, engine: Engine):
    objective = Adaptation(biased(0, 50.0), settings_for(boxes, loss="chamfer=1,occupancy=1,parts=0.1"), val=[boxes])
    terms = terms_of(objective, engine)
    targets = objective.batch(0).targets
    assert targets is not None
    squared = (targets.points**2).sum(-1)
    torch.testing.assert_close(terms["chamfer"], (squared.mean(-1) + squared.amin(-1)).mean())
    assert all(bool(term.isfinite()) for term in terms.values())
    terms["chamfer"].backward()
    gradients = [weight.grad for weight in objective.module.parameters() if weight.grad is not None]
    assert all(bool((gradient == 0).all()) for gradient in gradients)
    scores = objective.validate()
    assert scores["boxes_iou"] < 1
    assert 0.01 < scores["boxes_cd"] < 1


def test_every_method_goes_on_exactly(boxes: Path, engine: Engine, tmp_path: Path):
    """With everything that is drawn at random, learned or remembered: targets, programs, baseline, lessons."""
    settings = settings_for(
        boxes, ids="nvil", visits=4 * 6, blocks=10, labels=(str(boxes.parent / "labels"),), taught=4, sampled=0.5,
        synthetic=0.0, mirror=0.5, rows=2,
    )  # fmt: skip

    def objective() -> Adaptation:
        torch.manual_seed(0)
        return Adaptation(biased(LEG, 2.0), settings, val=[boxes])

    whole = list(run(objective(), settings, tmp_path / "whole", engine))
    stop = threading.Event()
    for record in run(objective(), settings, tmp_path / "parts", engine, stop=stop):
        if record["step"] == 2:
            stop.set()
    rest = list(run(objective(), settings, tmp_path / "parts", engine))
    assert [record["step"] for record in rest] == [4, 5, 6]
    assert {"chamfer", "choice", "baseline", "label_ids", "label_parameters"} <= set(whole[0])
    assert (tmp_path / "whole" / STATE).read_bytes() == (tmp_path / "parts" / STATE).read_bytes()
    assert rest[-1]["loss"] == whole[-1]["loss"]


def test_labels_are_learned_by_heart(boxes: Path, engine: Engine, tmp_path: Path):
    settings = settings_for(
        boxes, loss="", labels=(str(boxes.parent / "labels"),), blocks=2, taught=8, synthetic=0.0, perturbed=0.25,
        visits=4 * 40, rate=5e-3, sampled=0.0,
    )  # fmt: skip
    torch.manual_seed(0)
    objective = Adaptation(
        build_generator("swift", {**TINY, "widths": (8, 8, 16), "feature": 64}), settings, val=[boxes]
    )
    records = list(run(objective, settings, tmp_path, engine))
    assert records[-1]["label_ids"] < 0.2
    assert records[-1]["loss"] < 0.5 * records[0]["loss"]
    assert records[-1]["val_score"] == records[-1]["val_boxes_iou"]


def test_what_does_not_fit_together_is_refused(boxes: Path):
    for wrong, words in (
        ({"loss": ""}, "nothing to learn from"),
        ({"loss": "neural"}, "needs a neural executor"),
        ({"loss": "", "labels": ("x",), "ids": "nvil"}, "ids are judged by a loss"),
        ({"mirror": 2.0}, "a share between 0 and 1"),
        ({"tries": 1}, "give 2 or more"),
        ({"loss": "chamfre"}, "did you mean 'chamfer'"),
    ):
        with pytest.raises(ShapeProgError, match=words):
            settings_for(boxes, **wrong)
    assert METHODS["guided"]["rate"] == 2e-5


def test_the_command_adapts_and_chooses_on_val(boxes: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    generator = biased(LEG)
    save_checkpoint(tmp_path / "start.safetensors", generator, card_of(generator, data="nothing"))
    words = ["adapt", tmp_path / "run", "--from", tmp_path / "start.safetensors", "--pack", boxes, "--val", boxes]
    words += [
        "--device",
        "cpu",
        "--batch",
        4,
        "--points",
        100,
        "--learn",
        "all",
        "--blocks",
        1,
        "--visits",
        12,
        "--rate",
        0.01,
    ]
    with pytest.raises(SystemExit) as end:
        main([str(word) for word in [*words, "--validate-every", 4, "--precision", "float32"]])
    assert not end.value.code
    assert "weights.safetensors" in capsys.readouterr().out
    scores = [record["val_boxes_cd"] for record in read_log(tmp_path / "run")]
    best, card = load_generator(tmp_path / "run" / BEST)
    assert card.scores["boxes_cd"] == min(scores)
    assert card.data == "nothing, adapted to boxes"
    assert card.command.startswith("shapeprog")
    assert best.design == "swift"
    assert (tmp_path / "run" / WEIGHTS).exists()
    for wrong, told in ((["--method", "indirect"], "guided, direct"), (["--loss", "chamfr"], "did you mean 'chamfer'")):
        with pytest.raises(SystemExit) as end:
            main([str(word) for word in [*words, *wrong]])
        assert end.value.code == 2
        assert told in capsys.readouterr().err


def test_evaluation_can_snap_to_the_grid():
    generator = biased(LEG).eval()
    shape = Shape("box", unroll(parse(TEXTS[0])).voxels().numpy().astype(np.bool_))
    as_it_is, snapped = (
        evaluate_generator(generator, [shape], 1, snapping=chosen, choose="argmax")[0] for chosen in (False, True)
    )
    assert snapped.iou > as_it_is.iou
    assert snapped.blocks == as_it_is.blocks == 1


@pytest.mark.parametrize("more", [{"ids": "nvil"}, {"labels": ("some",)}])
def test_ids_and_labels_need_all_weights(more: dict[str, Any], boxes: Path):
    with pytest.raises(ShapeProgError, match="where offsets alone learn"):
        settings_for(boxes, learn="offsets", **more)

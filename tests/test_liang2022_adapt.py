"""Pretraining, the executor's training and adaptation: what learns, that it learns, and what is refused."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import torch
from commands import PROGRAM
from liang2022_toys import run, same, small, targets, write_targets
from torch import nn

from shapeprog.data.packs import write_pack
from shapeprog.errors import ShapeProgError
from shapeprog.language import encode
from shapeprog.liang2022 import adapt, executor, pretrain
from shapeprog.liang2022.adapt import AdaptTask, TargetStream
from shapeprog.liang2022.decode import Decoded
from shapeprog.liang2022.executor import EMPTY_LOGIT, NeuralExecutor
from shapeprog.liang2022.fast import Fast
from shapeprog.liang2022.generator import vocabulary
from shapeprog.liang2022.loop import BEST, WEIGHTS
from shapeprog.liang2022.pretrain import teacher_forcing
from shapeprog.liang2022.settings import AdaptSettings, ExecutorSettings, PretrainSettings
from shapeprog.liang2022.weights import load_executor, load_generator, read_card, save_weights

pytestmark = pytest.mark.paper

ID_HEADS = {
    "fast": {f"id_head.{n}.{kind}" for n in (0, 2) for kind in ("weight", "bias")},
    "tian2019": {f"inner_net.logit{n}.{kind}" for n in (1, 2) for kind in ("weight", "bias")},
}
"""The weights that direct adaptation gives no gradient: an id is an arg-max, and numbers read ids without gradient."""


@pytest.fixture(scope="module")
def room(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with weights of each network, and a pack."""
    folder = tmp_path_factory.mktemp("paper")
    for design in ID_HEADS:
        save_weights(folder / f"{design}.safetensors", small(design))
    write_targets(folder / "few.npz", 2)
    return folder


def test_lstms_stay_in_training_mode_for_the_backward_pass_of_cudnn():
    generator, executor = small("tian2019"), NeuralExecutor().eval()
    assert generator.core.training
    assert executor.lstm.training
    assert not any(part.training for part in (generator, generator.shape_feat.BN1, executor.decoder))


def task(room: Path, method: str = "direct", **options: Any) -> AdaptTask:
    values = {
        "initial": str(room / "fast.safetensors"), "decoder": "argmax",
        "train": (str(room / "few.npz"),), "batch_size": 2, "rehearsal": 0, "points": 200, "learning_rate": 3e-3,
        "num_shapes": 16, "warm_up": 0, "decoded_ids": 0.0,
    }  # fmt: skip
    return AdaptTask(AdaptSettings(**{**values, "method": method, **options}))  # type: ignore[arg-type]


def table() -> Decoded:
    """As if the generator had decoded a table with loops, the same for two targets."""
    batch = teacher_forcing(targets(2), encode([PROGRAM] * 2), "written")
    return Decoded(**vars(batch), offsets=torch.zeros(batch.code.parameters.shape))


def write_parts_of_some_size(module: nn.Module) -> None:
    """Let numbers be around those of the table, so that what is predicted has a surface."""
    with torch.no_grad():
        if isinstance(module, Fast):
            module.number_head[-1].bias[2 - module.settings.low : 5 - module.settings.low] += 5  # type: ignore[index, operator, union-attr]
            return
        rows = module.inner_net.regress2.bias.view(22, 7)  # type: ignore[operator, union-attr]
        code = encode([PROGRAM])
        for ids, numbers in zip(code.ids.flatten(), code.parameters.flatten(0, 2), strict=True):
            rows[ids] = numbers


def gradients(adaptation: AdaptTask, monkeypatch: pytest.MonkeyPatch) -> dict[str, float]:
    """Norm of the gradient of each weight in a step on the table."""
    generator = adaptation.network
    write_parts_of_some_size(generator)
    monkeypatch.setattr(adapt, "decode", lambda *_, **__: table())
    losses = adaptation.losses(adaptation.batch(0), 0.5, torch.Generator().manual_seed(0))
    torch.stack([value for name, value in losses.items() if name[0] != "_"]).sum().backward()
    learning = {name: weight for name, weight in generator.named_parameters() if weight.requires_grad}
    return {name: 0.0 if weight.grad is None else float(weight.grad.norm()) for name, weight in learning.items()}


@pytest.mark.parametrize("method", ["direct", "guided"])
@pytest.mark.parametrize("design", ID_HEADS)
def test_gradients_through_renderer_and_executor_reach_every_layer_but_the_heads_of_ids(
    design: str, method: str, room: Path, monkeypatch: pytest.MonkeyPatch
):
    norms = gradients(task(room, method, initial=str(room / f"{design}.safetensors")), monkeypatch)
    assert {name for name, norm in norms.items() if norm == 0} == ID_HEADS[design]
    assert len(norms) > 25


@pytest.mark.parametrize("estimator", ["nvil", "rloo"])
def test_estimators_give_ids_a_gradient(estimator: str, room: Path):
    adaptation = task(room, estimator=estimator)
    losses = adaptation.losses(adaptation.batch(0), 0.5, torch.Generator().manual_seed(0))
    losses["estimator"].backward()
    assert all(float(weight.grad.norm()) > 0 for weight in adaptation.network.id_head.parameters())
    assert ("baseline" in losses) == (estimator == "nvil")
    assert 0 <= losses["_cost"] <= 1


def test_offsets_alone_learn_where_they_alone_are_asked_for(room: Path, monkeypatch: pytest.MonkeyPatch):
    norms = gradients(task(room, learn="offsets"), monkeypatch)
    assert {name.split(".")[0] for name in norms} == {"offset_head"}
    assert all(norms.values())


@pytest.mark.parametrize(
    ("method", "options"),
    [
        ("direct", {}),
        ("direct", {"decoder": "novel", "rehearsal": 2, "kl": 0.1, "decoded_ids": 0.1}),
        ("guided", {"learning_rate": 0.01, "num_shapes": 32}),
        ("hybrid", {"loss": "chamfer=1,neural=1"}),
        ("direct", {"learn": "offsets"}),
    ],
)
def test_a_few_steps_lower_the_loss(method: str, options: dict[str, Any], room: Path, tmp_path: Path):
    adaptation = task(room, method, **options)
    _, records = run(tmp_path, task=adaptation, settings=adaptation._settings)
    first, *_, last = (each["loss"] for each in records)
    assert last < first
    names = {"direct": {"chamfer"}, "guided": {"neural"}, "hybrid": {"chamfer", "neural"}}[method]
    assert names | {"kl", "decoded_ids"} & options.keys() <= records[0].keys()
    assert ("rehearsal_ids" in records[0]) == ("rehearsal" in options)
    assert load_generator(tmp_path / WEIGHTS).design == "fast"


def test_adaptation_validates_keeps_the_best_and_resumes_exactly(room: Path, tmp_path: Path):
    options = {"val": (str(room / "few.npz"),), "validate_every": 8, "estimator": "nvil", "num_shapes": 12}
    parts = {}
    for name, stop_at in (("one", 0), ("two", 2), ("two", 0)):
        adaptation = task(room, **options)
        _, records = run(tmp_path / name, task=adaptation, settings=adaptation._settings, stop_at=stop_at)
        parts[name] = dict(adaptation.module.state_dict())
    assert same(parts["one"], parts["two"])
    assert records[-1]["val_score"] == -records[-1]["val_few_cd"]
    assert (tmp_path / "two" / BEST).is_file()


def test_pretraining_learns_and_describes_its_weights(room: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(pretrain, "VALIDATION_BATCHES", 1)
    options = {"initial": str(room / "fast.safetensors"), "batch_size": 8, "warm_up": 0}
    settings = PretrainSettings(**options, num_shapes=160, learning_rate=0.01)  # type: ignore[arg-type]
    _, records = run(tmp_path, task=pretrain.PretrainTask(settings), settings=settings, command="the command")
    for name in ("ids", "numbers"):
        assert sum(each[name] for each in records[-4:]) < sum(each[name] for each in records[:4])
    assert {"val_ids", "val_numbers", "val_iou", "val_score"} <= records[-1].keys()
    card = read_card(tmp_path / WEIGHTS)
    assert (card.command, card.samples_seen, card.data) == ("the command", 160, "synthetic, prior narrow, from fast")
    assert card.scores["iou"] == pytest.approx(records[-1]["val_iou"])
    with pytest.raises(ShapeProgError, match=r"holds the design fast\n.*--design fast"):
        pretrain.PretrainTask(PretrainSettings(initial=str(room / "fast.safetensors"), design="tian2019"))


def test_the_executor_learns_single_blocks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(executor, "VALIDATION_BLOCKS", 16)
    settings = ExecutorSettings(num_shapes=48, batch_size=8, warm_up=0, learning_rate=3e-3)
    training = executor.ExecutorTask(settings)
    blocks = training.batch(0).code
    assert (blocks.ids > 0).any(-1).all()
    assert not blocks.parameters[~vocabulary().used[blocks.ids]].any()
    assert (blocks.parameters <= vocabulary().high[blocks.ids]).all()
    _, records = run(tmp_path, task=training, settings=settings)
    assert records[-1]["cells"] < records[0]["cells"]
    assert {"val_iou", "val_widened"} <= records[-1].keys()
    assert isinstance(load_executor(tmp_path / WEIGHTS), NeuralExecutor)


def test_the_executor_draws_the_union_of_the_blocks_that_draw():
    torch.manual_seed(0)
    network = NeuralExecutor().eval()
    ids, numbers = torch.rand(2, 3, 3, 22), torch.rand(2, 3, 3, 7)
    draws = torch.tensor([[True, False, True], [False] * 3])
    result = network.union(ids, numbers, draws)
    torch.testing.assert_close(result[0], torch.maximum(*network(ids[0, [0, 2]], numbers[0, [0, 2]])))
    assert (result[1] == EMPTY_LOGIT).all()


def test_every_shape_comes_once_before_any_comes_again(room: Path):
    write_targets(room / "five.npz", 5)
    stream = TargetStream([room / "five.npz"], 2, 50, seed=3)
    grids = torch.cat([stream[index][0] for index in range(5)]).flatten(1)
    for part in grids.split(5):
        assert len(part.unique(dim=0)) == 5
    assert torch.equal(stream[3][1], TargetStream([room / "five.npz"], 2, 50, seed=3)[3][1])
    assert stream[0][1].shape == (2, 50, 3)
    assert torch.equal(next(iter(stream))[0], stream[0][0])


def test_a_stream_takes_one_path_too(room: Path):
    several = TargetStream([room / "few.npz"], 2, 50)[0]
    for one in (room / "few.npz", str(room / "few.npz")):
        assert all(map(torch.equal, TargetStream(one, 2, 50)[0], several))


def test_the_ten_lines_of_the_manual_adapt(room: Path, tmp_path: Path):
    import shapeprog as sp

    generator = small()
    write_parts_of_some_size(generator)
    save_weights(tmp_path / "sized.safetensors", generator)
    lines = adapt.__doc__.partition("import *``:\n\n")[2]  # type: ignore[union-attr]
    code = "\n".join(line[4:] for line in lines.splitlines())
    code = code.replace('"fast-wide"', f"{str(tmp_path / 'sized.safetensors')!r}")
    few, losses = TargetStream([room / "few.npz"], 2, seed=0, points=100)[0], []

    def stream(_: object) -> Iterator[adapt.Targets]:
        for _ in range(8):
            yield few
            losses.append(float(values["loss"].detach()))

    exec(code, values := {**vars(adapt), "torch": torch, "sp": sp, "TargetStream": stream})
    assert sum(losses[-2:]) < 0.9 * sum(losses[:2])
    before, after = generator.state_dict(), values["generator"].state_dict()
    changed = {name for name in before if not torch.equal(before[name], after[name])}
    assert {"encoder.0.0.weight", "number_head.2.weight", "offset_head.0.weight"} <= changed


def refuse(room: Path, message: str, method: str = "direct", **options: Any) -> None:
    with pytest.raises(ShapeProgError, match=message):
        task(room, method, **options)


def test_what_cannot_be_adapted_is_an_error_before_it_begins(room: Path, tmp_path: Path):
    write_pack(tmp_path / "empty.npz", [])
    empty, gone = (str(tmp_path / name) for name in ("empty.npz", "gone.npz"))
    refuse(room, r"there is no pack .*gone\.npz", train=(gone,))
    refuse(room, r"there is no pack .*gone\.npz", val=(gone,))
    refuse(room, "there are no shapes to adapt to", train=(empty,))
    refuse(room, r"there are no shapes to validate on in .*empty\.npz", val=(empty,))
    refuse(room, r"give a pack: --train", train=())
    run(tmp_path / "executor", stop_at=1)
    refuse(room, "has no weights yet", "guided", executor=str(tmp_path / "executor" / WEIGHTS))
    refuse(room, "not of the neural executor", "guided", executor=str(room / "fast.safetensors"))
    refuse(room, r"unknown loss 'chamfr'", loss="chamfr")
    tian2019 = str(room / "tian2019.safetensors")
    refuse(room, r"the design tian2019 has no offsets\n.*--learn all", learn="offsets", initial=tian2019)
    refuse(room, r"an estimator samples ids.*\n.*leave --decoded-ids out", estimator="nvil", decoded_ids=1.0)
    refuse(room, "ids cannot learn", learn="offsets", estimator="rloo")
    scene = r"the losses coverage=1 are those of direct adaptation, and the method is {}\n.*--method direct"
    for method in ("guided", "hybrid"):
        refuse(room, scene.format(method), method, loss="coverage=1")
    refuse(room, "those of guided adaptation, and the method is direct", loss="neural=1")
    refuse(room, "those of hybrid adaptation, and the method is guided", "guided", loss="neural=1,chamfer=1")


@pytest.mark.wrong_types
@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"points": 0}, "points is 0\n  hint: give a whole number of 1 or more"),
        ({"num_shapes": 10.5}, "num_shapes is 10.5\n  hint: give a whole number"),
        ({"num_shapes": "10"}, "num_shapes is '10'"),
        ({"rehearsal": 0.5}, "rehearsal is 0.5"),
        ({"learning_rate": float("nan")}, "learning_rate is nan\n  hint: give a number of 0 or more"),
        ({"kl": -1}, "kl is -1"),
        ({"beta1": 1.5}, "beta1 is 1.5\n  hint: give a number of 0 or more, at most 1"),
        ({"beta1": 1}, "beta1 is 1\n  hint: give a number of 0 or more, below 1"),
        ({"train": "few.npz"}, r"train is 'few.npz'\n  hint: give a tuple of paths, such as \('x.npz',\)$"),
        ({"train": Path("few.npz")}, "hint: give a tuple of paths"),
        ({"train": ("few.npz", 5)}, r"train is \('few.npz', 5\)\n  hint: give a tuple of paths"),
        ({"initial": ("fast-wide",)}, "hint: give a text"),
        ({"initial": 5}, "initial is 5"),
    ],
)
def test_settings_check_themselves(options: dict[str, Any], message: str):
    with pytest.raises(ShapeProgError, match=message):
        AdaptSettings(**{"train": ("few.npz",), **options})


@pytest.mark.wrong_types
def test_settings_keep_paths_as_texts_and_lists_as_tuples():
    given: dict[str, Any] = {"train": [Path("few.npz"), "a"], "initial": Path("b"), "executor": Path("c")}
    assert AdaptSettings(**given) == AdaptSettings(train=("few.npz", "a"), initial="b", executor="c")


def test_ids_learn_from_decoded_ones_unless_an_estimator_trains_them():
    assert AdaptSettings(train=("few.npz",)).decoded_ids == 1
    assert AdaptSettings(train=("few.npz",), estimator="rloo").decoded_ids == 0


def test_a_stream_of_nothing_is_refused(room: Path):
    for options in ({"batch_size": 0}, {"points": 0}):
        with pytest.raises(ShapeProgError, match=r"is 0\n  hint: give a whole number of 1 or more"):
            TargetStream([room / "few.npz"], **options)
    with pytest.raises(ShapeProgError, match="index is -1"):
        TargetStream([room / "few.npz"])[-1]


def test_programs_that_draw_nothing_cost_but_have_no_gradient(room: Path):
    adaptation = task(room)
    with torch.no_grad():
        adaptation.network.id_head[2].bias[0] += 100
    losses = adaptation.losses(adaptation.batch(0), 0.0, torch.Generator().manual_seed(0))
    assert losses["chamfer"] > 10
    losses["chamfer"].backward()
    assert not any(weight.grad.any() for weight in adaptation.network.parameters() if weight.grad is not None)

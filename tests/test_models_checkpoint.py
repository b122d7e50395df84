"""Weights in files: round trips, and everything that may be wrong with one, in words."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import pytest
import torch
from safetensors.torch import save_file
from torch import nn

from shapeprog.cli import main
from shapeprog.errors import InputError, OutputError, ShapeProgError
from shapeprog.language import Language, language, statement, using
from shapeprog.language.parameters import Extent, Length, Position
from shapeprog.language.shapes import box
from shapeprog.models import checkpoint
from shapeprog.models.checkpoint import (
    Card,
    Listed,
    card_of,
    list_checkpoints,
    load_checkpoint,
    load_executor,
    load_generator,
    read_card,
    save_checkpoint,
)
from shapeprog.models.designs import build_generator
from shapeprog.models.executor import NeuralExecutor
from shapeprog.models.vocabulary import Vocabulary


@pytest.fixture(params=["tian2019", "swift", "executor"])
def network(request: pytest.FixtureRequest) -> nn.Module:
    name = str(request.param)
    return NeuralExecutor(Vocabulary.current()) if name == "executor" else build_generator(name)


def executor() -> NeuralExecutor:
    return NeuralExecutor(Vocabulary.current())


def written(folder: Path, **changes: object) -> Path:
    """A small file of weights whose card says what it should not."""
    path, module = folder / "one.safetensors", executor()
    save_checkpoint(path, module, dataclasses.replace(card_of(module), **changes))  # type: ignore[arg-type]
    return path


def test_weights_of_a_run_are_listed_by_the_folder_of_all_runs(tmp_path: Path) -> None:
    for run in ("first", "second"):
        (tmp_path / run).mkdir()
        written(tmp_path / run)
    found = [path.parent.name for path, _ in list_checkpoints([tmp_path], shipped=False)]
    assert found == ["first", "second"]


@pytest.mark.parametrize("half", [False, True])
def test_a_network_comes_back_as_it_was(network: nn.Module, half: bool, tmp_path: Path) -> None:
    path = tmp_path / "one.safetensors"
    card = card_of(network, data="narrow", seed=3, visits=640, command="shapeprog pretrain", scores={"iou": 0.5})
    save_checkpoint(path, network, card, half=half)
    loaded, told = load_checkpoint(path)
    assert json.loads(json.dumps(dataclasses.asdict(told))) == json.loads(json.dumps(dataclasses.asdict(card)))
    assert type(loaded) is type(network)
    assert not loaded.training
    for name, value in network.state_dict().items():
        found = loaded.state_dict()[name]
        assert found.dtype == value.dtype
        expected = value.half().float() if half and value.ndim > 1 and value.is_floating_point() else value
        assert torch.equal(found, expected), name
    listed = read_card(path)
    assert listed.parameters == sum(each.numel() for each in network.parameters())
    assert listed.size < listed.parameters * (2.2 if half else 4.2) + 20_000
    assert [each.name for each in tmp_path.iterdir()] == ["one.safetensors"]


def test_only_the_kind_that_is_asked_for(tmp_path: Path) -> None:
    path = written(tmp_path)
    assert load_executor(path)[1].kind == "executor"
    with pytest.raises(InputError, match="neural executor, not a generator"):
        load_generator(path)


def test_weights_are_as_readable_as_other_files(tmp_path: Path) -> None:
    (tmp_path / "plain").touch()
    assert written(tmp_path).stat().st_mode == (tmp_path / "plain").stat().st_mode


def test_a_missing_file_and_an_unknown_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    written(tmp_path).rename(tmp_path / "default.safetensors")
    monkeypatch.setattr(checkpoint, "SHIPPED", tmp_path)
    monkeypatch.chdir(tmp_path)
    assert isinstance(load_checkpoint("default")[0], NeuralExecutor)
    with pytest.raises(InputError, match="did you mean 'default'"):
        load_checkpoint("defualt")
    with pytest.raises(InputError, match="there are: default"):
        load_checkpoint("zzz")
    with pytest.raises(InputError, match="there is no file"):
        load_checkpoint(tmp_path / "none.safetensors")
    with pytest.raises(InputError, match="is a folder"):
        load_checkpoint(tmp_path)


@pytest.mark.parametrize("part", [0, 4, 100, 0.5, -1])
def test_a_file_that_is_cut_short(part: float, tmp_path: Path) -> None:
    path = written(tmp_path)
    content = path.read_bytes()
    path.write_bytes(content[: int(part * len(content)) if 0 < part < 1 else int(part)])
    with pytest.raises(InputError, match=r"cut short|no safetensors file"):
        load_checkpoint(path)


def test_files_of_other_kinds(tmp_path: Path) -> None:
    path = tmp_path / "other.safetensors"
    path.write_bytes(b"PK\x03\x04 this is a zip, or a picture, or anything else " * 10)
    with pytest.raises(InputError, match="no safetensors file"):
        load_checkpoint(path)
    path.write_bytes((20).to_bytes(8, "little") + b"{ this is no header }")
    with pytest.raises(InputError, match="its header is no JSON"):
        load_checkpoint(path)
    save_file({"weight": torch.zeros(3)}, path)
    with pytest.raises(InputError, match="without a card"):
        load_checkpoint(path)
    save_file({"weight": torch.zeros(3)}, path, {"card": "[]", "parameters": "3"})
    with pytest.raises(InputError, match=r"card of .* cannot be read"):
        load_checkpoint(path)


def test_a_card_that_does_not_fit(tmp_path: Path) -> None:
    with pytest.raises(ShapeProgError, match="no design 'swif'"):
        load_checkpoint(written(tmp_path, kind="generator", design="swif"))
    with pytest.raises(ShapeProgError, match="no setting 'widht'"):
        load_checkpoint(written(tmp_path, kind="generator", design="swift", settings={"widht": 3}))
    with pytest.raises(InputError, match="does not fit its network"):
        load_checkpoint(written(tmp_path, kind="generator", design="swift"))
    with pytest.raises(InputError, match="is for a 'planner'"):
        load_checkpoint(written(tmp_path, kind="planner"))


def test_weights_that_are_not_finite(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    module = executor()
    with torch.no_grad():
        module.pgm_embed.weight[0, 0] = torch.nan
    with pytest.raises(OutputError, match=r"1 of 1408 values of pgm_embed\.weight are not finite"):
        save_checkpoint(tmp_path / "one.safetensors", module, card_of(module))
    assert not list(tmp_path.iterdir())
    with monkeypatch.context() as patch:
        patch.setattr(checkpoint, "_bad", lambda values: "")
        patch.setattr(torch.Tensor, "isfinite", lambda self: torch.ones(self.shape, dtype=torch.bool))
        save_checkpoint(tmp_path / "one.safetensors", module, card_of(module))
    with pytest.raises(InputError, match=r"pgm_embed\.weight are not finite"):
        load_checkpoint(tmp_path / "one.safetensors")


def test_a_changed_vocabulary_is_refused_by_name(tmp_path: Path) -> None:
    grown, changed = Language(), Language()
    for each in language():
        grown.register(each)
        changed.register(dataclasses.replace(each, name="post") if each.name == "leg" else each)
    with using(grown):

        @statement("shelf", id=30)
        def shelf(at: Position, size: Extent, depth: Length):  # type: ignore[no-untyped-def]
            """A shelf."""
            return box(at, size)

        path = written(tmp_path)
        load_checkpoint(path)
    with pytest.raises(ShapeProgError, match="'shelf'"):
        load_checkpoint(path)
    path = written(tmp_path)
    with using(grown):
        assert load_executor(path)[0].vocabulary.size == 22
    with using(changed), pytest.raises(ShapeProgError, match="'leg'"):
        load_checkpoint(path)


def test_listing_reads_headers_and_names_what_is_wrong(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    written(tmp_path, data="blocks", seed=7, visits=1200, scores={"iou": 0.875})
    save_file({"step": torch.zeros(3)}, tmp_path / "state.safetensors")
    found = [each for _, each in list_checkpoints([tmp_path], shipped=False)]
    assert [type(each) for each in found] == [Listed]
    for words, part in ((["models", str(tmp_path)], "iou 0.875"), (["models", str(tmp_path), "--json"], "862272")):
        with pytest.raises(SystemExit) as end:
            main(words)
        assert end.value.code in (0, None)
        assert part in capsys.readouterr().out
    (tmp_path / "two.safetensors").write_bytes(b"{}")
    with pytest.raises(SystemExit) as end:
        main(["models", str(tmp_path)])
    told = capsys.readouterr()
    assert end.value.code == 1
    assert "862,272" in told.out
    assert "two.safetensors" in told.err
    (_, lost), (_, kept), *_ = list_checkpoints([tmp_path / "none", tmp_path], shipped=False)
    assert isinstance(lost, InputError)
    assert "there is no file" in lost.message
    assert isinstance(kept, Listed)


def test_what_it_is_cannot_be_told_of_any_module() -> None:
    with pytest.raises(TypeError, match="Linear"):
        card_of(nn.Linear(1, 1))
    assert {each.name for each in dataclasses.fields(Card)} >= {"kind", "design", "settings", "vocabulary", "scores"}

"""Published weights: read by names or by order, refused in words, and never run."""

from __future__ import annotations

import argparse
import os
from collections import OrderedDict
from pathlib import Path
from typing import Any

import pytest
import torch
from torch import nn

from shapeprog.cli import main, modelling
from shapeprog.errors import InputError
from shapeprog.models.checkpoint import load_checkpoint, load_generator
from shapeprog.models.executor import NeuralExecutor
from shapeprog.models.published import read_published
from shapeprog.models.tian2019 import PUBLISHED, Tian2019
from shapeprog.models.vocabulary import Vocabulary


class Payload:
    """A pickle that would write a file."""

    def __init__(self, trace: Path) -> None:
        self.trace = trace

    def __reduce__(self) -> tuple[Any, ...]:
        return os.system, (f"echo run > {self.trace}",)


def networks() -> list[nn.Module]:
    vocabulary = Vocabulary.current()
    return [Tian2019(PUBLISHED, vocabulary), NeuralExecutor(vocabulary)]


def saved(path: Path, state: object, opt: object = None, legacy: bool = True) -> Path:
    options = argparse.Namespace(rnn_size=64, save_folder="models") if opt is None else opt
    torch.save({"model": state, "opt": options}, path, _use_new_zipfile_serialization=not legacy)
    return path


@pytest.mark.parametrize("legacy", [True, False])
@pytest.mark.parametrize("prefix", ["", "module."])
def test_both_networks_are_recognised_by_names(legacy: bool, prefix: str, tmp_path: Path) -> None:
    for module in networks():
        state = module.state_dict()
        old = OrderedDict((prefix + name, each) for name, each in state.items() if "num_batches" not in name)
        found = read_published(saved(tmp_path / "one.t7", old, legacy=legacy))
        assert type(found) is type(module)
        assert all(torch.equal(each, state[name]) for name, each in found.state_dict().items())


def test_other_names_are_taken_in_their_order(tmp_path: Path) -> None:
    module = networks()[1]
    state = {f"layer{n}": each for n, (name, each) in enumerate(module.state_dict().items()) if "num_b" not in name}
    found = read_published(saved(tmp_path / "one.t7", state))
    assert torch.equal(found.state_dict()["decoder.0.weight"], module.state_dict()["decoder.0.weight"])


def test_what_does_not_fit_is_named(tmp_path: Path) -> None:
    state = dict(networks()[0].state_dict())
    state.pop("core.weight_hh_l0")
    with pytest.raises(InputError, match=r"as a generator core\.weight_hh_l0 is missing"):
        read_published(saved(tmp_path / "one.t7", state))
    state = dict(networks()[0].state_dict()) | {"core.weight_hh_l0": torch.zeros(4, 2)}
    with pytest.raises(InputError, match=r"\(4, 2\), not \(256, 64\)"):
        read_published(saved(tmp_path / "one.t7", state))
    with pytest.raises(InputError, match="no weights under 'model'"):
        read_published(saved(tmp_path / "one.t7", {"epoch": 3}))
    with pytest.raises(InputError, match="not all values of core"):
        read_published(saved(tmp_path / "one.t7", state | {"core.weight_hh_l0": torch.full((256, 64), torch.nan)}))


def test_files_that_are_none(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="there is no file"):
        read_published(tmp_path / "none.t7")
    for content in (b"", b"hello", b"\x80\x02}q\x00.", b"PK\x03\x04" + bytes(100)):
        (tmp_path / "bad.t7").write_bytes(content)
        with pytest.raises(InputError, match=r"no file of weights|no weights under"):
            read_published(tmp_path / "bad.t7")
    path = saved(tmp_path / "cut.t7", networks()[1].state_dict(), legacy=False)
    path.write_bytes(path.read_bytes()[:50_000])
    with pytest.raises(InputError, match="no file of weights"):
        read_published(path)


@pytest.mark.parametrize("place", ["model", "opt", "weight", "settings"])
@pytest.mark.parametrize("legacy", [True, False])
def test_a_malicious_file_runs_nothing(place: str, legacy: bool, tmp_path: Path) -> None:
    trace, state = tmp_path / "trace", dict(networks()[1].state_dict())
    payload: Any = Payload(trace)
    opt = payload if place == "opt" else argparse.Namespace(data=payload) if place == "settings" else None
    content = payload if place == "model" else state | {"more": payload} if place == "weight" else state
    path = saved(tmp_path / "bad.t7", content, opt, legacy)
    with pytest.raises(InputError, match="nothing in it was run"):
        read_published(path)
    assert not trace.exists()
    assert argparse.Namespace not in torch.serialization.get_safe_globals()
    torch.load(path, weights_only=False)
    assert trace.exists()  # the file would have run


def test_the_command_writes_a_checkpoint(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(modelling, "CALIBRATION", 4)
    module = networks()[0]
    saved(tmp_path / "old.t7", module.state_dict())
    for words, statistics in ((["--out", "new.safetensors"], "batch"), (["--calibrate", "4", "--half"], "running")):
        with pytest.raises(SystemExit) as end:
            main(["import-weights", "old.t7", *words])
        told = capsys.readouterr()
        assert end.value.code in (0, None), told.err
        name = words[1] if words[0] == "--out" else "old.safetensors"
        assert f"wrote {name}: generator, 1,417,404 parameters" in told.out
        found, card = load_generator(name)
        assert found.settings.statistics == statistics
        assert card.command.startswith("shapeprog import-weights old.t7")
    calibrated, published = load_checkpoint("old.safetensors")[0], load_checkpoint("new.safetensors")[0]
    assert torch.equal(
        published.state_dict()["shape_feat.conv1.weight"], module.state_dict()["shape_feat.conv1.weight"]
    )
    assert (calibrated.state_dict()["shape_feat.BN3.running_var"] != 1).all()
    with pytest.raises(SystemExit) as end:
        main(["import-weights", "old.t7", "--out", "new.bin"])
    assert end.value.code == 2
    assert "new.safetensors" in capsys.readouterr().err

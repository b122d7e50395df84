"""Files of weights: they come back as they were, say what they are, and damaged or hostile ones end in a sentence."""

from __future__ import annotations

import argparse
import json
import os
import pickle
import random
from dataclasses import asdict
from pathlib import Path

import pytest
import torch
from liang2022_toys import SMALL, run, same, small
from safetensors.torch import load, save
from torch import Tensor

from shapeprog.errors import InputError, OutputError, ShapeProgError
from shapeprog.liang2022.executor import NeuralExecutor
from shapeprog.liang2022.tian2019 import PUBLISHED, Tian2019
from shapeprog.liang2022.weights import (
    build_generator,
    load_executor,
    load_generator,
    load_weights,
    read_card,
    read_published,
    save_weights,
)

pytestmark = pytest.mark.paper


def write(path: Path, **options: object) -> Path:
    save_weights(path, small(), data="synthetic", seed=3, samples_seen=640, scores={"iou": 0.5}, **options)  # type: ignore[arg-type]
    return path


def rewrite(path: Path, tensors: dict[str, Tensor] | None = None, **card: object) -> None:
    """Write a file again with other tensors or fields of its card."""
    text = json.dumps(asdict(read_card(path)) | card)
    path.write_bytes(save(load(path.read_bytes()) | (tensors or {}), {"card": text}))


@pytest.mark.parametrize("half", [False, True])
def test_weights_come_back_with_their_card(half: bool, tmp_path: Path):
    path = write(tmp_path / "one.safetensors", half=half)
    module, card = load_weights(path)
    known = {"data": "synthetic", "seed": 3, "samples_seen": 640, "scores": {"iou": 0.5}, "design": "fast"}
    assert asdict(card).items() >= {**known, "settings": json.loads(json.dumps(asdict(SMALL)))}.items()
    assert not module.training
    for name, value in small().state_dict().items():
        again = module.state_dict()[name]
        assert again.dtype == value.dtype
        torch.testing.assert_close(again, value, atol=1e-6 * half, rtol=1e-3 * half)
    assert write(tmp_path / "two.safetensors", half=half).read_bytes() == path.read_bytes()
    assert load_generator(path).settings == SMALL


def test_files_of_the_other_network_and_names_that_do_not_ship_are_refused(tmp_path: Path):
    save_weights(tmp_path / "executor.safetensors", NeuralExecutor())
    write(tmp_path / "generator.safetensors")
    assert isinstance(load_executor(tmp_path / "executor.safetensors"), NeuralExecutor)
    for reader, name, message in (
        (load_generator, tmp_path / "executor.safetensors", "holds weights of the executor, not of a generator"),
        (load_executor, tmp_path / "generator.safetensors", "of the generator fast, not of the neural executor"),
        (load_weights, "fats", "no weights called 'fats' ship with shapeprog"),
        (load_weights, tmp_path / "gone.safetensors", r"there is no file .*gone"),
        (build_generator, "fist", r"unknown design 'fist'\n.*did you mean fast"),
    ):
        with pytest.raises(ShapeProgError, match=message):
            reader(name)


def test_a_run_without_a_validation_is_an_error_with_a_cure(tmp_path: Path):
    run(tmp_path / "executor", stop_at=2)
    for name in ("executor/weights.safetensors", "executor"):
        with pytest.raises(InputError, match=r"the run in .*executor has no weights yet\n.*--validate-every"):
            load_executor(tmp_path / name)
    write(tmp_path / "executor" / "weights.safetensors")
    with pytest.raises(InputError, match="executor is a folder"):
        load_executor(tmp_path / "executor")


@pytest.mark.wrong_types
def test_a_card_cannot_ask_for_more_than_a_network_may_have(tmp_path: Path):
    path = write(tmp_path / "one.safetensors")
    large = ({"feature": 10**6}, {"squeeze": True}, {"low": 2, "high": 1}, {"low": None}, {"smoothing": "x"})
    for settings in (*large, {"widths": (1, 1)}, {"widths": 3}, {"depth": 3}):
        rewrite(path, settings=settings)
        with pytest.raises(ShapeProgError, match=r"out of range|cannot be read as weights"):
            load_weights(path)


def test_weights_that_are_not_finite_are_neither_written_nor_read(tmp_path: Path):
    path = write(tmp_path / "one.safetensors")
    generator = small()
    with torch.no_grad():
        generator.block_memory.bias[0] = torch.inf
    before = path.read_bytes()
    with pytest.raises(OutputError, match=r"block_memory\.bias is not finite"):
        save_weights(path, generator)
    assert path.read_bytes() == before
    rewrite(path, {"block_memory.bias": torch.full((32,), torch.nan)})
    with pytest.raises(InputError, match=r"block_memory\.bias is no plain tensor of finite numbers"):
        load_weights(path)


def other_headers(content: bytes) -> list[bytes]:
    """Other headers before the same numbers."""
    length = int.from_bytes(content[:8], "little")
    header, body = json.loads(content[8 : 8 + length]), content[8 + length :]
    card, name = json.loads(header["__metadata__"]["card"]), max(header)
    wrong = ({"design": "none"}, {"design": 3}, {"settings": []}, {"settings": {"feature": 10**12}})
    changes = (*wrong, {"scores": "x"}, {"scores": {"iou": "x"}})
    cards = [*(json.dumps({**card, **change}) for change in changes), "[" * 9999, "null"]
    changed = [{**header, "__metadata__": {"card": text}} for text in cards]
    for entry in ({"dtype": "F8_E4M3"}, {"dtype": "I64"}, {"shape": [1, 1 << 62]}, {"data_offsets": [0, 1 << 40]}):
        changed.append({**header, name: {**header[name], **entry}})
    texts = [json.dumps(each).encode() for each in ([], {}, *changed)]
    return [len(text).to_bytes(8, "little") + text + body for text in texts]


def test_damaged_files_end_in_weights_or_in_a_sentence(tmp_path: Path):
    path, dice = write(tmp_path / "one.safetensors"), random.Random(0)
    good = path.read_bytes()
    head = 8 + int.from_bytes(good[:8], "little")
    cases = [b"", b"{}", b"\xff" * 8 + good[8:], good[:-1], good + b"\0" * 8, good[:head], *other_headers(good)]
    for number in range(150):
        content = bytearray(good)
        for _ in range(dice.choice((1, 2, 16))):
            content[dice.randrange(len(content) if number % 3 == 0 else head)] = dice.randrange(256)
        cases.append(bytes(content))
    read = 0
    for content in cases:
        path.write_bytes(content)
        try:
            module, _ = load_weights(path)
        except ShapeProgError:
            continue
        read += 1
        assert all(value.isfinite().all() for value in module.state_dict().values())
    assert 20 < read < len(cases) - 50


def publish(path: Path, state: dict[str, object], **others: object) -> Path:
    torch.save({"model": state, "opt": argparse.Namespace(rnn_size=64), **others}, path)
    return path


def test_published_checkpoints_are_read(tmp_path: Path):
    torch.manual_seed(1)
    for network in (Tian2019(PUBLISHED), NeuralExecutor()):
        state = {f"module.{name}": value for name, value in network.state_dict().items() if "num_batches" not in name}
        module = read_published(publish(tmp_path / "one.t7", state))
        assert type(module) is type(network)
        assert same(dict(module.state_dict()), dict(network.state_dict()))
        save_weights(tmp_path / "one.safetensors", module)
        again, card = load_weights(tmp_path / "one.safetensors")
        assert same(dict(again.state_dict()), dict(network.state_dict()))
        assert card.design == "executor" or again.settings == PUBLISHED


class Hostile:
    """A pickle that would write a file."""

    def __reduce__(self) -> tuple[object, ...]:
        return os.mkdir, ("harmed",)


def test_checkpoints_that_hold_more_than_weights_run_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(tmp_path)
    state = dict(Tian2019(PUBLISHED).state_dict())
    for content in (pickle.dumps({"model": Hostile()}), publish(tmp_path / "a.t7", state, more=Hostile()).read_bytes()):
        (tmp_path / "bad.t7").write_bytes(content)
        with pytest.raises(InputError, match=r"holds more than weights; nothing in it was run"):
            read_published(tmp_path / "bad.t7")
    run(tmp_path / "run", stop_at=1)
    torch.save({"module": Hostile()}, tmp_path / "run" / "state.pt")
    with pytest.raises(InputError, match="damaged"):
        run(tmp_path / "run")
    assert not (tmp_path / "harmed").exists()


@pytest.mark.filterwarnings("ignore")
def test_tensors_of_other_kinds_are_refused(tmp_path: Path):
    state = NeuralExecutor().state_dict()
    good = state["pgm_embed.weight"]
    odd = [good.to_sparse(), good.to("meta"), good.to(torch.complex64), good.to(torch.float8_e4m3fn), good[:0], "text"]
    for each in (*odd, torch.full_like(good, 1e300, dtype=torch.float64)):
        with pytest.raises(InputError, match=r"pgm_embed\.weight|damaged, or holds more"):
            read_published(publish(tmp_path / "odd.t7", {**state, "pgm_embed.weight": each}))

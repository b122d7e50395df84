"""Files of weights that are hard to read: each ends in a network or in words, hides no other, and costs no memory."""

from __future__ import annotations

import json
import os
from pathlib import Path

import pytest
import torch
from safetensors.torch import load, save_file

from shapeprog.cli import main
from shapeprog.errors import InputError, ShapeProgError
from shapeprog.models.checkpoint import Listed, list_checkpoints, load_checkpoint, read_card
from shapeprog.models.designs import build_generator
from shapeprog.models.published import LARGEST, read_published
from shapeprog.models.tensor_file import file_bytes, read_header
from tests.fuzz.crafted_weights import ODD, crafted
from tests.fuzz.weight_files import checkpoint, published


def ends(name: str, content: bytes, folder: Path) -> bool:
    """Whether a file of that content is read; if not, it is refused in words."""
    path = folder / f"case{Path(name).suffix}"
    path.write_bytes(content)
    try:
        (load_checkpoint if path.suffix == ".safetensors" else read_published)(path)
    except ShapeProgError as error:
        said = error.message
    else:
        return True
    assert str(path) in said, name
    return False


def test_what_is_mutated_is_good_itself(tmp_path: Path) -> None:
    for name, content in (("a.safetensors", checkpoint()), ("a.t7", published()), ("b.t7", published(legacy=True))):
        assert ends(name, content, tmp_path)


@pytest.mark.wrong_types
def test_crafted_files_end_in_a_network_or_in_words(tmp_path: Path) -> None:
    good = {"parameter", "turned", "eight-bits"} | {f"card-{key}" for key in ("data", "version", "command")}
    good |= {f"card-{key}" for key in ("seed", "visits", "scores", "vocabulary")}
    for name, content in crafted():
        assert not ends(name, content, tmp_path) or Path(name).stem in good, name


@pytest.mark.parametrize(
    "kind", ["sparse", "meta", "quantised", "expanded", "expanded-far", "nested", "complex", "whole"]
)
def test_tensors_of_other_kinds_are_named(kind: str, tmp_path: Path) -> None:
    assert kind in ODD
    (tmp_path / "one.t7").write_bytes(published(ODD[kind]))
    with pytest.raises(InputError, match=r"pgm_embed\.weight (is no plain|has the shape|are finite)|holds more"):
        read_published(tmp_path / "one.t7")


def test_a_bad_file_hides_no_good_one(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    kinds = [(name, content) for name, content in crafted() if name.endswith(".safetensors")]
    for number, (_, content) in enumerate(kinds):
        (tmp_path / f"{number:03}-bad.safetensors").write_bytes(content)
    os.mkfifo(tmp_path / "pipe.safetensors")
    (tmp_path / "lost.safetensors").symlink_to(tmp_path / "nowhere")
    for name in ("000-a-good", "zz-good"):
        (tmp_path / f"{name}.safetensors").write_bytes(checkpoint())
    found = dict(list_checkpoints([tmp_path], shipped=False))
    assert isinstance(found[tmp_path / "zz-good.safetensors"], Listed)
    for words in (["models", str(tmp_path)], ["models", str(tmp_path), "--json"]):
        with pytest.raises(SystemExit) as end:
            main(words)
        told = capsys.readouterr()
        assert end.value.code == 1
        assert "zz-good" in told.out
        assert "000-a-good" in told.out
        assert "pipe.safetensors is no regular file" in told.err


def test_the_same_weights_make_the_same_bytes() -> None:
    tensors = {"b": torch.ones(2, 3), "a": torch.arange(3), "c": torch.zeros(0), "d": torch.ones((), dtype=torch.half)}
    texts = {name: name * 3 for name in "zyxwvutsrq"}
    turned = dict(reversed(tensors.items())), dict(reversed(texts.items()))
    files = {file_bytes(*each) for each in 4 * [(tensors, texts), turned]}
    assert len(files) == 1
    assert all(torch.equal(each, tensors[name]) for name, each in load(*files).items())


def test_a_header_tells_what_the_library_reads(tmp_path: Path) -> None:
    tensors = {
        "b": torch.ones(2, 3),
        "a": torch.arange(3),
        "c": torch.zeros(0),
        "d": torch.ones((), dtype=torch.bfloat16),
    }
    save_file(tensors, tmp_path / "one.safetensors", {"word": "text"})
    header = read_header(tmp_path / "one.safetensors")
    assert header.metadata == {"word": "text"}
    assert header.tensors == {"a": ("I64", (3,)), "b": ("F32", (2, 3)), "c": ("F32", (0,)), "d": ("BF16", ())}
    assert header.size == (tmp_path / "one.safetensors").stat().st_size


@pytest.mark.wrong_types
def test_a_card_cannot_ask_for_more_than_a_network_may_have() -> None:
    for settings in ({"feature": 10**6}, {"widths": (1, 1)}, {"widths": 3}, {"low": 2, "high": 1}, {"squeeze": True}):
        with pytest.raises(ShapeProgError, match=r"sizes of layers|no range"):
            build_generator("swift", settings)
    for settings in ({"statistics": "none"}, {"legal": None}, {"padding": "x"}):
        with pytest.raises(ShapeProgError, match=r"no statistics|are weights"):
            build_generator("tian2019", settings)


def test_numbers_of_a_type_that_the_network_cannot_use_are_refused(tmp_path: Path) -> None:
    weights = load(checkpoint())
    (tmp_path / "one.safetensors").write_bytes(checkpoint())
    texts = read_header(tmp_path / "one.safetensors").metadata
    for name, dtype in (("bins.1.bias", torch.float64), ("bins.1.bias", torch.int64), ("bins.1.bias", torch.bool)):
        changed = {**weights, name: weights[name].to(dtype)}
        (tmp_path / "one.safetensors").write_bytes(file_bytes(changed, texts))
        with pytest.raises(InputError, match=r"numbers of bins\.1\.bias are"):
            load_checkpoint(tmp_path / "one.safetensors")


def test_scores_of_a_card_are_numbers(tmp_path: Path) -> None:
    weights, path = load(checkpoint()), tmp_path / "one.safetensors"
    path.write_bytes(checkpoint())
    texts = read_header(path).metadata
    for scores in ({"iou": None}, {"iou": "x"}, {"iou": 10**400}, {"iou": True}, {"iou": float("nan")}):
        card = json.dumps(json.loads(texts["card"]) | {"scores": scores})
        path.write_bytes(file_bytes(weights, {**texts, "card": card}))
        with pytest.raises(InputError, match="card of"):
            read_card(path)


def test_published_files_are_regular_and_not_endless(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.t7")
    (tmp_path / "endless.t7").symlink_to("/dev/zero")
    for name in ("pipe.t7", "endless.t7"):
        with pytest.raises(InputError, match="no regular file"):
            read_published(tmp_path / name)
    with open(tmp_path / "large.t7", "wb") as file:
        file.truncate(LARGEST + 1)
    with pytest.raises(InputError, match="larger than 256 MB"):
        read_published(tmp_path / "large.t7")

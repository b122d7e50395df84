"""What the README prints is what the package writes."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import shapeprog as sp

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")


def snippets(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```$", README, re.DOTALL | re.MULTILINE)


@pytest.fixture(scope="module")
def demo():
    return sp.infer(ROOT / "examples" / "chair_kenney.obj").program


def test_the_demo_writes_the_chair_of_the_readme(demo):
    printed = sp.parse(snippets("python")[0])
    assert {each.name for each in sp.names(printed)} == {each.name for each in sp.names(demo)}
    said, found = sp.inline(printed), sp.inline(demo)
    assert [(node.name, getattr(node, "role", "")) for node in said.walk()] == [
        (node.name, getattr(node, "role", "")) for node in found.walk()
    ]
    for one, other in zip(said.walk(), found.walk(), strict=True):
        assert other.values == pytest.approx(one.values, abs=0.03)

"""The pages of the documentation agree with the code; `make docs` builds them."""

from __future__ import annotations

import importlib
import re
from pathlib import Path

import pytest

import shapeprog
from docs.generated import commands, statements
from shapeprog import liang2022
from shapeprog.cli.app import app, library, paper
from shapeprog.language import standard, using
from shapeprog.liang2022 import losses, renderer
from shapeprog.liang2022.losses import LOSSES

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
PAGES = [*DOCS.rglob("*.md"), *ROOT.glob("*.md"), *ROOT.glob("src/**/*.md")]


def page(name: str) -> str:
    return (DOCS / f"{name}.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("package", [shapeprog, liang2022], ids=lambda package: package.__name__)
def test_every_public_name_is_on_the_page_of_the_api(package):
    listed = set(re.findall(rf"\b{re.escape(package.__name__)}\.(\w+)$", page("api"), re.MULTILINE))
    assert set(package.__all__) - listed == set()


def test_every_name_on_the_page_of_the_api_exists():
    for path in re.findall(r"^\.\. auto\w+:: (\S+)$", page("api"), re.MULTILINE):
        module, _, name = path.rpartition(".")
        assert hasattr(importlib.import_module(module), name), path


def test_every_statement_and_role_is_in_a_table():
    with using(standard):
        rows = re.findall(r"^\| `(\w+)` \|", "\n".join(statements()), re.MULTILINE)
        assert sorted(rows) == sorted({*standard.names, *standard.roles})
        assert "`turn`: angle in degrees, 0 by default" in "\n".join(statements("solids"))


def test_every_command_has_a_section():
    groups = (("shapeprog", app), ("shapeprog library", library), ("shapeprog paper", paper))
    names = [f"{prefix} {each.name}" for prefix, group in groups for each in group.registered_commands]
    text = "\n".join(commands())
    assert set(names) <= set(re.findall(r"^## (.+)$", text, re.MULTILINE))
    assert "```text\nF1@1%" in text
    assert "\b" not in text


def test_every_loss_is_on_the_page_of_training():
    built_in = {name for name, loss in LOSSES.items() if loss.__module__ == losses.__name__}
    assert built_in <= set(re.findall(r"^\| `(\w+)` \|", page("training"), re.MULTILINE))


def test_the_page_of_the_paper_names_functions_and_tests_that_exist():
    tests = "\n".join(path.read_text(encoding="utf-8") for path in Path(__file__).parent.glob("test_*.py"))
    named = set(re.findall(r"`(test_\w+)`", page("paper")))
    assert {name for name in named if f"def {name}(" not in tests} == set()
    functions = set(re.findall(r"`renderer\.(\w+)(?:\.\w+)?`", page("paper"))) - {"py"}
    assert all(hasattr(renderer, name) for name in functions)


@pytest.mark.parametrize("path", PAGES, ids=lambda path: str(path.relative_to(ROOT)))
def test_no_relative_link_is_dead(path):
    links = re.findall(r"\]\((?!\w+:)([^)#\s]+)(?:#[^)\s]*)?\)", path.read_text(encoding="utf-8"))
    assert [link for link in links if not (path.parent / link).exists()] == []


def test_the_citation_names_the_version():
    assert f"\nversion: {shapeprog.__version__}\n" in (ROOT / "CITATION.cff").read_text(encoding="utf-8")

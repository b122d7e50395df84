"""The commands and blocks of the README and of the pages for users run.

Blocks marked ``sh`` and ``python`` run in order, in one folder and one namespace for each page, unless the line above
is ``<!-- not run: reason -->``. A ``python`` block that begins with ``# name.py`` is a file that later commands use.
Blocks marked ``py`` are programs.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import shapeprog as sp
from docs.notebook import notebook
from shapeprog.formats.format import suffixes

ROOT = Path(__file__).parents[1]
README, DOCS = ROOT / "README.md", ROOT / "docs"
PAGES = ("tutorial", "language", "statements", "names", "units", "formats", "libraries", "extending")
WHOLE = "width, depth, height = 120, 60, 75"  # first line of the examples on the page of the language
COMMENT = re.compile(r"^ *# (?!unit: ).*\n|  # .*$", re.MULTILINE)
BLOCK = re.compile(r"(<!-- not run: [^\n]* -->\n)?^```(sh|python|py)\n(.*?)^```$", re.DOTALL | re.MULTILINE)


def blocks(page: Path) -> Iterator[tuple[str, str]]:
    """The language and the text of each block of a page, or of each code cell of a notebook."""
    text = page.read_text(encoding="utf-8")
    if page.suffix == ".ipynb":
        sources = ["".join(cell["source"]) for cell in json.loads(text)["cells"] if cell["cell_type"] == "code"]
        yield from (("sh" if each.startswith("%%bash") else "python", each.removeprefix("%%bash")) for each in sources)
    else:
        yield from ((language, code) for skipped, language, code in BLOCK.findall(text) if not skipped)


def run(page: Path, folder: Path) -> dict[str, Any]:
    """Run the blocks of a page in a folder; the names that its Python code defines."""
    found: dict[str, Any] = {}
    for language, code in blocks(page):
        if language == "sh":
            shell(code, folder)
        elif file := re.match(r"# (\w+\.py)\n", code):
            (folder / file[1]).write_text(code, encoding="utf-8")
        elif language == "python":
            exec(compile(code, f"{page.name}: {code.splitlines()[0]}", "exec"), found)
    return found


def shell(commands: str, folder: Path) -> None:
    """Run commands in a folder; every one must succeed."""
    env = os.environ | {"PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"}
    ended = subprocess.run(["bash", "-euc", commands], cwd=folder, env=env, capture_output=True, text=True)
    assert ended.returncode == 0, f"{commands}\n{ended.stdout}{ended.stderr}"


@pytest.fixture
def folder(tmp_path, monkeypatch):
    shutil.copytree(ROOT / "examples", tmp_path / "examples")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_the_blocks_of_the_readme_run_and_infer_the_program_that_it_prints(folder):
    found = sp.format_program(run(README, folder)["program"])
    printed = next(code for language, code in blocks(README) if language == "py")
    assert COMMENT.sub("", printed) == found
    assert COMMENT.sub("", (folder / "demo-output" / "chair_kenney.shape").read_text(encoding="utf-8")) == found
    tutorial = (DOCS / "tutorial.md").read_text(encoding="utf-8")
    beginning = re.search(r"^```text\n(# placed: .*\n)((?:.+\n)+?)```$", tutorial, re.MULTILINE)
    assert beginning
    assert found.startswith(beginning[2])
    assert (folder / "demo-output" / "chair_kenney.shape").read_text(encoding="utf-8").startswith(beginning[1])
    replaced = re.findall(r"^sed 's/(.+?)/.+/'", tutorial, re.MULTILINE)
    assert [found.count(each) for each in replaced] == [1]


@pytest.mark.nightly
def test_the_everyday_commands_of_the_readme_run(folder):
    run(README, folder)
    commands = re.findall(r"^\| `(shapeprog [^`]*)` \|", README.read_text(encoding="utf-8"), re.MULTILINE)
    assert len(commands) == 8
    shell("\n".join(commands), folder)


@pytest.mark.nightly
@pytest.mark.parametrize("name", [*(f"{page}.md" for page in PAGES), "tutorial.ipynb"])
def test_the_blocks_of_a_page_run(name, folder):
    run(DOCS / name, folder)


@pytest.mark.nightly
def test_the_page_of_libraries_prints_the_program_that_its_command_writes(folder):
    page = DOCS / "libraries.md"
    printed = next(code for language, code in blocks(page) if language == "py")
    run(page, folder)
    written = (folder / "demo-output" / "bookcase_kenney_open.shape").read_text(encoding="utf-8")
    assert COMMENT.sub("", written) == printed


@pytest.mark.parametrize("page", [README, *(DOCS / f"{page}.md" for page in PAGES)], ids=lambda page: page.stem)
def test_the_programs_of_a_page_are_programs(page):
    for language, code in blocks(page):
        if language == "py":
            below = page.stem == "language" and "width, depth, height" not in code
            program = sp.parse(f"{WHOLE}\n{code}" if below else code, page.name)
            assert sp.unroll(sp.encode(program)).mask.any()
            assert program.source is None or program.source.warnings == ()


def test_the_page_of_formats_shows_the_desk_of_the_language(tmp_path):
    desk = sp.parse(next(code for language, code in blocks(DOCS / "language.md") if language == "py"))
    text = (DOCS / "formats.md").read_text(encoding="utf-8")
    (script,) = re.findall(r"^```openscad\n(.*?)^```$", text, re.DOTALL | re.MULTILINE)
    assert f"\n{script}\n" in sp.export(desk, tmp_path / "desk.scad").read_text(encoding="utf-8")
    (listed,) = re.findall(r"^```\ncount .*\n((?:.+\n)+)Area", text, re.MULTILINE)
    rows = sp.export(desk, tmp_path / "desk.csv").read_text(encoding="utf-8").splitlines()[1:]
    assert [row.split() for row in listed.splitlines()] == [row.replace(",", " ").split() for row in rows]


def test_the_page_of_the_language_says_what_the_first_line_of_its_examples_is():
    assert f"assume this first line: `{WHOLE}`" in (DOCS / "language.md").read_text(encoding="utf-8")


def test_the_readme_is_short():
    text = README.read_text(encoding="utf-8")
    assert len(text.splitlines()) <= 150
    assert len(text.split()) <= 1500


def test_the_notebook_is_made_from_the_tutorial():
    made = notebook((DOCS / "tutorial.md").read_text(encoding="utf-8"))
    assert json.loads((DOCS / "tutorial.ipynb").read_text(encoding="utf-8")) == made, "run python docs/notebook.py"


def test_all_formats_are_documented():
    text = (DOCS / "formats.md").read_text(encoding="utf-8")
    assert not [suffix for suffix in suffixes() if f"`{suffix}`" not in text]

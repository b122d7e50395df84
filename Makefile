# make demo    infer a program from one example; shows it and leaves picture, GLB and text in demo-output
# make test    linter, type checker and the quick suite; tests of the paper's package if it or they differ from HEAD^
# make lint    linter, formatter and type checker
# make docs    the documentation in build/docs; a warning is an error
# make nightly the suite with many more random cases, every tensor annotation checked, and the tests that take long:
#              40,000 broken files and programs (by hand: python -m tests.fuzz --help), 100 kills; and the documentation
#
# The tables of the paper have a command of their own: shapeprog paper table.
#
# Each makes its own environment in .venv first.  PYTHON=... chooses the interpreter, 3.10 or newer.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
READY := $(VENV)/.ready
DOCS_READY := $(VENV)/.docs-ready
PAPER_TESTS := $(wildcard tests/test_liang2022_*.py) tests/test_cuda.py
PAPER := src/shapeprog/liang2022 tests/liang2022_toys.py $(PAPER_TESTS)

.PHONY: demo test lint docs nightly clean

demo: $(READY)
	$(BIN)/shapeprog infer examples/chair_kenney.obj --unit cm --out demo-output

test: $(READY)
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/python -m pytest -n 2 --dist loadfile -m "not paper"
	git diff --quiet HEAD^ -- $(PAPER) 2>/dev/null || $(BIN)/python -m pytest -n 2 --dist loadfile -m paper $(PAPER_TESTS)

lint: $(READY)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

docs: $(DOCS_READY)
	$(BIN)/python -m sphinx --fail-on-warning --keep-going --nitpicky --fresh-env --quiet docs build/docs

nightly: $(READY)
	$(BIN)/python -m pytest -n 2 --dist loadfile --nightly -m "not nightly" --typecheck
	$(BIN)/python -m pytest -n 2 --dist worksteal --nightly -m nightly
	$(MAKE) docs

clean:
	rm -rf $(VENV) demo-output build/docs

$(READY): pyproject.toml constraints.txt
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --constraint constraints.txt torch
	$(BIN)/python -m pip install --quiet --constraint constraints.txt --editable '.[dev]'
	touch $(READY)

$(DOCS_READY): $(READY)
	$(BIN)/python -m pip install --quiet --constraint constraints.txt --editable '.[docs]'
	touch $(DOCS_READY)

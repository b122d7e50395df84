# make demo    infer a program from one example; shows it and leaves picture, GLB and text in demo-output
# make test    linter, type checker and the quick suite
# make lint    linter, formatter and type checker
# make nightly the suite with many more random cases and every tensor annotation checked
#
# Each makes its own environment in .venv first.  PYTHON=... chooses the interpreter, 3.10 or newer.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
READY := $(VENV)/.ready

.PHONY: demo test lint nightly clean

demo: $(READY)
	$(BIN)/shapeprog infer examples/chair_kenney.obj --out demo-output

test: $(READY)
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/python -m pytest -n 2 --dist loadfile

lint: $(READY)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

nightly: $(READY)
	$(BIN)/python -m pytest -n 2 --dist loadfile --typecheck --hypothesis-profile nightly

clean:
	rm -rf $(VENV) demo-output

$(READY): pyproject.toml constraints.txt
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --constraint constraints.txt torch
	$(BIN)/python -m pip install --quiet --constraint constraints.txt --editable '.[dev]'
	touch $(READY)

"""Options and profiles of the suite."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import hypothesis
import pytest

if TYPE_CHECKING:
    from commands import Run

SOURCE = Path(__file__).parents[1] / "src"

hypothesis.settings.register_profile("quick", max_examples=20, deadline=None, derandomize=True, database=None)
hypothesis.settings.register_profile("nightly", max_examples=1000, deadline=None)
hypothesis.settings.load_profile("quick")


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--typecheck", action="store_true", help="check the shapes of all annotated tensors; slower")
    parser.addoption("--nightly", action="store_true", help="many more random cases, and the tests marked nightly")


def pytest_configure(config: pytest.Config) -> None:
    if config.getoption("--nightly"):
        hypothesis.settings.load_profile("nightly")
    if config.getoption("--typecheck"):
        from jaxtyping import install_import_hook

        files = [path for path in SOURCE.rglob("*.py") if not path.stem.endswith("_kernels")]  # numba compiles those
        names = [".".join(path.relative_to(SOURCE).with_suffix("").parts) for path in files]
        config.addinivalue_line("filterwarnings", "ignore:Do not use the `random` module")  # beartype does
        install_import_hook([name for name in names if not name.endswith("__init__")], "typechecker.check")

    import torch

    torch.set_num_threads(1)  # the suite runs one process per core


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    if config.getoption("--typecheck"):
        refused = pytest.mark.skip(reason="the type checker refuses it first")
        for item in items:
            if item.get_closest_marker("wrong_types"):
                item.add_marker(refused)
    if not config.getoption("--nightly"):
        late = [item for item in items if item.get_closest_marker("nightly")]
        config.hook.pytest_deselected(items=late)
        items[:] = [item for item in items if item not in late]


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter, config: pytest.Config) -> None:
    from tests.fuzz.campaign import tonight

    if config.getoption("--nightly"):
        terminalreporter.write_line(f"seeds of the fuzz suite: {', '.join(map(str, tonight()))}")


@pytest.fixture(autouse=True)
def same_random_state() -> None:
    """Every test begins alike, whichever ran before it in the same process."""
    import numpy as np
    import torch

    torch.manual_seed(0)
    np.random.seed(0)  # noqa: NPY002


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Run:
    """Run the command in an empty folder, as a shell would."""
    from commands import Ended

    from shapeprog.cli import main

    monkeypatch.chdir(tmp_path)

    def call(*words: object) -> Ended:
        with pytest.raises(SystemExit) as end:
            main([str(word) for word in words])
        told = capsys.readouterr()
        code = end.value.code
        return Ended(code if isinstance(code, int) else 0, told.out, told.err)

    return call


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """Inference that always finds the same table, at once."""
    from commands import PROGRAM

    from shapeprog import inference

    def infer(shape, *, progress, **_):
        progress("searching", 0.5)
        program, scores = replace(PROGRAM, frame=shape.frame), {"odd": float("nan")}
        return inference.Result(program, PROGRAM.snap(), scores, "Stopped at once.", (), seconds=0.1)

    monkeypatch.setattr(inference, "infer", infer)

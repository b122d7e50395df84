"""Options and profiles of the suite."""

from __future__ import annotations

from pathlib import Path

import hypothesis
import pytest

SOURCE = Path(__file__).parents[1] / "src"

hypothesis.settings.register_profile("quick", max_examples=20, deadline=None, derandomize=True, database=None)
hypothesis.settings.register_profile("nightly", max_examples=1000, deadline=None)
hypothesis.settings.load_profile("quick")


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--typecheck", action="store_true", help="check the shapes of all annotated tensors; slower")


def pytest_configure(config: pytest.Config) -> None:
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


@pytest.fixture(autouse=True)
def same_random_state() -> None:
    """Every test begins alike, whichever ran before it in the same process."""
    import numpy as np
    import torch

    torch.manual_seed(0)
    np.random.seed(0)  # noqa: NPY002

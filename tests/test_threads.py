"""Threads of a user's process: inference leaves their number as it was, and lets none of torch's stand by."""

from __future__ import annotations

import importlib

import pytest
import torch
from threadpoolctl import threadpool_info, threadpool_limits

from shapeprog.geometry import arrays
from shapeprog.geometry.arrays import one_thread, over_threads


@pytest.fixture(autouse=True)
def two_threads():
    before = torch.get_num_threads()
    torch.set_num_threads(2)
    yield
    torch.set_num_threads(before)


def parts() -> int:
    """In how many parts kernels share their work."""
    found: list[int] = []
    over_threads(lambda first, last: found.append(first), 100)
    return len(found)


def test_torch_has_one_thread_and_kernels_keep_theirs():
    with one_thread():
        assert (torch.get_num_threads(), parts()) == (1, 2)
        with one_thread(kernels=1):
            assert (torch.get_num_threads(), parts()) == (1, 1)
        assert (torch.get_num_threads(), parts()) == (1, 2)
    assert (torch.get_num_threads(), parts(), arrays._kernel_threads) == (2, 2, 0)


def test_linear_algebra_has_one_thread_as_well():
    def threads() -> set[int]:
        return {library["num_threads"] for library in threadpool_info() if library["user_api"] == "blas"}

    with threadpool_limits(2, user_api="blas"):
        assert threads() == {2}
        with one_thread(), one_thread(kernels=1):
            assert threads() == {1}
        assert threads() == {2}


def test_the_number_of_threads_comes_back_after_an_error():
    with pytest.raises(ZeroDivisionError), one_thread():
        raise ZeroDivisionError
    assert torch.get_num_threads() == 2


def test_inference_computes_with_one_thread_of_torch(monkeypatch: pytest.MonkeyPatch):
    module = importlib.import_module("shapeprog.inference.infer")
    monkeypatch.setattr(module, "loaded", lambda shape: 1 / (torch.get_num_threads() - 1))
    with pytest.raises(ZeroDivisionError):
        module.infer("any.obj")
    assert torch.get_num_threads() == 2

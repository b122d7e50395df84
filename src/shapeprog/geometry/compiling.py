"""How kernels are compiled: once, for arrays of one type each, with as little around them as numba allows.

Compiling is what a first run waits for.  Kernels therefore take contiguous arrays of one type each, so that
each is compiled for one signature; what only kernels call has no entrance from Python and no file of its own in the
cache; and divisions are those of numpy, without a check before each.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from numba import njit

Function = Callable[..., Any]


_njit: Any = njit  # whose annotations lack some of its options

LEAN = {"nogil": True, "error_model": "numpy", "no_cfunc_wrapper": True}


def kernel(function: Function) -> Function:
    """A kernel called from Python: kept in the cache, running without the interpreter's lock."""
    compiled: Function = _njit(cache=True, **LEAN)(function)
    return compiled


def helper(function: Function) -> Function:
    """A function that only kernels call."""
    compiled: Function = _njit(no_cpython_wrapper=True, **LEAN)(function)
    return compiled

"""torch, imported on first use, or NumPy instead of it where one program is drawn without gradient.

Importing torch takes longer than drawing a program.  If it is loaded when this module is, the names ``torch`` and
``Tensor`` here are its own.  Otherwise ``torch.stack`` and the like import it when they are called, except within
:func:`on_numpy`: there they work on NumPy arrays, as far as unrolling and the declarations that ship need them.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np

_without_torch: ContextVar[bool] = ContextVar("without_torch", default=False)


@contextmanager
def on_numpy(possible: bool) -> Iterator[None]:
    """Let NumPy take the place of torch within, where that is possible and torch is not loaded yet.

    Parameters
    ----------
    possible
        Whether only built-in declarations are called in the block.  No tensor may be returned from it.
    """
    token = _without_torch.set(possible and "torch" not in sys.modules)
    try:
        yield
    finally:
        _without_torch.reset(token)


def _copied(array: Any, dim: int, index: Any, source: Any) -> Any:
    result = array.copy()
    result[index] = source
    return result


_METHODS: dict[str, Any] = {
    "device": "cpu",
    "requires_grad": False,
    "abs": lambda array: np.abs(array),
    "all": lambda array, dim=None, keepdim=False: np.ndarray.all(array, dim, keepdims=keepdim),
    "clamp": lambda array, min=None, max=None: np.clip(array, min, max),
    "contiguous": lambda array: array,
    "cos": lambda array: np.cos(array),
    "cpu": lambda array: array,
    "detach": lambda array: array,
    "div": lambda array, other, rounding_mode: {"floor": array // other}[rounding_mode],
    "double": lambda array: array.astype(np.float64),
    "clone": lambda array: array.copy(),
    "expand": lambda array, *shape: np.broadcast_to(array, shape, subok=True),
    "flatten": lambda array, start=0: array.reshape(*array.shape[:start], math.prod(array.shape[start:])),
    "gather": lambda array, dim, index: np.take_along_axis(array, index, dim),
    "index_add": lambda array, dim, index, source: _copied(array, dim, index, array[index] + source),  # none twice
    "index_copy": _copied,
    "index_select": lambda array, dim, index: np.take(array, index, dim),
    "long": lambda array: array.astype(np.int64),
    "nan_to_num": lambda array, nan: np.nan_to_num(array, nan=nan),
    "new_zeros": lambda array, *shape: np.zeros(shape, array.dtype).view(type(array)),
    "nonzero": lambda array: np.argwhere(array.view(np.ndarray)).view(type(array)),
    "numpy": lambda array: array.view(np.ndarray),
    "sin": lambda array: np.sin(array),
    "split": lambda array, sizes: np.split(array, np.cumsum(sizes)[:-1]) if sizes else [],
    "sum": lambda array, dim=None, keepdim=False: np.ndarray.sum(array, dim, keepdims=keepdim),
    "to": lambda array, like: array.astype(like if isinstance(like, type) else like.dtype),
    "unbind": lambda array, dim: tuple(np.moveaxis(array, dim, 0)),
    "unflatten": lambda array, dim, shape: array.reshape(*array.shape[:dim], *shape),  # of the last dimension
}
_Array = type("_Array", (np.ndarray,), _METHODS)


def _of_tensors(function: Callable[..., Any]) -> Callable[..., Any]:
    """A function of NumPy that returns arrays with these methods, wherever they are asked to be."""

    def call(*arguments: Any, device: object = None, **named: Any) -> Any:
        result = function(*arguments, **named)
        if type(result) is tuple:
            return [np.asarray(array).view(_Array) for array in result]
        return np.asarray(result).view(_Array)

    return call


_ALIKE = (
    "arange", "argsort", "bincount", "deg2rad", "eye", "full", "full_like", "isin", "maximum", "minimum", "ones_like",
    "sqrt", "stack", "unique", "where", "zeros_like",
)  # fmt: skip
_FUNCTIONS: dict[str, Callable[..., Any]] = {
    **{name: getattr(np, name) for name in _ALIKE},
    "atan2": np.arctan2,
    "cat": np.concatenate,
    "diag_embed": lambda diagonal: diagonal[..., None] * np.eye(diagonal.shape[-1]),
    "from_numpy": np.asarray,
    "searchsorted": lambda row, values, right=False: np.searchsorted(row, values, "right" if right else "left"),
    "tensor": np.array,
    "unique_consecutive": np.unique,  # of sorted numbers
}
_one_hot = _of_tensors(lambda index, classes: np.eye(classes, dtype=np.int64)[index])
_NUMPY = SimpleNamespace(
    **{name: _of_tensors(function) for name, function in _FUNCTIONS.items()},
    linalg=SimpleNamespace(cross=_of_tensors(np.linalg.cross)),
    nn=SimpleNamespace(functional=SimpleNamespace(one_hot=_one_hot)),
    is_grad_enabled=lambda: False, long=np.int64, float32=np.float32, float64=np.float64, pi=math.pi,
)  # fmt: skip


class _Torch:
    """The module, or NumPy; nothing is cached, because threads may differ in which of them they use."""

    def __getattr__(self, name: str) -> Any:
        if _without_torch.get():
            return getattr(_NUMPY, name)
        import torch as module

        return getattr(module, name)


if TYPE_CHECKING or "torch" in sys.modules:
    import torch as torch
    from torch import Tensor as Tensor
else:
    torch, Tensor = _Torch(), _Array

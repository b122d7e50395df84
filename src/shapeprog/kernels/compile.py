"""How kernels are declared, compiled and kept: the one convention of all compiled loops.

    @helper
    def square(x):
        return x * x

    @kernel("void(f8[::1], f8[::1])")
    def squares(values, out):
        for k in range(len(values)):
            out[k] = square(values[k])

A *kernel* is called from Python and has the one signature that it declares, so it is compiled once; a call with other
types is an error.  A *helper* is a plain Python function that kernels call.  Neither needs numba to be imported:
it is loaded when the first kernel is called.  Compiled kernels are kept in numba's cache; a kernel counts as changed
when its own code, that of any helper it reaches, or a constant that these read has changed, in whatever file.

What makes compiling slow is the compiler's front end: a tenth of a second for each helper, and more for its lines.
"""

from __future__ import annotations

import gc
import importlib
import inspect
import os
import threading
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from functools import cache, cached_property
from hashlib import sha256
from types import CodeType, FunctionType
from typing import Any

from shapeprog.errors import ShapeProgError
from shapeprog.processes import Worker, serve

Function = Callable[..., Any]

OPTIONS: dict[str, Any] = {"nogil": True, "error_model": "numpy", "no_cfunc_wrapper": True}
"""Kernels run without the interpreter's lock, and divide as numpy does, without a check before each division."""

MOST = 3
"""Maximum number of further processes that compile, if there are as many cores."""

_lock = threading.RLock()
_helpers: dict[Function, dict[str, Any]] = {}
_kernels: dict[str, Kernel] = {}


def helper(function: Function | None = None, **options: Any) -> Any:
    """Declare a function that only kernels call; it stays a plain one.  Options are numba's, such as ``inline``."""
    if function is None:
        return lambda decorated: helper(decorated, **options)
    plain = inspect.unwrap(function)
    _helpers[plain] = options
    return plain


def kernel(signature: str, **options: Any) -> Callable[[Function], Kernel]:
    """Declare a kernel by its one signature in numba's short words, such as ``"void(f8[:, ::1], i8)"``."""
    return lambda function: Kernel(inspect.unwrap(function), signature, options)


class Kernel:
    """A compiled function, loaded from the cache or compiled when it is first called."""

    def __init__(self, function: Function, signature: str, options: dict[str, Any]) -> None:
        self.function, self.signature, self._options = function, signature, options
        self._compiled: Any = None
        self.__name__, self.__doc__ = function.__name__, function.__doc__
        self.name = f"{function.__module__}:{function.__qualname__}"
        _kernels[self.name] = self

    def __call__(self, *arguments: Any) -> Any:
        """Run it."""
        if self._compiled is None:
            self.compile()
        return self._compiled(*arguments)

    def compile(self) -> None:
        """Load it from the cache, or compile it and keep it there."""
        with _lock, _without_collector():
            if self._compiled is None:
                self._dispatcher.compile(self._types())
                self._dispatcher.disable_compile()
                self._compiled = self._dispatcher

    def load(self) -> bool:
        """Load it from the cache; whether it was there."""
        with _lock:
            if self._compiled is None:
                cache = self._dispatcher._cache
                key = cache._index_key(self._types(), self._dispatcher.targetctx.codegen())
                if key not in cache._cache_file._load_index():
                    return False
            self.compile()
            return True

    @cached_property
    def _dispatcher(self) -> Any:
        numba: Any = importlib.import_module("numba")
        dispatcher = numba.njit(cache=True, **OPTIONS, **self._options)(_linked(self.function))
        # numba only checks the file of the kernel, but the compiled code includes all helpers
        stamp = _digest(self.function, f"{numba.__version__}, bounds checked: {numba.config.BOUNDSCHECK}")
        dispatcher._cache._cache_file._source_stamp = stamp
        return dispatcher

    def _types(self) -> Any:
        sigutils: Any = importlib.import_module("numba.core.sigutils")
        return sigutils.normalize_signature(self.signature)[0]


def prepare(modules: Sequence[str], report: Callable[[str], None] | None = None) -> None:
    """Load or compile all kernels of some modules, given by full name, before they are needed.

    Kernels that are missing in the cache are compiled by several processes at once.  The others take kernels from the
    front, this one from the back, so list modules that import quickly first.  ``report`` is called with a sentence
    before the first compilation, which takes seconds.
    """
    lacking: list[Kernel] = []
    waiting: deque[str] = deque()
    complete = threading.Event()
    threads: list[threading.Thread] = []
    try:
        for name in modules:
            importlib.import_module(name)
            for item in list(_kernels.values()):
                if item.function.__module__ == name and not item.load():
                    if report and not lacking:
                        report("compiling kernels for this machine (first run only, up to half a minute)")
                    lacking.append(item)
                    waiting.append(item.name)
            while waiting and len(threads) < min(max((os.cpu_count() or 2) - 1, 1), MOST):
                threads.append(threading.Thread(target=_serve, args=(waiting, complete), daemon=True))
                threads[-1].start()
        while waiting:
            with suppress(IndexError):  # another process took the last one
                _kernels[waiting.pop()].compile()
    finally:
        waiting.clear()
        complete.set()
    for thread in threads:
        thread.join()
    for item in lacking:  # from the cache now; compiled here should another process have failed
        item.compile()


def _serve(waiting: deque[str], complete: threading.Event) -> None:
    """Have another process compile kernels into the cache, one of the names waiting after another."""
    with suppress(ShapeProgError):  # should it fail, its kernels are compiled here
        worker = Worker("shapeprog.kernels.compile", quiet=True)
        try:
            while name := _next(waiting, complete):
                worker.ask(name)
        finally:
            worker.close()


def _next(waiting: deque[str], complete: threading.Event) -> str:
    """The next name, once there is one; none at the end."""
    while True:
        with suppress(IndexError):
            return waiting.popleft()
        if complete.wait(0.01):
            return ""


def _linked(function: Function) -> FunctionType:
    """A copy of a function whose helpers are compiled ones; the function itself is unchanged."""
    assert isinstance(function, FunctionType)
    helpers = {name: _compiled_helper(value) for name, value in _read(function).items() if _is_helper(value)}
    names = {**function.__globals__, **helpers}
    copy = FunctionType(function.__code__, names, function.__name__, function.__defaults__)
    copy.__qualname__, copy.__module__ = function.__qualname__, function.__module__
    return copy


@cache
def _compiled_helper(function: Function) -> Any:
    """A helper as the compiler wants it: compiled with, and into, the kernels that reach it.

    Literal numbers count as any others, or the compiler would make a version of the helper for each of them.
    """
    numba: Any = importlib.import_module("numba")
    unliteral = importlib.import_module("numba.core.types").unliteral
    dispatcher = numba.njit(no_cpython_wrapper=True, **OPTIONS, **_helpers[function])(_linked(function))
    template = dispatcher.get_call_template
    dispatcher.get_call_template = lambda args, kws: template(tuple(map(unliteral, args)), kws)
    return dispatcher


def _read(function: FunctionType) -> dict[str, Any]:
    """The module-level values that a function uses, by name."""
    module = function.__globals__
    return {name: module[name] for name in function.__code__.co_names if name in module}


def _is_helper(value: Any) -> bool:
    return isinstance(value, FunctionType) and value in _helpers


def _digest(function: Function, compiler: str) -> str:
    """Changes with the code of a kernel, of the helpers it reaches, and with every number or text that these read."""
    digest, visited, stack = sha256(compiler.encode()), set[Function](), [function]
    while stack:
        current = stack.pop()
        if current in visited or not isinstance(current, FunctionType):
            continue
        visited.add(current)
        code, values = current.__code__, _read(current)
        read = sorted((name, repr(value)) for name, value in values.items() if isinstance(value, (int, float, str)))
        constants = [value.co_code if isinstance(value, CodeType) else value for value in code.co_consts]
        digest.update(repr((code.co_name, code.co_code, constants, code.co_names, read)).encode())
        stack += [value for value in values.values() if isinstance(value, FunctionType)]
    return digest.hexdigest()


@contextmanager
def _without_collector() -> Iterator[None]:
    """The compiler creates many objects that stay alive, so garbage collection only costs time."""
    before = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if before:
            gc.enable()


def _compile(name: str) -> str:
    """The work of another process: compile a kernel into the cache, given its name."""
    from shapeprog.kernels import compile as room  # not the copy of this module that runs as a script

    importlib.import_module(name.partition(":")[0])
    room._kernels[name].compile()
    return name


if __name__ == "__main__":
    serve(_compile)

"""How kernels are declared, compiled and kept: the one convention of all compiled loops.

    @helper
    def square(x):
        return x * x

    @kernel("void(f8[::1], f8[::1])")
    def squares(values, out):
        for k in range(len(values)):
            out[k] = square(values[k])

A *kernel* is called from Python and has the one signature that it declares; a call with other types is an error.  A
*helper* is a plain Python function that kernels call.  Numba is imported when the first kernel is called.

Compiled kernels are kept in numba's cache.  That compares the file of the kernel alone, but the code of its helpers is
compiled into it: the name under which a kernel is kept therefore has a digest of all code and constants it reaches.
"""

from __future__ import annotations

import importlib
import inspect
import os
import subprocess
import sys
import threading
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from functools import cache, cached_property
from hashlib import sha256
from pathlib import Path
from types import CodeType, FunctionType
from typing import Any

Function = Callable[..., Any]

OPTIONS: dict[str, Any] = {"nogil": True, "error_model": "numpy", "no_cfunc_wrapper": True}
"""Kernels run without the interpreter's lock, and divide as numpy does, without a check before each division."""

MOST = 3  # processes that compile in parallel with this one, at most, where there are as many cores


_lock = threading.RLock()
_helpers: dict[Function, dict[str, Any]] = {}
_kernels: dict[str, Kernel] = {}


def helper(function: Function | None = None, **options: Any) -> Any:
    """Declare a function that kernels call; it stays a plain one.  Options are numba's, such as ``forceinline``."""
    if function is None:
        return lambda declared: helper(declared, **options)
    plain = inspect.unwrap(function)
    _helpers[plain] = options
    return plain


def kernel(signature: str) -> Callable[[Function], Kernel]:
    """Declare a kernel by its one signature in numba's short form, such as ``"void(f8[:, ::1], i8)"``."""
    return lambda function: Kernel(inspect.unwrap(function), signature)


class Kernel:
    """A compiled function, loaded from the cache or compiled when it is first called."""

    def __init__(self, function: Function, signature: str) -> None:
        self.function, self.signature = function, signature
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
        with _lock:
            if self._compiled is None:
                with suppress(OSError):  # on a full disk, it is compiled but not kept
                    self._dispatcher.compile(self.signature)
                self._dispatcher.disable_compile()
                self._compiled = self._dispatcher

    def load(self) -> bool:
        """Load it from the cache; returns whether it was there."""
        with _lock:
            if self._compiled is None:
                folder = Path(self._dispatcher.stats.cache_path)
                if not any(folder.glob(f"*{self._dispatcher.__qualname__}-*.nbi")):
                    return False
            self.compile()
            return True

    @cached_property
    def _dispatcher(self) -> Any:
        numba: Any = importlib.import_module("numba")
        copy = _linked(self.function)
        copy.__qualname__ = f"{self.function.__name__}_{self._digest()}"
        return numba.njit(cache=True, **OPTIONS)(copy)

    def _digest(self) -> str:
        """Changes with the kernel, the helpers it reaches, every number or text that these read, and the compiler."""
        numba: Any = importlib.import_module("numba")
        host = importlib.import_module("llvmlite.binding").get_host_cpu_name()
        changed = Path(self.function.__code__.co_filename).stat().st_mtime_ns  # which numba compares too
        digest, visited, stack = sha256(), set[Function](), [self.function]
        digest.update(repr((numba.__version__, numba.config.BOUNDSCHECK, host, changed)).encode())
        while stack:
            current = stack.pop()
            if current in visited:
                continue
            visited.add(current)
            code, names = current.__code__, current.__globals__
            values = {name: names[name] for name in code.co_names if name in names}
            read = sorted((name, repr(value)) for name, value in values.items() if isinstance(value, (int, float, str)))
            constants = [value.co_code if isinstance(value, CodeType) else value for value in code.co_consts]
            digest.update(repr((code.co_name, code.co_code, constants, code.co_names, read)).encode())
            stack += [value for value in values.values() if isinstance(value, FunctionType)]
        return digest.hexdigest()[:16]


def modules_of(*paths: str) -> list[str]:
    """Names of the modules with kernels in folders, such as ``geometry/``, and in files, as ``geometry/surface``."""
    root = Path(__file__).parents[1]
    files = (file for path in paths for file in sorted(root.glob(f"{path}*_kernels.py")))
    return [".".join(["shapeprog", *file.relative_to(root).with_suffix("").parts]) for file in files]


def prepare(modules: Sequence[str], tell: Callable[[str], None] | None = None) -> None:
    """Compile all kernels of some modules, so that nobody waits for them later.

    What the cache lacks is compiled by several processes at once, which share only the cache: the others begin
    with the first modules, this one with the last.

    Parameters
    ----------
    modules
        Their full names.
    tell
        Called with a sentence before anything is compiled, which takes seconds.
    """
    lacking = [kernel for kernel in _of(modules) if not kernel.load()]
    if not lacking:
        return
    if tell:
        tell("compiling kernels for this machine (first run only, up to half a minute)")
    count = min(max((os.cpu_count() or 2) - 1, 1), MOST)
    children: list[subprocess.Popen[bytes]] = []
    try:
        with suppress(OSError):  # where no other can be started, all is compiled here
            children += [_other(f"{number}/{count}", modules) for number in range(count)]
        for kernel in reversed(lacking):
            kernel.compile()
    finally:
        for child in children:
            child.kill()
            child.communicate()


def _of(modules: Iterable[str]) -> Iterator[Kernel]:
    """The kernels of some modules, which are imported one by one."""
    for name in modules:
        importlib.import_module(name)
        yield from [kernel for kernel in _kernels.values() if kernel.function.__module__ == name]


def _other(share: str, modules: Sequence[str]) -> subprocess.Popen[bytes]:
    """Start a process that compiles a share of the kernels of some modules; Ctrl-C does not reach it."""
    path = os.pathsep.join(entry for entry in sys.path if entry)
    return subprocess.Popen(
        [sys.executable, "-m", "shapeprog.kernels.compile", share, *modules], env={**os.environ, "PYTHONPATH": path},
        stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True,
    )  # fmt: skip


def _serve(share: str, modules: Sequence[str]) -> None:
    """Compile a share of the kernels, until the process that holds the standard input ends."""
    threading.Thread(target=lambda: (sys.stdin.read(), os._exit(0)), daemon=True).start()
    number, count = map(int, share.split("/"))
    for index, kernel in enumerate(_of(modules)):
        if index % count == number:
            kernel.compile()


def _linked(function: Function) -> FunctionType:
    """A copy of a function that calls compiled helpers; the function itself is unchanged."""
    names = function.__globals__
    helpers = {name: names[name] for name in function.__code__.co_names if isinstance(names.get(name), FunctionType)}
    replaced = {name: _compiled(value) for name, value in helpers.items() if value in _helpers}
    copy = FunctionType(function.__code__, {**names, **replaced}, function.__name__, function.__defaults__)
    copy.__module__ = function.__module__
    return copy


@cache
def _compiled(function: Function) -> Any:
    """A helper for the compiler, which makes it a part of the kernels that reach it."""
    numba: Any = importlib.import_module("numba")
    dispatcher = numba.njit(no_cpython_wrapper=True, **OPTIONS, **_helpers[function])(_linked(function))
    template = dispatcher.get_call_template  # else each literal number is a version: 15 % slower
    dispatcher.get_call_template = lambda args, kws: template(tuple(map(numba.types.unliteral, args)), kws)
    return dispatcher


if __name__ == "__main__":
    from shapeprog.kernels import compile as module  # not the copy of this module that runs as a script

    module._serve(sys.argv[1], sys.argv[2:])

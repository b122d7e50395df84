"""Data sets of synthetic shapes, stored as programs: a few hundred bytes a shape, drawn when they are read."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import torch

from shapeprog.data.arrays import read_numpy
from shapeprog.data.reading import few
from shapeprog.errors import InputError, OutputError
from shapeprog.files import atomic_path
from shapeprog.language.statement import SLOTS, language
from shapeprog.language.tensors import Code

_SUFFIX = ".npz"
_ARRAYS = ("ids", "parameters", "statement_ids", "statement_names")
_CURE = "write one with: shapeprog sample wide --programs FILE.npz"


def write_programs(path: str | os.PathLike[str], code: Code) -> int:
    """Write programs (B, K, J) of whole numbers, whole or not at all, and return how many there were.

    The file keeps the names of the statements, so that a language which numbers them differently is noticed.

    Raises
    ------
    OutputError
        If a number is not whole or does not fit 16 bits, or if the file cannot be written.
    """
    target = Path(path)
    if target.suffix != _SUFFIX:
        raise OutputError(f"{target} is no name for a data set of programs", f"end it in {_SUFFIX}")
    numbers = code.parameters.detach().cpu().double().numpy()
    limits = np.iinfo(np.int16)
    if not (np.isfinite(numbers) & (numbers == np.rint(numbers)) & (abs(numbers) <= limits.max)).all():
        raise OutputError(
            "a data set of programs holds whole numbers of 16 bits only", "round the parameters first: code.parameters"
        )
    ids = code.ids.detach().cpu().numpy()
    known = [(declared.id, declared.name) for declared in language() if (ids == declared.id).any()]
    with atomic_path(target) as temporary, temporary.open("wb") as stream:
        np.savez_compressed(
            stream,
            ids=ids.astype(np.int16),
            parameters=numbers.astype(np.int8 if abs(numbers).max(initial=0) <= np.iinfo(np.int8).max else np.int16),
            statement_ids=np.array([number for number, _ in known], np.int16),
            statement_names=np.array([name for _, name in known], np.str_),
        )
    return len(ids)


def read_programs(path: str | os.PathLike[str]) -> Code:
    """The programs of a file that ``write_programs`` made.

    Raises
    ------
    InputError
        If there is no such file, it is none of those, it is damaged, or its statements are not those in force.
    """
    target = Path(path)
    arrays = read_numpy(target, _ARRAYS)
    missing = [name for name in _ARRAYS if name not in arrays]
    if missing:
        raise InputError(f"{target.name} is no data set of programs: it has no {' and no '.join(missing)}", _CURE)
    ids, numbers, statement_ids, names = (arrays[name] for name in _ARRAYS)
    if ids.ndim != 3 or numbers.shape != (*ids.shape, SLOTS) or {ids.dtype.kind, numbers.dtype.kind} != {"i"}:
        raise InputError(
            f"{target.name}: ids are {few([ids.dtype])} {ids.shape} and parameters {few([numbers.dtype])} "
            f"{numbers.shape}, not whole numbers (B, K, J) and (B, K, J, {SLOTS})", _CURE
        )  # fmt: skip
    if names.dtype.kind != "U" or names.ndim != 1 or names.shape != statement_ids.shape:
        raise InputError(f"{target.name}: its statements are no list of names with an id each", _CURE)
    for number, name in zip(statement_ids.tolist(), names.tolist(), strict=True):
        if name not in language() or language()[name].id != number:
            raise InputError(
                f"{target.name} uses the statement {name!r} with id {number}, which the language in force does not "
                "have", "load the module that declares it with --with"
            )  # fmt: skip
    return Code(torch.from_numpy(ids.astype(np.int64)), torch.from_numpy(numbers.astype(np.float32)))

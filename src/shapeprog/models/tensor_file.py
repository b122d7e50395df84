"""Safetensors files: their headers, looked at closely before anything is read, and their bytes.

A header tells name, type, shape and place of every tensor, so a file that is cut, damaged or of another kind is known
by its header alone: the tensors must follow each other without gaps and end where the file ends.
"""

from __future__ import annotations

import json
import math
import stat
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from shapeprog.errors import InputError

WIDTHS = {
    "BOOL": 1, "U8": 1, "I8": 1, "F8_E4M3": 1, "F8_E5M2": 1, "F8_E8M0": 1,
    "U16": 2, "I16": 2, "F16": 2, "BF16": 2, "U32": 4, "I32": 4, "F32": 4, "U64": 8, "I64": 8, "F64": 8, "C64": 8,
}  # fmt: skip
"""Bytes of one number of each type."""

METADATA = "__metadata__"
"""The one entry of a header that is no tensor: texts by name."""

_LARGEST_HEADER = 10 << 20
_LENGTH = 8


@dataclass(frozen=True)
class Header:
    """What a file says it holds.

    Parameters
    ----------
    metadata
        Texts by name.
    tensors
        Type and shape by name.
    size
        Bytes of the file.
    """

    metadata: dict[str, str]
    tensors: dict[str, tuple[str, tuple[int, ...]]]
    size: int


def read_header(path: Path) -> Header:
    """The header of a file, which fits the size of the file.

    Raises
    ------
    InputError
        If there is no such file, or it is no safetensors file, or is damaged or cut short.
    """
    try:
        kept = path.stat()
        if stat.S_ISDIR(kept.st_mode):
            cure = f"list what it holds: shapeprog models {path}"
            raise InputError(f"{path} is a folder, not a file of weights", cure)
        if not stat.S_ISREG(kept.st_mode):
            raise InputError(f"{path} is no regular file", "give a file on a disk")
        with open(path, "rb") as file:
            length = int.from_bytes(file.read(_LENGTH), "little")
            text = file.read(min(length, _LARGEST_HEADER))
    except FileNotFoundError as error:
        raise InputError(f"there is no file {path}", "check the path; list weights with: shapeprog models") from error
    except OSError as error:
        raise InputError(f"cannot read {path}: {error.strerror}", "check the path and its permissions") from error
    size = kept.st_size
    if not text.startswith(b"{"):
        raise InputError(
            f"{path} is no safetensors file", "published .t7 files become one by: shapeprog import-weights"
        )
    if length > max(size - _LENGTH, 0):
        raise _cut(path, size)
    if len(text) < length:
        raise _broken(path, f"is larger than {_LARGEST_HEADER >> 20} MB")
    try:
        content = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise _broken(path, "is no JSON") from error
    metadata = content.pop(METADATA, {})
    if not isinstance(metadata, dict) or not all(isinstance(each, str) for each in metadata.values()):
        raise _broken(path, "holds metadata that is no text")
    tensors, end = {}, 0
    for start, stop, name, dtype, shape in sorted(_entries(path, content)):
        if start != end or stop != start + WIDTHS[dtype] * math.prod(shape):
            raise _broken(path, f"puts {name[:80]!r} where it cannot be")
        tensors[name], end = (dtype, shape), stop
    if size < _LENGTH + length + end:
        raise _cut(path, size)
    if size > _LENGTH + length + end:
        raise InputError(f"{path} goes on after its last tensor", "copy or make it again")
    return Header(metadata, tensors, size)


def read_tensors(path: Path) -> dict[str, Tensor]:
    """All tensors of a file whose header has been read.

    Raises
    ------
    InputError
        If the library finds it damaged after all.
    """
    from safetensors import SafetensorError
    from safetensors.torch import load_file

    try:
        return load_file(path)
    except (SafetensorError, OSError, KeyError) as error:
        raise InputError(f"the tensors of {path} cannot be read", "copy or make it again") from error


def file_bytes(tensors: Mapping[str, Tensor], metadata: Mapping[str, str]) -> bytes:
    """The bytes of a file: the same for the same tensors and texts, whose order in the header is that of their names.

    The library alone writes the texts in the order of a hash table, which is another in every process.
    """
    from safetensors.torch import save

    content = save(dict(tensors))
    length = int.from_bytes(content[:_LENGTH], "little")
    header = json.loads(content[_LENGTH : _LENGTH + length])
    told = json.dumps({METADATA: dict(sorted(metadata.items())), **header}, separators=(",", ":"), ensure_ascii=False)
    text = told.encode()
    text += b" " * (-len(text) % _LENGTH)  # tensors begin at a multiple of eight bytes
    return len(text).to_bytes(_LENGTH, "little") + text + content[_LENGTH + length :]


def same_kind(dtype: str, wanted: torch.dtype) -> bool:
    """Whether numbers of a type of a file can stand for those of a network: real ones, or whole ones of 64 bits."""
    return dtype in ("F32", "F16", "BF16") if wanted.is_floating_point else dtype == "I64"


def _entries(path: Path, content: dict[str, Any]) -> Iterator[tuple[int, int, str, str, tuple[int, ...]]]:
    """First and last byte, name, type and shape of each tensor."""
    for name, entry in content.items():
        told: dict[str, Any] = entry if isinstance(entry, dict) else {}
        dtype, shape, place = told.get("dtype"), told.get("shape", ""), told.get("data_offsets", "")
        if not isinstance(dtype, str) or dtype not in WIDTHS:
            raise _broken(path, f"tells no known type of {name[:80]!r}")
        if not _whole(shape) or not _whole(place) or len(place) != 2:
            raise _broken(path, f"tells no shape and place of {name[:80]!r}")
        yield place[0], place[1], name, dtype, tuple(shape)


def _whole(numbers: Any) -> bool:
    return isinstance(numbers, list) and all(type(each) is int and each >= 0 for each in numbers)


def _broken(path: Path, what: str) -> InputError:
    return InputError(f"{path} is no safetensors file: its header {what}", "copy or make it again")


def _cut(path: Path, size: int) -> InputError:
    return InputError(f"{path} is cut short: it has only {size} bytes", "copy or download it again")

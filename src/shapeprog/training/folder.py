"""The folder of a run: its state, its log, and the lock that keeps two processes from writing into it."""

from __future__ import annotations

import contextlib
import json
import math
import os
from collections.abc import Iterator, Mapping
from pathlib import Path

from shapeprog.errors import InputError, ShapeProgError
from shapeprog.files import make_folder, output_error, write_bytes, write_text

STATE, WEIGHTS, BEST, LOG, LOCK = "state.safetensors", "weights.safetensors", "best.safetensors", "log.jsonl", "lock"

Record = dict[str, float]
"""What one step has to tell, by name: always ``step`` and ``visits``."""


@contextlib.contextmanager
def locked(folder: Path, needed: bool = True) -> Iterator[None]:
    """The folder, made if missing, for this process alone; the lock falls with the process, however it ends.

    Parameters
    ----------
    needed
        False for a process that writes nothing, which needs no lock.

    Raises
    ------
    ShapeProgError
        If another process trains into it.
    OutputError
        If it cannot be written.
    """
    if not needed:
        yield
        return
    path = make_folder(folder) / LOCK
    try:
        stream = path.open("a+")
    except OSError as error:
        raise output_error(path, error) from error
    with stream:
        if not _take(stream.fileno()):
            raise ShapeProgError(
                f"another process is training into {folder}", "wait for it, stop it, or choose another folder"
            )
        yield


def _take(file: int) -> bool:
    """Lock an open file if nobody else has."""
    try:
        if os.name == "nt":
            import msvcrt

            msvcrt.locking(file, msvcrt.LK_NBLCK, 1)  # type: ignore[attr-defined,unused-ignore]
        else:
            import fcntl

            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return False
    return True


def read_state(folder: Path, restart: bool) -> bytes | None:
    """The bytes of the state in a folder; ``None`` where there is none or the run shall begin anew.

    Raises
    ------
    InputError
        If it cannot be read.
    """
    path = folder / STATE
    if restart or not path.exists():
        return None
    try:
        return path.read_bytes()
    except OSError as error:
        raise InputError(f"cannot read {path}: {error.strerror}", "check the file, or begin with --restart") from error


def write_state(folder: Path, content: bytes) -> None:
    """Keep a state, whole or not at all: the last good one stays if this fails."""
    write_bytes(folder / STATE, content)


class Log:
    """Records as lines of JSON in ``log.jsonl`` and, if asked for, as curves for TensorBoard.

    Parameters
    ----------
    folder
        Of the run; ``None`` for a process that writes nothing.
    step
        Step it goes on from: what an interrupted run logged after it is dropped.
    tensorboard
        Whether to write curves too.

    Raises
    ------
    ShapeProgError
        If TensorBoard is asked for and not installed.
    """

    def __init__(self, folder: Path | None, step: int, tensorboard: bool = False) -> None:
        self._path = self._curves = None
        if folder is None:
            return
        self._path = folder / LOG
        kept = [json.dumps(each) for each in read_log(folder) if each["step"] <= step]
        write_text(self._path, "".join(f"{line}\n" for line in kept))
        if tensorboard:
            self._curves = _curves(folder, step)

    def __enter__(self) -> Log:
        return self

    def __exit__(self, *_: object) -> None:
        if self._curves is not None:
            self._curves.close()

    def write(self, record: Mapping[str, float]) -> None:
        """Add a record."""
        if self._path is None:
            return
        finite = {name: value for name, value in record.items() if math.isfinite(value)}
        try:
            with self._path.open("a", encoding="utf-8") as stream:
                stream.write(json.dumps(finite) + "\n")
            if self._curves is not None:
                for name, value in finite.items():
                    self._curves.add_scalar(name, value, int(record["step"]))
        except OSError as error:
            raise output_error(self._path, error) from error


def read_log(folder: Path) -> list[Record]:
    """The records of a run, in order; a line that was cut short ends them."""
    path = folder / LOG
    records: list[Record] = []
    for line in path.read_text(encoding="utf-8").splitlines() if path.exists() else []:
        try:
            record = json.loads(line)
        except ValueError:
            break
        records.append(record)
    return records


def _curves(folder: Path, step: int):  # type: ignore[no-untyped-def]  # a SummaryWriter, which may not be installed
    try:
        from torch.utils.tensorboard import SummaryWriter
    except ImportError as error:
        raise ShapeProgError("TensorBoard is not installed", "pip install 'shapeprog[train]'") from error
    return SummaryWriter(str(folder / "tensorboard"), purge_step=step + 1, flush_secs=10)

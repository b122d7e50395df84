"""The folder of a run: its state, its log, and the lock that keeps two processes from writing into it."""

from __future__ import annotations

import contextlib
import json
import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from shapeprog.errors import InputError, ShapeProgError
from shapeprog.files import append_line, lock, make_folder, output_error, sync, write_bytes, write_text
from shapeprog.training.state import card_of

STATE, WEIGHTS, BEST, LOG, LOCK = "state.safetensors", "weights.safetensors", "best.safetensors", "log.jsonl", "lock"
PREVIOUS = "previous.safetensors"
"""The state before the last one."""

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
        if not lock(stream.fileno()):
            raise ShapeProgError(
                f"another process is training into {folder}", "wait for it, stop it, or choose another folder"
            )
        yield


def read_state(folder: Path, restart: bool) -> bytes | None:
    """The bytes of the state in a folder; ``None`` where it holds no run or the run shall begin anew.

    Raises
    ------
    InputError
        If it cannot be read, is damaged, or is missing from a run: names the last state that is good.
    """
    path = folder / STATE
    if restart:
        return None
    if not path.exists():
        if (folder / LOG).exists():
            raise _lost(folder, f"{folder} holds the log of a run but no {STATE}")
        return None
    content = _content(path)
    try:
        card_of(content, str(path))
    except InputError as error:
        raise _lost(folder, error.message) from error
    return content


def _content(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise InputError(f"cannot read {path}: {error.strerror}", "check the file, or begin with --restart") from error


def _lost(folder: Path, problem: str) -> InputError:
    """The error for a run whose state is lost, with what it can go on from."""
    path = folder / PREVIOUS
    try:
        step = card_of(_content(path), str(path))["step"]
    except InputError:
        return InputError(f"{problem}; there is no other state", "begin anew with --restart")
    return InputError(
        f"{problem}; the last good state is {path}, of step {step}",
        f"rename it to {STATE} and give the same command, which then goes on from there; or begin anew with --restart",
    )


def begin_state(folder: Path, content: bytes) -> None:
    """Keep the first state of a run, in the place of whatever run the folder held."""
    with contextlib.suppress(OSError):
        (folder / PREVIOUS).unlink(missing_ok=True)
    write_bytes(folder / STATE, content)


def write_state(folder: Path, content: bytes) -> None:
    """Keep a state, whole or not at all, and beside it the one before."""
    path = folder / STATE
    with contextlib.suppress(OSError):  # there is none, or it cannot be read
        write_bytes(folder / PREVIOUS, path.read_bytes())
    write_bytes(path, content)


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
    InputError
        If the log that is gone on with is damaged, or lacks records.
    ShapeProgError
        If TensorBoard is asked for and not installed.
    """

    def __init__(self, folder: Path | None, step: int, tensorboard: bool = False) -> None:
        self._path = self._curves = None
        if folder is None:
            return
        self._path = folder / LOG
        if step == 0:
            write_text(self._path, "")
        elif self._path.exists():
            records = read_log(folder)
            unbroken = [each for place, each in enumerate(records) if each["step"] == records[0]["step"] + place]
            kept = [each for each in unbroken if each["step"] <= step]
            if not kept or kept[-1]["step"] < step:
                raise _broken(self._path, f"it does not reach to step {step}, that of the state", kept)
            write_text(self._path, "".join(f"{json.dumps(each)}\n" for each in kept))
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
        append_line(self._path, json.dumps(finite))
        if self._curves is not None:
            try:
                for name, value in finite.items():
                    self._curves.add_scalar(name, value, int(record["step"]))
            except OSError as error:
                raise output_error(self._path.parent, error) from error

    def settle(self) -> None:
        """See to it that the records are on the disk, before a state that relies on them."""
        if self._path is not None:
            sync(self._path)


def read_log(folder: Path) -> list[Record]:
    """The records of a run, in order; a last line that was cut short is left out.

    Raises
    ------
    InputError
        If the log cannot be read or another line of it is damaged: names the last record that is good.
    """
    path = folder / LOG
    if not path.exists():
        return []
    *lines, _ = _content(path).split(b"\n")
    records: list[Record] = []
    for number, line in enumerate(lines, 1):
        try:
            record = json.loads(line)
            if not (isinstance(record["step"], int) and all(isinstance(each, int | float) for each in record.values())):
                raise TypeError
        except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
            raise _broken(path, f"line {number} is no record", records) from error
        records.append(record)
    return records


def _broken(path: Path, problem: str, good: Sequence[Record]) -> InputError:
    """The error for a log that does not belong to the state beside it any more."""
    last = f"the last good record is that of step {good[-1]['step']:.0f}" if good else "there is no good record"
    return InputError(
        f"the log {path} is damaged: {problem}; {last}",
        "the state is not: move the log away and the run goes on with a new one, or begin anew with --restart",
    )


def _curves(folder: Path, step: int):  # type: ignore[no-untyped-def]  # a SummaryWriter, which may not be installed
    try:
        from torch.utils.tensorboard import SummaryWriter
    except ImportError as error:
        raise ShapeProgError("TensorBoard is not installed", "pip install 'shapeprog[train]'") from error
    return SummaryWriter(str(folder / "tensorboard"), purge_step=step + 1, flush_secs=10)

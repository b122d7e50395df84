"""Commands that train: pretrain a generator, train the neural executor."""

from __future__ import annotations

import shlex
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeVar

import typer

from shapeprog.cli import terminal
from shapeprog.errors import InputError

if TYPE_CHECKING:
    from shapeprog.training.engine import Engine
    from shapeprog.training.folder import Record
    from shapeprog.training.settings import Settings

Folder = Annotated[Path, typer.Argument(help="Folder of the run; goes on with the run that it holds.")]
Visits = Annotated[int | None, typer.Option(help="Shapes to learn from, in all.")]
Batch = Annotated[int | None, typer.Option(help="Shapes of one step in each process.")]
Rate = Annotated[float | None, typer.Option(help="Largest rate of learning.")]
Schedule = Annotated[str | None, typer.Option(help="How the rate falls: cosine, constant or steps.")]
Precision = Annotated[str | None, typer.Option(help="bf16 or float32.")]
ValidateEvery = Annotated[int | None, typer.Option(help="Visits between validations; 0: only at the end.")]
Device = Annotated[str, typer.Option(help="auto, cpu or cuda.")]
Threads = Annotated[int | None, typer.Option(help="Threads of torch.", min=1)]
Restart = Annotated[bool, typer.Option("--restart", help="Begin anew even if the folder holds a run.")]
TensorBoard = Annotated[bool, typer.Option("--tensorboard", help="Write curves for TensorBoard too.")]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Show no progress.")]

Known = TypeVar("Known", bound=Any)


def pretrain_command(
    folder: Folder,
    preset: Annotated[str, typer.Option(help="Settings to begin with: default or tian2019.")] = "default",
    design: Annotated[str | None, typer.Option(help="Network.")] = None,
    prior: Annotated[str | None, typer.Option(help="Synthetic furniture: narrow or wide.")] = None,
    visits: Visits = None,
    batch: Batch = None,
    rate: Rate = None,
    schedule: Schedule = None,
    warm_up: Annotated[int | None, typer.Option(help="Visits over which the rate rises.")] = None,
    decay: Annotated[float | None, typer.Option(help="Weight decay.")] = None,
    clip: Annotated[float | None, typer.Option(help="Bound of the gradient; 0 for none.")] = None,
    precision: Precision = None,
    shapes: Annotated[int | None, typer.Option(help="Number of different shapes; 0: an endless stream.")] = None,
    blocks: Annotated[int | None, typer.Option(help="Most blocks of a program.")] = None,
    order: Annotated[str | None, typer.Option(help="Order of the blocks: coverage or written.")] = None,
    rows: Annotated[int | None, typer.Option(help="Canvases learned from in each shape; 0: all.")] = None,
    sampled: Annotated[float | None, typer.Option(help="Share of steps on canvases of its own drawing.")] = None,
    seed: terminal.Seed = 0,
    val: Annotated[list[Path] | None, typer.Option("--val", help="A pack to validate on; may be given again.")] = None,
    start: Annotated[str | None, typer.Option("--from", help="Weights to begin from: a file or a name.")] = None,
    validate_every: ValidateEvery = None,
    device: Device = "auto",
    threads: Threads = None,
    restart: Restart = False,
    tensorboard: TensorBoard = False,
    modules: terminal.With = None,
    quiet: Quiet = False,
) -> None:
    """Pretrain a generator on synthetic furniture: supervised, from an endless stream.

    Interrupted by Ctrl-C, or killed, it goes on exactly where it was when the same command is given again. Several
    processes: torchrun --nproc-per-node 2 -m shapeprog pretrain ...
    """
    from shapeprog.training.engine import Engine
    from shapeprog.training.pretrain import PRESETS, pretrain

    terminal.load_modules(modules)
    if preset not in PRESETS:
        raise InputError(f"there is no preset {preset!r}", f"choose one of {', '.join(PRESETS)}")
    settings = given(PRESETS[preset], locals())
    with stopping() as stop:
        engine = Engine(device, settings.precision, threads)
        records = pretrain(
            folder, settings, engine, packs=val or (), start=start, command=command_line(), restart=restart, stop=stop,
            tensorboard=tensorboard,
        )  # fmt: skip
        follow(records, folder, settings, engine, stop, quiet)


def train_executor_command(
    folder: Folder,
    prior: Annotated[str | None, typer.Option(help="Synthetic furniture whose blocks are drawn.")] = None,
    visits: Annotated[int | None, typer.Option(help="Blocks to learn from, in all.")] = None,
    batch: Annotated[int | None, typer.Option(help="Blocks of one step in each process.")] = None,
    rate: Rate = None,
    widened: Annotated[float | None, typer.Option(help="Share of blocks whose numbers are moved at random.")] = None,
    spread: Annotated[int | None, typer.Option(help="By how many cells they are moved at most.")] = None,
    precision: Precision = None,
    seed: terminal.Seed = 0,
    validate_every: ValidateEvery = None,
    device: Device = "auto",
    threads: Threads = None,
    restart: Restart = False,
    tensorboard: TensorBoard = False,
    modules: terminal.With = None,
    quiet: Quiet = False,
) -> None:
    """Train the neural executor, which guided and hybrid adaptation draw with, on blocks of synthetic programs.

    It goes on where it was when the same command is given again.
    """
    from shapeprog.training.engine import Engine
    from shapeprog.training.executor import ExecutorSettings, train_executor

    terminal.load_modules(modules)
    settings = given(ExecutorSettings(), locals())
    with stopping() as stop:
        engine = Engine(device, settings.precision, threads)
        records = train_executor(
            folder, settings, engine, command=command_line(), restart=restart, stop=stop, tensorboard=tensorboard
        )
        follow(records, folder, settings, engine, stop, quiet)


def given(preset: Known, options: dict[str, Any]) -> Known:
    """The settings of a preset with the options that were given."""
    names = {field.name for field in fields(preset)}
    return replace(preset, **{name: value for name, value in options.items() if name in names and value is not None})


def command_line() -> str:
    """The command as it was given, for the card of the weights."""
    return shlex.join(["shapeprog", *sys.argv[1:]])


@contextmanager
def stopping() -> Iterator[threading.Event]:
    """An event that the first Ctrl-C, or a request to terminate, sets; a second one interrupts at once.

    One that is ignored, as Ctrl-C is in the background of a script, stays so.

    Memory is kept between steps, which these commands alone want, and which must be said before any is used.
    """
    from shapeprog.training.engine import tune_allocator

    tune_allocator()
    stop = threading.Event()

    def ask(number: int, frame: Any) -> None:
        if stop.is_set():
            raise KeyboardInterrupt
        stop.set()

    before = {each: signal.getsignal(each) for each in (signal.SIGINT, signal.SIGTERM)}
    before = {each: handler for each, handler in before.items() if handler != signal.SIG_IGN}
    for each in before:
        signal.signal(each, ask)
    try:
        yield stop
    finally:
        for each, handler in before.items():
            signal.signal(each, handler)


def follow(
    records: Iterator[Record], folder: Path, settings: Settings, engine: Engine, stop: threading.Event, quiet: bool
) -> None:
    """Show the progress of a run, and at its end what came of it."""
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    console = terminal.errors()
    columns = [TextColumn("{task.completed}/{task.total} visits"), BarColumn(), TextColumn("{task.fields[told]}")]
    silent = quiet or not engine.writes
    last: Record = {}
    with Progress(
        *columns, TimeRemainingColumn(), console=console, disable=silent or not console.is_terminal, transient=True
    ) as bar:
        together = settings.batch * engine.processes
        task = bar.add_task("", total=settings.steps(engine.processes) * together, told="")
        seconds = loss = 0.0
        for record in records:
            share = 0.05 if last else 1.0
            seconds += share * (record["seconds"] - seconds)
            loss += share * (record["loss"] - loss)
            last = record
            bar.update(task, completed=record["visits"], told=f"loss {loss:.3f}, {together / seconds:.1f} shapes/s")
            scores = _scores(record)
            if scores and not silent:
                console.print(f"{record['visits']} visits: {scores}", markup=False)
    if not engine.writes:
        return
    if stop.is_set() and (not last or last["visits"] < settings.visits):
        raise terminal.Interrupted(f"{folder} holds the run; the same command goes on with it")
    if not quiet:
        told = f"trained for {settings.visits} visits" if last else "nothing left to do"
        terminal.output().print(f"{told}; the weights are {folder / 'weights.safetensors'}")


def _scores(record: Record) -> str:
    named = {name.removeprefix("val_"): value for name, value in record.items() if name.startswith("val_")}
    return ", ".join(f"{name} {value:.4g}" for name, value in named.items() if name != "score")

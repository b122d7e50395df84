"""The commands ``shapeprog paper ...``.  Options of training are made from the fields of the settings."""

from __future__ import annotations

import inspect
import re
import shlex
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, get_origin, get_type_hints

import typer

from shapeprog.cli import terminal
from shapeprog.cli.sampling import write_samples
from shapeprog.errors import InputError, ShapeProgError
from shapeprog.liang2022.settings import METHODS, AdaptSettings, ExecutorSettings, PretrainSettings, TrainingSettings

if TYPE_CHECKING:
    from shapeprog.liang2022.loop import Task

app = typer.Typer(no_args_is_help=True, rich_markup_mode=None)

Weights = Annotated[str, typer.Option(help="Weights: a file, or the name of some that ship (see: models).")]
Device = Annotated[str, typer.Option(help="auto, cpu or cuda.")]


def command(name: str) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Add a command whose errors are sentences."""
    return lambda function: app.command(name)(terminal.guarded(function))


@command("infer")
def infer_command(
    inputs: Annotated[list[Path], typer.Argument(help="Meshes, point clouds, voxels, packs or folders.")],
    out: Annotated[Path | None, typer.Option("--out", "-o", help="Folder for a .shape file of each.")] = None,
    weights: Weights = "fast-wide",
    decoder: Annotated[
        str, typer.Option(help="argmax (the network alone), novel, or select: best of 8 blocks for the target.")
    ] = "select",
    blocks: Annotated[int, typer.Option(help="Largest number of blocks.", min=1)] = 10,
    device: Device = "cpu",
) -> None:
    """Write the program of each shape block by block with a generator; see --decoder.

    Example: shapeprog paper infer examples/bench_kenney.obj
    """
    from shapeprog.data import load_all
    from shapeprog.files import make_folder
    from shapeprog.formats import save
    from shapeprog.liang2022.decode import decode
    from shapeprog.liang2022.evaluate import grids
    from shapeprog.liang2022.weights import load_generator

    generator, console, failed = load_generator(weights).to(device), terminal.output(), False
    for _, shape in load_all([str(path) for path in inputs]):
        if isinstance(shape, ShapeProgError):
            terminal.complain(shape)
            failed = True
            continue
        decoded = decode(generator, grids([shape]).to(device), decoder=decoder, blocks=blocks)  # type: ignore[arg-type]
        console.print(f"# {shape.name}: canvas IoU {float(decoded.iou(grids([shape]).to(device))):.3f}")
        terminal.print_program(console, decoded.programs()[0])
        if out is not None:
            save(decoded.programs()[0], make_folder(out) / f"{shape.name}.shape")
    if failed:
        raise typer.Exit(1)


@command("sample")
def sample_command(
    prior: Annotated[str, typer.Argument(help="Synthetic shapes: narrow (as published) or wide.")],
    out: Annotated[Path, typer.Option("--out", "-o", help="Contact sheet to write.")] = Path("sheet.png"),
    count: Annotated[int, typer.Option(help="Number of shapes.", min=1)] = 24,
    seed: terminal.Seed = 0,
) -> None:
    """Draw synthetic shapes on a contact sheet.

    Example: shapeprog paper sample narrow --out narrow.png
    """
    from shapeprog.liang2022.prior import programs

    write_samples(
        prior,
        programs(prior, count, seed),
        seed=seed,
        out=out,
        folder=None,
        pack=None,
        points=0,
        columns=6,
        quiet=False,
    )


@command("models")
def models_command(
    files: Annotated[list[Path] | None, typer.Argument(help="Further files or folders of weights.")] = None,
) -> None:
    """List the weights that ship, and others: network, data, shapes seen, scores.

    Example: shapeprog paper models runs
    """
    from rich import box
    from rich.table import Table

    from shapeprog.liang2022.weights import SHIPPED, SUFFIX, read_card

    table = Table("name", "design", "data", "shapes seen", "seed", "scores", box=box.SIMPLE_HEAD)
    failed = False
    for root in [SHIPPED, *(files or [])]:
        for path in sorted(root.rglob(f"*{SUFFIX}")) if root.is_dir() else [root]:
            try:
                card = read_card(path)
            except ShapeProgError as error:
                terminal.complain(error)
                failed = True
                continue
            name = path.stem if root == SHIPPED else str(path)
            scores = ", ".join(f"{score} {value:.3g}" for score, value in card.scores.items() if score != "score")
            table.add_row(name, card.design, card.data, f"{card.samples_seen:,}", str(card.seed), scores)
    terminal.output().print(table)
    if failed:
        raise typer.Exit(1)


@command("import")
def import_command(
    file: Annotated[Path, typer.Argument(help="Published checkpoint of Tian et al. 2019 (.t7).")],
    out: Annotated[Path, typer.Option("--out", "-o", help="File to write, NAME.safetensors.")],
) -> None:
    """Turn published weights into a file of this package; nothing else in the checkpoint is run.

    Example: shapeprog paper import program_generator_chair.t7 --out chair.safetensors
    """
    from shapeprog.liang2022.weights import read_published, save_weights

    save_weights(out, read_published(file), data="as published by Tian et al. 2019", command=_command_line())
    terminal.output().print(f"wrote {out}")


@command("table")
def table_command(
    packs: Annotated[Path | None, typer.Argument(help="Folder of {bench,cabinet}_{train,val,test}.npz.")] = None,
    results: Annotated[Path, typer.Option(help="Folder of the runs; runs in it are resumed.")] = Path("paper-results"),
    quick: Annotated[
        bool, typer.Option("--quick", help="A five-minute version: synthetic targets if no packs are given.")
    ] = False,
    only: Annotated[list[str] | None, typer.Option(help="Rows to make; all by default.")] = None,
    seeds: Annotated[int, typer.Option(help="Seeds of rows with adaptation.", min=1)] = 1,
    measure: Annotated[bool, typer.Option("--measure", help="Measure finished runs; train nothing.")] = False,
    plots: Annotated[Path | None, typer.Option(help="Folder for plots of sample efficiency and extrapolation.")] = None,
) -> None:
    """Reproduce Table 1 and the rows that go beyond it.

    Example: shapeprog paper table --quick
    """
    from shapeprog.liang2022.experiment import run_table

    for line in run_table(packs, results, quick=quick, only=only, seeds=seeds, measure=measure):
        terminal.output().print(line)
    if plots is not None and packs is not None:
        from shapeprog.files import make_folder
        from shapeprog.liang2022 import plots as figures

        figures.plot_efficiency(packs, results, make_folder(plots) / "adaptation_efficiency.png")
        figures.plot_extrapolation(figures.extrapolation(), plots / "extrapolation.png")


def _training_command(name: str, kind: type[TrainingSettings], make: Callable[[Any, str], Task], doc: str) -> None:
    """Add a command that trains, with an option for each field of its settings."""
    hints, helps = get_type_hints(kind), _field_help(kind)

    def run(folder: Path, device: str, threads: int | None, restart: bool, quiet: bool, **options: Any) -> None:
        method = options.pop("method", None)
        loaded = options.pop("with_modules", None)
        values = {key: tuple(map(str, value)) if isinstance(value, list) else value for key, value in options.items()}
        values = {key: value for key, value in values.items() if value not in (None, ())}
        _load_losses(loaded or [], str(values.get("loss", "")))
        if method is not None and method not in METHODS:
            raise InputError(f"unknown method {method!r}", f"choose one of {', '.join(METHODS)}")
        settings = kind(**{**(METHODS[method] if method else {}), **values})
        _follow(folder, settings, make, device, threads, restart, quiet)

    folder = typer.Argument(help="Folder of the run; a run in it is resumed.")
    signature = [_parameter("folder", Path, folder, inspect.Parameter.empty)]
    if kind is AdaptSettings:
        signature.append(_parameter("method", str, typer.Option(help="direct, guided or hybrid."), "direct"))
        with_help = "A Python file that declares a loss with @loss; may be given again."
        signature.append(_parameter("with_modules", list[Path] | None, typer.Option("--with", help=with_help), None))
    for field in fields(kind):
        hint = hints[field.name]
        plain = str if get_origin(hint) is Literal else list[Path] if get_origin(hint) is tuple else hint
        default = "" if field.default in ((), "", 0) else f" [{field.default}]"
        option = typer.Option(f"--{field.name.replace('_', '-')}", help=helps[field.name] + default)
        signature.append(_parameter(field.name, plain | None, option, None))
    signature += [
        _parameter("device", str, typer.Option(help="auto, cpu or cuda."), "auto"),
        _parameter("threads", int | None, typer.Option(help="Threads of torch."), None),
        _parameter("restart", bool, typer.Option("--restart", help="Start over if the folder holds a run."), False),
        _parameter("quiet", bool, typer.Option("--quiet", "-q", help="Print nothing but errors."), False),
    ]
    run.__doc__, run.__name__ = doc, name
    run.__signature__ = inspect.Signature(signature)  # type: ignore[attr-defined]
    run.__annotations__ = {option.name: option.annotation for option in signature}
    command(name)(run)


def _parameter(name: str, kind: Any, option: Any, default: Any) -> inspect.Parameter:
    keyword = inspect.Parameter.POSITIONAL_OR_KEYWORD
    return inspect.Parameter(name, keyword, default=default, annotation=Annotated[kind, option])


def _field_help(kind: type) -> dict[str, str]:
    """Descriptions of the fields in the docstrings of a settings class and its bases."""
    helps: dict[str, str] = {}
    for base in reversed(kind.__mro__):
        section = inspect.cleandoc(base.__doc__ or "").partition("----------\n")[2]
        for names, text in re.findall(r"^(\w[\w, ]*)\n((?:    .*\n?)+)", section, re.MULTILINE):
            helps |= dict.fromkeys(names.split(", "), " ".join(text.split()))
    return helps


def _follow(
    folder: Path, settings: TrainingSettings, make: Callable[[Any, str], Task], device: str, threads: int | None,
    restart: bool, quiet: bool,
) -> None:  # fmt: skip
    """Train with a progress bar; print validations, and what came of it."""
    import torch
    from rich.progress import Progress

    from shapeprog.liang2022.loop import BEST, WEIGHTS, train, tune_allocator

    tune_allocator()
    if threads is not None:
        torch.set_num_threads(threads)
    console, last = terminal.errors(), {"samples_seen": 0.0}
    with _stop_on_interrupt() as stop, Progress(console=console, disable=quiet or not console.is_terminal) as bar:
        task = bar.add_task("training", total=settings.num_shapes)
        made = make(settings, _command_line())
        for last in train(made, settings, folder, device=device, restart=restart, stop=stop):
            bar.update(task, completed=last["samples_seen"], description=f"loss {last['loss']:.3f}")
            scores = [
                f"{key.removeprefix('val_')} {value:.4g}" for key, value in last.items() if key.startswith("val_")
            ]
            if scores and not quiet:
                console.print(f"{last['samples_seen']:.0f} shapes: {', '.join(scores)}", markup=False)
    if stop.is_set() and last["samples_seen"] < settings.num_shapes:
        raise terminal.Interrupted(f"{folder} holds the run; the same command resumes it")
    if not quiet:
        best = (folder / BEST).exists()
        terminal.output().print(
            f"the weights are {folder / WEIGHTS}" + f"; the best on validation: {folder / BEST}" * best
        )


@contextmanager
def _stop_on_interrupt() -> Iterator[threading.Event]:
    """An event that the first Ctrl-C or SIGTERM sets; the second interrupts at once."""
    stop = threading.Event()

    def ask(number: int, frame: Any) -> None:
        if stop.is_set():
            raise KeyboardInterrupt
        stop.set()

    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    for number, handler in before.items():
        if handler != signal.SIG_IGN:
            signal.signal(number, ask)
    try:
        yield stop
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _load_losses(files: list[Path], wanted: str) -> None:
    """Run Python files that declare losses; warn of those that ``--loss`` does not name."""
    if not files:
        return
    import runpy

    from shapeprog.liang2022.losses import LOSSES

    before = set(LOSSES)
    for file in files:
        if not file.is_file():
            raise InputError(f"there is no file {file}", "check the path")
        try:
            runpy.run_path(str(file))
        except ShapeProgError:
            raise
        except Exception as error:
            raise InputError(f"{file} raised {type(error).__name__}: {error}", "correct it") from error
    for name in LOSSES.keys() - before:
        if name not in wanted:
            terminal.errors().print(f"The loss {name!r} is declared, and --loss does not use it.", style="yellow")


def _command_line() -> str:
    return shlex.join(["shapeprog", *sys.argv[1:]])


def _pretraining(settings: PretrainSettings, command_line: str) -> Task:
    from shapeprog.liang2022.pretrain import PretrainTask

    return PretrainTask(settings, command_line)


def _executor(settings: ExecutorSettings, command_line: str) -> Task:
    from shapeprog.liang2022.executor_training import ExecutorTask

    return ExecutorTask(settings, command_line)


def _adaptation(settings: AdaptSettings, command_line: str) -> Task:
    from shapeprog.liang2022.adapt import AdaptTask

    return AdaptTask(settings, command_line)


_training_command(
    "pretrain", PretrainSettings, _pretraining,
    "Pretrain a generator on synthetic shapes.\n\n"
    "Interrupted, the same command resumes exactly. Several processes: torchrun --nproc-per-node 2 -m shapeprog ...\n\n"
    "Example: shapeprog paper pretrain runs/narrow --prior narrow --num-shapes 40000",
)  # fmt: skip
_training_command(
    "train-executor", ExecutorSettings, _executor,
    "Train the neural executor, which guided and hybrid adaptation differentiate through.\n\n"
    "Example: shapeprog paper train-executor runs/executor",
)  # fmt: skip
_training_command(
    "adapt", AdaptSettings, _adaptation,
    "Adapt a generator to real shapes: direct (the paper), guided (the baseline) or hybrid.\n\n"
    "All weights learn, through the renderer, the neural executor or both.\n\n"
    "Example: shapeprog paper adapt runs/bench --train bench_train.npz --val bench_val.npz",
)  # fmt: skip

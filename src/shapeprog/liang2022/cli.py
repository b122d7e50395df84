"""The commands ``shapeprog paper ...``.  Options of training are made from the fields of the settings."""

from __future__ import annotations

import inspect
import pkgutil
import runpy
import shlex
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, get_origin, get_type_hints

import typer

from shapeprog.cli import terminal
from shapeprog.cli.data_sets import write_samples
from shapeprog.errors import InputError, ShapeProgError
from shapeprog.liang2022.settings import BEST, WEIGHTS, AdaptSettings, ExecutorSettings, PretrainSettings

app = typer.Typer(no_args_is_help=True, rich_markup_mode=None)

COMMAND_LINE = shlex.join(["shapeprog", *sys.argv[1:]])


@app.command("infer")
@terminal.guarded
def infer_command(
    inputs: Annotated[list[Path], typer.Argument(help="Meshes, point clouds, voxels, packs or folders.")],
    out: Annotated[Path | None, typer.Option("--out", "-o", help="Folder for a .shape file of each.")] = None,
    weights: Annotated[str, typer.Option(help="A file, or the name of weights that ship (see: models).")] = "fast-wide",
    decoder: Annotated[str, typer.Option(help="argmax, novel or select.")] = "select",
    blocks: Annotated[int, typer.Option(help="Largest number of blocks.", min=1)] = 10,
) -> None:
    """Write the program of each shape block by block with a generator.

    argmax is the network alone, novel the likeliest of 8 blocks that is new, select the best of 8 for the target.
    The defaults are ours: the synthetic shapes of fast-wide include the test categories, and select reads the target.
    Closest to the paper: --weights tian2019-narrow --decoder argmax.

    Example: shapeprog paper infer examples/bench_kenney.obj
    """
    import torch

    from shapeprog.cli.results import unused_stem
    from shapeprog.data import load_all
    from shapeprog.files import make_folder
    from shapeprog.formats import save
    from shapeprog.liang2022 import decode, load_generator

    generator, failures, code = load_generator(weights), list[ShapeProgError](), terminal.MISTAKE
    stems = set[str]()
    for _, shape in load_all(inputs):
        if isinstance(shape, ShapeProgError):
            failures.append(shape)
            continue
        cells = torch.from_numpy(shape.voxels).byte()[None]
        decoded = decode(generator, cells, decoder=decoder, blocks=blocks)  # type: ignore[arg-type]
        (program,) = decoded.programs()
        terminal.output().print(f"# {shape.name}: canvas IoU {float(decoded.iou()):.3f}")
        terminal.print_program(program)
        if out is not None:
            stem = unused_stem(shape.name, stems.__contains__)
            stems.add(stem)
            save(program, make_folder(out) / f"{stem}.shape")
        code = terminal.FAILED
    terminal.finish(failures, code)


@app.command("sample")
@terminal.guarded
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

    write_samples(prior, programs(prior, count, seed), seed, out=out)


@app.command("models")
@terminal.guarded
def models_command(
    files: Annotated[list[Path] | None, typer.Argument(help="Further files or folders of weights.")] = None,
) -> None:
    """List the weights that ship, and others: network, data, shapes seen, scores.

    Example: shapeprog paper models runs
    """
    from shapeprog.liang2022.weights import SHIPPED, SUFFIX, read_card

    for root in [SHIPPED, *(files or [])]:
        for path in sorted(root.rglob(f"*{SUFFIX}")) if root.is_dir() else [root]:
            card, name = read_card(path), path.stem if root == SHIPPED else path
            scores = "".join(f", {score} {value:.3g}" for score, value in card.scores.items() if score != "score")
            terminal.output().print(f"{name}: {card.design}; {card.data}; {card.samples_seen:,} shapes seen{scores}")


@app.command("import")
@terminal.guarded
def import_command(
    file: Annotated[Path, typer.Argument(help="Published checkpoint of Tian et al. 2019 (.t7), or weights of a run.")],
    out: Annotated[Path, typer.Option("--out", "-o", help="File to write, NAME.safetensors.")],
    half: Annotated[bool, typer.Option("--half", help="Store float16, as in the files that ship.")] = False,
) -> None:
    """Turn published weights into a file of this package; nothing else in the checkpoint is run.

    Example: shapeprog paper import program_generator_chair.t7 --out chair.safetensors
    """
    from shapeprog.liang2022.weights import SUFFIX, load_weights, read_published, save_weights

    if file.suffix == SUFFIX:
        module, card = load_weights(file)
        fields = {name: value for name, value in vars(card).items() if name not in ("design", "settings", "version")}
    else:
        module, fields = read_published(file), {"data": "as published by Tian et al. 2019", "command": COMMAND_LINE}
    save_weights(out, module, half=half, **fields)
    terminal.output().print(f"wrote {out}")


@app.command("table")
@terminal.guarded
def table_command(
    packs: Annotated[Path | None, typer.Argument(help="Folder of {bench,cabinet}_{train,val,test}.npz.")] = None,
    results: Annotated[Path, typer.Option(help="Folder of the runs; runs in it are resumed.")] = Path("paper-results"),
    quick: Annotated[bool, typer.Option("--quick", help="Five minutes; without packs on synthetic targets.")] = False,
    only: Annotated[list[str] | None, typer.Option(help="Rows to make; all by default.")] = None,
    seeds: Annotated[int, typer.Option(help="Seeds of rows with adaptation.", min=1)] = 1,
    measure: Annotated[bool, typer.Option("--measure", help="Measure finished runs; train nothing.")] = False,
) -> None:
    """Reproduce Table 1 and the rows that go beyond it.

    Example: shapeprog paper table --quick
    """
    from shapeprog.liang2022.experiment import run_table
    from shapeprog.liang2022.loop import tune_allocator

    tune_allocator()
    for line in run_table(packs, results, quick=quick, only=only, seeds=seeds, measure=measure):
        terminal.output().print(line)


def _add_training(name: str, kind: type[Any], task: str, doc: str) -> None:
    """Add a command that trains a task of this package, with an option for each field of its settings."""

    def run(
        folder: Annotated[Path, typer.Argument(help="Folder of the run; a run in it is resumed.")],
        device: Annotated[str, typer.Option(help="auto, cpu or cuda.")] = "auto",
        restart: Annotated[bool, typer.Option("--restart", help="Start over if the folder holds a run.")] = False,
        files: Annotated[list[Path] | None, typer.Option("--with", help="Python files that declare losses.")] = None,
        **options: Any,
    ) -> None:
        from shapeprog.files import check_file
        from shapeprog.liang2022.loop import train, tune_allocator

        tune_allocator()
        values = {key: value for key, value in options.items() if value not in (None, [])}
        settings = kind(**{key: tuple(value) if isinstance(value, list) else value for key, value in values.items()})
        for file in files or []:
            check_file(file)
            try:
                runpy.run_path(str(file), run_name=str(file))
            except Exception as error:
                raise InputError(f"{file} raised {type(error).__name__}: {error}", "correct it") from error
        last = {"samples_seen": 0.0}
        with _stop_event() as stop, terminal.progress() as begin:
            update, made = begin("training"), pkgutil.resolve_name(f"shapeprog.liang2022.{task}")(settings)
            steps = train(made, settings, folder, device=device, restart=restart, stop=stop, command=COMMAND_LINE)
            for last in steps:
                update(f"loss {last['loss']:.3f}", last["samples_seen"] / settings.num_shapes)
                scores = [f"{key[4:]} {value:.4g}" for key, value in last.items() if key.startswith("val_")]
                if scores:
                    terminal.note(f"{last['samples_seen']:.0f} shapes: {', '.join(scores)}", "none")
        if stop.is_set() and last["samples_seen"] < settings.num_shapes:
            raise terminal.Interrupted(f"{folder} holds the run; the same command resumes it")
        best = f"; the best on validation: {folder / BEST}" if (folder / BEST).exists() else ""
        terminal.say(f"the weights are {folder / WEIGHTS}{best}")

    parameters = inspect.signature(run, eval_str=True).parameters.values()
    signature = [parameter for parameter in parameters if parameter.name != "options"]
    hints, bases = get_type_hints(kind), [base for base in reversed(kind.__mro__) if is_dataclass(base)]
    meanings = {field.name: field.metadata["help"] for base in bases for field in fields(base) if field.metadata}
    for field in fields(kind):
        hint: Any = {Literal: str, tuple: list[str]}.get(get_origin(hints[field.name]), hints[field.name])
        default = f" [{field.default}]" if field.default else ""
        option = Annotated[hint | None, typer.Option(help=meanings[field.name] + default)]
        signature.append(inspect.Parameter(field.name, inspect.Parameter.KEYWORD_ONLY, default=None, annotation=option))
    run.__signature__ = inspect.Signature(signature)  # type: ignore[attr-defined]
    run.__annotations__ = {parameter.name: parameter.annotation for parameter in signature}
    app.command(name, help=doc)(terminal.guarded(run))


@contextmanager
def _stop_event() -> Iterator[threading.Event]:
    """An event that the first Ctrl-C or SIGTERM sets; the second interrupts at once."""
    stop = threading.Event()

    def ask(*_: object) -> None:
        if stop.is_set():
            raise KeyboardInterrupt
        stop.set()

    with ExitStack() as restore:
        for number in (signal.SIGINT, signal.SIGTERM):
            if signal.getsignal(number) != signal.SIG_IGN:
                restore.callback(signal.signal, number, signal.signal(number, ask))
        yield stop


_add_training("pretrain", PretrainSettings, "pretrain.PretrainTask", """Pretrain a generator on synthetic shapes.

    Interrupted, the same command resumes exactly.  Several processes: torchrun --nproc-per-node 2 -m shapeprog ...

    Example: shapeprog paper pretrain runs/narrow --prior narrow --num-shapes 40000""")  # fmt: skip

_add_training("train-executor", ExecutorSettings, "executor.ExecutorTask", """Train the neural executor.

    Guided and hybrid adaptation differentiate through it.

    Example: shapeprog paper train-executor runs/executor""")  # fmt: skip

_add_training("adapt", AdaptSettings, "adapt.AdaptTask", """Adapt a generator to real shapes.

    All weights learn, through the renderer (direct, the method of the paper), the neural executor (guided) or both
    (hybrid). The other defaults are ours: the synthetic shapes of fast-wide include the test categories, select reads
    the target, and self-training and rehearsal are added. Closest to the paper: --initial tian2019-narrow
    --decoder argmax --decoded-ids 0 --rehearsal 0 --points 5000.

    Example: shapeprog paper adapt runs/bench --train bench_train.npz --val bench_val.npz""")  # fmt: skip

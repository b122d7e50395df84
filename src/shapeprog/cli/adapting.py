"""Commands that learn from real shapes: label them by search, adapt a generator to them."""

from __future__ import annotations

import os
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from shapeprog.cli import terminal, training
from shapeprog.errors import InputError, ShapeProgError
from shapeprog.inference.budget import BUDGET

if TYPE_CHECKING:
    from shapeprog.inference.labelling import Labelled


def label_command(
    pack: Annotated[Path, typer.Argument(help="A pack of shapes.")],
    out: Annotated[Path, typer.Option("--out", "-o", help="File of labels; goes on with those that it holds.")],
    blocks: Annotated[int, typer.Option(help="Most blocks of a program.", min=1)] = 10,
    budget: Annotated[float, typer.Option(help="Most seconds for each shape; a safety net.", min=0.1)] = BUDGET,
    processes: Annotated[int | None, typer.Option(help="Shapes at a time; by default one per core.", min=1)] = None,
    seed: terminal.Seed = 0,
    modules: terminal.With = None,
    quiet: training.Quiet = False,
) -> None:
    """Find programs for all shapes of a pack by search, as labels to learn from: shapeprog adapt --labels FILE.

    Each line of the file is a JSON object: name, program, snapped, scores, and what --budget cut short. Interrupted,
    the same command goes on. The same --seed writes the same file.
    """
    from rich.progress import track

    from shapeprog.inference.labelling import label

    os.environ.setdefault("OMP_NUM_THREADS", "1")  # the processes share the cores
    terminal.load_modules(modules)
    records = label(pack, out, blocks=blocks, budget=budget, seed=seed, processes=processes, modules=modules or ())
    last = next(records)
    console, left = terminal.errors(), last.total - last.done
    failures: list[Labelled] = []
    try:
        with closing(records):
            for last in track(records, "labelling", total=left, console=console, transient=True, disable=quiet):
                if last.error is not None:
                    failures.append(last)
    except KeyboardInterrupt:
        kept = f"{out} holds {last.done} of {last.total} labels; the same command goes on"
        raise terminal.Interrupted(kept) from None
    for each in failures:
        assert each.error is not None
        terminal.complain(ShapeProgError(f"{each.name}: {each.error.message}", each.error.hint))
    if not quiet:
        which = f"all {last.total} shapes" if not failures else f"{last.done} of {last.total} shapes"
        terminal.output().print(f"{out} holds labels of {which}")
    if last.cut and not quiet:
        terminal.errors().print(
            f"The time budget cut short {last.cut} of them, which may come out otherwise in another run; to have them "
            "decided by the seed alone, take out their lines (those that name a cut) and give a larger --budget.",
            style="yellow", markup=False,
        )  # fmt: skip
    if failures:
        raise typer.Exit(1)


def adapt_command(
    folder: training.Folder,
    start: Annotated[str, typer.Option("--from", help="Weights to begin from: a file or a name.")],
    packs: Annotated[list[Path], typer.Option("--pack", help="A pack of shapes to adapt to; may be given again.")],
    method: Annotated[str, typer.Option(help="Settings to begin with: guided, direct, hybrid or distill.")] = "direct",
    val: Annotated[list[Path] | None, typer.Option("--val", help="A pack to validate on; may be given again.")] = None,
    select: Annotated[str | None, typer.Option(help="What the best weights have on --val: iou or cd.")] = None,
    loss: Annotated[str | None, typer.Option(help="Terms and weights: chamfer=1,occupancy=0.3")] = None,
    executor: Annotated[str | None, typer.Option(help="Weights of the neural executor, for guided and hybrid.")] = None,
    ids: Annotated[str | None, typer.Option(help="How ids learn: none, nvil, rloo or expected.")] = None,
    cost: Annotated[str | None, typer.Option(help="What ids are judged by: loss or iou.")] = None,
    ids_weight: Annotated[float | None, typer.Option(help="How much that counts.")] = None,
    tries: Annotated[int | None, typer.Option(help="Programs that rloo samples, blocks that expected weighs.")] = None,
    labels: Annotated[list[Path] | None, typer.Option(help="Labels to teach: a file or a folder; again.")] = None,
    labels_weight: Annotated[float | None, typer.Option(help="How much labels count beside the loss.")] = None,
    form: Annotated[str | None, typer.Option(help="Labels snapped to whole numbers, or the program as it is.")] = None,
    taught: Annotated[int | None, typer.Option(help="Programs taught in one step.")] = None,
    synthetic: Annotated[float | None, typer.Option(help="Share of these that are synthetic.")] = None,
    prior: Annotated[str | None, typer.Option(help="Synthetic furniture: narrow or wide.")] = None,
    perturbed: Annotated[float | None, typer.Option(help="Share of labels that are moved and drawn anew.")] = None,
    sampled: Annotated[float | None, typer.Option(help="Share taught on canvases of its own drawing.")] = None,
    rows: Annotated[int | None, typer.Option(help="Canvases learned from in each program; 0: all.")] = None,
    statistics: Annotated[str | None, typer.Option(help="Of normalisation while teaching: frozen or moving.")] = None,
    learn: Annotated[str | None, typer.Option(help="What learns: all weights, or those of the offsets.")] = None,
    choose: Annotated[str | None, typer.Option(help="How blocks are chosen: drawn or argmax.")] = None,
    points: Annotated[int | None, typer.Option(help="Points on each surface in one step.")] = None,
    mirror: Annotated[float | None, typer.Option(help="Share of shapes mirrored left to right.")] = None,
    blocks: Annotated[int | None, typer.Option(help="Most blocks of a program.")] = None,
    visits: training.Visits = None,
    batch: training.Batch = None,
    rate: training.Rate = None,
    schedule: training.Schedule = None,
    warm_up: Annotated[int | None, typer.Option(help="Visits over which the rate rises.")] = None,
    decay: Annotated[float | None, typer.Option(help="Weight decay.")] = None,
    clip: Annotated[float | None, typer.Option(help="Bound of the gradient; 0 for none.")] = None,
    precision: training.Precision = None,
    seed: terminal.Seed = 0,
    validate_every: training.ValidateEvery = None,
    device: training.Device = "auto",
    threads: training.Threads = None,
    restart: training.Restart = False,
    tensorboard: training.TensorBoard = False,
    modules: terminal.With = None,
    quiet: training.Quiet = False,
) -> None:
    """Adapt a generator to real shapes, whose programs are not known.

    guided draws with the neural executor, direct with the renderer, hybrid with both; distill learns from labels
    (shapeprog label), which --labels adds to the other methods too. Interrupted, the same command goes on exactly.
    """
    from shapeprog.training.adapt import adapt
    from shapeprog.training.adapt_settings import METHODS, AdaptSettings
    from shapeprog.training.engine import Engine

    terminal.load_modules(modules)
    if method not in METHODS:
        raise InputError(f"there is no method {method!r}", f"choose one of {', '.join(METHODS)}")
    told = {name: value for name, value in locals().items() if name in AdaptSettings.__dataclass_fields__}
    told |= {name: tuple(str(path) for path in told[name] or ()) for name in ("packs", "labels")}
    given = {name: value for name, value in told.items() if value is not None}
    settings = AdaptSettings(**{**METHODS[method], **given})
    with training.stopping() as stop:
        engine = Engine(device, settings.precision, threads)
        records = adapt(
            folder, settings, engine, start=start, val=val or (), command=training.command_line(), restart=restart,
            stop=stop, tensorboard=tensorboard,
        )  # fmt: skip
        training.follow(records, folder, settings, engine, stop, quiet)

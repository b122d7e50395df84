"""The command that adapts a generator to real shapes."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from shapeprog.cli import terminal, training
from shapeprog.errors import InputError


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

    guided draws with the neural executor, direct with the renderer, hybrid with both; distill learns from labels,
    which --labels adds to the other methods too. Interrupted, the same command goes on exactly.
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

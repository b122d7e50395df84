"""Commands on weights: what there is, and published ones as files of this package."""

from __future__ import annotations

import shlex
from collections import Counter
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from shapeprog.cli import terminal
from shapeprog.errors import InputError, ShapeProgError

if TYPE_CHECKING:
    from shapeprog.models.checkpoint import Listed
    from shapeprog.models.tian2019 import Told

SCORES = 4
"""Scores of weights that the table has room for."""

CALIBRATION = 32
"""Shapes of one batch of calibration, as in the published training."""


def models_command(
    folders: Annotated[list[Path] | None, typer.Argument(help="Folders or files of weights.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the cards as JSON.")] = False,
) -> None:
    """List the weights that ship, and those in folders: what they are, what they saw, how they score."""
    from shapeprog.models.checkpoint import list_checkpoints

    listed, failed = [], False
    for _, found in list_checkpoints(folders or []):
        if isinstance(found, ShapeProgError):
            terminal.complain(found)
            failed = True
        else:
            listed.append(found)
    if as_json:
        terminal.print_json([_described(each) for each in listed])
    elif listed:
        _print_table(listed)
    else:
        terminal.output().print("There are no weights here.")
    if failed:
        raise typer.Exit(1)


def import_weights_command(
    file: Annotated[Path, typer.Argument(help="A published checkpoint of Tian et al. (.t7): generator or executor.")],
    out: Annotated[Path | None, typer.Option("--out", "-o", help="File to write; NAME.safetensors.")] = None,
    calibrate: Annotated[
        int, typer.Option(help="Synthetic shapes to take running statistics from; 0: those of each batch.", min=0)
    ] = 0,
    half: Annotated[bool, typer.Option("--half", help="Keep the weights as float16.")] = False,
    seed: terminal.Seed = 0,
) -> None:
    """Turn published weights into a file of this package; nothing that the file may hold besides is run.

    The published generator normalises by the statistics of each batch, so that a prediction depends on the other
    shapes in it; with --calibrate it uses those of so many synthetic shapes instead.
    """
    from shapeprog.models.checkpoint import SUFFIX, card_of, save_checkpoint
    from shapeprog.models.published import read_published
    from shapeprog.models.tian2019 import Tian2019, calibrated

    target = out or Path(file.name).with_suffix(SUFFIX)
    if target.suffix != SUFFIX:
        raise InputError(f"weights are written as {SUFFIX} files, not as {target}", f"name it {target.stem}{SUFFIX}")
    module = read_published(file)
    words = ["shapeprog", "import-weights", file.name]
    if calibrate and isinstance(module, Tian2019):
        module = calibrated(module, _synthetic(calibrate, seed))
        words += ["--calibrate", str(calibrate), "--seed", str(seed)]
    card = card_of(module, data="as published by Tian et al. 2019", seed=seed, command=shlex.join(words))
    save_checkpoint(target, module, card, half=half)
    terminal.output().print(
        f"wrote {target}: {card.kind}, {sum(each.numel() for each in module.parameters()):,} parameters"
    )


def _synthetic(count: int, seed: int) -> Iterator[Told]:
    """Targets and canvases of the prior that the published weights were trained on."""
    from shapeprog.data.synthetic import Stream, prior
    from shapeprog.geometry.cells import preceding
    from shapeprog.language.unroll import draw_blocks
    from shapeprog.models.generator import live_blocks

    stream = Stream(prior("narrow"), CALIBRATION, seed=seed)
    for index in range(-(-count // CALIBRATION)):
        batch = stream[index]
        yield batch.voxels, preceding(draw_blocks(batch.code)), live_blocks(batch.code.ids)


def _described(listed: Listed) -> dict[str, Any]:
    card = asdict(listed.card)
    card["vocabulary"] = list(card["vocabulary"])
    return {
        "name": listed.name, "path": str(listed.path), "parameters": listed.parameters, "bytes": listed.size, **card,
        "scores": terminal.plain(card["scores"]),
    }  # fmt: skip


def _print_table(listed: list[Listed]) -> None:
    from rich import box
    from rich.table import Table

    from shapeprog.models.checkpoint import SHIPPED

    table = Table(box=box.SIMPLE_HEAD)
    table.add_column("name", overflow="fold")
    for heading in ("kind", "design"):
        table.add_column(heading)
    for heading in ("parameters", "MB"):
        table.add_column(heading, justify="right")
    table.add_column("data")
    for heading in ("visits", "seed"):
        table.add_column(heading, justify="right")
    table.add_column("version")
    table.add_column("scores")
    count = Counter(each.name for each in listed)
    for each in listed:
        card = each.card
        scores = ", ".join(f"{name} {value:.4g}" for name, value in list(card.scores.items())[:SCORES])
        scores += ", ... (--json)" * (len(card.scores) > SCORES)
        alone = count[each.name] == 1 or each.path.parent == SHIPPED
        name = each.name if alone else f"{each.path.parent.name}/{each.name}"
        table.add_row(
            name, card.kind, card.design, f"{each.parameters:,}", f"{each.size / 1e6:.1f}", card.data,
            f"{card.visits:,}", str(card.seed), card.version, scores,
        )  # fmt: skip
    terminal.output().print(table)

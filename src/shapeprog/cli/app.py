"""The list of the commands of ``shapeprog``.

Neither this module nor the others of this package import heavy modules: commands import them when they run.
"""

from __future__ import annotations

import os
from typing import Annotated

import typer

from shapeprog.cli import changes, inferring, libraries, measuring, sampling, terminal, tidying, writing
from shapeprog.liang2022.cli import app as paper

# Before torch is loaded: its idle workers would spin on the cores that the kernels of other threads want.
os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")

app = typer.Typer(
    name="shapeprog",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110},
)

PROGRAMS, OUTPUT, RESEARCH = "From shapes to programs", "View and export programs", "Data sets, scores, the paper"
"""Headings of the list of commands."""

for name, command, panel in (
    ("infer", inferring.infer_command, PROGRAMS),
    ("tidy", tidying.tidy_command, PROGRAMS),
    ("statements", writing.statements_command, PROGRAMS),
    ("export", writing.export_command, OUTPUT),
    ("render", writing.render_command, OUTPUT),
    ("show", writing.show_command, OUTPUT),
    ("sheet", writing.sheet_command, OUTPUT),
    ("evaluate", measuring.evaluate_command, RESEARCH),
    ("prepare", measuring.prepare_command, RESEARCH),
    ("sample", sampling.sample_command, RESEARCH),
):
    app.command(name, cls=changes.ChangingCommand, rich_help_panel=panel)(terminal.guarded(command))

library = typer.Typer(no_args_is_help=True, rich_markup_mode="rich")
library.command("learn")(terminal.guarded(libraries.learn_command))
library.command("show")(terminal.guarded(libraries.show_command))
app.add_typer(library, name="library", help="Learn functions from programs, or list them.", rich_help_panel=PROGRAMS)
app.add_typer(
    paper, name="paper", help="Liang (2022): networks, training, adaptation and Table 1.", rich_help_panel=RESEARCH
)


def _version(requested: bool) -> None:
    if requested:
        from shapeprog import __version__

        print(f"shapeprog {__version__}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool | None, typer.Option("--version", callback=_version, is_eager=True, help="Print the version.")
    ] = False,
    debug: Annotated[bool, typer.Option("--debug", help="Print the traceback of an error; of every command.")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Print errors only; of every command.")] = False,
) -> None:
    """Infer short, editable programs from furniture given as meshes, point clouds or voxels.

    Example: shapeprog infer chair.glb --out results

    Exit codes: 0 success, 1 some of several inputs failed, 2 wrong usage or input, 130 interrupted.
    """

"""The commands of ``shapeprog``: what they are called, and where they are.

Nothing heavy is imported here or by the modules of this room: commands import what they need when they run.
"""

from __future__ import annotations

import os
from typing import Annotated

import typer

from shapeprog.cli import (
    changes,
    inferring,
    libraries,
    measuring,
    sampling,
    terminal,
    tidying,
    writing,
)
from shapeprog.liang2022.cli import app as paper

# Before torch is loaded: its idle workers would spin on the cores that the kernels of other threads want.
os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")

app = typer.Typer(
    name="shapeprog",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
)

for name, command, help_line in (
    ("infer", inferring.infer_command, "Infer a program from each mesh, point cloud or voxel grid."),
    ("tidy", tidying.tidy_command, "Tie the numbers of a program: names for what is free."),
    ("render", writing.render_command, "Draw a program as a picture, cells or points."),
    ("export", writing.export_command, "Write a program for other tools: GLB, STL, OpenSCAD, STEP..."),
    ("show", writing.show_command, "Write a page to turn a program's shape in a browser."),
    ("sheet", writing.sheet_command, "Draw a contact sheet of a folder of programs."),
    ("statements", writing.statements_command, "Print the manual of the language."),
    ("prepare", measuring.prepare_command, "Turn a directory of models into packs."),
    ("sample", sampling.sample_command, "Draw synthetic furniture: a contact sheet or a pack."),
    ("evaluate", measuring.evaluate_command, "Measure predictions against targets."),
):
    app.command(name, cls=changes.ChangingCommand, short_help=help_line)(terminal.guarded(command))

library = typer.Typer(no_args_is_help=True, rich_markup_mode=None)
library.command("learn")(terminal.guarded(libraries.learn_command))
library.command("show")(terminal.guarded(libraries.show_command))
app.add_typer(library, name="library", help="Functions that programs may be written with.")
app.add_typer(paper, name="paper", help="The paper: networks, training, adaptation and its table (liang2022).")


def _version(wanted: bool) -> None:
    if wanted:
        from shapeprog import __version__

        print(f"shapeprog {__version__}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool | None, typer.Option("--version", callback=_version, is_eager=True, help="Print the version.")
    ] = False,
    debug: Annotated[bool, typer.Option("--debug", help="Show the traceback of an error.")] = False,
) -> None:
    """Furniture as a mesh, point cloud or voxels in; a short program that a person can read, edit and run out.

    Exit codes: 0 all is well, 1 some of several inputs failed, 2 a mistake that can be mended, 130 interrupted.
    """

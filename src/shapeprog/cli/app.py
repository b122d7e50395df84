"""The list of the commands of ``shapeprog``, and how their words are read and their help is printed.

Neither this module nor the others of this package import heavy modules: commands import them when they run.
"""

from __future__ import annotations

import os
import re
from typing import Annotated, Any

import typer
from typer.core import TyperCommand

from shapeprog.cli import data_sets, inferring, libraries, terminal, tidying, writing
from shapeprog.cli.changes import CHANGE
from shapeprog.liang2022.cli import app as paper

# Before torch is loaded: its idle workers would spin on the cores that the kernels of other threads want.
os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")

app = typer.Typer(
    name="shapeprog",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110},
)


class Command(TyperCommand):
    """A command whose option ``--set`` takes all the changes that follow it, and whose options stand under the headings
    that they name as ``rich_help_panel``."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Read the words of the command line, with the option before each change."""
        words: list[str] = []
        for word in args:
            following = "--set" in words[-2:-1] and CHANGE.fullmatch(word)
            if "--set" in words[-2:-1] and words[-1].isidentifier() and re.fullmatch(r"-?[\d.]+", word):
                raise typer.BadParameter(f"write --set {words[-1]}={word}, with = between name and number.")
            words += ["--set", word] if following else [word]
        return super().parse_args(ctx, words)

    def format_options(self, ctx: Any, formatter: Any) -> None:
        """Write the help of arguments and options, a line each; those without a heading last."""
        groups: dict[str, list[tuple[str, str]]] = {}
        for parameter in self.get_params(ctx):
            heading = "Arguments" if parameter.param_type_name == "argument" else "Options"
            if record := parameter.get_help_record(ctx):
                names = re.sub(r" <.*>$", "", record[0])  # without the Python type
                groups.setdefault(getattr(parameter, "rich_help_panel", None) or heading, []).append((names, record[1]))
        for heading in sorted(groups, key="Options".__eq__):
            with formatter.section(heading):
                formatter.write_dl(groups[heading])


for name, command in (
    ("infer", inferring.infer_command),
    ("tidy", tidying.tidy_command),
    ("statements", writing.statements_command),
    ("export", writing.export_command),
    ("render", writing.render_command),
    ("show", writing.show_command),
    ("sheet", writing.sheet_command),
    ("evaluate", data_sets.evaluate_command),
    ("prepare", data_sets.prepare_command),
    ("sample", data_sets.sample_command),
):
    app.command(name, cls=Command)(terminal.guarded(command))

library = typer.Typer(no_args_is_help=True, rich_markup_mode=None)
library.command("learn", cls=Command)(terminal.guarded(libraries.learn_command))
library.command("show", cls=Command)(terminal.guarded(libraries.show_command))
app.add_typer(library, name="library", help="Learn functions from programs, or list them.")
app.add_typer(paper, name="paper", help="Liang (2022): networks, training, adaptation and Table 1.")


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
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Print neither remarks nor the names of files.")] = False,
) -> None:
    """Infer short, editable programs from furniture given as meshes, point clouds or voxels.

    Example: shapeprog infer chair.glb --out results

    Exit codes: 0 success, 1 some of several inputs or outputs failed, 2 wrong usage or input, 130 interrupted.
    """

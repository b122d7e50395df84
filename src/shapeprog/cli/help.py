"""The help of a command: its options and commands under headings, a line each."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from typer.core import TyperCommand, TyperGroup

LAST = "Options"
"""The heading of what has no other."""


class GroupedCommand(TyperCommand):
    """A command whose options stand under the headings that they name as ``rich_help_panel``."""

    def format_options(self, ctx: Any, formatter: Any) -> None:
        """Write the options."""
        records = ((each, each.get_help_record(ctx)) for each in self.get_params(ctx))
        _write(formatter, ((_heading(each), record) for each, record in records if record is not None))


class GroupedCommands(TyperGroup):
    """The same for the commands of a group."""

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write the commands."""
        named = ((name, self.get_command(ctx, name)) for name in self.list_commands(ctx))
        _write(formatter, ((_heading(each), (name, each.get_short_help_str(90))) for name, each in named if each))


def _heading(each: Any) -> str:
    heading = getattr(each, "rich_help_panel", None)
    return heading or ("Arguments" if getattr(each, "param_type_name", "") == "argument" else LAST)


def _write(formatter: Any, records: Iterable[tuple[str, tuple[str, str]]]) -> None:
    groups: dict[str, list[tuple[str, str]]] = {}
    for heading, record in records:
        groups.setdefault(heading, []).append(record)
    for heading in sorted(groups, key=LAST.__eq__):
        with formatter.section(heading):
            formatter.write_dl(groups[heading])

"""The help of a command: its options and commands under headings, a line each."""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import Any

from typer.core import TyperCommand, TyperGroup

LAST = "Options"  # the heading of options without a heading; it comes last


class GroupedCommand(TyperCommand):
    """A command whose options stand under the headings that they name as ``rich_help_panel``."""

    def format_options(self, ctx: Any, formatter: Any) -> None:
        """Write the options."""
        records = ((_heading(parameter), help_record(parameter, ctx)) for parameter in self.get_params(ctx))
        _write(formatter, ((heading, record) for heading, record in records if record is not None))


class GroupedCommands(TyperGroup):
    """The same for the commands of a group."""

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write the commands."""
        commands = ((name, self.get_command(ctx, name)) for name in self.list_commands(ctx))
        _write(formatter, ((_heading(item), (name, item.get_short_help_str(90))) for name, item in commands if item))


def help_record(parameter: Any, ctx: Any) -> tuple[str, str] | None:
    """Name and help of a parameter, without the Python type that Typer appends to the name of an argument."""
    record = parameter.get_help_record(ctx)
    return record and (re.sub(r" <.*>$", "", record[0]), record[1])


def _heading(item: Any) -> str:
    heading = getattr(item, "rich_help_panel", None)
    return heading or ("Arguments" if getattr(item, "param_type_name", "") == "argument" else LAST)


def _write(formatter: Any, records: Iterable[tuple[str, tuple[str, str]]]) -> None:
    groups: dict[str, list[tuple[str, str]]] = {}
    for heading, record in records:
        groups.setdefault(heading, []).append(record)
    for heading in sorted(groups, key=LAST.__eq__):
        with formatter.section(heading):
            formatter.write_dl(groups[heading])

"""Pages that are generated: tables of the statements from their declarations, the command line from its app."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import typer

from shapeprog.cli.app import app
from shapeprog.language import Statement, language
from shapeprog.language.parameters import Parameter
from shapeprog.language.statement import END
from shapeprog.view.manual import UNITS


def statements(kind: str = "") -> Iterator[str]:
    """Markdown tables of all statements, loops and roles, or of ``solids``, ``paper``, ``loops`` or ``roles`` alone."""
    known = language()
    drawing = [statement for statement in known if not statement.is_loop]
    roles = [role for role in known.roles.values() if role.name not in known]
    tables = {
        "solids": ("Solids", _declared(statement for statement in drawing if statement.id > END)),
        "paper": ("Statements of the paper", _declared(statement for statement in drawing if statement.id < END)),
        "loops": ("Loops", _declared(statement for statement in known if statement.is_loop)),
        "roles": ("Roles", _table("role", "meaning", rows=[(f"`{role.name}`", role.doc) for role in roles])),
    }
    for title, lines in [("", tables[kind][1])] if kind else tables.values():
        yield from (f"**{title}**", "") if title else ()
        yield from lines


def _declared(chosen: Iterable[Statement]) -> Iterator[str]:
    """A table of statements: name, parameters, meaning."""
    rows = []
    for statement in chosen:
        written = [parameter for parameter in statement.parameters if parameter.quantity.written_out]
        rows.append((f"`{statement.name}`", "<br>".join(map(_parameter, written)), statement.doc.replace("``", "`")))
    return _table("statement", "parameters", "meaning", rows=rows)


def _parameter(parameter: Parameter) -> str:
    """Kind, unit and default of a parameter."""
    quantity = parameter.quantity
    each = f" ({quantity.each})" if quantity.each else ""
    default = "" if parameter.default is None else f", {quantity.written(parameter.default)} by default"
    return f"`{parameter.name}`: {quantity.kind}{UNITS[quantity.kind]}{each}{default}"


def commands() -> Iterator[str]:
    """A Markdown section for every command: usage, help, arguments and options."""
    root = typer.main.get_command(app)
    return _command(root, root.make_context("shapeprog", [], resilient_parsing=True))


def _command(command: Any, context: Any) -> Iterator[str]:
    """The section of a command, followed by those of its subcommands."""
    usage = " ".join((context.command_path, *command.collect_usage_pieces(context)))
    yield from (f"## {context.command_path}", "", f"```text\n{usage}\n```", "")
    for paragraph in command.help.split("\n\n"):
        if example := re.fullmatch(r"Examples?:\s*(.*)", paragraph, re.DOTALL):
            yield f"```sh\n{' '.join(example[1].split())}\n```\n"
        elif paragraph.startswith("\b"):  # lines that are not to be joined
            yield f"```text{paragraph[1:]}\n```\n"
        else:
            yield f"{_plain(paragraph)}\n"
    records = [each.get_help_record(context) for each in command.get_params(context) if each.name != "help"]
    rows = [(f"`{re.sub(r' <.*>$', '', names)}`", _plain(text)) for names, text in records]  # without Python types
    yield from _table("argument or option", "meaning", rows=rows) if rows else ()
    for name in command.list_commands(context) if hasattr(command, "list_commands") else ():
        inner = command.get_command(context, name)
        yield from _command(inner, inner.make_context(name, [], parent=context, resilient_parsing=True))


def _table(*head: str, rows: Iterable[Sequence[str]]) -> Iterator[str]:
    """A table in Markdown."""
    for row in (head, ["---"] * len(head), *rows):
        yield f"| {' | '.join(row)} |"
    yield ""


def _plain(text: str) -> str:
    """Plain text as Markdown."""
    return re.sub(r"([\\`*_$<>|\[\]])", r"\\\1", text)

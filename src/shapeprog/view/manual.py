"""The manual, drawn from the declarations alone."""

from __future__ import annotations

from collections.abc import Sequence

from shapeprog.errors import ShapeProgError, did_you_mean
from shapeprog.formats.notation import groups
from shapeprog.language.parameters import Parameter
from shapeprog.language.statement import Role, Statement, language

UNITS = {
    "position": " in cells", "length": " in cells", "shift": " in cells", "angle": " in degrees", "count": " in copies",
    "turn": " in quarter turns", "axis": " of the grid",
}  # fmt: skip
"""Unit of each kind of parameter, as it follows the kind."""


_NAMES = """\
Names: numbers that others follow from, before their use and never twice
  width, thick = 10.2, 2      two numbers; what stands behind # is kept
  floor = -height / 2         numbers and names with + - * / and parentheses, wherever a number may stand
  def legs(long, thick=2):    a function of statements, loops, names and calls; it does not call itself
      leg(...)
  legs(long=9.7)              its statements, with these numbers"""


def manual(name: str | None = None) -> str:
    """The page of one statement or loop, or the list of all.

    Raises
    ------
    ShapeProgError
        If no statement is called ``name``.
    """
    known = language()
    if name is None:
        drawing = [declared for declared in known if not declared.is_loop]
        loops = [declared for declared in known if declared.is_loop]
        roles = [role for role in known.roles.values() if role.name not in known]
        title = "Roles: what a part is for, around its solid, as in seat(box(...))"
        parts = [_index("Statements", drawing), _index("Loops", loops), _index(title, roles), _NAMES.splitlines()]
        return "\n".join(line for part in parts for line in (*part, ""))
    if name in known:
        return page(known[name])
    if name in known.roles:
        return _role_page(known.roles[name])
    raise ShapeProgError(f"unknown statement {name!r}", did_you_mean(name, [*known.names, *known.roles]))


def _role_page(role: Role) -> str:
    """The page of a role that brings no solid along."""
    label = f"; in labelled parts it is a {role.label}" if role.label else ""
    return f"{role.name}(box(at=_, size=_))\n\n  {role.doc}: a role, around any solid.\n\n  role {role.id}{label}\n"


def page(declared: Statement) -> str:
    """The page of one declaration: how it is written, what it means, its parameters with range and slots."""
    kind = "loop" if declared.is_loop else "statement"
    lines = [declared.signature, "", f"  {_plain(declared.doc)}", ""]
    width = max((len(parameter.name) for parameter in declared.parameters), default=0)
    lines += [f"  {parameter.name:<{width}}  {_meaning(parameter)}" for parameter in declared.parameters]
    if declared.parameters:
        lines.append("")
    lines.append(f"  {kind} {declared.id}; in the paper's notation {_notation(declared)}")
    return "\n".join(lines) + "\n"


def _index(title: str, declared: Sequence[Statement | Role]) -> list[str]:
    width = max((len(each.name) for each in declared), default=0)
    return [title, *(f"  {each.id:>3}  {each.name:<{width}}  {_plain(each.doc)}" for each in declared)]


def _plain(doc: str) -> str:
    return doc.replace("``", "")


def _meaning(parameter: Parameter) -> str:
    quantity = parameter.quantity
    each = f" ({quantity.each})" if quantity.each else ""
    first, last = parameter.start, parameter.start + quantity.width - 1
    slots = f"slot {first}" if first == last else f"slots {first} to {last}"
    default = "" if parameter.default is None else f", {quantity.written(parameter.default)} unless given"
    known = quantity.range_text if quantity.written_out else f"always {quantity.written(quantity.low)}"
    return f"{quantity.kind}{each}{UNITS[quantity.kind]}, {known}{default}; {slots}"


def _notation(declared: Statement) -> str:
    words = [f"'{word}'" for word in (declared.paper or (declared.name,))]
    if declared.is_loop:
        words = words[:1]
    for symbol, parameters in groups(declared).items():
        width = sum(parameter.quantity.width for parameter in parameters)
        words.append(f"{symbol}=" + ("_" if width == 1 else f"({', '.join('_' * width)})"))
    return f"for(i<_, {', '.join(words)})" if declared.is_loop else f"draw({', '.join(words)})"

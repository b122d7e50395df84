"""The manual, drawn from the declarations alone."""

from __future__ import annotations

from shapeprog.errors import ShapeProgError, did_you_mean
from shapeprog.formats.notation import groups
from shapeprog.language.parameters import Parameter
from shapeprog.language.statement import Statement, language

_UNITS = {"position": "cells", "length": "cells", "shift": "cells", "count": "copies", "turn": "quarter turns"}
_AXES = {2: "(depth, left-right)", 3: "(up, depth, left-right)"}


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
        return "\n".join([*_index("Statements", drawing), "", *_index("Loops", loops), ""])
    if name not in known:
        raise ShapeProgError(f"no statement is called {name!r}", did_you_mean(name, known.names))
    return page(known[name])


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


def _index(title: str, declared: list[Statement]) -> list[str]:
    width = max((len(each.name) for each in declared), default=0)
    return [title, *(f"  {each.id:>3}  {each.name:<{width}}  {_plain(each.doc)}" for each in declared)]


def _plain(doc: str) -> str:
    return doc.replace("``", "")


def _meaning(parameter: Parameter) -> str:
    quantity = parameter.quantity
    axes = f" {_AXES[quantity.width]}" if quantity.width in _AXES else ""
    first, last = parameter.start, parameter.start + quantity.width - 1
    slots = f"slot {first}" if first == last else f"slots {first} to {last}"
    return f"{quantity.kind}{axes} in {_UNITS[quantity.kind]}, {quantity.range_text}; {slots}"


def _notation(declared: Statement) -> str:
    words = [f"'{word}'" for word in (declared.paper or (declared.name,))]
    if declared.is_loop:
        words = words[:1]
    for symbol, parameters in groups(declared).items():
        width = sum(parameter.quantity.width for parameter in parameters)
        words.append(f"{symbol}=" + ("_" if width == 1 else f"({', '.join('_' * width)})"))
    return f"for(i<_, {', '.join(words)})" if declared.is_loop else f"draw({', '.join(words)})"

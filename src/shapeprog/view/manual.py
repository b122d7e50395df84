"""The manual: placed parts, then the statements in cells, drawn from their declarations."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from shapeprog.errors import ShapeProgError, did_you_mean
from shapeprog.language.parameters import Parameter
from shapeprog.language.placement import BETWEEN, BOX, GROUPS, IN_BOX, ROUND_ROLES, SIZES
from shapeprog.language.statement import Role, Statement, language

_SOLIDS = (*IN_BOX, "bar", "bent_rod")

UNITS = {
    "position": " in cells", "length": " in cells", "shift": " in cells", "angle": " in degrees", "count": " in copies",
    "turn": " in quarter turns", "axis": " of the grid",
}  # fmt: skip
"""Unit of each kind of parameter, as it follows the kind."""

_PROGRAM, _WORDS = Path(__file__).with_suffix(".txt").read_text(encoding="utf-8").split("\n---\n")
_DOCS = dict(line.split(": ", 1) for line in _WORDS.splitlines())
"""The words of placed text, each with its meaning."""


def manual(name: str | None = None) -> str:
    """The page of one word of the language, or the list of all; a ``ShapeProgError`` if there is no word ``name``."""
    registry = language()
    if name is None:
        cells = "Statements in cells, as published: leg(at=(up, depth, side), size=(up, depth, side))"
        parts = [
            _PROGRAM.splitlines(),
            ["Solids", *_table({word: _DOCS[word] for word in _SOLIDS})],
            ["Groups and loops", *_table({group.example: _DOCS[word] for word, group in GROUPS.items()})],
            _index("Roles", [*registry.roles.values()]),
            _index(cells, [declared for declared in registry if not declared.is_loop]),
            _index("Loops in cells", [declared for declared in registry if declared.is_loop]),
        ]
        return "\n".join(line for part in parts for line in (*part, ""))
    pages = [_placed_page(name)] if name in _SOLIDS or name in GROUPS else []
    pages += [f"{name}=_\n\n  {_DOCS[name].capitalize()}.\n"] if name in _DOCS and not pages else []
    pages += [_PROGRAM[_PROGRAM.index("Keywords") :] + "\n"] if name in (*BOX, "at") else []
    pages += [_role_page(registry.roles[name])] if name in registry.roles else []
    pages += [page(registry[name])] if name in registry else []
    if not pages:
        raise ShapeProgError(
            f"unknown word {name!r}", did_you_mean(name, [*_DOCS, *BOX, "at", *registry.names, *registry.roles])
        )
    return "\n".join(pages)


def _placed_page(name: str) -> str:
    """The page of a placed solid, group or loop: an example, its meaning, and its keywords."""
    if name in GROUPS:
        keywords, example = GROUPS[name].keywords, GROUPS[name].example
    else:
        needed = [needs[name] for needs in (IN_BOX, BETWEEN) if name in needs]
        keywords = tuple(dict.fromkeys(word for needs in needed for word in (*needs.required, *needs.optional)))
        keywords = (*(BOX if name in IN_BOX else ()), *keywords)
        example = f"{name}({', '.join(f'{word}=_' for word in needed[0].required or ('left', *SIZES[::2]))})"
    plain = [word for word in keywords if word not in _DOCS]
    words = {word: _DOCS[word] for word in keywords if word in _DOCS}
    placed = [f"  {' '.join(plain)}"] if plain else []
    if plain == [*SIZES]:  # of a bar
        placed, words = [], {", ".join(SIZES): "two of these, across it: width and depth if it rises"} | words
    return "\n".join([example, "", f"  {_DOCS[name].capitalize()}.", "", *placed, *_table(words)]) + "\n"


def _role_page(role: Role) -> str:
    """The page of a role."""
    label = f"; in labelled parts it is a {role.label}" if role.label else ""
    example = (
        f"{role.name}(cylinder(left=_, radius=_))" if role.name in ROUND_ROLES else f"{role.name}(left=_, width=_)"
    )
    return f"{example}\n\n  {role.doc}: a role, around any solid or call.\n\n  role {role.id}{label}\n"


def _table(rows: Mapping[str, str]) -> list[str]:
    width = max((len(word) for word in rows), default=0)
    return [f"  {word:<{width}}  {doc}" for word, doc in rows.items()]


def page(declared: Statement) -> str:
    """The page of a declaration in cells: its form, its meaning, its parameters with range and slots."""
    kind = "loop" if declared.is_loop else "statement"
    lines = [declared.signature, "", f"  {_plain(declared.doc)}", ""]
    if declared.parameters:
        lines += [*_table({parameter.name: _meaning(parameter) for parameter in declared.parameters}), ""]
    lines.append(f"  {kind} {declared.id} in cells")
    return "\n".join(lines) + "\n"


def _index(title: str, declared: Sequence[Statement | Role]) -> list[str]:
    return [title, *_table({f"{entry.id:>3}  {entry.name}": _plain(entry.doc) for entry in declared})]


def _plain(doc: str) -> str:
    return doc.replace("``", "")


def _meaning(parameter: Parameter) -> str:
    quantity = parameter.quantity
    order = f" ({quantity.each})" if quantity.each else ""
    first, last = parameter.start, parameter.start + quantity.width - 1
    slots = f"slot {first}" if first == last else f"slots {first} to {last}"
    default = "" if parameter.default is None else f", {quantity.written(parameter.default)} unless given"
    legal = quantity.range_text if quantity.written_out else f"always {quantity.written(quantity.low)}"
    return f"{quantity.kind}{order}{UNITS[quantity.kind]}, {legal}{default}; {slots}"

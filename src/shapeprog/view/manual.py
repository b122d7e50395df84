"""The manual: placed parts, then the statements in cells, drawn from their declarations."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from shapeprog.errors import ShapeProgError, did_you_mean
from shapeprog.language.parameters import Parameter
from shapeprog.language.placement import BETWEEN, BOX, GROUPS, IN_BOX, ROUND_ROLES
from shapeprog.language.statement import Role, Statement, language

_SOLIDS = (*IN_BOX, "bar", "bent_rod")

UNITS = {
    "position": " in cells", "length": " in cells", "shift": " in cells", "angle": " in degrees", "count": " in copies",
    "turn": " in quarter turns", "axis": " of the grid",
}  # fmt: skip
"""Unit of each kind of parameter, as it follows the kind."""


_PROGRAM = """\
A program: parts that are placed from the sides of a box
  # unit: cm                                mm, cm, m or in; may be left out
  width, depth, height = 140, 60, 74        size of the whole, on one line; only names stand above it
  thickness = 2.5                           a number for others: names, + - * / and parentheses
  top(top=0, height=thickness)              a role alone is a box
  leg(cylinder(left=4, front=4, radius=3))  a role around another solid
  def shelf_pair(gap=2):                    a function draws in the box of its call
      shelf(bottom=gap, height=2)
  shelf_pair(gap=5, right=0, width=40)

Keywords of a box: x points right, y to the rear, z up; left and right as seen from the front
  left right width x    front rear depth y    bottom top height z
  left=3, width=20      from a side; sides are distances inwards
  left=3, right=3       between two sides
  x=5, width=20         x, y and z are offsets of the middle from that of the box around
  width=20              in the middle; height=20 is at the bottom
  (none)                the full extent of the box around
  at(left=3, top=0)     a point, of at most one side or offset for each axis"""

_DOCS = {
    "box": "a box",
    "cushion": "a box with rounded edges",
    "cylinder": "an upright cylinder, of its radius or of the width or depth of its box",
    "rod": "a round rod between two points, or upright in a box",
    "taper": "a round rod with another radius at each end, between two points or upright in a box",
    "bar": "a bar between two points; two of width, depth and height are its sizes across",
    "bent_rod": "a round rod along the circle from start through a second point to end",
    "inside": "a box in which the lines below are placed",
    "divide": "the lines below in that many equal boxes, along x, y or z",
    "mirror": "the lines below and their mirror image, about a plane through the point; two axes give four copies",
    "rotate": "copies about the vertical axis through a point, by default the middle",
    "translate": "copies, each moved by x, y and z from the one before",
    "row": "evenly spaced copies; last= places the first part of the last copy",
    "edge": "radius of the edges",
    "radius": "one radius, or (first, second) for the two ends of a taper",
    "tilt": "degrees by which it leans to the rear, about the bottom front edge of its box",
    "lean": "length by which its top is shifted to the rear",
    "turn": "degrees about its own axis",
    "gap": "distance between the boxes",
    "step": "degrees from copy to copy, by default the full circle divided by their number",
    "last": "keywords of a point, as in last=at(top=2)",
    "start": "a point, as in start=at(left=3, top=0)",
    "through": "a point",
    "end": "a point; axes without a keyword are those of start",
}
"""The words of placed text."""


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
    pages += [_PROGRAM[_PROGRAM.index("Keywords") :] + "\n"] if name in BOX else []
    pages += [_role_page(registry.roles[name])] if name in registry.roles else []
    pages += [page(registry[name])] if name in registry else []
    if not pages:
        raise ShapeProgError(
            f"unknown word {name!r}", did_you_mean(name, [*_DOCS, *BOX, *registry.names, *registry.roles])
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
        example = f"{name}({', '.join(f'{word}=_' for word in needed[0].required or BOX[:3])})"
    plain = " ".join(word for word in keywords if word not in _DOCS)
    placed = [f"  {plain}"] if plain else []
    words = _table({word: _DOCS[word] for word in keywords if word in _DOCS})
    return "\n".join([example, "", f"  {_DOCS[name].capitalize()}.", "", *placed, *words]) + "\n"


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

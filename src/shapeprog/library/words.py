"""Names of the functions of a library: by their parts and the look of these, or by their arrangement."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence

from shapeprog.language.statement import language
from shapeprog.library.blocks import Kind

LOOKS = {
    "cylinder": "round", "rod": "round", "taper": "tapered", "bent_rod": "bent", "rounded_box": "soft",
    "board": "leaning", "bar": "slanting",
}  # fmt: skip
"""Adjectives for solids; a box has none."""

SOLIDS = {"cuboid": "", "rounded_box": "cushions"}
"""Solids in the plural that are not called as they are."""

PLACES = {
    ((2, "pair"),): "left_and_right", ((1, "pair"),): "front_and_rear", ((0, "pair"),): "below_and_above",
    ((2, "row"),): "left_to_right", ((1, "row"),): "front_to_rear", ((0, "row"),): "stack",
    ((1, "pair"), (2, "pair")): "four", ((0, "row"), (2, "pair")): "stacked_pairs",
    ((0, "row"), (2, "row")): "lattice", ((0, "row"), (1, "pair"), (2, "pair")): "stacked_fours",
    ((1, "row"), (2, "pair")): "pairs_to_rear", ((1, "pair"), (2, "row")): "pairs_to_left",
}  # fmt: skip
"""Names of arrangements, by the axes along which copies are repeated."""

WHOLES = {
    frozenset(parts.split()): name
    for parts, name in {
        "arm back base": "sofa", "arm base cushion": "sofa", "base panel top": "case_without_sides",
        "side top base": "case",
        "side top panel": "case", "leg apron": "leg_frame", "leg stretcher": "leg_frame", "post rail": "back_frame",
        "post slat": "slatted_back", "arm arm_post": "arm_rests", "door handle": "doors_with_handles",
        "drawer handle": "drawers_with_handles", "leg post": "side_frame", "seat leg": "stool", "top leg": "table",
        "base pedestal": "column", "back seat": "seat_with_back",
    }.items()
}  # fmt: skip
"""Names of sets of parts."""


def name_of(kinds: Sequence[Kind], used: Collection[str]) -> str:
    """A name for the function of some blocks that is not in use, and is no word of the language."""
    statements = language()
    blocked = {*used, *statements.names, *statements.roles}
    options = list(_one(kinds[0]) if len(kinds) == 1 else _several(kinds))
    numbered = (f"{options[0]}_{number}" for number in range(2, len(blocked) + 3))
    return next(option for option in [*options, *numbered] if option not in blocked)


def _one(kind: Kind) -> Iterator[str]:
    solids = SOLIDS.get(kind.shape, plural(kind.shape))
    ways = tuple((axis, "pair" if way == "mirror" else way) for axis, way in kind.repeats)
    position = PLACES.get(ways, "several")
    if kind.word:
        look = LOOKS.get(kind.shape, "")
        yield _joined(look, plural(kind.word))
        yield _joined(position, look, plural(kind.word))
    else:
        yield _joined(position, solids or ("boxes" if position == "four" else ""))


def _several(kinds: Sequence[Kind]) -> Iterator[str]:
    name = WHOLES.get(frozenset(kind.word for kind in kinds))
    if name:
        yield name
    yield "_with_".join(dict.fromkeys(plural(kind.word) if kind.repeats else kind.word for kind in kinds))


def _joined(*words: str) -> str:
    return "_".join(filter(None, words))


def plural(word: str) -> str:
    """The plural of an English noun: ``shelf`` and ``shelves``."""
    if word.endswith("foot"):
        return f"{word[:-4]}feet"
    if word.endswith("f"):
        return f"{word[:-1]}ves"
    if word.endswith(("s", "x", "ch", "sh")):
        return f"{word}es"
    if word.endswith("y") and word[-2:-1] not in "aeiou":
        return f"{word[:-1]}ies"
    return f"{word}s"

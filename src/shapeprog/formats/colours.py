"""One colour for each role and solid, the same in every file and picture.

Statements of the paper have hues of Paul Tol's colour-blind-safe schemes, where members of one family (tops, supports,
bases) are shades of one colour.  The other roles were placed by annealing in CIE Lab, so that roles that occur together
in a piece of furniture are at least 25 apart.
"""

from __future__ import annotations

from collections.abc import Mapping

from shapeprog.language.statement import language

Colour = tuple[int, int, int]  # red, green and blue from 0 to 255

_BY_NAME: Mapping[str, str] = {
    "leg": "#4477AA", "layer": "#44AA99", "sideboard": "#CC6677", "horizontal_bar": "#117733",
    "top_rectangle": "#DDAA33", "top_square": "#E8C25E", "top_circle": "#C8921A",
    "support_cylinder": "#332288", "support_cuboid": "#5A49B0",
    "base_circle": "#AA4499", "base_square": "#BF6BB2", "base_cross": "#8E3380",
    "vertical_board": "#88CCEE", "locker": "#8C6D46", "back": "#BB4455", "chair_beam": "#EE8866", "line": "#AABB33",
    "back_support": "#882255",
    "seat": "#DDAA33", "top": "#C8921A", "arm": "#22DDEE", "arm_post": "#117777", "headboard": "#BBAA55",
    "footboard": "#665500", "mattress": "#FF88AA", "cushion": "#BB99FF", "pillow": "#66AA44", "shelf": "#44AA99",
    "drawer": "#BB99AA", "door": "#AADD88", "handle": "#994400", "side": "#336644", "panel": "#88CCEE",
    "body": "#8C6D46", "base": "#AA4499", "foot": "#0099FF", "rail": "#FF8866", "slat": "#11CC99", "post": "#885555",
    "apron": "#556600", "stretcher": "#117733", "brace": "#CCCC99", "pedestal": "#5A49B0", "block": "#FF88CC",
    "box": "#8FA3BF", "board": "#8FA3BF", "leaning_box": "#8FA3BF", "bar": "#C2A878", "beam": "#C2A878",
    "cylinder": "#7FB09A", "rod": "#B58FB5", "taper": "#C98F7A", "bent_rod": "#9AAE5C",
}  # fmt: skip

_OTHERS = ("#66CCEE", "#EE6677", "#228833", "#CCBB44", "#AA3377", "#EE7733", "#009988", "#0077BB")
"""Colours of a user's own statements and roles, by their id."""


def colour(word: str) -> Colour:
    """The colour of a role or statement, built in or a user's own."""
    text = _BY_NAME.get(word) or _OTHERS[language().called(word).id % len(_OTHERS)]
    return (int(text[1:3], 16), int(text[3:5], 16), int(text[5:7], 16))


def hexadecimal(word: str) -> str:
    """The same colour as ``#rrggbb``."""
    return "#{:02x}{:02x}{:02x}".format(*colour(word))

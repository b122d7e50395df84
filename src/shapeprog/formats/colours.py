"""One colour per statement, the same in every file and picture.

Hues follow Paul Tol's colour-blind-safe schemes: the statements that meet in one piece of furniture are far apart in
hue and lightness, and members of one family (tops, supports, bases) are shades of one colour.
"""

from __future__ import annotations

from collections.abc import Mapping

Colour = tuple[int, int, int]
"""Red, green and blue from 0 to 255."""

_BUILT_IN: Mapping[int, str] = {
    1: "#4477AA",  # leg
    2: "#DDAA33", 3: "#E8C25E", 4: "#C8921A",  # tops
    5: "#44AA99",  # layer
    6: "#332288", 7: "#5A49B0",  # supports
    8: "#AA4499", 9: "#BF6BB2", 10: "#8E3380",  # bases
    11: "#CC6677",  # sideboard
    12: "#117733",  # horizontal bar
    13: "#88CCEE",  # vertical board
    14: "#8C6D46",  # locker
    15: "#BB4455",  # back
    16: "#EE8866",  # chair beam
    17: "#AABB33",  # line
    18: "#882255",  # back support
}  # fmt: skip

_OTHERS = ("#66CCEE", "#EE6677", "#228833", "#CCBB44", "#AA3377", "#EE7733", "#009988", "#0077BB")


def colour(statement: int) -> Colour:
    """The colour of the statement with this id, built in or a user's own."""
    text = _BUILT_IN.get(statement, _OTHERS[statement % len(_OTHERS)])
    return (int(text[1:3], 16), int(text[3:5], 16), int(text[5:7], 16))


def hexadecimal(statement: int) -> str:
    """The same colour as ``#rrggbb``."""
    return "#{:02x}{:02x}{:02x}".format(*colour(statement))

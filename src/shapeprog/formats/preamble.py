"""Definitions before the model of a script: those that the model calls, directly or through others."""

from __future__ import annotations

import re
from collections.abc import Sequence

_DEFINED = re.compile(r"^(?:module|function|def|class) (\w+)", re.MULTILINE)
_CALLED = re.compile(r"(\w+)\s*\(")


def needed(pieces: Sequence[str], text: str) -> list[str]:
    """The pieces of script, in order, that a text needs; pieces without a definition are kept."""
    named = [(found[1] if (found := _DEFINED.search(piece)) else "", piece) for piece in pieces]
    used: set[str] = {""}
    waiting = [text, *(piece for name, piece in named if not name)]
    while waiting:
        called = set(_CALLED.findall(waiting.pop())) - used
        waiting += [piece for name, piece in named if name in called]
        used |= called
    return [piece for name, piece in named if name in used]

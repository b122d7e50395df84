"""What a script defines before the model: of all definitions those that the model calls, and those that these call."""

from __future__ import annotations

import re
from collections.abc import Sequence

_DEFINED = re.compile(r"^(?:module|function|def|class) (\w+)", re.MULTILINE)
_CALLED = re.compile(r"(\w+)\s*\(")


def needed(pieces: Sequence[str], text: str) -> list[str]:
    """Those of some pieces of script, in their order, that define nothing or something that a text needs."""
    defined = [_DEFINED.search(piece) for piece in pieces]
    names = [found[1] if found else "" for found in defined]
    used: set[str] = {""}
    waiting = [text, *(piece for piece, name in zip(pieces, names, strict=True) if not name)]
    while waiting:
        called = set(_CALLED.findall(waiting.pop())) - used
        waiting += [piece for piece, name in zip(pieces, names, strict=True) if name in called]
        used |= called & set(names)
    return [piece for piece, name in zip(pieces, names, strict=True) if name in used]

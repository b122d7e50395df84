"""The designs of generators by name."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

from shapeprog.errors import ShapeProgError, did_you_mean
from shapeprog.models.chained import Chained
from shapeprog.models.generator import Generator
from shapeprog.models.swift import Swift
from shapeprog.models.tian2019 import Tian2019
from shapeprog.models.vocabulary import Vocabulary

DESIGNS: dict[str, type[Generator]] = {kind.design: kind for kind in (Tian2019, Swift, Chained)}
"""All designs."""


def build_generator(
    name: str, settings: dict[str, Any] | None = None, vocabulary: Vocabulary | None = None
) -> Generator:
    """A generator of a design, freshly initialised.

    Parameters
    ----------
    name
        Name of the design.
    settings
        Its settings; the defaults of the design where left out.
    vocabulary
        By default all statements in force.

    Raises
    ------
    ShapeProgError
        If there is no such design, or no such setting.
    """
    if name not in DESIGNS:
        raise ShapeProgError(f"there is no design {name!r}", did_you_mean(name, DESIGNS))
    kind = DESIGNS[name]
    allowed = {field.name for field in fields(kind.Settings)}
    for key in settings or {}:
        if key not in allowed:
            raise ShapeProgError(f"the design {name} has no setting {key!r}", f"it has {', '.join(sorted(allowed))}")
    return kind(kind.Settings(**(settings or {})), vocabulary or Vocabulary.current())

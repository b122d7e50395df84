"""A little of every kind in turn, for the quick suite: one process, whose beginning costs more than its cases."""

from __future__ import annotations

from collections.abc import Iterator

from . import loaders, programs


def seeds() -> dict[str, bytes]:
    """The valid files of all kinds."""
    return loaders.seeds() | programs.seeds()


def cases(seed: int) -> Iterator[tuple[str, bytes]]:
    """Two files of shapes and a program, again and again."""
    kinds = [loaders.mutants(seed), loaders.mutants(seed + 1), programs.mutants(seed)]
    return (case for three in zip(*kinds, strict=False) for case in three)

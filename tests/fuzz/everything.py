"""A little of every kind in turn, for the quick suite: one process, whose beginning costs more than its cases."""

from __future__ import annotations

from collections.abc import Iterator

from . import loaders, programs, weights


def seeds() -> dict[str, bytes]:
    """The valid files of all kinds."""
    return loaders.seeds() | programs.seeds() | weights.seeds()


def cases(seed: int) -> Iterator[tuple[str, bytes]]:
    """Two files of shapes, a program, and weights, again and again."""
    kinds = [loaders.cases(seed), loaders.cases(seed + 1), programs.cases(seed), weights.cases(seed)]
    return (case for four in zip(*kinds, strict=False) for case in four)

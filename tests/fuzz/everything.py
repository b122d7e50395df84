"""A little of every kind in turn, for the quick suite: one process, whose beginning costs more than its cases."""

from __future__ import annotations

from collections.abc import Iterator

from . import loaders, programs, weights


def seeds() -> dict[str, bytes]:
    """The valid files of all kinds."""
    return loaders.seeds() | programs.seeds() | weights.seeds()


def cases(seed: int) -> Iterator[tuple[str, bytes]]:
    """Two files of shapes, a program, and weights, again and again."""
    kinds = [loaders.mutants(seed), loaders.mutants(seed + 1), programs.mutants(seed), weights.mutants(seed)]
    return (case for four in zip(*kinds, strict=False) for case in four)

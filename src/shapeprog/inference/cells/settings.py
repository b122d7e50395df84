"""Settings of the search on cells."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Settings:
    """Limits and prices of the search on cells; chosen on val.

    Parameters
    ----------
    blocks
        Largest number of blocks.
    price
        Price of a statement in IoU.
    rounds
        Largest number of rounds of ruin and recreate.
    chunk
        Rounds from one start, between two checks of the deadline.
    families
        Number of random ways of repeating a box that one proposal tries.
    forms
        Share of proposals that also try a form other than a box.
    heat
        Largest loss of the objective that a first round may accept; it cools linearly.
    recall
        Share of proposals that use a block of earlier programs of the search, if one gains, instead of a new search.
    patience
        Rounds without a gain after which the search stops.
    starts
        Weights of an empty cell against an occupied one, from which greedy starts are made; the best start is kept.  A
        light weight finds solid bodies, a heavy one the boards of a shelf that a single filled box would swallow.
    planes
        Mirror planes nearest the middle that may pair a second loop with a first.
    copies
        Largest number of copies of one loop that the search proposes; descent may add more.
    kept
        Number of latest programs whose blocks the search may reuse.
    clusters
        Share of the rounds that remove a block together with its nearest neighbours.
    cluster_forms
        The share ``forms`` in such a round.
    """

    blocks: int = 10
    price: float = 0.001
    rounds: int = 600
    chunk: int = 20
    families: int = 200
    forms: float = 0.3
    heat: float = 0.004
    recall: float = 0.5
    patience: int = 180
    starts: tuple[float, ...] = (0.9, 2.0, 5.0)
    planes: int = 3
    copies: int = 8
    kept: int = 12
    clusters: float = 0.25
    cluster_forms: float = 0.7

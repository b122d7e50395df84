"""Settings of the search on cells."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Settings:
    """Limits and prices of the search on cells; chosen on val."""

    blocks: int = 10  #: blocks, at most
    price: float = 0.001  #: price of a statement in IoU

    # Greedy starts, the best of which is kept.
    starts: tuple[float, ...] = (0.9, 2.0, 5.0)
    """Weights of an empty cell against an occupied one, one for each start.  A light weight finds solid bodies, a heavy
    one the boards of a shelf that a single filled box would swallow."""

    # Rounds of ruin and recreate
    rounds: int = 600  #: rounds, at most
    chunk: int = 20  #: rounds from one start, between two checks of the deadline
    patience: int = 180  #: rounds without a gain after which the search stops
    heat: float = 0.004  #: loss of the objective that a first round accepts, at most; it cools linearly
    clusters: float = 0.25  #: share of the rounds that remove a block together with its nearest neighbours

    # Proposals
    families: int = 200  #: random ways of repeating a box that one proposal tries
    planes: int = 3  #: mirror planes nearest the middle that may pair a second loop with a first
    copies: int = 8  #: copies of one loop, at most; descent may add more
    forms: float = 0.3  #: share that also try a form other than a box
    cluster_forms: float = 0.7  #: the same where a block is removed together with its neighbours
    recall: float = 0.5  #: share that use a block of an earlier program, if one gains, instead of a new search
    kept: int = 12  #: latest programs whose blocks may be used again

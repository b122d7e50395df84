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
    patience: int = 300  #: rounds without a gain after which the search stops

    # Proposals
    families: int = 60  #: random ways of repeating a box that one proposal tries
    copies: int = 8  #: copies of one loop, at most; descent may add more
    forms: float = 0.4  #: share that also try a form other than a box

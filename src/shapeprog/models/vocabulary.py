"""What a generator can say: ids, parameters and legal blocks, read from the statements in force.

The id of a statement is its index, so ids mean the same in every set of weights.  A record of the vocabulary is kept
with the weights, which refuse a language in which a statement they know means something else.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from reprlib import repr as shortened
from typing import Any

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from shapeprog.errors import ShapeProgError
from shapeprog.language.program import PUBLISHED_DEPTH
from shapeprog.language.statement import EMPTY, END, SLOTS, Statement, language

Record = dict[str, dict[str, Any]]


@dataclass(frozen=True)
class Vocabulary:
    """The statements that a generator knows.

    Parameters
    ----------
    statements
        Declarations in order of their ids.
    steps
        Steps J of one block: up to J - 1 loops and one drawing statement.
    """

    statements: tuple[Statement, ...]
    steps: int = PUBLISHED_DEPTH

    @classmethod
    def current(cls) -> Vocabulary:
        """All statements in force that generators are taught."""
        return cls(tuple(each for each in language() if each.taught))

    @property
    def size(self) -> int:
        """Number of ids V: one above the largest; ids without a statement are never legal."""
        return max([END, *(each.id for each in self.statements)]) + 1

    @cached_property
    def used(self) -> Bool[Tensor, "V 7"]:
        """Which parameter slots each id uses."""
        table = torch.zeros(self.size, SLOTS, dtype=torch.bool)
        for each in self.statements:
            table[each.id, : each.size] = True
        return table

    @cached_property
    def discrete(self) -> Bool[Tensor, "V 7"]:
        """Which parameter slots of each id take whole numbers only."""
        table = torch.zeros(self.size, SLOTS, dtype=torch.bool)
        for each in self.statements:
            table[each.id, : each.size] = torch.tensor([quantity.discrete for quantity in each.quantities])
        return table

    @cached_property
    def ranges(self) -> Float[Tensor, "V 7 2"]:
        """Lowest and highest declared value of each slot; zero where a slot is not used."""
        table = torch.zeros(self.size, SLOTS, 2)
        for each in self.statements:
            table[each.id, : each.size] = torch.tensor([(quantity.low, quantity.high) for quantity in each.quantities])
        return table

    @cached_property
    def legal(self) -> Bool[Tensor, "J previous V"]:
        """Which id may stand at a step after which previous id; row V is for the first step, which has none.

        A block is empty, or up to J - 1 loops and then one drawing statement.  A loop that turns stands alone around
        a statement that has an axis of its own: these are the published blocks, extended to registered statements.
        """
        start = self.size
        table = torch.zeros(self.steps, self.size + 1, self.size, dtype=torch.bool)
        loops = [each for each in self.statements if each.is_loop]
        draws = [each for each in self.statements if not each.is_loop]
        table[1:, [EMPTY, *(each.id for each in draws)], EMPTY] = True
        table[0, start, [EMPTY, *(each.id for each in draws)]] = True
        for outer in loops:
            inside = [each for each in draws if each.pivot is not None] if turns(outer) else draws
            table[0, start, outer.id] = self.steps > 1
            table[1:, outer.id, [each.id for each in inside]] = True
            if not turns(outer):
                for inner in loops:
                    table[1:-1, outer.id, inner.id] = not turns(inner)
        return table

    def allowed(self, step: int, previous: Int[Tensor, " N"] | None) -> Bool[Tensor, "N V"]:
        """Which ids are legal at a step; ``previous`` is ``None`` at the first, one row then serves all."""
        table = self.legal[step]
        return table[-1:] if previous is None else table.to(previous.device)[previous]

    def record(self) -> Record:
        """The vocabulary as JSON: what each statement is called and takes."""
        return {each.name: _described(each) for each in self.statements}

    @staticmethod
    def check(record: Record) -> Vocabulary:
        """The vocabulary of a record, made of the statements in force.

        Statements that were registered since are left out: the weights know nothing of them.

        Raises
        ------
        ShapeProgError
            If a statement of the record is not in force or has changed; it names the statement.
        """
        known = language()
        for name, described in record.items():
            if name not in known:
                raise ShapeProgError(
                    f"the weights know a statement {name[:80]!r} that is not registered",
                    "load the module that declares it (--with FILE), or use weights trained without it",
                )
            if not isinstance(described, dict):
                raise ShapeProgError(f"the weights do not say what the statement {name!r} was", "use other weights")
            current = _described(known[name])
            changed = sorted(key for key in described | current if described.get(key) != current.get(key))
            if changed:
                told = "; ".join(f"{key} was {shortened(described.get(key))}, is {current.get(key)}" for key in changed)
                raise ShapeProgError(
                    f"the statement {name!r} has changed since the weights were trained: {told}",
                    "restore its declaration, give the new one another name, or train new weights",
                )
        return Vocabulary(tuple(each for each in known if each.name in record))


def turns(loop: Statement) -> bool:
    """Whether a loop turns what is inside, rather than only shifting it."""
    assert loop.move is not None
    named = loop.split(torch.ones(1, SLOTS))
    return loop.move(torch.zeros(1), torch.zeros(1, dtype=torch.bool), **named).turn is not None


def _described(declared: Statement) -> dict[str, Any]:
    parameters = [
        [each.name, each.quantity.kind, each.quantity.width, each.quantity.low, each.quantity.high]
        for each in declared.parameters
    ]
    return {"id": declared.id, "loop": declared.is_loop, "parameters": parameters}

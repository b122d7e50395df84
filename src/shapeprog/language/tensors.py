"""Programs as tensors: ids and parameters of K blocks x 3 steps x 7 slots, or more where needed, batched."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from shapeprog.errors import ShapeProgError
from shapeprog.language.program import PUBLISHED_DEPTH, Chain, Draw, Loop, Program, nest, programs_of
from shapeprog.language.statement import EMPTY, END, SLOTS, language
from shapeprog.lazy_torch import Tensor, torch
from shapeprog.space import Array


@dataclass(frozen=True)
class Code:
    """Programs as tensors: the statement of each step of each block, 0 for none, and its parameters in slot order.

    ``roles`` are those of the blocks, 0 for none; ``None`` if no block has any, as generators write.
    """

    ids: Int[Tensor, "*steps"]  # (..., K, J), or single blocks or steps
    parameters: Float[Tensor, "*steps slots"]
    roles: Int[Tensor, ...] | None = None

    def __post_init__(self) -> None:
        kind, sizes, ids = str(self.parameters.dtype), tuple(self.parameters.shape), tuple(self.ids.shape)
        if kind.endswith("float16"):
            raise ShapeProgError(f"parameters hold {kind}", "give float32 or float64, as parameters.float() does")
        if sizes[:-1] != ids:
            raise ShapeProgError(f"parameters have the shape {sizes}, ids {ids}", "give a row of slots for each id")

    def __getitem__(self, index: Any) -> Code:
        """The part at an index of the leading dimensions: an integer, a slice, a mask, or a tuple of these."""
        return Code(self.ids[index], self.parameters[index], None if self.roles is None else self.roles[index])

    def having(self, parameters: Float[Tensor, "*steps slots"]) -> Code:
        """The same statements and roles with other parameters."""
        return replace(self, parameters=parameters)


def encode(
    programs: Program | Sequence[Program], *, blocks: int | None = None, dtype: torch.dtype | None = None
) -> Code:
    """Tensors of programs: (B, K, J) for a sequence, (K, J) for one program.

    There are as many steps J as the longest block has, at least the published three, and as many blocks K as the
    longest program has, or as are asked for.  There are as many slots as the longest statement takes, at least the
    published seven.  A ``ShapeProgError`` if a program has more blocks, or a statement that is not declared so.
    """
    batch = programs_of(programs)
    chains = [program.chains for program in batch]
    needed = max([0, *map(len, chains)])
    steps = max([PUBLISHED_DEPTH, *(len(chain) for program in chains for chain in program)])
    rows = needed if blocks is None else blocks
    if needed > rows:
        message = f"a program of {needed} blocks does not fit {rows} blocks"
        raise ShapeProgError(message, "allow more blocks, or shorten the program")
    ids = np.zeros((len(batch), rows, steps), np.int64)
    slots = max([SLOTS, *(len(node.values) for program in chains for chain in program for node in chain)])
    parameters = np.zeros((len(batch), rows, steps, slots), np.float64)
    roles = np.zeros((len(batch), rows), np.int64)
    registry = language()
    for b, program in enumerate(chains):
        for k, chain in enumerate(program):
            for j, node in enumerate(chain):
                ids[b, k, j] = registry.declaration(node.name, len(node.values)).id
                parameters[b, k, j, : len(node.values)] = node.values
                if isinstance(node, Draw) and node.role:
                    roles[b, k] = registry.roles[node.role].id
    played = torch.from_numpy(roles) if roles.any() else None
    code = Code(torch.from_numpy(ids), torch.from_numpy(parameters).to(dtype or torch.float32), played)
    return code if isinstance(programs, Iterable) else code[0]


def decode(code: Code) -> list[Program]:
    """Programs of tensors (..., K, J), one for each element of the batch in row-major order.

    A block that is no loops-then-statement, such as one the generator got wrong, draws nothing and is left out, and so
    is one with a number that is not finite.  Counts and turns end at the last whole number that float32 holds exactly.
    """
    programs = math.prod(code.ids.shape[:-2])
    ids = code.ids.detach().cpu().reshape(programs, *code.ids.shape[-2:]).numpy()
    values = code.parameters.detach().cpu().float().reshape(programs, *code.parameters.shape[-3:]).numpy()
    played = torch.zeros(code.ids.shape[:-1], dtype=torch.long) if code.roles is None else code.roles
    roles = played.cpu().reshape(programs, -1).tolist()
    blocks = (map(_chain, *program) for program in zip(ids, values, roles, strict=True))
    return [Program(tuple(nest(chain) for chain in chains if chain is not None)) for chains in blocks]


def _chain(ids: Array, values: Array, role: int) -> Chain | None:
    """The loops and the statement of one block with its role; ``None`` where it is no such thing."""
    registry = language()
    chain: list[Loop] = []
    for step, number in enumerate(ids.tolist()):
        if number not in registry or registry[number].size > values.shape[1]:
            return None
        declared = registry[number]
        used = values[step, : declared.size]
        if not np.isfinite(used).all():
            return None
        numbers = tuple(
            quantity.nearest(value) if quantity.discrete else value
            for value, quantity in zip(used.tolist(), declared.quantities, strict=True)
        )
        if declared.is_loop:
            chain.append(Loop(declared.name, numbers, ()))
            continue
        following = set(ids[step + 1 :].tolist())
        played = registry.role(role) if role else None
        statement = Draw(declared.name, numbers, played.name if played else "")
        return (*chain, statement) if following <= {EMPTY, END} else None
    return None

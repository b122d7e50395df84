"""A program as a function of its named numbers, for gradients and for least squares.

chair = Parametric(program)
numbers = chair.values.clone().requires_grad_()
loss(unroll(chair.at(numbers))).backward()     # numbers.grad: one entry for each of chair.names
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from jaxtyping import Float, Int

from shapeprog.arguments import check_tensor
from shapeprog.errors import ShapeProgError
from shapeprog.language.ast import Source
from shapeprog.language.evaluate import symbolic
from shapeprog.language.expression import Linear
from shapeprog.language.named import names
from shapeprog.language.parameters import LARGEST, Quantity
from shapeprog.language.program import Program, program_of
from shapeprog.language.statement import Statement, language
from shapeprog.language.tensors import Code, encode
from shapeprog.lazy_torch import Tensor, torch

ROUNDING = 1e-5  # cells by which a length may be negative, as one of zero may come out


class Parametric:
    """The tensors of a program for any values of its free named numbers; counts, turns and axes do not change.

    The larger radius of an upright taper stays the one that places it, unlike in :func:`shapeprog.set`.

    Attributes
    ----------
    names, values
        The F free numbers that others follow from, without those that are whole, and their values in the program.
    slots
        Which M numbers of the flattened ``code.parameters`` depend on them.
    matrix, offset
        ``offset + matrix @ values`` are those numbers where all of them are linear in the names, as
        :class:`~shapeprog.language.expression.Linear` has it; else ``None``.
    code
        The tensors of the unchanged program, in float64.
    """

    names: tuple[str, ...]
    values: Float[Tensor, " F"]
    slots: Int[Tensor, " M"]
    matrix: Float[Tensor, "M F"] | None
    offset: Float[Tensor, " M"] | None
    code: Code

    def __init__(self, program: Program) -> None:
        program = program_of(program)
        free = [named for named in names(program) if named.free and not named.whole]
        self._source = program.source or Source()
        self.names = tuple(named.name for named in free)
        self.values = torch.tensor([named.value for named in free], dtype=torch.float64)
        self.code = encode(program, dtype=torch.float64)
        moving = self._moving(dict(zip(self.names, self.values, strict=True)))
        self.slots = torch.tensor(list(moving), dtype=torch.long)
        lengths = [self._place(slot)[2].kind == "length" for slot in moving]
        self._least = torch.tensor([-ROUNDING if length else -LARGEST for length in lengths], dtype=torch.float64)
        self.matrix = self.offset = None
        try:
            forms = list(self._moving({name: Linear.of(name) for name in self.names}).values()) if moving else []
        except ShapeProgError:  # a product of names
            return
        factors = [dict(form.factors) for form in forms]
        rows = [[row.get(name, 0.0) for name in self.names] for row in factors]
        self.matrix = torch.tensor(rows, dtype=torch.float64).reshape(len(forms), len(free))
        self.offset = torch.tensor([form.constant for form in forms], dtype=torch.float64)

    def at(self, values: Float[Tensor, "*batch F"]) -> Code:
        """The program for other values of its names, one for each entry of a batch, with gradient.

        Raises
        ------
        ShapeProgError
            If these are no values, as many as there are names, in float32 or float64; and, where no gradient is
            recorded, if they make a length negative or a number not finite.  Where one is, steps may pass through such
            values: a negative length draws nothing, unless ``unroll`` is given the ``shortest``.
        """
        check_tensor("values", values, len(self.names))
        if self.matrix is not None and self.offset is not None:
            numbers = self.offset.to(values) + values @ self.matrix.to(values).T
        else:
            result = self._moving(dict(zip(self.names, values.unbind(-1), strict=True)))
            numbers = torch.stack(list(result.values()), -1)
        if not (torch.is_grad_enabled() and numbers.requires_grad):
            self._check(numbers)
        lead, original = values.shape[:-1], self.code.parameters
        flat = original.to(values).flatten().expand(*lead, -1).index_copy(-1, self.slots.to(values.device), numbers)
        ids, roles = self.code.ids.expand(*lead, *self.code.ids.shape), self.code.roles
        roles = None if roles is None else roles.expand(*lead, *roles.shape)
        return Code(ids, flat.reshape(*lead, *original.shape), roles)

    def _check(self, numbers: Float[Tensor, "*batch M"]) -> None:
        """Refuse numbers in ``slots`` that are not finite, and lengths among them that are negative."""
        good = (numbers >= self._least.to(numbers)) & (numbers <= LARGEST)  # neither is true of NaN
        if not bool(good.all()):
            index = tuple((~good).nonzero()[0].tolist())
            block, statement, quantity = self._place(int(self.slots[index[-1]]))
            message = f"a {quantity.kind} of {statement.name} in block {block + 1} is {numbers[index]:g}"
            entry = f" in entry {', '.join(map(str, index[:-1]))}" if index[:-1] else ""
            raise ShapeProgError(f"{message} with these values{entry}", "lengths are not negative, and numbers finite")

    def _place(self, slot: int) -> tuple[int, Statement, Quantity]:
        """Block, statement and quantity of a number among all."""
        row, place = divmod(slot, self.code.parameters.shape[-1])
        statement = language()[int(self.code.ids.flatten()[row])]
        return row // self.code.ids.shape[-1], statement, statement.quantities[place]

    def _moving(self, scope: Mapping[str, Any]) -> dict[int, Any]:
        """The continuous numbers that depend on names, by their place among all, for these values of the names."""
        _, steps, slots = self.code.parameters.shape
        result: dict[int, Any] = {}
        for block, chain in enumerate(Program(symbolic(self._source, scope)).chains):
            for step, node in enumerate(chain):
                quantities = language()[node.name].quantities
                for slot, (quantity, number) in enumerate(zip(quantities, node.values, strict=True)):
                    if not isinstance(number, int | float) and not quantity.discrete:
                        result[(block * steps + step) * slots + slot] = number
        return result

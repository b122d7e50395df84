"""Primitives as structures of arrays: of one kind as statements return them, and in padded slots as all is computed."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields
from functools import cached_property
from typing import TypeVar

import numpy as np
from jaxtyping import Bool, Float, Int

from shapeprog.errors import ShapeProgError
from shapeprog.geometry.primitives import primitives
from shapeprog.lazy_torch import Tensor, torch

Some = TypeVar("Some", bound="Batch")


@dataclass(frozen=True)
class Solids:
    """Primitives of one kind as a statement returns them, in cells of the grid frame, with any leading dimensions.

    ``kind`` is the number in the registry; sizes are in the order that the primitive declares; the columns of
    ``rotation`` are the local axes, ``None`` when they are those of the grid.
    """

    kind: int
    size: Float[Tensor, "*batch 4"]
    centre: Float[Tensor, "*batch 3"]
    rotation: Float[Tensor, "*batch 3 3"] | None = None


@dataclass(frozen=True)
class Batch:
    """``N`` slots of primitives for each element of a batch; ``mask`` is true for slots that hold one.

    A local point p of slot n lies at ``centre[n] + rotation[n] @ p``.  Padding has size and centre zero, no rotation.
    """

    kind: Int[Tensor, "*batch N"]
    size: Float[Tensor, "*batch N 4"]
    centre: Float[Tensor, "*batch N 3"]
    rotation: Float[Tensor, "*batch N 3 3"]
    mask: Bool[Tensor, "*batch N"]

    @property
    def batch_shape(self) -> torch.Size:
        """Leading dimensions, with one union of primitives for each element."""
        return self.mask.shape[:-1]

    @property
    def device(self) -> torch.device:
        """Where the tensors are."""
        return self.mask.device

    @cached_property
    def kinds(self) -> list[int]:
        """Kinds of primitive in use."""
        return np.flatnonzero(np.bincount(self.kind[self.mask].cpu().numpy())).tolist()

    @property
    def bounds(self) -> Float[Tensor, "*batch N 3"]:
        """Half extents of the box around each primitive in its local frame, with gradient to sizes."""
        half = torch.zeros_like(self.centre)
        for kind in self.kinds:
            of_kind = self.mask & (self.kind == kind)
            half = torch.where(of_kind[..., None], primitives[kind].bound(self.size), half)
        return half

    @property
    def reach(self) -> Float[Tensor, "*batch N 3"]:
        """Half extents of the box around each primitive along the axes of the grid, with gradient."""
        return (self.rotation.abs() @ self.bounds[..., None])[..., 0]

    @property
    def volumes(self) -> Float[Tensor, "*batch N"]:
        """Volume of each primitive, with gradient to sizes."""
        volume = torch.zeros_like(self.centre[..., 0])
        for kind in self.kinds:
            volume = torch.where(self.mask & (self.kind == kind), primitives[kind].volume(self.size), volume)
        return volume

    def __len__(self) -> int:
        return self.mask.shape[0]

    def __iter__(self: Some) -> Iterator[Some]:
        return (self[index] for index in range(len(self)))

    def __getitem__(self: Some, index: int | slice | Tensor | tuple[slice | Tensor, Tensor]) -> Some:
        """The element or elements at an index, or a choice, of the first dimensions."""
        return self._map(lambda tensor: tensor[index])

    def flatten(self: Some) -> Some:
        """The same with exactly one batch dimension."""
        lead, count = len(self.batch_shape), self.batch_shape.numel()
        return self if lead == 1 else self._map(lambda tensor: tensor.reshape(count, *tensor.shape[lead:]))

    def detach(self: Some) -> Some:
        """The same without gradient."""
        return self._map(lambda tensor: tensor.detach())

    def _map(self: Some, change: Callable[[Tensor], Tensor]) -> Some:
        return type(self)(*(change(getattr(self, field.name)) for field in fields(self)))


def check_batch(value: object) -> None:
    """Refuse anything but a batch, such as a program that was not unrolled."""
    if not isinstance(value, Batch):
        message = f"a {type(value).__name__} is given where a scene is needed"
        raise ShapeProgError(message, "give sp.unroll(program)")

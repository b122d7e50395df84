"""Primitives and scenes: distance, surface, cells, mesh, and losses; here are the names that declarations need."""

from shapeprog.geometry.batch import Solids
from shapeprog.geometry.primitive import Primitive
from shapeprog.geometry.primitives import primitives

__all__ = ["Primitive", "Solids", "primitives"]

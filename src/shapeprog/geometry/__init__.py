"""Primitives and scenes: distance, surface, occupancy, mesh, and the losses between shapes."""

from shapeprog.geometry import cuboid as cuboid
from shapeprog.geometry import cylinder as cylinder
from shapeprog.geometry.primitive import Primitive, primitives
from shapeprog.geometry.scene import Scene, Solids

__all__ = ["Primitive", "Scene", "Solids", "primitives"]

"""Oriented boxes around primitives.

Vectors are those of a person in front of the whole: to the right, to the rear, upwards.
"""

from __future__ import annotations

from shapeprog.geometry.scene import Scene
from shapeprog.geometry.separation import OrientedBoxes
from shapeprog.space import FloatArray


def boxes_of(scene: Scene) -> OrientedBoxes:
    """The boxes around the primitives of a scene (N,)."""
    edges = scene.rotation.transpose(1, 2) * scene.bounds[..., None]
    return OrientedBoxes(viewed(scene.centre.numpy()), viewed(edges.numpy()))


def viewed(vectors: FloatArray) -> FloatArray:
    """Vectors (..., 3) along the axes of the grid as those of a person in front of the whole."""
    result: FloatArray = vectors[..., ::-1] * [-1, 1, 1]
    return result

"""Candidates for unexplained points: boxes around clusters of points far from the surface of a program."""

from __future__ import annotations

import numpy as np
import torch
from scipy.spatial import cKDTree

from shapeprog.geometry.distance import signed_distance
from shapeprog.inference.candidates.drawings import drawings
from shapeprog.inference.candidates.loops import images
from shapeprog.inference.candidates.settings import SETTINGS
from shapeprog.inference.fit.tunable import THINNEST
from shapeprog.inference.pieces.oriented import bounds, boxes_around
from shapeprog.inference.surface.components import linked
from shapeprog.inference.surface.evidence import Evidence
from shapeprog.language.hints import Box
from shapeprog.language.program import Node, Program
from shapeprog.language.unroll import unroll


def residual_candidates(program: Program, evidence: Evidence) -> list[Node]:
    """Drawings of the boxes around clusters of visible points far from a program, and their mirror images."""
    tensor = torch.from_numpy(evidence.points)
    far = signed_distance(unroll(program), tensor).abs().numpy() > SETTINGS.far * evidence.tolerance
    points = evidence.points[far & (evidence.weights > evidence.weights.max() / 2)]
    if len(points) < SETTINGS.cluster_points:
        return []
    reach = SETTINGS.cluster_reach * (evidence.area / len(evidence.points)) ** 0.5
    pairs = cKDTree(points).query_pairs(reach, output_type="ndarray")
    cluster = linked(pairs, len(points))
    size = np.bincount(cluster)
    largest = np.argsort(-size, kind="stable")[: SETTINGS.clusters]
    members = [np.flatnonzero(cluster == label) for label in largest[size[largest] >= SETTINGS.cluster_points]]
    if not members:
        return []
    around = boxes_around(points[np.concatenate(members)], bounds(members))
    half = np.maximum(around.half, THINNEST / 2)
    nodes = [
        drawing for box in zip(around.centre, around.rotation, half, strict=True) for drawing in drawings(Box(*box))
    ]
    return [*nodes, *images(nodes, evidence.surface)]

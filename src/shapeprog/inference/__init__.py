"""Inference by search: propose, roll into loops, edit, refine, name; greedy boxes as the baseline."""

from shapeprog.inference.greedy import greedy_boxes
from shapeprog.inference.infer import Result, infer
from shapeprog.inference.refine import Schedule, refine
from shapeprog.inference.snapping import snap, snapped_from
from shapeprog.inference.structure import Settings

__all__ = ["Result", "Schedule", "Settings", "greedy_boxes", "infer", "refine", "snap", "snapped_from"]

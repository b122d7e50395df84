from .cells.settings import Settings
from .cells.structure import greedy_boxes
from .fit.adjustment import refine
from .infer import Result, infer

__all__ = ["Result", "Settings", "greedy_boxes", "infer", "refine"]

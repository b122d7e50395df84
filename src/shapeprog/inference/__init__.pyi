from .cells.search import greedy_boxes
from .cells.settings import Settings
from .fit.adjustment import refine
from .infer import Result, infer

__all__ = ["Result", "Settings", "greedy_boxes", "infer", "refine"]

from .cells.refine import Schedule, refine
from .cells.settings import Settings
from .cells.structure import greedy_boxes
from .infer import Result, infer

__all__ = ["Result", "Schedule", "Settings", "greedy_boxes", "infer", "refine"]

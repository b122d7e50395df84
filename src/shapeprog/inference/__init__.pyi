from .cells.greedy import greedy_boxes
from .cells.refine import Schedule, refine
from .cells.settings import Settings
from .infer import Result, infer

__all__ = ["Result", "Schedule", "Settings", "greedy_boxes", "infer", "refine"]

from .greedy import greedy_boxes
from .infer import Result, infer
from .refine import Schedule, refine
from .snapping import snap, snapped_from
from .structure import Settings

__all__ = ["Result", "Schedule", "Settings", "greedy_boxes", "infer", "refine", "snap", "snapped_from"]

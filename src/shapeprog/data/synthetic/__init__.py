"""Synthetic furniture: programs of many kinds of furniture, drawn at random and rendered as they are asked for."""

from shapeprog.data.synthetic.mixture import Prior
from shapeprog.data.synthetic.priors import PRIORS, prior, programs
from shapeprog.data.synthetic.store import read_programs, write_programs
from shapeprog.data.synthetic.stream import Batch, Stream

__all__ = ["PRIORS", "Batch", "Prior", "Stream", "prior", "programs", "read_programs", "write_programs"]

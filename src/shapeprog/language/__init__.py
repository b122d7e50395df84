"""The language of shape programs: statements by declaration, text, tensors, unrolling."""

from shapeprog.language import builtin as builtin
from shapeprog.language import furniture as furniture
from shapeprog.language.evaluate import evaluated
from shapeprog.language.named import Named, inline, names, set
from shapeprog.language.parametric import Parametric
from shapeprog.language.program import Draw, Loop, Program
from shapeprog.language.statement import Language, Role, Statement, language, loop, role, standard, statement, using
from shapeprog.language.tensors import Code, decode, encode
from shapeprog.language.unroll import unroll

__all__ = [
    "Code", "Draw", "Language", "Loop", "Named", "Parametric", "Program", "Role", "Statement",
    "decode", "encode", "evaluated", "inline", "language", "loop", "names", "role", "set", "standard", "statement",
    "unroll", "using",
]  # fmt: skip

"""The language of shape programs: statements by declaration, text, tensors, unrolling."""

from shapeprog.language import builtin as builtin
from shapeprog.language.program import Draw, Loop, Program
from shapeprog.language.statement import Language, Statement, language, loop, standard, statement, using
from shapeprog.language.tensors import Code, decode, encode
from shapeprog.language.unroll import unroll

__all__ = [
    "Code", "Draw", "Language", "Loop", "Program", "Statement",
    "decode", "encode", "language", "loop", "standard", "statement", "unroll", "using",
]  # fmt: skip

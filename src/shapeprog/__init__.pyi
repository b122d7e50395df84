from . import liang2022
from .data.from_arrays import shape_from_mesh, shape_from_points, shape_from_voxels
from .data.loading import load_all, load_shape
from .data.random import random_program
from .data.shape import Shape
from .errors import InputError, OutputError, ProgramError, ShapeProgError
from .evaluation.metrics import Metrics
from .evaluation.scoring import evaluate
from .formats.files import export, load, save
from .formats.json_form import program_from_json, program_to_json
from .formats.plugins import load_statements
from .geometry.losses import chamfer, coverage
from .geometry.scene import Scene
from .geometry.surface import sample
from .inference.fit.adjustment import refine
from .inference.infer import infer
from .language.ast import Source
from .language.dimensions import in_unit
from .language.evaluate import evaluated
from .language.expression import Expression, Linear, Name
from .language.named import Named, inline, names, set
from .language.parametric import Parametric
from .language.parser import parse
from .language.printer import format_program
from .language.program import Draw, Loop, Program
from .language.statement import loop, statement
from .language.tensors import Code, decode, encode
from .language.unit import Unit
from .language.unroll import unroll
from .library import Library, learn, load_library, save_library, with_library
from .space import Frame

__version__: str

__all__ = [
    "Code", "Draw", "Expression", "Frame", "InputError", "Library", "Linear", "Loop", "Metrics", "Name", "Named",
    "OutputError", "Parametric", "Program", "ProgramError", "Scene", "Shape", "ShapeProgError", "Source", "Unit",
    "chamfer", "coverage", "decode", "encode", "evaluate", "evaluated", "export", "format_program", "in_unit",
    "infer", "inline", "learn", "liang2022", "load", "load_all", "load_library", "load_shape", "load_statements",
    "loop", "names", "parse", "program_from_json", "program_to_json", "random_program", "refine", "sample", "save",
    "save_library", "set", "shape_from_mesh", "shape_from_points", "shape_from_voxels", "statement", "unroll",
    "with_library",
]  # fmt: skip

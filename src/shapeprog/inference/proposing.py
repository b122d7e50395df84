"""Proposals for the structure search, written with a generator.

The generator looks at the target and at what is drawn, and suggests several next blocks at the cost of one look.  They
are weighed by the cells they gain, and the best few are improved by descent; what gains most is drawn before the
generator looks again.  So a program is as good as the best the generator can think of, not as its likeliest thought.
"""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

import numpy as np
import numpy.typing as npt
import torch

from shapeprog.errors import ShapeProgError
from shapeprog.geometry.cells import cells_of, pack, words_of
from shapeprog.inference.block_layout import WIDTH
from shapeprog.inference.budget import NEVER, Deadline
from shapeprog.inference.drawing import Rows, draw_all
from shapeprog.inference.editing import improve_block
from shapeprog.inference.pool import Pool
from shapeprog.inference.raster_kernels import ROWS
from shapeprog.inference.reading import from_code
from shapeprog.inference.refine import single_threaded
from shapeprog.inference.structure import Proposals
from shapeprog.language.program import Program
from shapeprog.models.checkpoint import SHIPPED, SUFFIX, load_generator
from shapeprog.models.decoding import decode as write
from shapeprog.models.decoding import programs, suggest, whole_programs
from shapeprog.models.generator import Generator
from shapeprog.models.vocabulary import Vocabulary
from shapeprog.space import RESOLUTION, FloatArray

DEFAULT = "default"
"""Weights that take part unless others, or none, are asked for."""

WASTE = 0.9
"""Weight of an empty cell against an occupied one."""

FRUITLESS = 2
"""Looks in a row of which nothing gained, after which the generator is not asked again."""

BEST = 3
"""Suggestions for one place that descent improves before they are compared."""


def propose_program(
    generator: Generator,
    voxels: npt.NDArray[np.bool_],
    *,
    blocks: int,
    suggestions: int,
    price: float,
    seed: int = 0,
    deadline: Deadline = NEVER,
) -> Proposals:
    """A program for a solid of cells (32, 32, 32), built of the suggestions of a generator, and all it suggested.

    Parameters
    ----------
    blocks
        Most blocks of the program.
    suggestions
        Blocks that the generator suggests each time it looks.
    price
        IoU that one statement has to earn.
    deadline
        When the generator is not asked again.
    """
    occupied = words_of(pack(voxels)).reshape(-1)
    cost = price * int(voxels.sum())
    device = next(generator.parameters()).device
    target = torch.from_numpy(voxels.astype(np.uint8))[None].to(device)
    random = torch.Generator(device).manual_seed(seed)
    covered: Rows = np.zeros(ROWS, np.uint32)
    program: FloatArray = np.zeros((0, WIDTH))
    loose: list[FloatArray] = []
    memory, fruitless = None, 0
    with single_threaded():
        while len(program) < blocks and fruitless < FRUITLESS:
            if deadline.passed(f"the generator after {len(program)} of at most {blocks} blocks"):
                break
            canvas = cells_of(covered).reshape(1, RESOLUTION, RESOLUTION).to(device)
            code, memory = suggest(generator, target, canvas, memory, suggestions, random)
            suggested = from_code(code)
            pool, improved = Pool.of([suggested], cost), []
            for block in pool.several(occupied, covered, WASTE, BEST):
                improved.append(improve_block(block, occupied, covered, price, 1)[0][None])
            gain, best = Pool.of(improved, cost).best(occupied, covered, WASTE)
            loose.append(suggested)
            fruitless += 1
            if gain > 0:
                fruitless = 0
                program = np.concatenate([program, best[None]])
                covered = covered | draw_all(best[None])
    return Proposals((program,), np.concatenate([np.zeros((0, WIDTH)), *loose]))


def single_pass(generator: Generator, voxels: npt.NDArray[np.bool_], blocks: int) -> tuple[Program, Program]:
    """The program of at most ``blocks`` blocks that the generator writes in a single pass, and the same as drawn."""
    device = next(generator.parameters()).device
    target = torch.from_numpy(voxels.astype(np.uint8))[None].to(device)
    with single_threaded():
        said = write(generator, target, blocks=blocks)
    return programs(said.code)[0], whole_programs(said.drawn)[0]


def ready_generator(asked: Generator | str | Path | None, *, needed: bool = False) -> tuple[Generator | None, str]:
    """The generator that is asked for, and what hinders it where the default one cannot be used.

    Parameters
    ----------
    needed
        Whether there is no going on without one.

    Raises
    ------
    InputError
        If other weights than the default ones are asked for, and there are none or they are broken.
    ShapeProgError
        If a statement that they know has changed, or there is no generator where one is needed.
    """
    found, hindered = _asked_for(asked)
    if found is None and needed:
        raise ShapeProgError(
            f"there is no generator to write a program{': ' * bool(hindered)}{hindered}",
            "name weights (--weights; list them with: shapeprog models), or let the search find a program",
        )
    return found, hindered


def _asked_for(asked: Generator | str | Path | None) -> tuple[Generator | None, str]:
    if asked is None or isinstance(asked, Generator):
        return asked, ""
    path = SHIPPED / f"{asked}{SUFFIX}" if str(asked) == DEFAULT else Path(asked)
    if str(asked) != DEFAULT:
        return _loaded(str(asked), path.stat().st_mtime_ns if path.is_file() else 0, Vocabulary.current()), ""
    if not path.is_file():
        return None, ""
    try:
        return _loaded(DEFAULT, path.stat().st_mtime_ns, Vocabulary.current()), ""
    except ShapeProgError as error:
        return None, error.message


@lru_cache(2)
def _loaded(name: str, changed: int, vocabulary: Vocabulary) -> Generator:
    """Weights, read once as long as neither the file nor the language changes."""
    return load_generator(name)[0]

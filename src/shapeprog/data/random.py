"""Random programs from the declared ranges, for tests and as raw material for training."""

from __future__ import annotations

import torch

from shapeprog.arguments import MOST_SEED, check_number
from shapeprog.language.program import PUBLISHED_DEPTH, Chain, Draw, Loop, Program, nest
from shapeprog.language.statement import Statement, language


def random_program(
    generator: torch.Generator | int,
    *,
    blocks: int = 6,
    depth: int = PUBLISHED_DEPTH,
    copies: int = 4,
    whole: bool = False,
    published: bool = False,
) -> Program:
    """A program whose statements, loops and numbers are drawn uniformly from the declarations in force.

    Half of the parts play a role other than their own name.

    Parameters
    ----------
    generator
        Where the randomness comes from, or the seed of a new generator; the same state gives the same program.
    blocks
        How many drawing statements; loops are drawn for each.
    depth
        How many steps a block may have: one statement and up to ``depth - 1`` loops around it.
    copies
        The largest number of copies of a loop, within its declared range; at least one is drawn.
    whole
        Whether all numbers are whole, as in published programs.
    published
        Whether to stay within the published blocks.

    Raises
    ------
    ShapeProgError
        If the generator is neither a generator nor a seed, or another argument is out of range.
    """
    for name, number in (("blocks", blocks), ("depth", depth), ("copies", copies)):
        check_number(name, number, name == "depth", whole=True)
    if not isinstance(generator, torch.Generator):
        check_number("generator", generator, 0, MOST_SEED, whole=True)
        generator = torch.Generator().manual_seed(generator)
    drawing = [declared for declared in language() if not declared.is_loop]
    loops = [declared for declared in language() if declared.is_loop]
    body: list[Chain] = []
    while len(body) < blocks and drawing:
        levels = _pick(generator, depth) if loops else 0
        chain = [drawing[_pick(generator, len(drawing))]]
        chain = [loops[_pick(generator, len(loops))] for _ in range(levels)] + chain
        steps = [_step(generator, declared, copies, whole) for declared in chain]
        candidate: Chain = tuple(steps)
        if not published or not outside_published(Program((nest(candidate),))):
            body.append(candidate)
    return Program(tuple(nest(chain) for chain in body))


def outside_published(program: Program) -> list[str]:
    """Why a program leaves the published blocks [k], [19,k], [19,19,k], [20,10], [20,17], which have no roles."""
    reasons = []
    for number, chain in enumerate(program.chains, 1):
        ids = [language()[node.name].id for node in chain]
        words = [word for node in chain for word in (getattr(node, "role", ""), node.name) if word]
        plain = 1 <= ids[-1] <= 18 and ids[:-1] in ([], [19], [19, 19])
        if len(words) > len(chain) or not (plain or ids in ([20, 10], [20, 17])):
            reasons.append(f"block {number} ({' > '.join(words)}) is none of the published blocks")
    return reasons


def _pick(generator: torch.Generator, choices: int) -> int:
    return int(torch.randint(choices, (), generator=generator, device=generator.device))


def _step(generator: torch.Generator, declared: Statement, copies: int, whole: bool) -> Draw | Loop:
    values = []
    for quantity in declared.quantities:
        low, high = quantity.low, quantity.high
        if quantity.kind == "count":
            low = max(low, 1.0)
            high = max(low, min(high, float(copies)))
        if quantity.discrete or whole:
            values.append(float(low + _pick(generator, int(high - low) + 1)))
        else:
            part = torch.rand((), generator=generator, device=generator.device)
            values.append(float((low + (high - low) * part).clamp(low, high)))
    if declared.is_loop:
        return Loop(declared.name, tuple(values), ())
    roles = [role for role in language().roles if role != declared.name]
    plays = bool(roles) and _pick(generator, 2)
    return Draw(declared.name, tuple(values), roles[_pick(generator, len(roles))] if plays else "")

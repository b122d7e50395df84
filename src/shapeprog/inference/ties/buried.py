"""Parts that nobody sees: ties that make faces flush may leave a thin part wholly inside of others, or a part on its
own mirror image."""

from __future__ import annotations

from dataclasses import replace

import torch
from jaxtyping import Float
from torch import Tensor

from shapeprog.geometry.distance import signed_distance
from shapeprog.geometry.losses import volume
from shapeprog.geometry.scene import Scene
from shapeprog.geometry.surface import has_surface, sample_surface
from shapeprog.language.program import Chain, Loop, Program, nest
from shapeprog.language.tensors import encode
from shapeprog.language.unroll import unroll

SAMPLES = 512
"""Points of the surface of each block that are looked at."""

ON = 0.011
"""Cells above the others up to which a point counts as covered: numbers have two decimals."""

FEW = 512
"""Copies of a block that are compared with each other."""

SEEN = 0.005
"""Share of its surface that is left of a part that is seen."""


def buried(program: Program) -> list[int]:
    """The blocks whose whole surface lies inside or on that of the others; of several that hide each other the
    smallest."""
    scene = unroll(encode([Program(program.body)], dtype=torch.float64))
    found: list[int] = []
    while hidden := _hidden(scene):
        found.append(min(hidden)[1])
        scene = replace(scene, mask=scene.mask & (scene.block != found[-1]))
    return sorted(found)


def doubled(program: Program) -> list[Chain]:
    """The blocks of a program, without loops of two whose copies lie on each other; none if there is no such loop."""
    chains, scene = Program(program.body).chains, unroll(Program(program.body))
    found = [_once(chain) if _meet(scene.centre[scene.block == block]) else chain for block, chain in enumerate(chains)]
    return found if found != [*chains] else []


def _meet(centres: Float[Tensor, "N 3"]) -> bool:
    """Whether two of these, if they are few, lie at one place."""
    return len(centres) <= FEW and bool((torch.pdist(centres) <= ON).any())


def _once(chain: Chain) -> Chain:
    """A block without loops of two whose copies lie on each other."""
    for place, loop in enumerate(chain):
        if isinstance(loop, Loop) and loop.count == 2:
            rest = (*chain[:place], *chain[place + 1 :])
            both, one = (unroll(encode([Program((nest(each),))], dtype=torch.float64)) for each in (chain, rest))
            points = sample_surface(both, SAMPLES, torch.Generator().manual_seed(0)).points
            if bool((signed_distance(one, points) <= ON).all()):
                return _once(rest)
    return chain


def _hidden(scene: Scene) -> list[tuple[float, int]]:
    """The blocks of a scene (1, N) that nothing is seen of beside the others, each behind its volume."""
    blocks = torch.unique(scene.block[scene.mask])
    own = scene.mask & (scene.block == blocks[:, None])
    several = scene[torch.zeros(len(blocks), dtype=torch.long)]
    mine, rest = replace(several, mask=own), replace(several, mask=scene.mask & ~own)
    drawn = has_surface(mine) & has_surface(rest)
    if not drawn.any():
        return []
    points = sample_surface(mine[drawn], SAMPLES, torch.Generator().manual_seed(0)).points
    seen: Float[Tensor, " B"] = (signed_distance(rest[drawn], points) > ON).double().mean(-1)
    hidden = seen < SEEN
    return list(zip(volume(mine[drawn][hidden]).tolist(), blocks[drawn][hidden].tolist(), strict=True))

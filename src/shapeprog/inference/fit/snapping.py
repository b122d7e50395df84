"""Blocks onto the components of a mesh that they draw: the box around a component is exact, a fit to samples is not."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from shapeprog.inference.candidates.drawings import drawings, scene_of
from shapeprog.inference.candidates.loops import loop_values
from shapeprog.inference.fit.settings import FIT
from shapeprog.inference.surface.evidence import Evidence, off_parts
from shapeprog.language.hints import Box
from shapeprog.language.program import Loop, Program, nest


def snapped(program: Program, evidence: Evidence) -> Program:
    """The program, of one node for each block, with parts and rows that end where components of the target do.

    A copy lies on a component if no face of the box around it is farther off than ``FIT.component``, or if both share
    most of the box around them: the fit does not know ends that other parts hide.  The first copy of a block is drawn
    anew on its component, if its statement draws such boxes in one way; rows end at that of their last copy, if it is
    another.
    """
    if not program.size or not len(evidence.parts):
        return program
    scene = scene_of(program.body)
    off = off_parts(scene, evidence)
    straight = scene.mask & (scene.rotation.abs().amax(-1) > 1 - 1e-9).all(-1)
    ends, near = evidence.parts[nearest := off.argmin(-1)], off.min(-1)
    centre, reach = scene.centre.numpy(), scene.reach.numpy()
    low, high = np.stack([centre - reach, ends[..., 0, :]]), np.stack([centre + reach, ends[..., 1, :]])
    shared, around = (high.min(0) - low.max(0)).clip(0).prod(-1), (high.max(0) - low.min(0)).prod(-1)
    on = straight.numpy() & ((near <= FIT.component) | (near < np.inf) & (shared >= FIT.shared * around))
    middle, half = ends.mean(-2), (ends[..., 1, :] - ends[..., 0, :]) / 2
    body = list(program.body)
    for row, (chain, draw) in enumerate(zip(program.chains, program.draws, strict=True)):
        loops = [node for node in chain if isinstance(node, Loop)]
        slots, copies = np.flatnonzero(scene.mask[row]), math.prod(loop.count for loop in loops)
        if len(slots) != copies or not on[row, first := slots[0]]:
            continue
        options = drawings(Box(middle[row, first], np.eye(3), half[row, first]), draw.name)
        if len(options) != 1:
            continue
        for level, loop in enumerate(loops):
            copies //= loop.count
            last = slots[copies * (loop.count - 1)]
            other = nearest[row, last] != nearest[row, first]  # copies within .5 cells may be near the same component
            if loop.name == "translate" and on[row, last] and other:
                way = (middle[row, last] - middle[row, first]) / max(loop.count - 1, 1)
                step = np.where(np.array(loop.values[1:]) == 0, 0.0, way)
                loops[level] = replace(loop, values=loop_values(loop.count, *step.tolist()))
        body[row] = nest((*loops, replace(options[0], role=draw.role)))
    return Program(tuple(body))

"""Blocks onto the components of a mesh that they draw: the box around a component is exact, a fit to samples is not."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from scipy.spatial.distance import cdist

from shapeprog.geometry.mesh import part_meshes
from shapeprog.inference.candidates.drawings import drawings, scene_of
from shapeprog.inference.candidates.loops import loop_values
from shapeprog.inference.fit.settings import FIT
from shapeprog.inference.surface.evidence import Evidence, off_parts, seen_along
from shapeprog.inference.surface.oriented import primitive_boxes
from shapeprog.inference.surface.settings import SURFACE
from shapeprog.language.hints import Box, level_ends
from shapeprog.language.parameters import to_float32
from shapeprog.language.program import Draw, Loop, Program, nest
from shapeprog.language.statement import language


def snapped(program: Program, evidence: Evidence) -> Program:
    """The program, of one node for each block, with parts and rows that end where components of the target do.

    A copy lies on a component if no face of the box around it is farther off than ``FIT.component``, or, outside of
    rows, if both share most of the box around them: the fit does not know ends that other parts hide.  The first copy
    of a block is drawn anew on its component, if its statement draws such boxes in one way, or as a sheared box if the
    mesh has its corners; rows end at that of their last copy, if it is another.
    """
    if not program.size or not len(evidence.part_fill):
        return program
    scene = scene_of(program.body)
    strict, loose = (off_parts(scene, evidence, limit) for limit in (SURFACE.off_box, SURFACE.off_fill))
    off = np.where(strict.min(-1, keepdims=True) <= FIT.component, strict, loose)
    nearest, distance = off.argmin(-1), off.min(-1)
    centre, axes, half = primitive_boxes(scene)
    away, reach = seen_along(axes, centre, evidence.parts, nearest)
    low, high = np.stack([away - reach, -half]), np.stack([away + reach, half])
    shared, around = (high.min(0) - low.max(0)).clip(0).prod(-1), (high.max(0) - low.min(0)).prod(-1)
    close = distance <= FIT.component
    mostly = (distance < np.inf) & (shared >= FIT.shared * around)
    middle = evidence.parts.centre[nearest]
    body = list(program.body)
    for row, (chain, draw) in enumerate(zip(program.chains, program.draws, strict=True)):
        loops = [node for node in chain if isinstance(node, Loop)]
        slots, copies = np.flatnonzero(scene.mask[row]), math.prod(loop.count for loop in loops)
        alone = all(loop.name != "translate" for loop in loops)  # copies in a row may be on components of other sizes
        if len(slots) != copies or not (close | (mostly & alone))[row, first := slots[0]]:
            continue
        component = nearest[row, first]
        box = Box(*(column[component] for column in evidence.parts))
        options = drawings(box, draw.name)
        if len(options) != 1:
            continue
        if draw.name in ("board", "bar") and "leaning_box" in language():
            sheared = (Draw("leaning_box", tuple(map(to_float32, values))) for values in level_ends(box))
            options += [each for each in sheared if _has_corners(each, evidence)]
        if strict[row, first, component] == np.inf and len(options) == 1:
            continue
        for level, loop in enumerate(loops):
            copies //= loop.count
            last = slots[copies * (loop.count - 1)]
            other = nearest[row, last] != nearest[row, first]  # copies within .5 cells may be near the same component
            if loop.name == "translate" and close[row, last] and other:
                way = (middle[row, last] - middle[row, first]) / max(loop.count - 1, 1)
                step = np.where(np.array(loop.values[1:]) == 0, 0.0, way)
                loops[level] = replace(loop, values=loop_values(loop.count, *step.tolist()))
        body[row] = nest((*loops, replace(options[-1], role=draw.role)))
    return Program(tuple(body))


def _has_corners(draw: Draw, evidence: Evidence) -> bool:
    """Whether a vertex of the mesh lies at each corner of a box: mitred ends fill as much of it as level ones."""
    assert evidence.mesh is not None
    (solid,) = part_meshes(scene_of([draw])[0])
    return bool(cdist(solid.vertices, evidence.mesh.vertices).min(1).max() <= FIT.on_plane)

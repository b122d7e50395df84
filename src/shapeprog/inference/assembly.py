"""Structure from the surface: a program of few blocks that explains the visible surface of a target.

Pieces of the target become single blocks, and copies among them loops.  A first choice is fitted briefly, then competes
with its neighbours and with boxes around unexplained points.  The result is connected, fitted, moved onto the planes of
a mesh, separated where pairs have different roles, drawn on components, pruned, and connected again; changes that harm
are undone, and parts are centred and texts shortened where that is free.  A whole of another size is chosen again.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple

from shapeprog.data.remarks import remark_on_size
from shapeprog.geometry.surface import hidden_groups
from shapeprog.inference.budget import NEVER, Deadline, Progress
from shapeprog.inference.candidates.drawings import canonical_side, simplest, solid_boxes
from shapeprog.inference.candidates.loops import distinct, images, repeated, rows
from shapeprog.inference.candidates.neighbours import neighbours, recounted, residual_candidates, shorter
from shapeprog.inference.candidates.singles import single_candidates
from shapeprog.inference.choice.choice import choose, explained, missed, value
from shapeprog.inference.choice.connecting import connected, floating
from shapeprog.inference.choice.coverage import Coverage
from shapeprog.inference.fit.adjustment import adjust
from shapeprog.inference.fit.planes import on_planes
from shapeprog.inference.fit.snapping import snapped
from shapeprog.inference.pieces.pieces import Source, find_pieces
from shapeprog.inference.roles.roles import in_order, separated, with_roles
from shapeprog.inference.surface.evidence import Evidence
from shapeprog.language.free import numbers
from shapeprog.language.hints import Box
from shapeprog.language.program import Node, Program
from shapeprog.language.unroll import unroll

MOST_CANDIDATES = 1_500  # most candidates that are compared; half of them may be single blocks
SIDE = 0.03  # price of each side of the target in a second choice, if the first program is a tenth too small
LEAST_GAIN = 0.0005  # share of the surface from which another block is mentioned


class Assembly(NamedTuple):
    """A program, none where there is no surface to speak of; the share of the visible surface that it explains; and why
    it has no more blocks."""

    program: Program
    explained: float
    reason: str


def assemble(
    coverage: Coverage, *, blocks: int = 10, seed: int = 0, deadline: Deadline = NEVER,
    progress: Progress | None = None, candidates: list[Node] | None = None,
) -> Assembly:  # fmt: skip
    """A program of at most ``blocks`` blocks for the surface of a mesh or a point cloud; the same for the same seed."""
    evidence, report = coverage.evidence, progress or (lambda step, share: None)
    report("finding structure", 0.1)
    candidates = candidates or _candidates(evidence)
    if not candidates or evidence.area <= 0:
        return Assembly(Program(), 0.0, "")
    report("finding structure", 0.7)
    chosen, others = _chosen(candidates, coverage, blocks, seed, deadline)
    start = connected(Program(tuple(chosen)), coverage)
    adjusted = adjust(start, evidence, deadline=deadline, progress=progress)
    fitted = separated(on_planes(_unharmed(adjusted, start, coverage), evidence), blocks)
    exact = _unharmed(snapped(fitted, evidence), fitted, coverage, 0.08)
    program = connected(_pruned(exact, coverage), coverage)
    program = in_order(with_roles(separated(canonical_side(simplest(program)), blocks)))  # pruning may change roles
    table = coverage.table([*program.body, *others[:1]])
    share, more = (explained(table, range(number)) for number in (program.blocks, len(table.prices)))
    hidden = float(evidence.weights[evidence.weights < evidence.weights.max()].sum())
    result = Assembly(program, share, _reason(program.blocks, blocks, share, hidden, more - share, others))
    unlike = not coverage.prices.side and remark_on_size(unroll(program), evidence.surface)
    if not unlike or deadline.passed("another choice that reaches the sides of the target"):
        return result
    coverage = Coverage(evidence, replace(coverage.prices, side=SIDE))
    again = assemble(coverage, blocks=blocks, seed=seed, deadline=deadline, progress=progress, candidates=candidates)
    return result if remark_on_size(unroll(again.program), evidence.surface) else again


def _candidates(evidence: Evidence) -> list[Node]:
    """Single blocks for the pieces of a target, the most important first, and loops over copies of them."""
    pieces = find_pieces(evidence)
    singles = distinct(single_candidates(pieces))
    components = pieces.boxes.take(pieces.boxes.straight & (pieces.source == Source.COMPONENT.value))
    loops = repeated(singles, list(rows([[Box(*box)] for box in zip(*components, strict=True)])))
    loops = distinct([*loops, *images([*singles, *loops], pieces.cloud.points)])
    return [*singles[: MOST_CANDIDATES // 2], *loops][:MOST_CANDIDATES]


def _chosen(
    candidates: list[Node], coverage: Coverage, blocks: int, seed: int, deadline: Deadline
) -> tuple[list[Node], list[Node]]:
    """A choice among a first one, for point clouds also one with a wide tolerance, their adjusted forms and neighbours,
    boxes around unexplained points, and candidates passed over; and the others, those that would explain most first."""
    evidence = coverage.evidence
    first, others = _choice(candidates, coverage, blocks, seed)
    if not first or deadline.passed("another choice among neighbours"):
        return first, others
    starts = [first]
    if evidence.mesh is None:
        wide = replace(evidence, tolerance=1.5 * evidence.tolerance, reach=1.5 * evidence.reach)
        starts.append(_choice(candidates, Coverage(wide, coverage.prices), blocks, seed)[0])
    pool = first.copy()
    for nodes in starts:
        adjusted = adjust(Program(tuple(nodes)), evidence, steps=8, deadline=deadline)
        pool += [*nodes, *adjusted.body, *neighbours(adjusted), *residual_candidates(adjusted, evidence)]
    pool = list(dict.fromkeys([*pool, *others[:200]]))  # the first choice first: the search starts there
    return _choice(pool, coverage, blocks, seed, range(len(first)))


def _choice(
    nodes: list[Node], coverage: Coverage, blocks: int, seed: int, start: Sequence[int] = ()
) -> tuple[list[Node], list[Node]]:
    """The most valuable blocks, and the others, those that would explain most of the rest first."""
    table = coverage.table(nodes)
    chosen = choose(table, blocks, start=start, seed=seed)
    return [nodes[index] for index in chosen], [nodes[index] for index in missed(table, chosen)]


def _unharmed(adjusted: Program, start: Program, coverage: Coverage, harm: float = 0.005) -> Program:
    """The adjusted program; blocks whose adjustment costs more than ``harm`` of the target are restored.

    A block loses a loop, nested loops become one row, or a part slightly off the middle is centred, where the text
    becomes cheaper and that costs less than .001, the error of the coverage; and a row loses a copy that costs nothing,
    such as a shelf inside the top.  Of two texts of equal price the more valuable stays.
    """
    options = [(index, node, harm) for index, node in enumerate(start.body)]
    for index, (chain, solids) in enumerate(zip(adjusted.chains, solid_boxes(adjusted.draws), strict=True)):
        options += [(index, node, -0.001) for node in shorter(chain, solids)]
        options += [(index, node, -0.00001) for node in recounted(chain, solids, -1)]
    nodes = [*adjusted.body, *(node for _, node, _ in options)]
    table, selected = coverage.table(nodes), tuple(range(len(start.body)))
    text = [(price, Program((node,)).size) for price, node in zip(table.prices, nodes, strict=True)]
    for option, (index, _, least) in enumerate(options, len(selected)):
        trial, before = (*selected[:index], option, *selected[index + 1 :]), text[selected[index]]
        needed = max(least, 0.0) if text[option] == before else least
        if (least > 0 or text[option] <= before) and value(table, trial) > value(table, selected) + needed:
            selected = trial
    return Program(tuple(nodes[option] for option in selected))


def _pruned(program: Program, coverage: Coverage) -> Program:
    """The program without blocks that connect nothing and cost more than they explain, or are hidden in others."""
    table, every, scene = coverage.table(program.body), tuple(range(program.blocks)), unroll(program)
    hidden = hidden_groups(scene, scene.block)
    fewer = [(every[:index] + every[index + 1 :], index in hidden) for index in every]
    better = [rest for rest, unseen in fewer if unseen or value(table, rest) > value(table, every)]
    for rest in sorted(better, key=partial(value, table), reverse=True):
        shorter_program = Program(tuple(program.body[index] for index in rest))
        if len(floating(connected(shorter_program, coverage))) <= len(floating(connected(program, coverage))):
            return _pruned(shorter_program, coverage)
    return program


def _reason(used: int, allowed: int, share: float, hidden: float, gain: float, others: Sequence[Node]) -> str:
    """Why the program has so many blocks, which explain this share, and not also the first of the others."""
    text = f"{used} drawing statement{'s cover' if used != 1 else ' covers'} {share:.0%} of the surface"
    text += f" ({hidden:.0%} is hidden inside)" * (hidden >= 0.1)
    if used >= allowed:
        return f"{text}; this is the maximum, raise --blocks for more."
    if gain < LEAST_GAIN:
        return f"{text}; no other candidate covers another {LEAST_GAIN:.2%}."
    more = numbers(Program(tuple(others[:1])))
    return f"{text}; one more would cover another {gain:.1%} with {more} more numbers: raise --detail to add it."

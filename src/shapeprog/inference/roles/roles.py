"""Roles of the parts of a program: one for every drawing statement, by rules on its solids alone.

First the kind of the whole is determined.  A seat or a bed has a main surface with a part that rises behind it, a seat
may have parts that rise on both sides instead; neither is closed above or in front between walls as high as the whole.
All else is a table or a case.  A chair may face any way.  Then the first rule of its list that fits a solid gives it a
role.  Copies of one statement have one role: that of most of their surface, or one that covers all of theirs.  A row of
two parts of different roles becomes two statements, and so do boxes mirrored from front to rear.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import cycle

import numpy as np

from shapeprog.geometry.scene import Scene
from shapeprog.inference.candidates.drawings import redrawn_by, simplest, solid_boxes
from shapeprog.inference.candidates.loops import mirrors
from shapeprog.inference.roles.measures import Mask, Parts
from shapeprog.language.parameters import to_float32
from shapeprog.language.program import Draw, Node, Program, nest
from shapeprog.language.statement import language
from shapeprog.language.unroll import unroll
from shapeprog.space import DEPTH, SIDE, UP, Frame, axis_name

Rule = tuple[str, Callable[[Parts], Mask]]


def anything(p: Parts) -> Mask:
    """All parts."""
    return np.ones(p.count, bool)


SUPPORTING: tuple[Rule, ...] = (
    # What carries a main surface, or hangs below it.
    ("pedestal", lambda p: p.below & p.central & p.upright & (p.equal == 1)),
    ("foot", lambda p: p.below & p.grounded & ~p.level & p.small),
    ("leg", lambda p: p.below & p.upright),
    ("base", lambda p: p.below & (p.wide | (p.slender & p.grounded))),
    ("apron", lambda p: (p.below | p.alongside) & p.level & (p.top >= p.main_low[UP] - 1.5 * p.near)),
    ("stretcher", lambda p: p.below & ~p.grounded & (p.level | p.lying)),
    ("leg", lambda p: p.below),
)

SEATING: tuple[Rule, ...] = (
    ("base", lambda p: p.below & p.grounded & (p.top < p.main_high[UP] + p.near) & (p.span > 0.3) & ~p.slender),
    ("shelf", lambda p: p.wide & p.below & (p.top < p.main_low[UP] - 1.5 * p.near)),
    ("cushion", lambda p: p.wide & p.alongside & p.padded & (p.bottom >= p.main_low[UP] - p.near)),
    ("base", lambda p: p.main & ~p.lying & p.grounded),
    ("seat", lambda p: p.main | (p.wide & (p.alongside | p.below) & (p.top <= p.main_high[UP] + 2 * p.near))),
    # A part from the ground to above the seat is a leg as well.
    ("leg", lambda p: p.rising & p.grounded & p.upright),
    # Behind: a back, its rails and slats, its posts.
    ("slat", lambda p: p.rising & p.level & ((p.equal >= 5) | (p.behind & (p.span >= 0.5) & (p.equal >= 3)))),
    ("rail", lambda p: p.rising & p.behind & (p.span >= 0.5) & p.level & (p.up <= p.size[UP] / 4)),
    ("rail", lambda p: p.rising & p.behind & (p.span >= 0.5) & p.highest & (p.up <= 0.1 * p.size[UP])),
    ("back", lambda p: p.rising & p.behind & (p.span >= 0.5)),
    # At the sides: arm rests and their posts.
    ("arm_post", lambda p: p.rising & (p.aside > 0.3) & (p.rear < 0.25) & p.upright),
    ("arm", lambda p: p.rising & (p.aside > 0.3) & ((p.rear < 0.25) | (p.run > 0.5))),
    ("slat", lambda p: p.rising & p.upright & (p.aside < 0.35) & (p.equal >= 3)),
    ("post", lambda p: p.rising & p.slender),
    ("back", lambda p: p.rising),
    *SUPPORTING,
    ("block", anything),
)

BED: tuple[Rule, ...] = (
    ("headboard", lambda p: p.head_or_foot & (p.rear > 0.25) & (p.top >= p.main_high[UP] + p.near)),
    ("footboard", lambda p: p.head_or_foot & (p.rear < -0.25)),
    ("mattress", lambda p: p.wide & ~p.below & (p.top <= p.main_high[UP] + 2 * p.near)),
    ("pillow", lambda p: (p.bottom >= p.main_high[UP] - 2 * p.near) & ~p.slender & (p.run <= 0.5)),
    ("side", lambda p: (p.aside > 0.3) & (p.run >= 0.5)),
    ("slat", lambda p: p.level & (p.equal >= 5)),
    *SUPPORTING,
    ("leg", lambda p: p.grounded & p.upright),  # up to a headboard
    ("post", lambda p: p.upright),
    ("rail", lambda p: p.level),
    ("body", anything),
)

CASE: tuple[Rule, ...] = (
    # In front: a plinth, doors and drawers with their handles.
    ("base", lambda p: p.front & p.grounded & (p.rear < 0) & (p.up <= np.where(p.in_front, 0.2, 0.3) * p.size[UP])),
    ("handle", lambda p: p.tiny & p.in_front & p.backed & ~p.grounded & (p.long <= 0.3 * p.size.max())),
    ("door", lambda p: p.front & p.in_front & p.backed & ((p.up >= p.side) | (p.up > 0.5 * p.size[UP]))),
    ("drawer", lambda p: p.front & p.in_front & p.backed),
    # Lying boards: the highest is the top, one on the ground the base.
    ("top", lambda p: (p.wide | p.main) & p.highest & (p.up <= 0.3 * p.size[UP])),
    ("base", lambda p: p.wide & p.flat & (p.grounded | (p.cased & p.lowest))),
    ("base", lambda p: p.wide & p.grounded & (p.up <= 0.2 * p.size[UP])),
    ("shelf", lambda p: p.wide & p.flat & p.board),
    ("body", lambda p: p.bulky),
    # Standing boards at the sides, within and behind.
    ("side", lambda p: p.wall & p.outermost & (p.long >= 0.3 * p.size[UP])),
    ("panel", lambda p: p.wall | p.front),
    # Sticks.
    ("foot", lambda p: p.grounded & ~p.level & p.small),
    ("brace", lambda p: p.slender & ~p.grounded & (p.rise > 0.35) & (p.rise < 0.97)),
    ("pedestal", lambda p: p.upright & p.central & (p.equal == 1)),
    ("post", lambda p: p.upright & p.walled & (p.top >= p.floor + 0.6 * p.size[UP])),
    ("leg", lambda p: p.grounded & ((p.slender & ~p.level) | p.stubby)),
    ("post", lambda p: p.upright),
    ("base", lambda p: p.level & p.grounded),
    ("rail", lambda p: p.level & p.cased),
    ("apron", lambda p: p.level & (p.top >= p.floor + 0.8 * p.size[UP])),
    ("stretcher", lambda p: p.level),
    # All other parts.
    ("top", lambda p: p.lying & p.board & p.highest & (p.up <= 0.3 * p.size[UP])),
    ("shelf", lambda p: p.lying & p.flat),
    ("drawer", lambda p: p.cased & p.in_front & ~p.grounded),
    ("block", anything),
)

MIXED = ({"top", "base", "shelf"}, "shelf"), ({"door", "drawer", "panel", "side"}, "panel")
"""Roles of copies whose positions have different roles, as the top and the base of one loop."""


def with_roles(program: Program) -> Program:
    """The program with a role for every plain solid, one node for each block; existing roles are kept.

    A box that is a leg is written as the statement ``leg``.
    """
    return redrawn_by(program, map(_named, program.draws, roles_of_blocks(program)))


def separated(program: Program, most: int) -> Program:
    """The program, of one node for each block, with pairs of different roles as two blocks each, while there are at
    most so many: rows of two copies, and boxes mirrored from front to rear, such as a door and the back of a case."""
    body = list(program.body)
    for index in reversed(range(len(body))):
        *outer, draw = Program((body[index],)).chains[0]
        for k, loop in enumerate(outer):
            shift = _to_copy(loop, outer[k + 1 :], draw)
            if shift is None or len(body) >= most:
                continue
            pair = [nest((*outer[:k], *outer[k + 1 :], copy)) for copy in (draw, _shifted(draw, shift))]
            trial = [*body[:index], *pair, *body[index + 1 :]]
            roles = roles_of_blocks(Program(tuple(trial)))
            if roles[index] != roles[index + 1]:
                body = trial
                break
    return Program(tuple(body))


def _to_copy(loop: Node, inner: Sequence[Node], draw: Node) -> Sequence[float] | None:
    """How far the second copy of a pair is from the first, along up, depth and side; ``None`` for other loops."""
    if loop.name == "translate" and loop.values[0] == 2 and not inner:
        return loop.values[1:]
    level = all((node.name == "translate" and node.values[1 + DEPTH] == 0) or mirrors(node, SIDE) for node in inner)
    if mirrors(loop, DEPTH) and level and draw.name in ("box", "cushion"):
        ((box,),) = solid_boxes([draw])
        return 0.0, 2 * (loop.values[2] - float(box.centre[DEPTH])), 0.0
    return None


def _shifted(draw: Node, shift: Sequence[float]) -> Node:
    """A drawing statement with its positions moved along up, depth and side."""
    along = cycle(shift)
    kinds = (quantity.kind for quantity in language()[draw.name].quantities)
    values = (v + next(along) if kind == "position" else v for v, kind in zip(draw.values, kinds, strict=True))
    return replace(draw, values=tuple(map(to_float32, values)))


def named_anew(program: Program) -> Program:
    """The program with each block drawn by the plainest statement, with a role by its neighbours, and in order;
    existing roles are ignored."""
    bare = redrawn_by(program, (Draw(draw.name, draw.values) for draw in program.draws))
    return in_order(with_roles(simplest(bare)))


def in_order(program: Program) -> Program:
    """The program, of one node for each block, as a person would list it: the main surface, then from the floor up.

    At one height the larger come first.
    """
    scene = unroll(program)
    if not scene.mask.any():
        return program
    parts = Parts(scene)

    def rank(index: int) -> tuple[bool, int, float]:
        mine = parts.block == index
        level = round(float((parts.bottom[mine] - parts.floor).min(initial=parts.size[UP])) / parts.near)
        return not parts.main[mine].any(), level, -float(parts.surface[mine].sum())

    return Program(tuple(program.body[index] for index in sorted(range(len(program.body)), key=rank)))


def roles_of_blocks(program: Program) -> list[str]:
    """The role of each block: that of most of the surface of its copies, none where it draws nothing."""
    scene = unroll(program)
    shares = [defaultdict[str, float](float) for _ in range(program.blocks)]
    if scene.mask.any():
        parts = _facing(scene)
        roles = np.full(parts.count, "", object)
        for role, fits in (("body", anything),) if parts.count == 1 else _kind(parts):
            roles[(roles == "") & fits(parts)] = role
        for block, role, surface in zip(parts.block.tolist(), roles, parts.surface.tolist(), strict=True):
            shares[block][role] += surface
    return [_common(share) for share in shares]


def _common(share: dict[str, float]) -> str:
    """One role for copies that have so much surface in each of several."""
    role = max(share, key=share.__getitem__, default="")
    if role and share[role] < 0.75 * sum(share.values()):
        return next((common for names, common in MIXED if set(share) <= names), role)
    return role


def _named(draw: Draw, role: str) -> Draw:
    """The drawing statement with a role, if it has none yet and can have one."""
    if draw.role or role not in language().roles or language()[draw.name].hint is None:
        return draw
    if (draw.name, role) == ("box", "leg"):
        return Draw("leg", draw.values)
    return replace(draw, role="" if role == draw.name else role)


def _facing(scene: Scene) -> Parts:
    """The parts unchanged, or in a frame turned by quarters so that the back, which is on one side alone, is behind."""
    parts = Parts(scene)
    if _leaned_on(parts) > 0:
        return parts
    return max((parts, *(Parts(scene, turns) for turns in (2, 1, 3))), key=_leaned_on)  # unchanged where all are 0


def note_on_front(program: Program, frame: Frame) -> str:
    """A sentence about the back of a seat or bed that is not behind; empty if it is, or there is none."""
    scene, sat_on = unroll(program), {"seat", "mattress"}.intersection(draw.word for draw in program.draws)
    turns = _facing(scene).turns if sat_on and scene.mask.any() else 0
    side, k, sign = (("", 0, 0), ("on the left", SIDE, -1), ("in front", DEPTH, 1), ("on the right", SIDE, 1))[turns]
    return side and f"Its back seems to be {side}: if so, add --front {axis_name(sign * np.array(frame.axes)[:, k])}."


def _leaned_on(p: Parts) -> float:
    """How much surface rises behind the main surface and not before it, if the whole has a back there; 0 if not."""
    behind = float(p.surface[p.rising & (p.rear > 0.25)].sum())
    before = float(p.surface[p.rising & (p.rear < -0.25)].sum())
    return behind - before if _kind(p) is not CASE and before < behind / 2 else 0.0  # arm rests may end before it


def _kind(p: Parts) -> tuple[Rule, ...]:
    """The rules for the kind of the whole."""
    walls = p.wall & p.outermost & (p.up >= 0.6 * p.size[UP]) & (p.top >= p.floor + 0.9 * p.size[UP])
    above = p.wide & (p.top >= p.floor + 0.8 * p.size[UP])
    closed = above | ((p.front | p.level) & p.rising & (p.rear < 0) & (p.span > 0.3))  # a sofa is open above its seat
    plate = p.main_high[UP] < p.floor + 0.05 * p.size[UP]  # the base of a coat rack
    if not p.main.any() or plate or (walls.sum() > 1 and closed.any()) or (p.rising & p.bulky).any():
        return CASE
    high = p.rising & (p.top >= p.main_high[UP] + 0.12 * p.size[UP])
    if (high & (p.rear > 0.1)).any():
        return BED if _is_bed(p) else SEATING
    arms = (p.low + p.high - p.main_low - p.main_high)[high & (p.aside > 0.3), SIDE]
    return SEATING if (arms < 0).any() and (arms > 0).any() and not p.cased else CASE


def _is_bed(p: Parts) -> bool:
    """Whether a seat or a bed is a bed: low, not much wider than long, and covered by its main surface evenly."""
    _, depth, side = p.size
    low = p.size[UP] < (0.6 if depth > side else 0.5) * depth
    face, off = p.face[p.main], (p.low + p.high - p.main_low - p.main_high)[p.main, SIDE] / 2
    covered = (p.main_high - p.main_low)[DEPTH:].prod() >= 0.6 * depth * side
    covered &= face.sum() >= 0.3 * depth * side  # also by slats
    even = abs(off @ face) <= 0.05 * side * face.sum()  # a corner sofa has more on one side
    return bool(low and covered and even and depth > 0.75 * side)

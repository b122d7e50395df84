"""Ties: which relations between the numbers of a program are found again, and which are found that there are not.

    python -m benchmarks.ties --out ties.jsonl
    python -m benchmarks.ties DATA/partnet_chairs --sets chairs --objects 80 --out chairs_val.jsonl
    python -m benchmarks.ties --table ties.jsonl

=========  ============================================================================================================
set        what is tied
=========  ============================================================================================================
fitted     programs of the prior ``furniture`` with normal noise of .05 cells on every number (angles and steps: as much
           as moves a surface so far), and as evidence the points of the planted solids: how inference ties
alone      the same programs without any evidence: how ``shapeprog tidy`` ties
rows       placed programs with a row of 3 to 30 equal parts, with parts that divide a box, or with parts in an inner
           box, with the same noise and evidence
inferred   what inference finds for the meshes of those
small      the same for meshes with 3 to 12 small parts in a row: drawers with handles, rungs, feet
chairs     what inference finds for PartNet chairs, of which it is known which parts are copies of each other
=========  ============================================================================================================

*Planted.*  A furniture is designed by relations: drawn again with other measures and otherwise alike, what is related
still is.  Relations are equalities between features of parts: their sides, middles, lengths, radii and steps.  Each
planted part is compared with the nearest one of the tied program, however it is written there; how its features follow
from the free numbers is measured by finite differences.  A relation is planted where it holds in every redrawing, up to
the rounding of lengths.  Relations follow from each other, so they are counted as a space of rows has dimensions:
``recall`` is the share of the dimensions of the planted relations that hold in the tied program.  Of the dimensions of
what the tied program holds to, those are ``chance`` that the planted furniture happens to hold to within twice the
noise, and ``false`` those that vary from redrawing to redrawing otherwise.  ``mixed`` is the share of the keywords with
a shared name whose others are of another kind, such as a clearance and a radius.

*Groups.*  ``found``: the equal parts are one statement with the right count (``counted``), with every side within one
cell (``near``), and a box or division is written as one (``grouped``).

*Chairs.*  Two primitives that stand for two parts (IoU >= .5, each its own) share their numbers where their sizes stay
the same whatever the free numbers of the program: a loop repeats them, or the same names and expressions give them.
``recall`` is, of the pairs of parts that are copies of each other, the share that do; ``false`` is, of the pairs that
do, the share whose parts differ in some extent by more than .1 cells and 5 %.  The columns ``plain`` say the same of
the program without its names, where only loops share numbers.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
from scipy.linalg import null_space

from benchmarks.planted import in_frame
from benchmarks.rows import measure_all, read_rows
from benchmarks.structure import whole

SETS = ("fitted", "alone", "rows", "inferred", "small", "chairs")

COLUMNS = {
    "fitted": ("recall", "false", "chance", "mixed", "planted", "found", "free", "seconds"),
    "rows": ("found", "counted", "near", "grouped", "count", "seconds"),
    "chairs": ("recall", "false", "plain_recall", "plain_false", "copies", "shared", "parts", "matched", "free"),
}
COLUMNS |= {"alone": COLUMNS["fitted"], "inferred": COLUMNS["rows"], "small": COLUMNS["rows"]}

NOISE = 0.05
"""Standard deviation of the noise, in cells."""

ROUNDING = 1e-5
"""What rounding to single precision may add to that, in cells."""

VARIANTS = 100
"""Redrawings of one piece of furniture."""

STEP = 0.05
"""Cells or degrees by which a number is changed to see what follows."""

PER = 11
"""Features of a block."""

SLENDER = 2.0
"""Length over breadth from which a part aslant runs between two ends."""

VARYING = 0.1
"""Cells, root mean square, by which a relation varies that the design does not have."""

NEAR = 1.0
"""Cells by which the sides of parts in a row may be off."""

ROUNDED = 0.02
"""Cells by which what holds may be off: lengths are rounded to two decimals."""

ALIKE, FINE = 0.05, 0.1
"""By what the extents of parts that are alike differ at most: a share of the longer, or so many cells."""

SHAKEN = 0.1
"""Share of itself by which every free number is changed, at most, to see which sizes stay the same."""


@dataclass(frozen=True)
class Task:
    """One program to be tied; ``pack`` is the file with the chairs."""

    set: str
    number: int
    seed: int
    pack: Path | None = None


def measure(task: Task) -> dict[str, Any]:
    """The row of one program."""
    import torch

    torch.set_num_threads(1)
    found = {"chairs": of_chair, "rows": of_group, "inferred": of_group, "small": of_group}.get(task.set, of_furniture)(
        task
    )
    return {"set": task.set, "number": task.number, "seed": task.seed, **found}


def of_furniture(task: Task) -> dict[str, Any]:
    """How many ties of a planted program are found again."""
    from shapeprog.data.synthetic.furniture import furniture
    from shapeprog.inference.candidates.drawings import between_ends
    from shapeprog.inference.surface.evidence import evidence_of_program
    from shapeprog.inference.ties.tying import tie
    from shapeprog.language.free import free_numbers
    from shapeprog.language.printer import format_program

    planted = furniture(task.number, task.seed)
    noisy = with_noise(planted, np.random.default_rng((task.seed, task.number)))
    evidence = evidence_of_program(planted if task.set == "fitted" else noisy, task.seed)
    started = time.process_time()
    known = task.set == "alone"
    floor = None if known else float(evidence.surface[:, 0].min())
    tied = tie(noisy if known else between_ends(noisy), evidence, known=known, floor=floor, seed=task.seed)
    seconds = time.process_time() - started
    drawn, plain, ways = redrawn(task.number, task.seed), plain_slopes(planted), slopes(tied, planted)
    written = relations_written(len(plain))
    off = np.abs(written @ drawn.T)
    holding = np.abs(written @ ways).max(1, initial=0) < 1e-3
    designed, happening = off.max(1) <= ROUNDED, off[:, 0] <= 2 * NOISE + ROUNDING
    meaning = written @ plain  # zero where a relation holds for all numbers, as that a rod is as wide as deep
    relations = null_space(ways.T, 1e-4).T
    spread = np.linalg.svd(relations @ (drawn - drawn.mean(0)).T, compute_uv=False) / np.sqrt(len(drawn))
    varying = int((spread > VARYING).sum())
    wanted, found = rank(meaning[designed]), rank(relations @ plain, 0.05)
    kept, likely = rank(meaning[designed & holding]), rank(meaning[(designed | happening) & holding])
    ties, mixed = kinds_tied(tied)
    return {
        "planted": wanted, "found": found, "kept": kept, "recall": kept / max(wanted, 1),
        "chance": (likely - kept) / max(found, 1),
        "false": max(min(found - kept, varying) - (likely - kept), 0) / max(found, 1),
        "names_shared": ties, "mixed": mixed / max(ties, 1), "free": free_numbers(tied), "seconds": seconds,
        "planted_text": format_program(planted), "text": format_program(tied),
    }  # fmt: skip


def redrawn(number: int, seed: int) -> Any:
    """The features (K, F) of furniture that is designed as that of a number is, which comes first."""
    from shapeprog.data.synthetic.furniture import furniture
    from shapeprog.inference.fit.tunable import Tunable
    from shapeprog.language.unroll import unroll

    tunable = Tunable(furniture(number, seed))
    moving = set(tunable.moving)

    def design(program: Any) -> list[Any]:
        """All but the numbers that may move."""
        return [
            (node.name, [(n, slot) in moving or value for slot, value in enumerate(node.values)])
            for n, node in enumerate(program.walk())
        ]

    programs = (tunable.program, *(furniture(number, seed, measures) for measures in range(VARIANTS)))
    return np.array([features(unroll(each)) for each in programs if design(each) == design(tunable.program)])


def with_noise(program: Any, random: np.random.Generator) -> Any:
    """The plain program with noise on every number that may move."""
    import torch

    from shapeprog.inference.fit.tunable import Tunable

    tunable = Tunable(program)
    noise = NOISE * random.normal(size=len(tunable.values)) / tunable.scale.numpy()
    low = np.minimum(tunable.values.numpy(), np.maximum(tunable.low.numpy(), -1e9))
    return tunable.settled(torch.from_numpy(np.maximum(tunable.values.numpy() + noise, low)))


def sides(scene: Any) -> tuple[Any, Any]:
    """Of every primitive of a scene the low and high sides and the two least half sizes, and the same with the ends of
    its axis for sides (N, 2, 8); its kind and block, and whether it is a slender one that runs aslant (N, 3)."""

    drawn = scene.mask.numpy()
    local, turned, centre = (each.numpy()[drawn] for each in (scene.bounds, scene.rotation, scene.centre))
    every, longest = np.arange(len(local)), local.argmax(1)
    axis, sizes = np.abs(turned[every, :, longest]), np.sort(local, 1)
    rows = [
        np.concatenate([centre - half, centre + half, sizes[:, :2]], 1)
        for half in (np.einsum("nij,nj->ni", np.abs(turned), local), axis * sizes[:, 2:])
    ]
    aslant = (axis.max(1) < 0.9999) & (sizes[:, 2] > SLENDER * sizes[:, 1])
    labels = np.stack([*(each.numpy()[drawn] for each in (scene.kind, scene.block)), aslant], 1)
    return np.stack(rows, 1).astype(np.float64), labels


def features(scene: Any, places: Any = None, of: Any = None) -> Any:
    """Numbers for each block of a program (F): low and high sides of its first copy, its two least half sizes, and how
    far the last copy is from the first.  What runs aslant has the ends of its axis for sides.

    Parameters
    ----------
    places, of
        The primitives that stand for those of another program, and the scene of that.
    """
    rows, labels = sides(scene)
    rows, labels = (rows, labels) if places is None else (rows[places], sides(of)[1])
    rows = rows[np.arange(len(rows)), labels[:, 2]]
    blocks = [np.flatnonzero(labels[:, 1] == block) for block in np.unique(labels[:, 1])]
    return np.concatenate([[*rows[each[0]], *(rows[each[-1]] - rows[each[0]])[:3]] for each in blocks])


def matched(scene: Any, planted: Any) -> Any:
    """The primitive of a scene that stands for each planted one (N,): the nearest, each once where they suffice."""
    from scipy.optimize import linear_sum_assignment

    (here, found), (there, wanted) = sides(scene), sides(planted)
    far = np.abs(there[:, None, 0] - here[:, 0]).sum(-1) + (wanted[:, None, 0] != found[:, 0])
    places = far.argmin(1)
    one, two = linear_sum_assignment(far)
    places[one] = two
    return places


def relations_written(count: int) -> Any:
    """Relations (M, F) that people write between so many features, whether they hold or not: sides and middles that are
    flush or mirror each other, equal lengths, radii and steps."""
    unit = np.eye(count).reshape(-1, PER, count)
    low, high, steps = unit[:, :3], unit[:, 3:6], unit[:, 8:].reshape(-1, count)
    rows: list[Any] = []
    for up, axis in ((True, 0), (False, 1), (False, 2)):
        for group in ([*low[:, axis], *high[:, axis]], [*(low + high)[:, axis] / 2]):
            rows += [] if up else [*group, *(one + two for one, two in combinations(group, 2))]
            rows += [one - two for one, two in combinations(group, 2)]
    for group in ([*(high - low).reshape(-1, count), *(2 * unit[:, 6:8]).reshape(-1, count)], [*steps]):
        rows += [one + sign * two for one, two in combinations(group, 2) for sign in (1, -1)]
    return np.array(rows).reshape(-1, count)


def lifted(count: int) -> Any:
    """How features follow from lifting everything (F,): where the floor is does not matter."""
    return np.tile(np.isin(np.arange(PER), (0, 3)) * 1.0, count // PER)


def plain_slopes(program: Any) -> Any:
    """How the features of a plain program (F, Z) follow from its numbers, and from lifting it."""
    import torch

    from shapeprog.inference.fit.tunable import Tunable

    tunable = Tunable(program)
    start = features(tunable.scene(tunable.values))
    moved = torch.diag(torch.full_like(tunable.values, STEP)) + tunable.values
    columns = [(features(tunable.scene(values)) - start) / STEP for values in moved]
    return np.stack([lifted(len(start)), *columns], 1)


def slopes(program: Any, planted: Any) -> Any:
    """The same of the features of a planted program by the free numbers of the program that stands for it."""
    from benchmarks.editing import multiplied
    from shapeprog.language.free import free_values
    from shapeprog.language.unroll import unroll

    of = unroll(planted)
    places = matched(unroll(program), of)
    start = features(unroll(program), places, of)
    columns = [lifted(len(start))]
    for place, value in enumerate(free_values(program)):
        if value:
            changed = unroll(multiplied(program, place, 1 + STEP / value))
            columns.append((features(changed, places, of) - start) / STEP)
    return np.stack(columns, 1)


def rank(rows: Any, least: float = 1e-3) -> int:
    """How many rows are independent."""
    return int(np.linalg.matrix_rank(rows, least)) if rows.size else 0


def kinds_tied(program: Any) -> tuple[int, int]:
    """How many keywords share a name with another, and how many share one of another kind: size, clearance, offset,
    radius and so on.  A clearance may be the size of a part at that side: there, faces touch."""
    from shapeprog.language.ast import Group, Part, Point
    from shapeprog.language.expression import Name
    from shapeprog.language.placement import AXES

    kinds = {word: kind for words in AXES for word, kind in zip(words, ("low", "high", "size", "offset"), strict=True)}
    uses: dict[str, list[tuple[str, str, Any]]] = {}
    for line in program.source.walk():
        if not isinstance(line, Part | Group):
            continue
        for key, argument in line.keywords:
            inner = argument.keywords if isinstance(argument, Point) else [(key, argument)]
            for word, value in inner:
                for number in value if isinstance(value, tuple) else (value,):
                    if isinstance(number, Name):
                        uses.setdefault(number.name, []).append((kinds.get(word, word), word, dict(line.keywords)))
    mixed = 0
    for each in uses.values():
        names = {"clearance" if kind in ("low", "high") else kind for kind, _, _ in each}
        at_side = {
            side
            for words in AXES for _, word, given in each if word == words.size
            for side in (words.low, words.high)
            if not given.get(side) and (side in given or (side == "bottom" and not {"top", "z"} & set(given)))
        }  # fmt: skip
        if {"size", "clearance"} <= names and any(word in at_side for _, word, _ in each):
            names -= {"clearance"}
        mixed += len(names) - 1
    return sum(len(each) - 1 for each in uses.values()), mixed


def of_group(task: Task) -> dict[str, Any]:
    """Whether equal parts that were planted are one statement with the right count, and planted boxes are written."""
    from shapeprog.data.placement import shape_from_mesh
    from shapeprog.formats.parts import parts
    from shapeprog.inference import infer
    from shapeprog.inference.surface.evidence import evidence_of_program
    from shapeprog.inference.ties.tying import tie
    from shapeprog.language.parser import parse
    from shapeprog.language.printer import format_program
    from shapeprog.language.program import Program
    from shapeprog.language.unroll import unroll

    kind, role, text = (design_of_small if task.set == "small" else design)(
        task.number, np.random.default_rng((task.seed, task.number))
    )
    drawn = parse(text)
    planted, scene = Program(drawn.body), unroll(drawn)
    started = time.process_time()
    if task.set == "rows":
        noisy = with_noise(planted, np.random.default_rng((task.seed, task.number, 1)))
        found = tie(noisy, evidence_of_program(planted, task.seed), seed=task.seed)
    else:
        shape = shape_from_mesh(**whole(parts(planted)), name="", axes=np.eye(3))
        found = infer(shape, seed=task.seed).program
        scene = in_frame(scene, shape.frame)
    seconds = time.process_time() - started
    (here, labels), (there, wanted) = sides(unroll(found)), sides(scene)
    equal = np.isin(wanted[:, 1], [block for block, node in enumerate(planted.draws) if node.role == role])
    places = matched(unroll(found), scene)[equal]
    blocks, near = np.unique(labels[places, 1]), np.abs(here[places, 0, :6] - there[equal, 0, :6]).max() < NEAR
    one = len(blocks) == 1 and (labels[:, 1] == blocks[0]).sum() == equal.sum()
    written = format_program(found)
    grouped = {"divide": "divide(" in written, "inside": "inside(" in written or "def " in written}.get(kind, True)
    return {
        "kind": kind, "count": int(equal.sum()), "near": bool(near), "counted": bool(one and near),
        "grouped": grouped, "found": bool(grouped and (one or kind == "inside") and near), "seconds": seconds,
        "planted_text": text, "text": written,
    }  # fmt: skip


def design(number: int, random: Any) -> tuple[str, str, str]:
    """What is planted (``row``, ``divide`` or ``inside``), the role of its equal parts, and a program in the grid."""
    high, wide, deep = random.uniform(20, 28), random.uniform(10, 20), random.uniform(8, 12)
    count, few = int(random.integers(3, 31)), int(random.integers(2, 5))
    if number % 6 == 1:
        wide, high = random.uniform(20, 28), random.uniform(10, 16)
    thick, pitch = random.uniform(0.5, 0.8), high / (count + 1)
    board = random.uniform(0.2, 0.45) * pitch  # a third of what there is for each
    whole = f"width, depth, height = {wide:.2f}, {deep:.2f}, {high:.2f}\n"
    posts = f"for _ in mirror(x=0):\n    side(width={thick:.2f}, left=0)\n"
    inner = f"left={thick:.2f}, right={thick:.2f}"
    row = f"for _ in row({count}, last=at(top={{}})):\n    {{}}\n"
    kind = ("row", "row", "row", "row", "divide", "inside")[number % 6]
    if number % 6 == 0:  # a ladder
        last = f"{pitch:.2f}"
        end = f"left={thick / 2:.2f}, bottom={pitch:.2f}"
        rung = f"stretcher(rod(start=at({end}), end=at(right={thick / 2:.2f}), radius={min(board, thick) / 2:.2f}))"
        posts = posts.replace("left=0", f"left=0, depth={1.5 * thick:.2f}")
        whole = whole.replace(f"{deep:.2f}", f"{1.5 * thick:.2f}")
        return kind, "stretcher", whole + posts + row.format(last, rung)
    if number % 6 == 1:  # a fence of slats
        pitch = wide / count
        slat = f"slat(left={pitch / 3:.2f}, width={pitch / 3:.2f}, rear={thick:.2f}, depth={thick:.2f})"
        rails = (
            f"rail(bottom=2, height=1, depth={thick:.2f}, rear=0)\nrail(top=2, height=1, depth={thick:.2f}, rear=0)\n"
        )
        rails = f"for _ in mirror(z=0):\n    {rails.splitlines()[0]}\n"
        whole = whole.replace(f"{deep:.2f}", f"{2 * thick:.2f}")
        return kind, "slat", whole + rails + f"for _ in row({count}, last=at(right={pitch / 3:.2f})):\n    {slat}\n"
    if number % 6 == 2:  # shelves
        shelf = f"shelf({inner}, height={board:.2f}, bottom={pitch / 2:.2f})"
        return (
            kind,
            "shelf",
            whole + posts + f"back({inner}, rear=0, depth=.3)\n" + row.format(f"{pitch / 2:.2f}", shelf),
        )
    if number % 6 == 3:  # drawers between sides, with gaps
        drawer = f"drawer({inner}, height={0.8 * pitch:.2f}, bottom={pitch:.2f}, front=0)"
        return kind, "drawer", whole + posts + row.format(f"{pitch / 2:.2f}", drawer)
    if number % 6 == 4:  # doors or drawers that fill a case
        axis, role = (("x", "door"), ("z", "drawer"))[number // 6 % 2]
        case = f"body(front={thick:.2f}, bottom={2 * thick:.2f})\nbase(height={2 * thick:.2f}, front={2 * thick:.2f})\n"
        gap = random.uniform(0.15, 0.4)
        box = f"front=0, depth={thick:.2f}, bottom={2 * thick:.2f}"
        return kind, role, whole + case + f"for _ in divide({few}, {axis}, gap={gap:.2f}, {box}):\n    {role}()\n"
    side = random.uniform(0.25, 0.4) * 26
    return (
        kind,
        "drawer",
        (
            f"width, depth, height = 26.00, {deep:.2f}, {high * 0.6:.2f}\n"
            f"top(top=0, height={thick:.2f})\n"
            f"leg(left=1, width={thick:.2f}, front=.5, rear=.5, top={thick:.2f})\n"
            f"with inside(right=1, width={side:.2f}, front=.5, rear=.5, top={thick:.2f}):\n"
            f"    for _ in mirror(x=0):\n        panel(left=0, width={thick:.2f})\n"
            f"    back(left={thick:.2f}, right={thick:.2f}, rear=0, depth=.3)\n"
            f"    shelf(left={thick:.2f}, right={thick:.2f}, rear=.3, height={thick:.2f}, bottom=1)\n"
            f"    for _ in divide({few}, z, gap=.25, left={thick:.2f}, right={thick:.2f}, front=0, depth={thick:.2f}, "
            f"bottom=2):\n"
            f"        drawer()\n"
        ),
    )


def design_of_small(number: int, random: Any) -> tuple[str, str, str]:
    """The same of furniture with a row of small parts."""
    count, thick = int(random.integers(3, 13)), random.uniform(0.5, 0.8)
    wide, deep, high = random.uniform(14, 26), random.uniform(7, 12), random.uniform(14, 26)
    whole = f"width, depth, height = {wide:.2f}, {deep:.2f}, {high:.2f}\n"
    if number % 3 == 0:  # drawers with handles
        role, size = ("drawer", "handle")[number // 3 % 2], random.uniform(0.1, 0.3) * wide
        box = f"gap={random.uniform(0.15, 0.4):.2f}, front=.5, depth={thick:.2f}"
        handle = f"handle(width={size:.2f}, front=-.5, depth=.5, z=0, height=.4)"
        body = f"body(front={thick + 0.5:.2f})\n"
        return "row", role, whole + body + f"for _ in divide({count}, z, {box}):\n    drawer()\n    {handle}\n"
    if number % 3 == 1:  # rungs between the posts of a back
        pitch = (high - 4) / (count + 1)
        seat = f"seat(bottom=4, height={thick:.2f})\n"
        posts = f"for _ in mirror(x=0):\n    leg(left=0, width={thick:.2f}, depth={thick:.2f}, {{}})\n"
        start = f"start=at(left={thick / 2:.2f}, rear={thick / 2:.2f}, bottom={4 + pitch:.2f})"
        rung = f"rod({start}, end=at(right={thick / 2:.2f}), radius={min(random.uniform(0.15, 0.3) * pitch, 0.4):.2f})"
        row = f"for _ in row({count}, last=at(top={pitch:.2f})):\n    stretcher({rung})\n"
        return "row", "stretcher", whole + seat + posts.format("front=0, height=4") + posts.format("rear=0") + row
    size, lift = random.uniform(0.2, 0.5) * wide / count, random.uniform(0.8, 1.5)
    foot = f"foot(left=.5, width={size:.2f}, front=.5, depth={size:.2f}, height={lift:.2f})"
    row = f"for _ in mirror(y=0):\n    for _ in row({count}, last=at(right=.5)):\n        {foot}\n"
    return "row", "foot", whole + f"body(bottom={lift:.2f})\n" + row


def of_chair(task: Task) -> dict[str, Any]:
    """Which copies of parts of a chair share their numbers in what is inferred for it."""
    from shapeprog.data import read_pack
    from shapeprog.evaluation.parts import best_pairs, overlaps
    from shapeprog.inference import infer
    from shapeprog.language.named import inline
    from shapeprog.language.printer import format_program
    from shapeprog.language.unroll import unroll

    assert task.pack is not None
    boxes, group = boxes_of(task.pack, task.number)
    program = infer(read_pack(task.pack)[task.number], seed=task.seed).program
    pairs = best_pairs(overlaps(boxes, unroll(program), task.seed))
    extents = np.array([np.sort(2 * box.half) for box in boxes])
    row: dict[str, Any] = {"parts": len(boxes), "matched": len(pairs), "text": format_program(program)}
    for kind, each in (("", program), ("plain_", inline(program))):
        free, sizes = shaken(each)
        copies, shared = [], []
        for (one, here), (two, there) in combinations(sorted(pairs), 2):
            same = bool(np.allclose(sizes[:, here], sizes[:, there], rtol=1e-3, atol=1e-4))
            least = np.maximum(ALIKE * np.maximum(extents[one], extents[two]), FINE)
            alike = bool((np.abs(extents[one] - extents[two]) <= least).all())
            copies += [same] if group[one] == group[two] else []
            shared += [alike] if same else []
        row |= {kind + "copies": copies, kind + "shared": shared, kind + "free": free}
    return row


def boxes_of(pack: Path, number: int) -> tuple[list[Any], Any]:
    """The boxes of the parts of a chair in the grid, and the group of copies (B,) that each is of."""
    from shapeprog.language.hints import Box
    from shapeprog.space import Frame

    with np.load(pack.with_name(f"{pack.stem}_boxes.npz")) as data:
        rows = slice(data["start"][number], data["start"][number + 1])
        centre, extents, axes = np.split(data["boxes"][rows].astype(np.float64), [3, 6], 1)
        group = data["group"][rows]
    axes = axes.reshape(-1, 2, 3)
    axes = np.concatenate([axes, np.cross(axes[:, :1], axes[:, 1:])], 1)  # directions as rows
    reach = (np.abs(axes) * extents[:, :, None] / 2).sum(1)
    low, high = (centre - reach).min(0), (centre + reach).max(0)
    frame = Frame.around(low, high, [(0, 0, -1), (1, 0, 0), (0, -1, 0)])  # x, y, z are -left-right, up, -depth
    turned = np.asarray(frame.axes)
    return [
        Box(frame.to_grid(at), (each @ turned).T, np.maximum(size / 2 / frame.scale, 0.05))
        for at, size, each in zip(centre, extents, axes, strict=True)
    ], group


def shaken(program: Any) -> tuple[int, Any]:
    """The number of free numbers; and the sizes of the boxes of all primitives (K, N, 3), smallest first, as they are
    and where all free numbers are others."""
    from benchmarks.editing import multiplied
    from shapeprog.language.free import free_numbers
    from shapeprog.language.unroll import unroll

    free = free_numbers(program)
    changed = program
    for place, factor in enumerate(np.random.default_rng(0).uniform(1 - SHAKEN, 1 + SHAKEN, free)):
        changed = multiplied(changed, place, factor)
    scenes = [unroll(each) for each in (program, changed)]
    return free, np.array([np.sort(scene.bounds[scene.mask].numpy(), 1) for scene in scenes])


def tasks(args: argparse.Namespace) -> Iterator[Task]:
    """All that is asked for."""
    for which in args.sets:
        pack = Path(args.data) / f"chair_{args.split}.npz" if which == "chairs" else None
        for number in range(args.first, args.first + args.objects):
            yield Task(which, number, args.seed, pack)


def run(args: argparse.Namespace) -> None:
    """Measure what is not in the output yet, program after program, in several processes."""
    out = Path(args.out)
    done = {(row["set"], row["number"], row["seed"]) for row in read_rows(out)}
    measure_all(
        out, [task for task in tasks(args) if (task.set, task.number, task.seed) not in done], measure, args.workers
    )


def table(path: Path) -> str:
    """Markdown: the mean of every measure over programs; of chairs, shares of all pairs."""
    lines, every = [], read_rows(path)
    for which in SETS:
        rows = [row for row in every if row["set"] == which]
        if not rows:
            continue
        head = f"| {which}, {len(rows)} programs | " + " | ".join(COLUMNS[which]) + " |"
        means = of_pairs(rows) if which == "chairs" else {}
        cells = [
            means[column] if column in means else np.mean([row[column] for row in rows]) for column in COLUMNS[which]
        ]
        written = (f"{mean:.1f}" if mean > 2 else f"{mean:.3f}" for mean in cells)
        lines += [head, "|" + "---|" * (len(COLUMNS[which]) + 1), "| mean | " + " | ".join(written) + " |", ""]
    return "\n".join(lines)


def of_pairs(rows: list[dict[str, Any]]) -> dict[str, float]:
    """Recall and false ones of all pairs of all chairs, and how many pairs a chair has."""
    found = {}
    for kind in ("", "plain_"):
        for column, name in (("copies", "recall"), ("shared", "false")):
            each = [pair for row in rows for pair in row[kind + column]]
            found[kind + name] = abs(float(np.mean(each or [np.nan])) - (name == "false"))
            found[kind + column] = len(each) / len(rows)
    return found


def main() -> None:
    """Run, or print the table of a run."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", nargs="?", help="the folder of the chairs, chair_val.npz and chair_val_boxes.npz")
    parser.add_argument("--sets", nargs="*", default=["fitted", "alone"], choices=SETS)
    parser.add_argument("--split", default="val", choices=("val", "test"))
    parser.add_argument("--objects", type=int, default=200, help="so many of each set")
    parser.add_argument(
        "--first", type=int, default=0, help="the number of the first; tune furniture on 1000 and above"
    )
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", default="ties.jsonl", help="rows, one line of JSON each; appended to")
    parser.add_argument("--table", default=None, help="print the table of these rows and do nothing else")
    args = parser.parse_args()
    if args.table is None:
        if "chairs" in args.sets and args.data is None:
            parser.error("name the folder of the chairs")
        run(args)
    print(table(Path(args.table or args.out)))


if __name__ == "__main__":
    main()

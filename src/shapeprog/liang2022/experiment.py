"""Table 1 of the paper and the rows that go beyond it, each a set of weights and an adaptation.

Finished runs and measures are reused.  Settings were chosen on validation shapes; test shapes are measured once.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np
import torch

from shapeprog.data.packs import read_pack, write_pack
from shapeprog.data.synthetic.shapes import shapes_of
from shapeprog.errors import InputError, did_you_mean
from shapeprog.files import make_folder
from shapeprog.inference import greedy_boxes
from shapeprog.inference.cells.reconstruct import refined
from shapeprog.liang2022.adapt import AdaptTask
from shapeprog.liang2022.evaluate import decode_all, measure
from shapeprog.liang2022.loop import append_line, read_log, train
from shapeprog.liang2022.prior import programs
from shapeprog.liang2022.settings import BEST, LOG, STATE, AdaptSettings, Decoder
from shapeprog.liang2022.weights import load_generator

CATEGORIES = ("bench", "cabinet")
DECODERS: tuple[Decoder, ...] = get_args(Decoder)
PAPER = {"tian2019-none": (13.5, 10.4), "tian2019-guided": (7.8, 9.2), "tian2019-direct": (3.5, 4.3)}  # CD x 1000

MEASURED = "rows.jsonl"  # file of the measures, one line a shape
REFINED_SHAPES = 40  # test shapes of rows with test-time refinement, which takes seconds a shape


@dataclass(frozen=True)
class Row:
    """A row of the table."""

    label: str
    initial: str = ""  # weights that it starts from, or {row} for those of another row; none for greedy boxes
    method: Literal["", "direct", "guided", "hybrid"] = ""  # no adaptation by default
    options: Mapping[str, Any] = field(default_factory=dict)  # settings of the adaptation
    decoders: tuple[Decoder, ...] = ("select",)  # how programs are written when they are measured
    refine: bool = False  # refine the numbers of each program by chamfer at test time


# Closest to the paper: arg-max, no self-training of ids.  Rehearsal and a KL term to the start are ours.
NARROW: dict[str, Any] = {"prior": "narrow", "decoder": "argmax", "decoded_ids": 0.0, "kl": 1.0}
LONG: dict[str, Any] = NARROW | {"kl": 3.0, "num_shapes": 3200, "validate_every": 800}
GUIDED: dict[str, Any] = {"learning_rate": 3e-5}
GUIDED_LONG: dict[str, Any] = LONG | {"learning_rate": 1e-5, "validate_every": 400}

ROWS: dict[str, Row] = {
    "boxes": Row("greedy boxes"),
    "boxes-refined": Row("greedy boxes, refined at test time", refine=True),
    "none": Row("`fast`, narrow prior", "fast-narrow", decoders=DECODERS),
    "guided": Row("`fast`, narrow prior, guided", "fast-narrow", "guided", NARROW | GUIDED, DECODERS),
    "direct": Row("`fast`, narrow prior, direct", "fast-narrow", "direct", NARROW, DECODERS),
    "guided-long": Row("`fast`, narrow prior, guided, 3,200 shapes", "fast-narrow", "guided", GUIDED_LONG, DECODERS),
    "direct-long": Row("`fast`, narrow prior, direct, 3,200 shapes", "fast-narrow", "direct", LONG, DECODERS),
    "tian2019-none": Row("`tian2019`", "tian2019-narrow", decoders=DECODERS),
    "tian2019-guided": Row("`tian2019`, guided, 3,200 shapes", "tian2019-narrow", "guided", GUIDED_LONG, DECODERS),
    "tian2019-direct": Row(
        "`tian2019`, direct, 3,200 shapes", "tian2019-narrow", "direct", LONG | {"validate_every": 400}, DECODERS
    ),
    "wide-none": Row("wide prior", "fast-wide", decoders=DECODERS),
    "wide-guided": Row("wide prior, guided", "fast-wide", "guided", {}, DECODERS),
    "wide-direct": Row("wide prior, direct", "fast-wide", "direct", {}, DECODERS),
    "soft-iou": Row("+ soft IoU", "fast-wide", "direct", {"loss": "chamfer=1,soft_iou=3"}, DECODERS),
    "coverage": Row("+ coverage", "fast-wide", "direct", {"loss": "chamfer=1,coverage=1"}),
    "no-rehearsal": Row("without rehearsal", "fast-wide", "direct", {"rehearsal": 0}),
    "hybrid": Row("hybrid", "fast-wide", "hybrid"),
    "offsets": Row("offsets alone", "fast-wide", "direct", {"learn": "offsets", "learning_rate": 1e-3}),
    "nvil": Row("ids by NVIL", "fast-wide", "direct", {"estimator": "nvil", "num_shapes": 800}),
    "rloo": Row("ids by leave-one-out", "fast-wide", "direct", {"estimator": "rloo", "num_shapes": 400}),
    "refined": Row("wide prior, direct, refined at test time", "{wide-direct}", refine=True),
}

QUICK: dict[str, Any] = {"num_shapes": 640, "batch_size": 16, "warm_up": 80, "points": 500}
QUICK_ROWS, QUICK_SHAPES = ("none", "guided", "direct"), 48


def run_table(
    packs: Path | None, results: Path, *, quick: bool = False, only: Sequence[str] | None = None, seeds: int = 1,
    measure: bool = False,
) -> Iterator[str]:  # fmt: skip
    """Train and measure rows, then yield the table as lines of Markdown.

    ``packs`` is a folder of ``{bench,cabinet}_{train,val,test}.npz``, ``None`` for synthetic targets in the ``quick``
    version of three rows and few shapes; ``results`` gets all that is made; ``only`` names the rows to make; ``seeds``
    counts those of rows with adaptation; ``measure`` trains nothing.  Raises an ``InputError`` for no such row or pack.
    """
    for name in only or ():
        if name not in ROWS:
            raise InputError(f"unknown row {name!r}", did_you_mean(name, ROWS))
    categories: tuple[str, ...] = CATEGORIES
    if packs is None:
        if not quick:
            raise InputError("the table needs packs of shapes", "make them with 'shapeprog prepare', or give --quick")
        packs, categories = _synthetic_packs(make_folder(results / "packs")), ("synthetic",)
    for category in categories:
        for name in only or (QUICK_ROWS if quick else ROWS):
            for seed in range(seeds if ROWS[name].method else 1):
                weights = _adapted(name, category, packs, results, seed, quick, measure)
                if weights is not None:
                    yield from _measured(name, category, packs, results, seed, weights, quick)
    yield from table(results, categories)


def _adapted(name: str, category: str, packs: Path, results: Path, seed: int, quick: bool, measure: bool) -> str | None:
    """The weights of a row, trained where they are missing; ``None`` if nothing shall be trained."""
    row, initial = ROWS[name], ROWS[name].initial
    if initial.startswith("{"):
        return _adapted(initial.strip("{}"), category, packs, results, seed, quick, measure)
    if not row.method:
        return initial
    folder = results / "runs" / f"{name}-{category}-{seed}"
    settings = AdaptSettings(
        train=(str(packs / f"{category}_train.npz"),), val=(str(packs / f"{category}_val.npz"),), initial=initial,
        seed=seed, method=row.method, **({"validate_every": 400} | dict(row.options) | (QUICK if quick else {})),
    )  # fmt: skip
    log = read_log(folder / LOG) if (folder / STATE).exists() else []
    if not log or log[-1]["samples_seen"] < settings.num_shapes:
        if measure:
            return None
        for _ in train(AdaptTask(settings), settings, folder, command=f"shapeprog paper table --only {name}"):
            pass
    return str(folder / BEST)


def _measured(
    name: str, category: str, packs: Path, results: Path, seed: int, weights: str, quick: bool
) -> Iterator[str]:
    """Measure a row on the test shapes, one line of JSON a shape, where that is missing."""
    row, path = ROWS[name], make_folder(results) / MEASURED
    measured = {(record["row"], record["category"], record["seed"], record["decoder"]) for record in read_log(path)}
    count = QUICK_SHAPES if quick else REFINED_SHAPES if row.refine else None
    for decoder in [decoder for decoder in row.decoders if (name, category, seed, decoder) not in measured]:
        shapes, made = list(read_pack(packs / f"{category}_test.npz"))[:count], []
        if weights:
            fine, rounded = decode_all(load_generator(weights), shapes, decoder)
        else:
            fine = rounded = [greedy_boxes(shape.voxels) for shape in shapes]
        for program, on_canvas, shape in zip(fine, rounded, shapes, strict=True):
            if row.refine:
                program = refined(program, torch.from_numpy(np.array(shape.points)), seed=seed)
            key = {"row": name, "category": category, "seed": seed, "decoder": decoder}
            made.append(key | asdict(measure(program, on_canvas, shape, seed=seed)))
        for line in made:
            append_line(path, json.dumps({key: value for key, value in line.items() if value == value}))
        yield f"{name}, {category}, seed {seed}, {decoder}: CD {np.mean([record['cd'] for record in made]):.5f}"


def table(results: Path, categories: Sequence[str] = CATEGORIES) -> Iterator[str]:
    """The table as Markdown: CD x 1000 (mean and standard error, median) and IoU by decoder, and the paper's CD."""
    measured = read_log(results / MEASURED)
    for index, category in enumerate(categories):
        yield f"\n**{category}** CD x 1000 (median), IoU\n"
        yield "| row | seeds | paper | " + " | ".join(DECODERS) + " |"
        yield "|---" * (3 + len(DECODERS)) + "|"
        for name, row in ROWS.items():
            records = [record for record in measured if (record["row"], record["category"]) == (name, category)]
            if records:
                paper = f"{PAPER[name][index]}" if name in PAPER and len(categories) > 1 else ""
                cells = [_cell([r for r in records if r["decoder"] == decoder]) for decoder in DECODERS]
                yield f"| {row.label} | {len({r['seed'] for r in records})} | {paper} | {' | '.join(cells)} |"


def _cell(records: list[dict[str, Any]]) -> str:
    """CD as a mean with its standard error, over seeds if there are several, else over shapes; median CD; IoU."""
    if not records:
        return ""
    cd, iou, seeds = (np.array([record[key] for record in records]) for key in ("cd", "iou", "seed"))
    by_seed = [1000 * cd[seeds == seed] for seed in np.unique(seeds)]
    means, median = [part.mean() for part in by_seed], np.mean([np.median(part) for part in by_seed])
    spread = np.array(means if len(means) > 1 else by_seed[0])
    return f"{np.mean(means):.2f} ± {spread.std(ddof=1) / len(spread) ** 0.5:.2f} ({median:.2f}), {iou.mean():.3f}"


def _synthetic_packs(folder: Path) -> Path:
    """Packs of wide synthetic furniture, most of which the narrow prior does not hold, for the quick version."""
    for split, count, seed in (("train", 320, 11), ("val", 16, 12), ("test", QUICK_SHAPES, 13)):
        if not (folder / f"synthetic_{split}.npz").exists():
            named = {f"{split}_{n}": program for n, program in enumerate(programs("wide", count, seed))}
            write_pack(folder / f"synthetic_{split}.npz", shapes_of(named, 2000, seed))
    return folder

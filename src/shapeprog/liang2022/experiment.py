"""The experiment: Table 1 of the paper and the rows that go beyond it, trained, measured and printed.

Every row is a set of weights and an adaptation.  Finished runs and measurements are reused.  Settings were
chosen on the validation shapes; test shapes are measured once.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import torch

from shapeprog.data.packs import read_pack, write_pack
from shapeprog.data.shape import Shape
from shapeprog.errors import InputError, did_you_mean
from shapeprog.files import append_line, make_folder
from shapeprog.geometry.cells import voxels
from shapeprog.geometry.surface import sample_surface
from shapeprog.language.program import Program
from shapeprog.language.unroll import unroll
from shapeprog.liang2022.adapt import AdaptTask
from shapeprog.liang2022.decode import Decoder, decode_all
from shapeprog.liang2022.evaluate import grids, measure
from shapeprog.liang2022.loop import BEST, STATE, read_log, train
from shapeprog.liang2022.prior import prior
from shapeprog.liang2022.settings import METHODS, AdaptSettings
from shapeprog.liang2022.weights import load_generator

CATEGORIES = ("bench", "cabinet")
DECODERS: tuple[Decoder, ...] = ("argmax", "novel", "select")
PAPER = {"tian2019-none": (0.0135, 0.0104), "tian2019-guided": (0.0078, 0.0092), "tian2019-direct": (0.0035, 0.0043)}
"""CD of Table 1 as published: bench, cabinet."""

REFINED_SHAPES = 40
"""Test shapes of rows with test-time refinement, which takes seconds a shape."""


@dataclass(frozen=True)
class Row:
    """A row of the table.

    Parameters
    ----------
    label
        Description of the row.
    initial
        Weights that it starts from.
    method
        ``direct``, ``guided`` or ``hybrid``; no adaptation by default.
    options
        Settings of the adaptation.
    decoders
        How programs are written when they are measured.
    refine
        Refine the numbers of each program by chamfer at test time.
    """

    label: str
    initial: str
    method: str = ""
    options: Mapping[str, Any] = field(default_factory=dict)
    decoders: tuple[Decoder, ...] = ("select",)
    refine: bool = False


NARROW: dict[str, Any] = {"prior": "narrow"}
AS_PUBLISHED: dict[str, Any] = {"decoder": "argmax", "decoded_ids": 0.0}
TIAN: dict[str, Any] = NARROW | AS_PUBLISHED | {"num_shapes": 480, "batch_size": 8, "rehearsal": 4, "warm_up": 48}

ROWS: dict[str, Row] = {
    "none": Row("narrow prior, no adaptation", "fast-narrow", decoders=DECODERS),
    "guided": Row("narrow prior, guided with self-training", "fast-narrow", "guided", NARROW, DECODERS),
    "direct": Row("narrow prior, direct with self-training", "fast-narrow", "direct", NARROW, DECODERS),
    "published-ids": Row(
        "narrow prior, direct by arg-max, KL", "fast-narrow", "direct", NARROW | AS_PUBLISHED | {"kl": 1.0}, DECODERS
    ),
    "published-guided": Row(
        "narrow prior, guided by arg-max, KL, rate 1e-4", "fast-narrow", "guided",
        NARROW | AS_PUBLISHED | {"kl": 1.0, "learning_rate": 1e-4}, DECODERS,
    ),
    "no-rehearsal": Row("narrow prior, no rehearsal", "fast-narrow", "direct", NARROW | {"rehearsal": 0}, DECODERS),
    "tian2019-none": Row("tian2019, no adaptation", "tian2019-narrow", decoders=DECODERS),
    "tian2019-guided": Row("tian2019, guided by arg-max, 480 shapes", "tian2019-narrow", "guided", TIAN, DECODERS),
    "tian2019-direct": Row("tian2019, direct by arg-max, 480 shapes", "tian2019-narrow", "direct", TIAN, DECODERS),
    "wide-none": Row("wide prior, no adaptation", "fast-wide", decoders=DECODERS),
    "wide-guided": Row("wide prior, guided", "fast-wide", "guided", {}, DECODERS),
    "wide-direct": Row("wide prior, direct", "fast-wide", "direct", {}, DECODERS),
    "soft-iou": Row("direct, + soft IoU", "fast-wide", "direct", {"loss": "chamfer=1,soft_iou=3"}, DECODERS),
    "wide-argmax": Row(
        "direct by arg-max, + KL, + soft IoU", "fast-wide", "direct",
        AS_PUBLISHED | {"kl": 1.0, "loss": "chamfer=1,soft_iou=3"}, DECODERS,
    ),
    "coverage": Row("+ coverage and excess", "fast-wide", "direct", {"loss": "chamfer=1,surface=1,excess=1"}),
    "hybrid": Row("hybrid", "fast-wide", "hybrid"),
    "offsets": Row("offsets alone", "fast-wide", "direct", {"learn": "offsets", "learning_rate": 1e-3}),
    "nvil": Row("direct, ids by NVIL", "fast-wide", "direct", {"estimator": "nvil", "num_shapes": 800}),
    "rloo": Row("direct, ids by leave-one-out", "fast-wide", "direct", {"estimator": "rloo", "num_shapes": 400}),
    "refined": Row("wide prior, direct, refined at test time", "{wide-direct}", refine=True),
}  # fmt: skip
"""All rows; ``{row}`` starts from the weights of another."""

QUICK: dict[str, Any] = {"num_shapes": 640, "batch_size": 16, "warm_up": 80, "points": 500}
QUICK_ROWS, QUICK_SHAPES = ("none", "guided", "direct"), 48


def run_table(
    packs: Path | None, results: Path, *, quick: bool = False, only: Sequence[str] | None = None, seeds: int = 1,
    measure: bool = False,
) -> Iterator[str]:  # fmt: skip
    """Train and measure rows, then yield the table as lines of Markdown.

    Parameters
    ----------
    packs
        Folder of ``{bench,cabinet}_{train,val,test}.npz``; synthetic targets if ``None``, for the quick version.
    results
        Folder of all that is made.
    quick
        Three rows, one category, few shapes: five minutes on two cores.
    only
        Rows to make.
    seeds
        Seeds of rows with adaptation.
    measure
        Train nothing.

    Raises
    ------
    InputError
        If there is no such row, or no packs.
    """
    for name in only or ():
        if name not in ROWS:
            raise InputError(f"unknown row {name!r}", did_you_mean(name, ROWS))
    categories: tuple[str, ...] = CATEGORIES
    if packs is None:
        if not quick:
            raise InputError(
                "the table needs packs of ShapeNet shapes", "make them with 'shapeprog prepare', or --quick"
            )
        packs, categories = _synthetic_packs(make_folder(results / "packs")), ("synthetic",)
    selected = only or (QUICK_ROWS if quick else tuple(ROWS))
    for category in categories:
        for name in selected:
            for seed in range(seeds if ROWS[name].method else 1):
                weights = adapted(name, category, packs, results, seed, quick, measure)
                if weights is not None:
                    yield from _measured(name, category, packs, results, seed, weights, quick)
    yield from table(results, categories)


def adapted(
    name: str, category: str, packs: Path, results: Path, seed: int, quick: bool = False, measure: bool = False
) -> str | None:
    """The weights of a row, trained where they are missing; ``None`` if nothing shall be trained."""
    row = ROWS[name]
    initial = row.initial
    if initial.startswith("{"):
        parent = adapted(initial.strip("{}"), category, packs, results, seed, quick, measure)
        if parent is None:
            return None
        initial = parent
    if not row.method:
        return initial
    folder = results / "runs" / f"{name}-{category}-{seed}"
    settings = AdaptSettings(
        train=(str(packs / f"{category}_train.npz"),), val=(str(packs / f"{category}_val.npz"),), initial=initial,
        seed=seed, validate_every=800, **{**METHODS[row.method], **row.options, **(QUICK if quick else {})},
    )  # fmt: skip
    log = read_log(folder) if (folder / STATE).exists() else []
    if not log or log[-1]["samples_seen"] < settings.num_shapes:
        if measure:
            return None
        for _ in train(AdaptTask(settings, f"shapeprog paper table --only {name}"), settings, folder):
            pass
    return str(folder / BEST)


def _measured(
    name: str, category: str, packs: Path, results: Path, seed: int, weights: str, quick: bool
) -> Iterator[str]:
    """Measure a row on the test shapes, one line of JSON a shape, where that is missing."""
    row, path = ROWS[name], make_folder(results) / "rows.jsonl"
    known = {(record["row"], record["category"], record["seed"], record["decoder"]) for record in rows_of(results)}
    missing = [decoder for decoder in row.decoders if (name, category, seed, decoder) not in known]
    if not missing:
        return
    generator = load_generator(weights)
    count = QUICK_SHAPES if quick else REFINED_SHAPES if row.refine else None
    shapes = list(read_pack(packs / f"{category}_test.npz"))[:count]
    for decoder in missing:
        decoded = decode_all(generator, grids(shapes), decoder=decoder)
        key = {"row": name, "category": category, "seed": seed, "decoder": decoder}
        made = []
        for program, whole, shape in zip(decoded.programs(), decoded.programs(whole=True), shapes, strict=True):
            program = _refined(program, shape, seed) if row.refine else program
            made.append(key | asdict(measure(program, whole, shape, seed=seed)))
        for line in made:
            append_line(path, json.dumps({k: v for k, v in line.items() if v == v}))
        yield f"{name}, {category}, seed {seed}, {decoder}: CD {np.mean([record['cd'] for record in made]):.5f}"


def _refined(program: Program, shape: Shape, seed: int) -> Program:
    from shapeprog.inference import refine
    from shapeprog.inference.refine import REACH

    assert shape.points is not None
    return refine(program, torch.from_numpy(np.asarray(shape.points, np.float32)), reach=REACH, seed=seed)


def rows_of(results: Path) -> list[dict[str, Any]]:
    """All measured shapes."""
    path = results / "rows.jsonl"
    return [json.loads(line) for line in path.read_text().splitlines()] if path.exists() else []


def table(results: Path, categories: Sequence[str] = CATEGORIES) -> Iterator[str]:
    """The table as Markdown: CD x 1000 (mean and standard error, median) and IoU by decoder, and the paper's CD."""
    measured = rows_of(results)
    for index, category in enumerate(categories):
        yield f"\n**{category}** CD x 1000 (median), IoU"
        yield "| row | paper | " + " | ".join(DECODERS) + " |"
        yield "|---" * (2 + len(DECODERS)) + "|"
        for name, row in ROWS.items():
            cells = [_cell(measured, name, category, decoder) for decoder in DECODERS]
            if any(cells):
                paper = f"{1000 * PAPER[name][index]:.1f}" if name in PAPER and len(categories) > 1 else ""
                yield f"| {row.label} | {paper} | " + " | ".join(cells) + " |"


def _cell(measured: list[dict[str, Any]], row: str, category: str, decoder: str) -> str:
    """Mean over shapes of each seed, averaged over seeds, with its standard error; median CD; IoU."""
    matching = [
        record
        for record in measured
        if (record["row"], record["category"], record["decoder"]) == (row, category, decoder)
    ]
    if not matching:
        return ""
    seeds = sorted({record["seed"] for record in matching})
    means = [np.mean([record["cd"] for record in matching if record["seed"] == seed]) for seed in seeds]
    cd, iou = (np.array([record[key] for record in matching]) for key in ("cd", "iou"))
    error = np.std(means, ddof=1) / len(means) ** 0.5 if len(means) > 1 else np.std(cd, ddof=1) / len(cd) ** 0.5
    return f"{1000 * np.mean(means):.2f} ± {1000 * error:.2f} ({1000 * np.median(cd):.2f}), {iou.mean():.3f}"


def _synthetic_packs(folder: Path) -> Path:
    """Packs of wide synthetic furniture, which the narrow prior does not hold, as targets of the quick version."""
    for split, count, seed in (("train", 320, 11), ("val", 16, 12), ("test", QUICK_SHAPES, 13)):
        path = folder / f"synthetic_{split}.npz"
        if not path.exists():
            code = prior("wide").sample(count, seed)[0]
            scene = unroll(code)
            points = sample_surface(scene, 2000, torch.Generator().manual_seed(seed)).points.numpy().astype(np.float32)
            cells = voxels(scene).numpy().astype(bool)
            write_pack(path, [Shape(f"{split}_{n}", cells[n], points[n]) for n in range(count)])
    return folder

"""Validation of a generator: what it says when told the truth, and what it rebuilds when left alone."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import torch

from shapeprog.data.packs import read_pack
from shapeprog.data.synthetic import Stream, prior
from shapeprog.evaluation.generated import code_iou, scores_on_packs, single_pass
from shapeprog.models.generator import Generator
from shapeprog.training.folder import Record
from shapeprog.training.lessons import Lesson, Order, lesson

SEED = 2**62
"""Seed of the synthetic shapes, far from any that training uses."""

SHAPES, BATCH = 512, 32
"""How many synthetic shapes there are, and how many are looked at together."""


class Validation:
    """Fixed shapes, synthetic and real, and the scores of a generator on them.

    Parameters
    ----------
    name
        Name of the prior of the synthetic shapes.
    blocks
        Most blocks of a program.
    order
        Order of the blocks in which the generator is taught.
    packs
        Files of real shapes.
    device
        Where the shapes are kept.

    Raises
    ------
    InputError
        If a pack cannot be read, or the prior is not known.
    """

    def __init__(
        self,
        name: str,
        blocks: int,
        order: Order,
        packs: Sequence[Path] = (),
        device: torch.device | str = "cpu",
    ) -> None:
        self._blocks = blocks
        stream = Stream(prior(name), BATCH, seed=SEED, blocks=blocks, device=device)
        made = (stream[index] for index in range(SHAPES // BATCH))
        self._lessons = [lesson(each.voxels, each.code, order) for each in made]
        self._packs = {Path(path).stem: list(read_pack(path)) for path in packs}

    def __call__(self, generator: Generator) -> Record:
        """Scores by name, ``score`` among them: the mean IoU over the packs, or the synthetic one without packs.

        ``ids``: share of the statement ids that are right when those before are told; ``parameters``: mean absolute
        error, in cells, of the parameters of the true ids; ``iou``: of single-pass programs; and what
        :func:`shapeprog.evaluation.generated.scores_on_packs` says of each pack.
        """
        right, steps, off, slots = (torch.zeros((), dtype=torch.float64) for _ in range(4))
        overlaps = []
        for each in self._lessons:
            for total, more in zip((right, steps, off, slots), told(generator, each), strict=True):
                total += more
            overlaps.append(code_iou(single_pass(generator, each.target, self._blocks)[1], each.target))
        scores = {
            "ids": float(right / steps),
            "parameters": float(off / slots),
            "iou": float(torch.cat(overlaps).mean()),
        }
        scores |= scores_on_packs(generator, self._packs, self._blocks)
        real = [scores[f"{name}_iou"] for name in self._packs]
        return {**scores, "score": sum(real) / len(real) if real else scores["iou"]}


def told(generator: Generator, each: Lesson) -> tuple[float, float, float, float]:
    """Ids that are right, ids, absolute errors of parameters added, and parameters, when told what comes before."""
    ids, values = each.code.ids[each.live], each.code.parameters[each.live]
    prediction = generator.predict(each.target, each.canvases, each.code, each.live)
    used = generator.vocabulary.used.to(ids.device)[ids]
    off = ((prediction.values.detach() - values).abs() * used).sum()
    return float((prediction.logits.argmax(-1) == ids).sum()), ids.numel(), float(off), float(used.sum())

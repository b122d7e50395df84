"""Teaching labels: lessons from programs of real shapes, some of them perturbed, mixed with synthetic ones."""

from __future__ import annotations

from pathlib import Path

import torch
from torch import Tensor

from shapeprog.data.synthetic import Stream, prior
from shapeprog.language.tensors import Code
from shapeprog.models.generator import Generator
from shapeprog.models.vocabulary import Vocabulary
from shapeprog.training.adapt_settings import AdaptSettings
from shapeprog.training.engine import scrambled
from shapeprog.training.labels import perturbed, read_labels
from shapeprog.training.lessons import Lesson, lesson, lesson_losses
from shapeprog.training.shapes import TargetStream


class Teaching:
    """Lessons from labels; lesson ``index`` depends on the settings and the index alone.

    Parameters
    ----------
    settings
        Of the adaptation.
    vocabulary
        What the generator can say.
    device
        Where lessons are made.

    Raises
    ------
    InputError
        If labels or packs cannot be read, or none of the labels is for a shape of the packs.
    """

    def __init__(self, settings: AdaptSettings, vocabulary: Vocabulary, device: torch.device | str = "cpu") -> None:
        self._settings, self._vocabulary, self._device = settings, vocabulary, torch.device(device)
        made = round(settings.synthetic * settings.taught)
        self._real = settings.taught - made
        packs = [Path(path) for path in settings.packs]
        everything = TargetStream(packs, 1, seed=0)
        sources = [Path(path) for path in settings.labels]
        self.labels = read_labels(sources, everything.names, vocabulary, settings.blocks, settings.form)
        places = self.labels.known.nonzero()[:, 0].numpy()
        self._shapes = TargetStream(packs, max(1, self._real), seed=settings.seed + 1, points=1, places=places)
        self._stream = None
        if made:
            kind = prior(settings.prior)
            self._stream = Stream(kind, made, seed=settings.seed, blocks=settings.blocks, device=device)

    def __getitem__(self, index: int) -> Lesson:
        """The lesson of an index, 0 or more."""
        codes, cells = [], []
        if self._real:
            targets = self._shapes[index]
            code = Code(*(each[targets.place] for each in (self.labels.code.ids, self.labels.code.parameters)))
            random = torch.Generator().manual_seed(scrambled(self._settings.seed, 1, index))
            other, drawn = perturbed(code, self._vocabulary, self._settings.jitter, random)
            moved = torch.rand(self._real, generator=random) < self._settings.perturbed
            values = torch.where(moved[:, None, None, None], other.parameters, code.parameters)
            codes.append(Code(code.ids.to(self._device), values.to(self._device)))
            cells.append(torch.where(moved[:, None, None, None], drawn, targets.cells).to(self._device))
        if self._stream is not None:
            batch = self._stream[index]
            codes.append(batch.code)
            cells.append(batch.voxels)
        ids, values = torch.cat([each.ids for each in codes]), torch.cat([each.parameters for each in codes])
        return lesson(torch.cat(cells), Code(ids, values))


def teach(
    generator: Generator, taught: Lesson, settings: AdaptSettings, progress: float, random: torch.Generator
) -> dict[str, Tensor]:
    """The losses of a lesson: cross-entropy of ids and loss of parameters, weighted."""
    generator.train(settings.statistics == "moving")
    terms = lesson_losses(
        generator, taught, sampled=settings.sampled, rows=settings.rows, progress=progress, random=random
    )
    return {f"label_{name}": settings.labels_weight * value for name, value in terms.items()}

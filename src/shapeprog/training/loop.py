"""The loop of every kind of training: a batch, a loss, a step of the optimiser, a record.

It resumes exactly: whatever a step draws at random is a function of the seed and the step, and so is its batch.
"""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Protocol, TypeVar, runtime_checkable

import torch
from torch import Tensor, nn

from shapeprog.errors import ShapeProgError
from shapeprog.training.engine import Engine
from shapeprog.training.folder import BEST, WEIGHTS, Log, Record, begin_state, locked, read_state, write_state
from shapeprog.training.settings import Settings
from shapeprog.training.state import capture, card_of, restore

Batch = TypeVar("Batch")


@runtime_checkable
class Objective(Protocol[Batch]):
    """What is learned, from what, and how well."""

    @property
    def module(self) -> nn.Module:
        """All that learns; the engine moves it to its device."""

    def batch(self, index: int) -> Batch:
        """The batch of an index, the same each time it is asked for; called from another thread."""

    def loss(self, batch: Batch, progress: float, random: torch.Generator) -> dict[str, Tensor]:
        """Terms (,) whose sum is made small, already weighted; ``progress`` is the share of the run that is done.

        Those whose name begins with ``_`` are reported without it and not added.
        """

    def validate(self) -> Record:
        """Scores by name on fixed shapes, ``score`` among them: the larger the better. Called in evaluation mode."""

    def save(self, path: Path, visits: int, scores: Record) -> None:
        """Write the weights as a checkpoint."""


def run(
    objective: Objective[Any],
    settings: Settings,
    folder: Path,
    engine: Engine,
    *,
    restart: bool = False,
    stop: threading.Event | None = None,
    save_seconds: float = 120.0,
    tensorboard: bool = False,
) -> Iterator[Record]:
    """Train, yielding one record per step; a run that the folder holds goes on where it was saved.

    The folder gets ``state.safetensors``, from which the run goes on, and ``previous.safetensors``, the one before it;
    ``log.jsonl``; after each validation ``weights.safetensors``; and ``best.safetensors`` whenever the score is the
    best so far.

    Parameters
    ----------
    objective
        What is learned.
    settings
        How; kept with the state.
    folder
        Of the run; made if missing.
    engine
        Where.
    restart
        Begin anew even if the folder holds a run.
    stop
        Once set, the state is saved after the step under way and the loop ends; closing the generator does the same.
    save_seconds
        How often the state is saved.
    tensorboard
        Whether to write curves for TensorBoard too.

    Raises
    ------
    ShapeProgError
        If the run was begun with other settings, another process trains into the folder, or the loss is no number.
    OutputError
        If something cannot be written; the last good state stays.
    """
    module = engine.place(objective.module).train()
    optimiser = settings.make_optimiser(module)
    weights = [weight for group in optimiser.param_groups for weight in group["params"]]
    told, together = {**settings.record(), "processes": engine.processes}, settings.batch * engine.processes
    with locked(folder, needed=engine.writes):
        first = (
            (read_state(folder, restart) or capture(module, optimiser, 0, told, -math.inf)) if engine.writes else b""
        )
        state = engine.share(first)
        card = card_of(state, str(folder))
        settings.check(card["settings"], told, str(folder))
        restore(state, module, optimiser)
        step, best, steps = card["step"], card["best"], settings.steps(engine.processes)
        if engine.writes and step == 0:
            begin_state(folder, state)  # tells at once where nothing can be written, and replaces an older run
        if engine.writes and step >= steps and not (folder / WEIGHTS).exists():
            objective.save(folder / WEIGHTS, step * together, _validate(objective, engine))  # fewer visits than before
        with Log(folder if engine.writes else None, step, tensorboard) as log:

            def save() -> None:
                log.settle()
                write_state(folder, capture(module, optimiser, step, told, best))

            saved = clock = time.monotonic()
            for batch in engine.ahead(objective.batch, range(step, steps)):
                for group in optimiser.param_groups:
                    group["lr"] = settings.rate_at(step * together)
                with engine.autocast():
                    terms = objective.loss(batch, step / steps, engine.random(settings.seed, step))
                loss = torch.stack([term.float() for name, term in terms.items() if name[0] != "_"]).sum()
                optimiser.zero_grad()
                loss.backward()
                norm = settings.limit(engine.average_gradients(weights))
                told_stop = torch.tensor(float(stop is not None and stop.is_set()), device=engine.device)
                values = torch.stack([each.detach().float() for each in (loss, norm, told_stop, *terms.values())])
                engine.average([values])
                total, gradient, stopping, *each = values.tolist()
                if not math.isfinite(total + gradient):
                    raise ShapeProgError(
                        f"the loss of step {step + 1} is {total}, its gradient {gradient}",
                        f"lower the rate or clip the gradient; the state in {folder} is from before",
                    )
                optimiser.step()
                step += 1
                record = {"step": step, "visits": step * together, "loss": total, "gradient": gradient}
                record |= {"rate": settings.rate_at((step - 1) * together)}
                record |= {name.lstrip("_"): value for name, value in zip(terms, each, strict=True)}
                record |= {"seconds": time.monotonic() - clock}
                if engine.writes and due(step, steps, together, settings.validate_every):
                    scores = _validate(objective, engine)
                    record |= {f"val_{name}": value for name, value in scores.items()}
                    objective.save(folder / WEIGHTS, step * together, scores)
                    if scores.get("score", -math.inf) > best:
                        best = scores["score"]
                        objective.save(folder / BEST, step * together, scores)
                log.write(record)
                ending = step == steps or stopping > 0
                if engine.writes and (ending or time.monotonic() - saved >= save_seconds):
                    save()
                    saved = time.monotonic()
                try:
                    yield record
                except GeneratorExit:
                    if engine.writes:
                        save()
                    raise
                if ending:
                    break
                clock = time.monotonic()
        engine.wait()


def due(step: int, steps: int, together: int, every: int) -> bool:
    """Whether a validation follows a step: every so many visits, and at the end."""
    return step == steps or (every > 0 and step * together // every > (step - 1) * together // every)


def _validate(objective: Objective[Any], engine: Engine) -> Record:
    module = objective.module.eval()
    try:
        with torch.no_grad(), engine.autocast():
            scores = objective.validate()
            return {name: value for name, value in scores.items() if math.isfinite(value)}
    finally:
        module.train()

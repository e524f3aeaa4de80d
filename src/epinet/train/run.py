"""A training run in a folder, from a recipe to weights with their history.

recipe.yaml              the recipe, every value of it
last.pt                  the checkpoint to continue from
weights.safetensors      averaged weights of the last validation
best.safetensors         those of the best validation (BadPix .07)
log.jsonl, tensorboard/  loss, rate and scores
validation/              pictures of the last validation
run.json                 the recipe, the curve and the last scores
"""

from __future__ import annotations

import copy
import json
import logging
import math
import time
from collections.abc import Callable, Sequence
from contextlib import nullcontext
from dataclasses import asdict
from datetime import timedelta
from functools import cached_property
from pathlib import Path
from typing import Any, cast

import torch
import yaml
from torch import Tensor, nn
from torch.optim.swa_utils import AveragedModel

from epinet.errors import InputError
from epinet.io.atomic import atomic_path, check_writable, remove_leftovers
from epinet.networks.base import Batch, Network
from epinet.networks.weights import CALIBRATION, Weights, save_weights
from epinet.synth.options import RANGES_PX
from epinet.train.ahead import made_ahead, pays
from epinet.train.batches import batches_of
from epinet.train.checkpoint import State, continuing, write_checkpoint
from epinet.train.interruption import interruption
from epinet.train.log import Log
from epinet.train.norms import norms_of, take_statistics
from epinet.train.optimisers import Optimisers
from epinet.train.parallel import ALONE, Team
from epinet.train.precision import computes_bf16
from epinet.train.recipe import Recipe
from epinet.train.start import begin, mixed_with_start
from epinet.train.validation import (
    RENDERED,
    Validation,
    fitted_calibration,
    mean_scores,
    save_pictures,
)

LOGGER = logging.getLogger(__name__)
STATISTICS_BATCHES = 48
"""Batch-norm statistics of averaged weights are taken anew, over so many of the last batches."""

MOMENTUM = 0.05
"""Of the statistics that batch normalisation keeps where the recipe fixes it."""

LOG_EVERY = 20

BEST = "badpix_0.07"
"""The score that decides which weights are the best."""

SAVE_EVERY_S = 240.0
SAY_EVERY_S = 20.0


class StoppedError(Exception):
    """A run ended before its last step."""

    resumable = True
    """Whether it can go on from its checkpoint."""


class DivergedError(StoppedError):
    """The loss, its gradient or the weights are no finite numbers any more."""

    resumable = False


class Run:
    """One training run; continues where the folder's checkpoint stands.

    Args:
        recipe: what to do.
        folder: of the run, made if need be.
        device: to train on.
        team: the processes that share the run.
        validation: default: small rendered scenes of held-out kinds.
        cache: folder that keeps rendered scenes for other runs on the same ones.

    Raises:
        InputError: the folder cannot be written, its checkpoint is damaged or of another recipe,
            the starting weights cannot be used, or scenes cannot.
    """

    def __init__(
        self,
        recipe: Recipe,
        folder: Path,
        *,
        device: torch.device | str = "cpu",
        team: Team = ALONE,
        validation: Validation | None = None,
        cache: Path | None = None,
    ) -> None:
        self.recipe, self.folder, self.team = recipe, folder, team
        self.device = torch.device(device)
        self.bf16 = recipe.bf16 and computes_bf16(self.device)
        if recipe.shards % team.size:
            raise InputError(
                f"{team.size} processes cannot share the {recipe.shards} shards of the recipe: "
                f"--set shards={team.size}"
            )
        mine = range(team.rank, recipe.shards, team.size)
        self.batches = batches_of(recipe, mine, cache=cache, device=str(self.device))
        check_writable(folder)
        remove_leftovers(folder / "validation")
        torch.manual_seed(recipe.seed)
        self.net = recipe.network()
        self.started_from: dict[str, Any] | None = None
        resumed = self._checkpoint.exists()
        if not resumed:
            self.started_from = begin(self.net, recipe, self.batches[0])
        else:
            self.net.attach(recipe)
        for part in recipe.frozen:
            self.net.get_submodule(part).requires_grad_(False)
        self.net.to(self.device, memory_format=torch.channels_last)  # type: ignore[call-overload]
        # Norms are set by a batch of each process's own: only the leader's may count.
        team.share([*self.net.parameters(), *self.net.buffers()])
        self.averaged: AveragedModel | None = None
        if recipe.averaging:
            self.averaged = AveragedModel(self.net, multi_avg_fn=self._average)
        self.optimisers = Optimisers(self.net, recipe, team)
        self.step, self.seconds = 0, 0.0
        self.clock = time.monotonic
        """Of `seconds`; a measurement on a busy machine may count its own CPU time instead."""
        self.best = math.inf
        self.losses: list[float] = []
        self.history: list[dict[str, Any]] = []
        self._validation = validation
        if resumed:
            self._resume()
        self._check_all_stand_at_this_step()
        if recipe.bf16 and not self.bf16:
            self._say(f"computing in float32: this {self.device.type} has no bfloat16 of its own")
        self._recent: dict[int, Batch] = {}

    def _say(self, line: str) -> None:
        """Log a line, once for all processes that share the run."""
        if self.team.leads:
            LOGGER.info("%s", line)

    @property
    def _checkpoint(self) -> Path:
        return self.folder / "last.pt"

    def _average(
        self, averages: Sequence[Tensor], new: Sequence[Tensor], updates: Tensor | int
    ) -> None:
        decay = min(self.recipe.averaging, (1 + int(updates)) / (10 + int(updates)))
        torch._foreach_lerp_(list(averages), list(new), 1 - decay)

    def _resume(self) -> None:
        with continuing(self._checkpoint, self.recipe, self._validated_on, self.device) as state:
            self.started_from = state["started_from"]
            self.net.load_state_dict(state["net"])
            if self.averaged:
                self.averaged.load_state_dict(state["averaged"])
            self.optimisers.load(state["optimisers"])
            self.step, self.seconds = state["step"], state["seconds"]
            self.best, self.losses = state["best"], state["losses"]
            self.history = state["history"]
        self._say(f"continuing at step {self.step} of {self.recipe.steps}")

    def _check_all_stand_at_this_step(self) -> None:
        """Processes on several machines must see the same folder."""
        step = torch.tensor(float(self.step), device=self.device)
        leaders = step.clone()
        self.team.share([leaders])
        apart = (step - leaders).abs()
        self.team.add([apart])
        if apart > 0:
            raise InputError(
                f"{self.folder}: the processes of this run find different checkpoints there; "
                "give a folder that all of their machines share"
            )

    def save(self) -> None:
        """Write the checkpoint to resume from.

        Raises:
            InputError: it cannot be written; the one before is kept.
        """
        state: State = {
            "recipe": self.recipe.as_dict(),
            "validated_on": self._validated_on,
            "started_from": self.started_from,
            "net": self.net.state_dict(),
            "averaged": self.averaged and self.averaged.state_dict(),
            "optimisers": self.optimisers.state(),
            "step": self.step,
            "seconds": self.seconds,
            "best": self.best,
            "losses": self.losses,
            "history": self.history,
        }
        write_checkpoint(self._checkpoint, state)

    def metadata(self) -> dict[str, Any]:
        """What the weights of this run say about themselves."""
        return {
            "recipe": self.recipe.as_dict(),
            "data": self.recipe.provenance,
            "validated_on": self._validated_on,
            "disparity_range_px": self.recipe.limits_px,
            "input": self.recipe.input.name,
            "started_from": self.started_from,
            "steps": self.step,
            "minutes": round(self.seconds / 60, 1),
            "scores": self.history[-1]["scores"] if self.history else {},
        }

    @property
    def _validated_on(self) -> str:
        return RENDERED if self._validation is None else ", ".join(self._validation.scenes)

    def train(self, save_every_s: float = SAVE_EVERY_S) -> None:
        """Train to the recipe's last step.

        Raises:
            StoppedError: interrupted (Ctrl-C, SIGTERM); a checkpoint has been saved.
            DivergedError: the loss, its gradient or the weights are not finite; the last
                checkpoint is from before.
            InputError: something cannot be written.
        """
        made, steps = self.batches, self.recipe.steps
        ahead = pays(self.device, self.team.size)
        with made_ahead(made, steps, self.device) if ahead else nullcontext(made) as self.batches:
            try:
                self._train(save_every_s)
            finally:
                self.batches = made

    def _train(self, save_every_s: float) -> None:
        if not self.team.leads:
            with interruption() as interrupted:
                while self.step < self.recipe.steps:
                    self._train_step(interrupted())
            return
        with atomic_path(self.folder / "recipe.yaml") as temporary:
            temporary.write_text(yaml.safe_dump(self.recipe.as_dict(), sort_keys=False))
        with Log(self.folder, self.step) as log, interruption() as interrupted:
            self._lead(log, interrupted, save_every_s)

    def _lead(self, log: Log, interrupted: Callable[[], bool], save_every_s: float) -> None:
        saved = said = time.monotonic()
        begun, begun_at = self.step, said
        if self._validation_is_due:  # the run was stopped just before
            self._validate(log)
            self.save()
        while self.step < self.recipe.steps:
            step_begun = self.clock()
            stopped: StoppedError | None = None
            try:
                self._train_step(interrupted())
            except StoppedError as stop:
                if not stop.resumable:
                    raise
                stopped = stop
            self.seconds += self.clock() - step_begun
            if self.step % LOG_EVERY == 0:
                recent = self.losses[-LOG_EVERY:]
                rate = self.recipe.rate(self.step - 1)
                log.write(self.step, {"loss": sum(recent) / len(recent), "rate": rate})
            if stopped is not None:
                self.save()
                raise stopped
            if self._validation_is_due:
                self._validate(log)
            now = time.monotonic()
            if self.step == self.recipe.steps or now - saved > save_every_s:
                self.save()
                saved = now
            if now - said > SAY_EVERY_S and self.losses:
                self._say_progress((self.step - begun) / (now - begun_at))
                said = now

    @property
    def _validation_is_due(self) -> bool:
        at_mark = self.step == self.recipe.steps or self.step % self.recipe.validate_every == 0
        validated = self.history[-1]["step"] if self.history else 0
        return at_mark and self.step > validated

    def _train_step(self, stop: bool = False) -> None:
        """One step of all processes; any of them can stop all of them after it."""
        net, shards = self.net, self.recipe.shards
        self._set_modes()
        statistics = [b for b in net.buffers() if b.is_floating_point()]
        in_parts = shards > 1 and bool(statistics)
        before = [b.clone() for b in statistics] if in_parts else []
        sums = [torch.zeros_like(b) for b in statistics] if in_parts else []
        loss = torch.zeros((), device=self.device)
        net.zero_grad(set_to_none=True)
        for batches in self.batches:
            batch = batches(self.step)
            if batches is self.batches[0]:
                self._keep(batch)
            if in_parts:
                torch._foreach_copy_(statistics, before)
            part = self._loss(batch) / shards
            part.backward()  # type: ignore[no-untyped-call]
            loss += part.detach()
            if in_parts:
                torch._foreach_add_(sums, statistics, alpha=1 / shards)
        flag = torch.tensor(float(stop), device=self.device)
        gradients = [p.grad for p in net.parameters() if p.grad is not None]
        self.team.add([loss, flag, *gradients, *sums])
        if in_parts:
            torch._foreach_copy_(statistics, sums)
        clip = math.inf if self.recipe.gradient_clip is None else self.recipe.gradient_clip
        norm = nn.utils.clip_grad_norm_(net.parameters(), clip)
        self.optimisers.step(self.recipe.rate(self.step))
        weights = [t for t in net.state_dict().values() if t.is_floating_point()]
        size = nn.utils.get_total_norm(weights, norm_type=1)
        last, *others, stopped = torch.stack([loss, norm, size, flag]).tolist()  # the one wait
        self._check_finite(last, *others)
        if self.averaged:
            self.averaged.update_parameters(net)
        self.step += 1
        self.losses.append(last)
        if stopped > 0:
            raise StoppedError(f"stopped at step {self.step} of {self.recipe.steps}")

    def _set_modes(self) -> None:
        """Training mode; batch normalisation with its own statistics once the recipe fixes them."""
        self.net.train()
        for norm in norms_of(self.net):
            norm.momentum = MOMENTUM
            norm.train(not self._norms_fixed)

    @property
    def _norms_fixed(self) -> bool:
        share = self.recipe.fixed_norms_from
        return share is not None and self.step >= share * self.recipe.steps

    def _keep(self, batch: Batch) -> None:
        """For `_take_statistics`, where these weights will need it."""
        if self._norms_fixed or not norms_of(self.net):
            return
        self._recent[self.step] = batch
        self._recent.pop(self.step - STATISTICS_BATCHES, None)

    def _loss(self, batch: Batch) -> Tensor:
        """Mean loss over the pixels of a shard, by their weights."""
        with self._autocast():
            loss: Tensor = self.net.loss(batch, self.recipe)
            return loss

    def _autocast(self) -> torch.autocast:
        return torch.autocast(self.device.type, torch.bfloat16, enabled=self.bf16)

    def _check_finite(self, loss: float, gradient: float, weights: float) -> None:
        named = {"loss": loss, "norm of the gradient": gradient, "sum of the weights": weights}
        wrong = [name for name, value in named.items() if not math.isfinite(value)]
        if not wrong:
            return
        kept = f"{self._checkpoint} is from before; " if self._checkpoint.exists() else ""
        raise DivergedError(
            f"the {wrong[0]} is {named[wrong[0]]} at step {self.step}; {kept}the rate may be too "
            f"high: try --set learning_rate={self.recipe.learning_rate / 2:g} in another folder"
        )

    def _validate(self, log: Log) -> None:
        weights = self.weights()
        results = self.validation.predict(weights, self.device, bf16=self.bf16)
        scores = mean_scores(results)
        pictures = self.folder / "validation"
        save_pictures(pictures, results)
        entry = {
            "minutes": round(self.seconds / 60, 2),
            "mean_loss": round(sum(self.losses) / max(1, len(self.losses)), 5),
            "scores": {name: round(value, 4) for name, value in scores.items()},
        }
        self.losses = []
        self.history.append({"step": self.step, **entry})
        log.write(self.step, entry)
        log.show(self.step, pictures)
        metadata = self.metadata()
        if all(result.expected_error is not None for result in results.values()):
            metadata[CALIBRATION] = asdict(fitted_calibration(results))
        save_weights(self.folder / "weights.safetensors", weights.net, metadata)
        if scores[BEST] < self.best:
            self.best = scores[BEST]
            save_weights(self.folder / "best.safetensors", weights.net, metadata)
        with atomic_path(self.folder / "run.json") as temporary:
            summary = metadata | {"history": self.history}
            temporary.write_text(json.dumps(summary, indent=1) + "\n")
        self._say(
            f"step {self.step}: loss {entry['mean_loss']:.4f}, BadPix(.07) {scores[BEST]:.2f} %, "
            f"MSE x100 {scores['mse_x100']:.2f} on {len(self.validation.scenes)} held-out scenes"
        )

    @cached_property
    def validation(self) -> Validation:
        """The scenes to validate on; rendered at first use where none were given."""
        if self._validation is not None:
            return self._validation
        bounds = self.recipe.limits_px or self.recipe.data[0].bounds_px or RANGES_PX["hci"]
        return Validation.rendered(self.recipe.views, bounds)

    def weights(self) -> Weights:
        """The averaged weights, or the last where the recipe averages none.

        As long as batch normalisation learns, with statistics of their own over the last batches.
        """
        kept = self.averaged.module if self.averaged else self.net
        net: Network[Any] = copy.deepcopy(cast(Network[Any], kept))
        if not self._norms_fixed and norms_of(net):
            self._take_statistics(net)
        for norm in norms_of(net):
            norm.num_batches_tracked = torch.tensor(self.step)  # whatever the number of shards
        net = net.folded()
        if self.recipe.start_share:
            mixed_with_start(net, self.recipe)
        return Weights(net.eval(), self.metadata(), str(self.folder))

    def _take_statistics(self, net: Network[Any]) -> None:
        steps = range(max(0, self.step - STATISTICS_BATCHES), self.step)
        for step in steps:
            if step not in self._recent:  # of the time before an interruption
                self._recent[step] = self.batches[0](step)
        with self._autocast():
            batches = (self._recent[step] for step in steps)
            take_statistics(net, lambda batch: net.loss(batch, self.recipe), batches)

    def _say_progress(self, steps_per_s: float) -> None:
        left = timedelta(seconds=round((self.recipe.steps - self.step) / steps_per_s))
        loss = sum(self.losses) / len(self.losses)
        self._say(
            f"step {self.step} of {self.recipe.steps}, loss {loss:.4f}, {steps_per_s:.2f} steps/s, "
            f"{left} left"
        )

"""A training run: from a recipe to averaged weights with their history.

A recipe of our own, not the paper's: He initialisation on differences to the centre view, AdamW
with warm-up and cosine decay, larger patches, gradient clipping, averaged weights, and a
disparity range that widens while the network learns.
"""

from __future__ import annotations

import json
import math
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from pickle import UnpicklingError
from typing import Any, cast

import torch
from torch import Tensor, nn
from torch.optim.swa_utils import AveragedModel

from epinet.errors import InputError
from epinet.io.atomic import check_writable
from epinet.metrics.disparity import score
from epinet.model.checkpoint import LOCAL_CONTRAST, Weights, save_weights
from epinet.model.contrast import local_contrast
from epinet.model.initialise import revive_head, start_on_differences
from epinet.model.network import MARGIN_PX, VIEW_COUNTS, Epinet, EpinetConfig
from epinet.synth.faults import photographed
from epinet.synth.generator import VERSION, generator, pools
from epinet.synth.options import Options
from epinet.synth.validation import VALIDATION_SEED
from epinet.train.batches import (
    STEPS_PER_POOL,
    Batch,
    BatchSource,
    stack_star,
)


@dataclass(frozen=True)
class Recipe:
    """All that decides what a run learns."""

    name: str = "first"
    views: int = 9
    steps: int = 2400
    batch: int = 32
    """Patches per step, each of another scene: many small ones teach more than few large ones."""
    patch: int = 8
    """Side of the map a patch gives, in px; its views are 22 px larger."""
    learning_rate: float = 1e-3
    head_rate: float = 0.1
    """The head learns at this share of the rate: nothing normalises its sums (see revive_head)."""
    warmup_steps: int = 50
    weight_decay: float = 1e-4
    gradient_clip: float = 1.0
    averaging: float = 0.998
    """Decay of the running average of the weights."""
    disparity_px: float = 4.0
    """The range ends at +- this."""
    narrow_px: float = 1.0
    """The range starts at +- this."""
    widening: float = 0.4
    """Share of the steps after which the whole range is used."""
    seed: int = 1
    validate_every: int = 300

    def disparity_range(self, step: int) -> tuple[float, float]:
        """Range of the training scenes at a step."""
        progress = min(1.0, step / max(1.0, self.widening * self.steps))
        reach = self.narrow_px * (self.disparity_px / self.narrow_px) ** progress
        return -reach, reach

    def rate(self, step: int) -> float:
        """Learning rate at a step: linear warm-up, then a half cosine to 0."""
        warm = min(1.0, (step + 1) / self.warmup_steps)
        return self.learning_rate * warm * 0.5 * (1 + math.cos(math.pi * step / self.steps))


def validation_set(views: int, disparity_px: float) -> tuple[Tensor, Tensor]:
    """16 scenes of held-out textures and shapes: stacks (16, 4, N, 150, 150), truth (16, 1, 128,
    128).

    Half of them have the full range, half a quarter of it.
    """
    size = (128 + 2 * MARGIN_PX,) * 2
    stars, truths = [], []
    for k, reach in enumerate((disparity_px, disparity_px / 4)):
        options = Options(size=size, disparity_px=(-reach, reach), views=views, held_out=True)
        pool = next(pools(options, VALIDATION_SEED, 8, first=k))
        photos = photographed(generator(VALIDATION_SEED, 3, k), pool.views, options.faults)
        stars.append(local_contrast(photos[:, :, 0]))
        truths.append(pool.disparity[..., MARGIN_PX:-MARGIN_PX, MARGIN_PX:-MARGIN_PX])
    return stack_star(torch.cat(stars), views), torch.cat(truths)


class Run:
    """One training run in a folder; continues where the folder's checkpoint stands."""

    def __init__(
        self,
        recipe: Recipe,
        folder: Path,
        start: Weights | None = None,
        say: Callable[[str], None] = print,
    ) -> None:
        self.recipe, self.folder, self.say = recipe, folder, say
        self.started_from = None if start is None else start.metadata
        if recipe.views not in VIEW_COUNTS:
            raise InputError(f"views must be one of {VIEW_COUNTS}, not {recipe.views}")
        if start is not None and start.net.config != EpinetConfig(views=recipe.views):
            raise InputError(f"{start.source}: weights of another network than the recipe's")
        check_writable(folder)
        torch.manual_seed(recipe.seed)
        self.net = Epinet(EpinetConfig(views=recipe.views))
        self.net.to(memory_format=torch.channels_last)  # type: ignore[call-overload]
        if start is None:
            start_on_differences(self.net)
        else:
            self.net.load_state_dict(start.net.state_dict())
        self.averaged = AveragedModel(self.net, avg_fn=self._average, use_buffers=True)
        head = list(self.net.head.parameters())
        body = [*self.net.streams.parameters(), *self.net.merge.parameters()]
        groups = [{"params": body, "share": 1.0}, {"params": head, "share": recipe.head_rate}]
        self.optimiser = torch.optim.AdamW(
            groups, lr=recipe.learning_rate, weight_decay=recipe.weight_decay
        )
        self.step, self.seconds = 0, 0.0
        self.history: list[dict[str, Any]] = []
        if self._checkpoint.exists():
            self._resume()

    @property
    def _checkpoint(self) -> Path:
        return self.folder / "last.pt"

    def _average(self, average: Tensor, new: Tensor, updates: Tensor | int) -> Tensor:
        decay = min(self.recipe.averaging, (1 + int(updates)) / (10 + int(updates)))
        return torch.lerp(new, average, decay) if average.is_floating_point() else new

    def _resume(self) -> None:
        try:
            state = torch.load(self._checkpoint, weights_only=True)
        except (OSError, RuntimeError, UnpicklingError) as error:
            raise InputError(f"{self._checkpoint}: not a readable checkpoint ({error})") from error
        if state["recipe"] != asdict(self.recipe):
            raise InputError(
                f"{self._checkpoint}: belongs to another recipe; choose another folder"
            )
        self.started_from = state["started_from"]
        self.net.load_state_dict(state["net"])
        self.averaged.load_state_dict(state["averaged"])
        self.optimiser.load_state_dict(state["optimiser"])
        self.step, self.seconds = state["step"], state["seconds"]
        self.history = state["history"]
        self.say(f"continuing at step {self.step}")

    def save(self) -> None:
        """Write the checkpoint to resume from and the averaged weights to use."""
        state = {
            "recipe": asdict(self.recipe),
            "started_from": self.started_from,
            "net": self.net.state_dict(),
            "averaged": self.averaged.state_dict(),
            "optimiser": self.optimiser.state_dict(),
            "step": self.step,
            "seconds": self.seconds,
            "history": self.history,
        }
        temporary = self._checkpoint.with_suffix(".part")
        torch.save(state, temporary)
        temporary.replace(self._checkpoint)
        save_weights(
            self.folder / "weights.safetensors", cast(Epinet, self.averaged.module), self.metadata()
        )
        summary = self.metadata() | {"history": self.history}
        (self.folder / "run.json").write_text(json.dumps(summary, indent=1) + "\n")

    def metadata(self) -> dict[str, Any]:
        """What shipped weights say about themselves."""
        reach = self.recipe.disparity_px
        return {
            "recipe": asdict(self.recipe),
            "data": {"generator": VERSION, "seed": self.recipe.seed},
            "disparity_range_px": [-reach, reach],
            "input": LOCAL_CONTRAST,
            "started_from": self.started_from,
            "steps": self.step,
            "minutes": round(self.seconds / 60, 1),
            "scores": self.history[-1]["scores"] if self.history else {},
        }

    def train(self, save_every_s: float = 240) -> None:
        """Train to the recipe's last step."""
        recipe = self.recipe
        source = BatchSource(recipe.views, recipe.batch, recipe.patch, recipe.seed)
        stacks, truth = validation_set(recipe.views, recipe.disparity_px)
        if self.step == 0 and self.started_from is not None:
            revived = revive_head(self.net, source(0, recipe.disparity_range(0)).stacks)
            self.say(f"{revived} units of the head that never fired have a new start")
        saved = last = time.monotonic()
        losses = []
        while self.step < recipe.steps:
            pool_start = self.step - self.step % STEPS_PER_POOL
            losses.append(self._train_step(source(self.step, recipe.disparity_range(pool_start))))
            self.step += 1
            now = time.monotonic()
            self.seconds, last = self.seconds + now - last, now
            if self.step % recipe.validate_every == 0 or self.step == recipe.steps:
                scores = validate(self.averaged.module, stacks, truth)
                self._record(sum(losses) / len(losses), scores)
                losses = []
            if now - saved > save_every_s or self.step == recipe.steps:
                self.save()
                saved = now

    def _train_step(self, batch: Batch) -> float:
        self.net.train()
        rate = self.recipe.rate(self.step)
        for group in self.optimiser.param_groups:
            group["lr"] = rate * group["share"]
        with torch.autocast("cpu", dtype=torch.bfloat16):
            estimate = self.net(batch.stacks)
        error = (estimate - batch.disparity).abs()
        loss = (error * batch.weight).sum() / batch.weight.sum().clamp_min(1)
        value: float = loss.item()
        if not math.isfinite(value):
            raise FloatingPointError(
                f"the loss is {value} at step {self.step}; "
                f"{self._checkpoint} holds the last good state"
            )
        self.optimiser.zero_grad(set_to_none=True)
        loss.backward()
        nn.utils.clip_grad_norm_(self.net.parameters(), self.recipe.gradient_clip)
        self.optimiser.step()
        self.averaged.update_parameters(self.net)
        return value

    def _record(self, loss: float, scores: dict[str, float]) -> None:
        entry = {
            "step": self.step,
            "minutes": round(self.seconds / 60, 2),
            "loss": round(loss, 5),
            "scores": {k: round(v, 4) for k, v in scores.items()},
        }
        self.history.append(entry)
        left = self.seconds / self.step * (self.recipe.steps - self.step) / 60
        self.say(f"{json.dumps(entry)}, {left:.0f} min left")


@torch.no_grad()
def validate(net: nn.Module, stacks: Tensor, truth: Tensor) -> dict[str, float]:
    """Scores of a network on the validation set, over all pixels of all scenes."""
    net.eval()
    with torch.autocast("cpu", dtype=torch.bfloat16):
        estimate = torch.cat([net(s[None]) for s in stacks])
    return score(estimate.numpy(), truth.numpy(), border_px=0)

"""Recipes: everything that decides what a training run learns."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Annotated, Any, Literal

import torch
from pydantic import (
    BaseModel,
    Field,
    TypeAdapter,
    ValidationError,
    create_model,
    model_validator,
)

from epinet.documents import problems_of
from epinet.networks.base import Network, Settings
from epinet.networks.registry import OURS, network_type
from epinet.synth.generator import VERSION
from epinet.synth.options import RANGES_PX, Options
from epinet.train.augment import AUGMENTATIONS, Augmentation, Scale, SignReversal, ViewShift

RESERVED = frozenset({"size", "views", "disparity_px", "held_out"})
"""Options of rendered scenes that a recipe does not choose as such."""


PAPER = "epinet"
"""The network that recipes are for which name none."""


class Data(BaseModel):
    """One source of scenes: the generator, or a folder."""

    model_config = Settings.model_config

    generator: Literal["narrow", "hci", "wide"] | None = None
    """Scenes of this range of disparities, rendered as they are needed."""
    options: Mapping[str, Any] = {}
    """What else to change of them, see `epinet.synth.options`."""
    folder: Path | None = None
    """A scene with truth, or a folder of scenes."""
    disparity_px: tuple[float, float] | None = None
    """Of the folder's scenes, px per adjacent view, for what the weights say of themselves."""
    share: Annotated[float, Field(gt=0)] = 1.0
    """How often patches come from here, relative to the other sources."""

    @model_validator(mode="after")
    def _one_of_them(self) -> Data:
        if (self.generator is None) == (self.folder is None):
            raise ValueError("give either generator or folder")
        if self.disparity_px is not None:
            if self.generator is not None:
                raise ValueError("disparity_px is a folder's; a generator has its own")
            if not self.disparity_px[0] < self.disparity_px[1]:
                raise ValueError("disparity_px: the range is empty")
        if self.options:
            if self.generator is None:
                raise ValueError("options are the generator's")
            if reserved := sorted(RESERVED & self.options.keys()):
                raise ValueError(
                    f"options: {', '.join(reserved)} cannot be chosen here; sizes and views follow "
                    "from the recipe, and what is held out is for validation"
                )
            try:
                self.rendered()
            except ValidationError as error:
                raise ValueError("; ".join(problems_of(error, "options", Options))) from error
        return self

    def rendered(self) -> Options:
        """Of the scenes to render, but for their size and views."""
        assert self.generator is not None
        values = {"disparity_px": RANGES_PX[self.generator], **self.options}
        return TypeAdapter(Options).validate_python(values)

    @property
    def bounds_px(self) -> tuple[float, float] | None:
        """Disparities of these scenes, as far as that is known."""
        return self.disparity_px if self.generator is None else RANGES_PX[self.generator]


class Recipe(Settings):
    """All that decides what a run learns, whatever the network; `Recipe.of` gives one with the
    network's own values. Defaults are the paper's where it states them."""

    name: str = "unnamed"
    about: str = ""

    # The network.
    model: str = PAPER
    """Its name, or "my_package.my_module:MyNet"."""
    frozen: tuple[str, ...] = ()
    """Parts of the network that keep the weights they start from."""
    fixed_norms_from: Annotated[float, Field(ge=0, lt=1)] | None = None
    """From this share of the steps on, batch normalisation keeps its statistics. None: never."""

    # The data.
    data: tuple[Data, ...] = (Data(generator="hci"),)
    textures: Path | None = None
    """Folder of photographs that rendered scenes take textures from, too."""
    scene_weights: Mapping[str, Annotated[float, Field(ge=0)]] = {}
    """How often scenes on disk of these names give patches, relative to others of their size."""
    augmentations: tuple[str, ...] = ()
    scale_weights: tuple[Annotated[int, Field(ge=0)], ...] = (1, 1, 1, 1)
    """How often the augmentation `scale` takes N = 1, 2, 3, ..., relative to each other."""
    texture_threshold: Annotated[float, Field(ge=0)] = 0.02
    """Of the paper's rejection of textureless patches."""
    least_weight: Annotated[float, Field(ge=0, le=1)] | None = None
    """Pixels count by how well the views tell their disparity, at least so much. None: all count
    alike, and textureless patches are rejected whole, as in the paper."""
    told_px: Annotated[float, Field(gt=0)] = 0.03
    """They count half where the views tell it to within this standard deviation, by 25x25 px."""
    mirror_weight: Annotated[float, Field(ge=0, le=1)] = 0.0
    """What pixels count that mirror, where all scenes are rendered."""
    batch: Annotated[int, Field(ge=1)] = 16
    large_patches: Annotated[float, Field(ge=0, le=1)] = 0.0
    """Share of the batches whose views are twice as wide and high, and a quarter as many."""
    fewer_views: Annotated[float, Field(ge=0, le=1)] = 0.0
    """Share of the batches that show every second or fourth view only, to a network that takes
    several counts of views."""
    narrow: Annotated[float, Field(gt=0, le=1)] = 1.0
    """Rendered scenes begin with this share of their range of disparities ..."""
    widening: Annotated[float, Field(ge=0, le=1)] = 0.0
    """... and have the whole of it after this share of the steps."""

    # The optimisation.
    steps: Annotated[int, Field(ge=1)] = 10_000_000
    """A run at a constant rate may be made longer by another value: see `paced_by_steps`."""
    optimiser: Literal["rmsprop", "adamw", "muon"] = "rmsprop"
    learning_rate: Annotated[float, Field(gt=0)] = 1e-5
    final_learning_rate: Annotated[float, Field(ge=0)] = 1e-6
    decay: Literal["constant", "exponential", "cosine"] = "exponential"
    """The paper states both ends of its rate and not the way between."""
    warmup_steps: Annotated[int, Field(ge=0)] = 0
    weight_decay: Annotated[float, Field(ge=0)] = 0.0
    gradient_clip: Annotated[float, Field(gt=0)] | None = None
    """Largest norm of the whole gradient."""
    averaging: Annotated[float, Field(ge=0, lt=1)] = 0.0
    """Decay of the running average of the weights that is validated and kept; 0: the last."""
    start_share: Annotated[float, Field(ge=0, lt=1)] = 0.0
    """How much of the weights that it starts from is mixed into those that are validated and kept
    (Wortsman et al., CVPR 2022)."""
    bf16: bool = False
    """Autocast to bfloat16, on devices that compute in it; others train in float32."""
    shards: Annotated[int, Field(ge=1)] = 1
    """Parts of a batch that are normalised by themselves; up to so many processes share a run."""
    validate_every: Annotated[int, Field(ge=1)] = 1000

    @classmethod
    def of(cls, values: Mapping[str, Any]) -> Recipe:
        """A recipe for the network that it names.

        Args:
            values: by name; what is left out has its default. Values that only another network of
                this package has are passed over where they are that one's defaults: recipes used
                to hold those of all networks.

        Raises:
            InputError: there is no such network.
            ValidationError: values that are unknown or impossible.
        """
        model = values.get("model", PAPER)
        own = recipe_type(model if isinstance(model, str) else PAPER)
        others = {
            name: field.default
            for ours in OURS
            for name, field in recipe_type(ours).model_fields.items()
            if name not in own.model_fields
        }
        kept = {k: v for k, v in values.items() if k not in others or v != others[k]}
        return own.model_validate(kept)

    @model_validator(mode="after")
    def _possible(self) -> Recipe:
        if not self.data:
            raise ValueError("data: at least one source is needed")
        unknown = sorted(set(self.augmentations) - set(AUGMENTATIONS))
        if unknown:
            raise ValueError(
                f"augmentations: {', '.join(unknown)} unknown; there are {', '.join(AUGMENTATIONS)}"
            )
        if self.mirror_weight and (self.least_weight is None or self.folders):
            raise ValueError("mirror_weight: takes a least_weight and rendered scenes alone")
        if not any(self.scale_weights):
            raise ValueError("scale_weights: at least one must be greater than 0")
        if self.batch % self.shards:
            raise ValueError(f"a batch of {self.batch} cannot be split in {self.shards} shards")
        if self.large_patches and self.batch % (4 * self.shards):
            raise ValueError(
                f"a batch of {self.batch / 4:g} large patches (a quarter of {self.batch}) "
                f"cannot be split in {self.shards} shards"
            )
        if self.final_learning_rate > self.learning_rate:
            raise ValueError("final_learning_rate is greater than learning_rate")
        if self.decay == "exponential" and self.final_learning_rate == 0:
            raise ValueError("an exponential decay never reaches a final_learning_rate of 0")
        self._possible_for_network()
        return self

    def _possible_for_network(self) -> None:
        if self.start_share and self.from_scratch:
            raise ValueError("start_share: takes a start from weights")
        if self.frozen and self.from_scratch:
            raise ValueError("frozen: takes a start from weights")
        starts = [s for ours in OURS for s in network_type(ours).Settings.starts]
        if self.start in starts and not self.from_scratch:
            raise ValueError(f"start: {self.model} starts from {', '.join(self.starts)} or weights")
        if type(self) is Recipe:  # without a network's own values none can be made
            return
        try:
            with torch.device("meta"):  # no memory, and no random numbers
                net = self.network()
        except ValidationError as error:
            raise ValueError("; ".join(problems_of(error, "shape", self.kind.Config))) from error
        if self.views not in net.views:
            raise ValueError(f"views: {self.model} takes {net.views}, not {self.views}")
        if self.fewer_views and len(net.views) == 1:
            raise ValueError(f"fewer_views: {self.model} sees a fixed number of views")
        parts = [name for name, _ in net.named_children()]
        if unknown := sorted(set(self.frozen) - set(parts)):
            raise ValueError(
                f"frozen: {', '.join(unknown)} unknown; {self.model} has {', '.join(parts)}"
            )
        if set(self.frozen) == set(parts):
            raise ValueError("frozen: nothing is left to learn")

    @property
    def kind(self) -> type[Network[Any]]:
        """The class of the network."""
        return network_type(self.model)

    def network(self) -> Network[Any]:
        """The network to train, untrained."""
        return self.kind.of(self)

    def chosen_augmentations(self) -> tuple[Augmentation, ...]:
        """The augmentations in the order in which they are applied."""
        scale = Scale(self.scale_weights)
        chosen = [a for name, a in AUGMENTATIONS.items() if name in self.augmentations]
        return tuple(scale if a.name == Scale.name else a for a in chosen)

    @property
    def shifted(self) -> bool:
        return ViewShift.name in self.augmentations

    @property
    def folders(self) -> list[Path]:
        """Those of the data that lie on disk."""
        return [d.folder for d in self.data if d.folder is not None]

    @property
    def provenance(self) -> dict[str, Any]:
        """What weights say of the scenes that they learned from."""
        about: dict[str, Any] = {}
        if len(self.folders) < len(self.data):
            about |= {"generator": VERSION, "seed": self.seed}
        if self.folders:
            about |= {"folders": [str(folder) for folder in self.folders]}
        return about

    @property
    def scales(self) -> list[int]:
        """Every N that the augmentation `scale` takes."""
        if Scale.name not in self.augmentations:
            return [1]
        return [n for n, weight in enumerate(self.scale_weights, 1) if weight]

    def rate(self, step: int) -> float:
        """Learning rate at a step: linear warm-up, then the decay."""
        share = step / self.steps
        first, last = self.learning_rate, self.final_learning_rate
        if self.decay == "exponential":
            rate = first * (last / first) ** share
        elif self.decay == "cosine":
            rate = last + (first - last) * 0.5 * (1 + math.cos(math.pi * share))
        else:
            rate = first
        return float(rate * min(1.0, (step + 1) / max(1, self.warmup_steps)))

    def reach(self, step: int) -> float:
        """Share of the rendered scenes' range of disparities that is used at a step."""
        done = 1.0 if self.widening == 0 else min(1.0, step / (self.widening * self.steps))
        reach: float = self.narrow * (1 / self.narrow) ** done
        return reach

    @property
    def paced_by_steps(self) -> list[str]:
        """Values by which a step depends on how many there will be: none where a run may be made
        longer."""
        paced = {
            "decay": self.decay != "constant",
            "widening": self.narrow < 1 and self.widening > 0,
            "fixed_norms_from": bool(self.fixed_norms_from),
        }
        return [name for name, is_paced in paced.items() if is_paced]

    @property
    def disparity_range_px(self) -> tuple[float, float] | None:
        """What the network learns of, as far as that is known of all scenes."""
        bounds = [b for d in self.data if (b := d.bounds_px) is not None]
        if len(bounds) < len(self.data):
            return None
        low, high = min(b[0] for b in bounds), max(b[1] for b in bounds)
        if SignReversal.name in self.augmentations:
            low, high = min(low, -high), max(high, -low)
        return low / min(self.scales), high / min(self.scales)

    @property
    def limits_px(self) -> tuple[float, float] | None:
        """Disparities beyond which the network knows nothing, as far as that is known."""
        return None if self.kind.searches else self.disparity_range_px

    def as_dict(self) -> dict[str, Any]:
        return self.model_dump(mode="json")


@cache
def recipe_type(model: str) -> type[Recipe]:
    """Recipes for one network: their values are those of all recipes and the network's own.

    Raises:
        InputError: there is no network of that name.
    """
    own = network_type(model).Settings
    bases: Any = (Recipe,) if own is Settings else (own, Recipe)
    made: type[Recipe] = create_model(f"{own.__name__}Recipe", __base__=bases)
    return made

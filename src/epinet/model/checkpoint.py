"""Weights on disk: safetensors whose metadata says what they are."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Annotated, Any, Literal

import torch
from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, ValidationError
from safetensors import SafetensorError, safe_open
from safetensors.torch import save
from torch import Tensor

from epinet.documents import parse_json, problems_of, short, validated
from epinet.errors import InputError
from epinet.io.atomic import atomic_path
from epinet.model.epinet import Epinet, EpinetConfig
from epinet.model.sweepnet import SweepNet, SweepNetConfig
from epinet.reading import read_bytes
from epinet.texts import POINTER, is_pointer

FORMAT = "epinet-1"
LOCAL_CONTRAST = "local contrast"
"""Value of the metadata's "input" where the weights want views as in `model.contrast`."""

SWEEPNET_VIEWS = (9, 7, 5, 3)
"""Sides of the grids that SweepNet is shown: what it was trained on, though it takes any."""


Network = Epinet | SweepNet

CALIBRATION = "calibration"
"""Key of the metadata of `epinet.predict.confidence.Calibration`, where errors are predicted."""

EPINET, SWEEPNET = "epinet", "sweepnet"
MODELS: dict[str, tuple[type[Network], type[EpinetConfig] | type[SweepNetConfig]]] = {
    SWEEPNET: (SweepNet, SweepNetConfig),
    EPINET: (Epinet, EpinetConfig),
}
"""The networks by name, each with its configuration; the first is used unless told otherwise."""

DEFAULT_MODEL = next(iter(MODELS))

_MOST_PROBLEMS = 10
_COUNTER = "num_batches_tracked"

LARGEST_BYTES = 2**28
"""Of a weights file; the shipped ones have up to 10 MB."""

EVENS_PX, STEEPEST = (1e-9, 1e9), 1e4
"""Bounds of a calibration; fits to errors that tell nothing run away."""

_Disparity = Annotated[float, Field(ge=-1e4, le=1e4)]


class _Header(BaseModel):
    """Metadata of the safetensors file, all of them texts."""

    format: Literal["epinet-1"]
    model: Literal["epinet", "sweepnet"] = "epinet"
    config: str
    metadata: str


class _Calibration(BaseModel):
    model_config = ConfigDict(strict=True, extra="forbid")
    even_px: Annotated[float, Field(ge=EVENS_PX[0], le=EVENS_PX[1])]
    steepness: Annotated[float, Field(ge=-STEEPEST, le=STEEPEST)]


class _Data(BaseModel):
    model_config = ConfigDict(strict=True, extra="allow")
    generator: str | None = None
    folders: list[str] = []


class _Recipe(BaseModel):
    model_config = ConfigDict(strict=True, extra="allow")
    name: str | None = None


class _About(BaseModel):
    """What is used of what weights say about themselves; they may say more."""

    model_config = ConfigDict(strict=True, extra="allow")
    input: str | None = None
    disparity_range_px: tuple[_Disparity, _Disparity] | None = Field(None, strict=False)
    calibration: _Calibration | None = None
    steps: int | None = None
    data: _Data | None = None
    recipe: _Recipe | None = None
    scores: dict[str, float] | None = None
    validated_on: str | None = None


@dataclass(frozen=True)
class Weights:
    """A network ready to predict, and what its file says about it."""

    net: Network
    """In eval mode, float32, on the CPU."""
    metadata: dict[str, Any]
    """Recipe, data, steps, scores and "disparity_range_px"."""
    source: str
    sha256: str = ""
    """Of the file."""

    @property
    def sees_local_contrast(self) -> bool:
        """Whether they were trained on local contrast; otherwise on plain gray, as published."""
        return self.metadata.get("input") == LOCAL_CONTRAST

    @property
    def model(self) -> str:
        """Name of the network's kind."""
        return model_of(self.net)

    @property
    def views(self) -> tuple[int, ...]:
        """Sides of the grids of views that the network can be shown, the largest first."""
        return SWEEPNET_VIEWS if isinstance(self.net, SweepNet) else (self.net.config.views,)

    def lines(self) -> list[str]:
        """What people want to know of them."""
        about = self.metadata
        lines = [
            f"network   {self._network_text()}",
            f"input     {about.get('input', 'gray')}",
        ]
        if self.disparity_range_px is not None:
            low, high = self.disparity_range_px
            lines.append(f"range     {low:g}..{high:g} px per adjacent view")
        if about.get("steps"):
            data, recipe = about.get("data") or {}, about.get("recipe") or {}
            learned = []
            if "generator" in data:
                learned.append(f"scenes {data['generator']} of seed {data.get('seed')}")
            learned += data.get("folders", [])
            lines.append(
                f"training  recipe {recipe.get('name')}, {about['steps']} steps, "
                + ", ".join(learned)
            )
        scores = about.get("scores") or {}
        if {"badpix_0.07", "mse_x100"} <= scores.keys():
            lines.append(
                f"scores    BadPix(.07) {scores['badpix_0.07']:.2f} %, "
                f"MSE x100 {scores['mse_x100']:.2f} on "
                + (about.get("validated_on") or "rendered scenes held out")
            )
        return [*lines, f"file      {self.source}"]

    def _network_text(self) -> str:
        parameters = sum(p.numel() for p in self.net.parameters())
        if isinstance(self.net, SweepNet):
            return f"SweepNet, 3x3 to 9x9 views, {parameters:,} parameters"
        config = self.net.config
        return (
            f"EPINET, {config.streams} streams of {config.views} views, {parameters:,} parameters"
        )

    @property
    def disparity_range_px(self) -> tuple[float, float] | None:
        """Range of the training scenes, where the file states it."""
        bounds = self.metadata.get("disparity_range_px")
        return None if bounds is None else (float(bounds[0]), float(bounds[1]))


def model_of(net: Network) -> str:
    """Name of a network's kind."""
    return next(name for name, (kind, _) in MODELS.items() if isinstance(net, kind))


def save_weights(path: Path, net: Network, metadata: dict[str, Any], *, half: bool = True) -> None:
    """Write a network's weights.

    Args:
        half: in half precision, but for the batch-norm statistics; otherwise all in float32.

    Raises:
        InputError: the file cannot be written.
    """

    def stored(name: str, tensor: Tensor) -> Tensor:
        halve = half and tensor.is_floating_point() and "running" not in name
        return (tensor.half() if halve else tensor).contiguous()

    tensors = {n: stored(n, t.detach().cpu()) for n, t in net.state_dict().items()}
    header = {
        "format": FORMAT,
        "model": model_of(net),
        "config": json.dumps(net.config.as_dict()),
        "metadata": json.dumps(metadata),
    }
    with atomic_path(path) as temporary:
        temporary.write_bytes(save(tensors, metadata=header))


def shipped_weights(model: str | None = None) -> dict[str, Path]:
    """Files of the weights that come with the package, of one model or of all, by name.

    Raises:
        InputError: there is no such model.
    """
    if model is not None and model not in MODELS:
        raise InputError(f"model {model}: there are {', '.join(MODELS)}")
    folder = Path(str(resources.files("epinet.model") / "weights"))
    return {path.stem: path for path in sorted(folder.glob(f"{model or ''}*.safetensors"))}


def load_weights(path: Path | str) -> Weights:
    """Read weights: a file, or shipped ones by their name.

    Raises:
        InputError: not a weights file of epinet, or damaged.
    """
    shipped = shipped_weights()
    file = shipped.get(str(path), Path(path))
    if not file.is_file():
        raise InputError(
            f"{file}: no such weights file, and none of the shipped {', '.join(shipped)}"
        )
    data = read_bytes(file, LARGEST_BYTES)
    try:
        with safe_open(file, framework="pt") as stored:
            texts = stored.metadata() or {}
            tensors = {name: stored.get_tensor(name) for name in stored.keys()}  # noqa: SIM118
    except (SafetensorError, OSError) as error:
        if is_pointer(Path(file)):
            raise InputError(f"{file}: {POINTER}") from error
        raise InputError(f"{file}: not a readable safetensors file ({error})") from error
    if texts.get("format") != FORMAT:
        raise InputError(
            f"{file}: safetensors, but not weights of epinet (its metadata lacks format={FORMAT})"
        )
    header = validated(_Header, texts, f"{file}, its metadata")
    metadata = parse_json(header.metadata, f"{file}, its metadata")
    validated(_About, metadata, f"{file}, its metadata")
    net = _network(header, tensors, file)
    return Weights(net.eval(), metadata, str(file), hashlib.sha256(data).hexdigest())


def _network(header: _Header, tensors: Mapping[str, Tensor], file: Path) -> Network:
    """The network of a file, which takes no more memory than its tensors say.

    Raises:
        InputError: its configuration is out of bounds, or its tensors are others or not finite.
    """
    kind, config_type = MODELS[header.model]
    try:
        config: Any = TypeAdapter(config_type).validate_python(
            parse_json(header.config, f"{file}, its configuration")
        )
    except ValidationError as error:
        raise InputError(problems_of(error, f"{file}, its configuration")) from error
    check_tensors(tensors, lambda: kind(config), "its configuration", file)
    net = kind(config)
    net.load_state_dict({n: t.float() if t.is_floating_point() else t for n, t in tensors.items()})
    return net


def check_tensors(
    tensors: Mapping[str, Tensor], make: Callable[[], Network], whose: str, file: Path
) -> None:
    """Refuse tensors that a network does not have, or that no network may have.

    Args:
        tensors: by their names in the network. Counters of batches, which tell nothing, may lack.
        make: makes the network, here without memory.
        whose: what the shapes are those of, for messages.
        file: where they come from.

    Raises:
        InputError: tensors that are missing, unknown, of another shape or not finite.
    """
    with torch.device("meta"):
        wanted = {name: tuple(t.shape) for name, t in make().state_dict().items()}
    found = {name: tuple(t.shape) for name, t in tensors.items()}
    problems = [
        f"{file}: tensor {short(name)} is {found.get(name, 'missing')}, {whose} has "
        f"{wanted.get(name, 'none of that name')}"
        for name in sorted(wanted.keys() | found.keys())
        if wanted.get(name) != found.get(name)
        and not (name.endswith(_COUNTER) and name not in found)
    ]
    problems = problems or [
        f"{file}: tensor {name} holds values that are not finite; take another copy"
        for name, tensor in tensors.items()
        if not torch.isfinite(tensor).all()
    ]
    if problems:
        raise InputError(problems[:_MOST_PROBLEMS])

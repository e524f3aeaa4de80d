"""Weights on disk: safetensors whose metadata says what they are."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
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
from epinet.networks.base import Network, config_as_dict
from epinet.networks.inputs import GRAY, INPUTS, Input
from epinet.networks.registry import (
    OURS,
    folder_of_weights,
    name_of,
    network_type,
    network_type_of_file,
)
from epinet.reading import read_bytes
from epinet.texts import POINTER, is_pointer

FORMAT = "epinet-1"
CALIBRATION = "calibration"
"""Key of the metadata of `epinet.predict.confidence.Calibration`, where errors are predicted."""

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
    model: Annotated[str, Field(max_length=200)] = "epinet"
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

    net: Network[Any]
    """In eval mode, float32, on the CPU."""
    metadata: dict[str, Any]
    """Recipe, data, steps, scores and "disparity_range_px"."""
    source: str
    sha256: str = ""
    """Of the file."""

    @property
    def input(self) -> Input:
        """What the network was trained to see of gray views."""
        return INPUTS.get(self.metadata.get("input") or GRAY.name, GRAY)

    @property
    def model(self) -> str:
        """Name of the network."""
        return name_of(type(self.net))

    def lines(self) -> list[str]:
        """What people want to know of them."""
        about = self.metadata
        lines = [
            f"network   {self.net.describe()}",
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

    @property
    def disparity_range_px(self) -> tuple[float, float] | None:
        """Range of the training scenes, where the file states it."""
        bounds = self.metadata.get("disparity_range_px")
        return None if bounds is None else (float(bounds[0]), float(bounds[1]))


def save_weights(
    path: Path, net: Network[Any], metadata: dict[str, Any], *, half: bool = True
) -> None:
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
        "model": name_of(type(net)),
        "config": json.dumps(config_as_dict(net)),
        "metadata": json.dumps(metadata),
    }
    with atomic_path(path) as temporary:
        temporary.write_bytes(save(tensors, metadata=header))


def shipped_weights(model: str | None = None) -> dict[str, Path]:
    """Files of the weights that come with a network, by name; of all of the package's by default.

    Raises:
        InputError: there is no such network.
    """
    names = OURS if model is None else [model]
    folders = [folder_of_weights(network_type(name)) for name in names]
    paths = [path for folder in folders for path in folder.glob("*.safetensors")]
    return {path.stem: path for path in sorted(paths, key=lambda path: path.stem)}


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


def _network(header: _Header, tensors: Mapping[str, Tensor], file: Path) -> Network[Any]:
    """The network of a file, which takes no more memory than its tensors say.

    Raises:
        InputError: its configuration is out of bounds, or its tensors are others or not finite.
    """
    try:
        kind = network_type_of_file(header.model)
    except InputError as error:
        raise InputError([f"{file}: {problem}" for problem in error.problems]) from error
    try:
        config: Any = TypeAdapter(kind.Config).validate_python(
            parse_json(header.config, f"{file}, its configuration")
        )
    except ValidationError as error:
        raise InputError(problems_of(error, f"{file}, its configuration", kind.Config)) from error
    check_tensors(tensors, lambda: kind(config), "its configuration", file)
    net = kind(config)
    net.load_state_dict({n: t.float() if t.is_floating_point() else t for n, t in tensors.items()})
    return net


def check_tensors(
    tensors: Mapping[str, Tensor], make: Callable[[], Network[Any]], whose: str, file: Path
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

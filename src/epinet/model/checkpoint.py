"""Weights on disk: safetensors whose metadata says what they are."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Any

from safetensors import SafetensorError, safe_open
from safetensors.torch import save
from torch import Tensor

from epinet.errors import InputError
from epinet.io.atomic import atomic_path
from epinet.model.network import Epinet, EpinetConfig

FORMAT = "epinet-1"
LOCAL_CONTRAST = "local contrast"
"""Value of the metadata's "input" where the weights want views as in `model.contrast`."""


@dataclass(frozen=True)
class Weights:
    """A network ready to predict, and what its file says about it."""

    net: Epinet
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

    def lines(self) -> list[str]:
        """What people want to know of them."""
        config, about = self.net.config, self.metadata
        lines = [
            f"network   EPINET, {config.streams} streams of {config.views} views, "
            f"{config.parameters:,} parameters",
            f"input     {about.get('input', 'gray')}",
        ]
        if self.disparity_range_px is not None:
            low, high = self.disparity_range_px
            lines.append(f"range     {low:g}..{high:g} px per adjacent view")
        if about.get("steps"):
            data, recipe = about.get("data", {}), about.get("recipe", {})
            lines.append(
                f"training  recipe {recipe.get('name')}, {about['steps']} steps, "
                f"scenes {data.get('generator')} of seed {data.get('seed')}"
            )
        if scores := about.get("scores"):
            lines.append(
                f"scores    BadPix(.07) {scores['badpix_0.07']:.2f} %, "
                f"MSE x100 {scores['mse_x100']:.2f} on rendered scenes held out"
            )
        return [*lines, f"file      {self.source}"]

    @property
    def disparity_range_px(self) -> tuple[float, float] | None:
        """Range of the training scenes, where the file states it."""
        bounds = self.metadata.get("disparity_range_px")
        return None if bounds is None else (float(bounds[0]), float(bounds[1]))


def save_weights(path: Path, net: Epinet, metadata: dict[str, Any], *, half: bool = True) -> None:
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
        "config": json.dumps(net.config.as_dict()),
        "metadata": json.dumps(metadata),
    }
    with atomic_path(path) as temporary:
        temporary.write_bytes(save(tensors, metadata=header))


DEFAULT = "epinet_9x9"
"""Name of the weights to use where none are asked for."""


def shipped_weights() -> dict[str, Path]:
    """Files of the weights that come with the package, by name."""
    folder = Path(str(resources.files("epinet.model") / "weights"))
    return {path.stem: path for path in sorted(folder.glob("*.safetensors"))}


def load_weights(path: Path | str | None = None) -> Weights:
    """Read weights: a file, shipped ones by their name, or None for the default.

    Raises:
        InputError: not a weights file of epinet, or damaged.
    """
    shipped = shipped_weights()
    file = shipped.get(str(path or DEFAULT), Path(path or DEFAULT))
    if not file.is_file():
        raise InputError(
            f"{file}: no such weights file, and none of the shipped {', '.join(shipped)}"
        )
    try:
        with safe_open(file, framework="pt") as stored:
            header = stored.metadata() or {}
            digest = hashlib.sha256(file.read_bytes()).hexdigest()
            tensors = {name: stored.get_tensor(name) for name in stored.keys()}  # noqa: SIM118
    except (SafetensorError, OSError) as error:
        raise InputError(f"{file}: not a readable safetensors file ({error})") from error
    if header.get("format") != FORMAT:
        raise InputError(
            f"{file}: safetensors, but not weights of epinet (its metadata lacks format={FORMAT})"
        )
    try:
        net = Epinet(EpinetConfig(**json.loads(header["config"])))
        metadata = json.loads(header["metadata"])
        net.load_state_dict(
            {n: t.float() if t.is_floating_point() else t for n, t in tensors.items()}
        )
        weights = Weights(net.eval(), metadata, str(file), digest)
        _ = weights.disparity_range_px
    except (KeyError, IndexError, TypeError, ValueError, RuntimeError, AttributeError) as error:
        raise InputError(f"{file}: its configuration or tensors do not fit ({error})") from error
    return weights

"""The reference architecture in Keras, in an environment of its own, with our weights."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from torch.nn import functional as F

from benchmarks.peers.keras_weights import write_keras
from epinet.lightfield import LightField
from epinet.networks.epinet import Epinet
from epinet.networks.epinet.layers import MARGIN_PX
from epinet.networks.weights import Weights, load_weights
from epinet.synth.options import RANGES_PX

REQUIREMENT = "tensorflow-cpu==2.21.*"
WORKER = Path(__file__).parent / "keras_worker.py"
WEIGHTS = "epinet_9x9"
MEMORY_MB = 1536.0


def ensure_environment(folder: Path) -> Path:
    """Python of a virtual environment with TensorFlow, made at the first use (1.5 GB)."""
    python = folder / "bin" / "python"
    ready = folder / ".ready"
    if not ready.exists():
        print(f"installing {REQUIREMENT} into {folder}", file=sys.stderr)
        subprocess.run([sys.executable, "-m", "venv", folder], check=True)
        subprocess.run([python, "-m", "pip", "install", "--quiet", REQUIREMENT], check=True)
        ready.touch()
    return python


def prepare(weights: Weights, lf: LightField, folder: Path) -> list[str]:
    """Write the worker's weights and stacks; the first of its arguments.

    The published network sees what ours sees: views padded to give a map of their size, and
    normalised by their local contrast where the weights were trained so.
    """
    assert isinstance(weights.net, Epinet)
    stacks = _seen(weights, lf)
    write_keras(folder / "weights.h5", weights.net)
    padded = F.pad(stacks, (MARGIN_PX,) * 4, mode="replicate")
    np.save(folder / "stacks.npy", padded.numpy())
    return [str(folder / "weights.h5"), str(folder / "stacks.npy")]


def ours(weights: Weights, lf: LightField) -> NDArray[np.float32]:
    """The map (H, W) that our network makes of the same."""
    assert isinstance(weights.net, Epinet)
    disparity, _ = weights.net.predict(_seen(weights, lf), RANGES_PX["hci"], MEMORY_MB)
    found: NDArray[np.float32] = disparity.numpy()
    return found


def shipped() -> Weights:
    return load_weights(WEIGHTS)


def random(seed: int = 1) -> Weights:
    """Weights of plain gray input whose batch normalisation is no identity."""
    torch.manual_seed(seed)
    net = Epinet()
    for module in net.modules():
        if isinstance(module, torch.nn.Conv2d):
            torch.nn.init.kaiming_normal_(module.weight)
        if isinstance(module, torch.nn.BatchNorm2d):
            for values in (module.weight, module.running_var):
                assert values is not None
                torch.nn.init.uniform_(values, 0.5, 1.5)
            for values in (module.bias, module.running_mean):
                assert values is not None
                torch.nn.init.normal_(values, 0, 0.1)
    return Weights(net.eval(), {"input": "gray"}, "random")


def _seen(weights: Weights, lf: LightField) -> torch.Tensor:
    (views,) = weights.net.views
    return weights.input.of(torch.from_numpy(lf.central(views).stacks(views)))

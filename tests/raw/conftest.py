"""A capture of the forward model that several tests read from disk."""

from __future__ import annotations

from pathlib import Path

import pytest
from plenoptic_forward import F01, Optics, Scene, photograph, write_capture


@pytest.fixture(scope="session")
def f01_optics() -> Optics:
    return Optics(size=(400, 440), pitch=10.0, rotation=-0.00086, centre=(222.2, 199.1))


@pytest.fixture(scope="session")
def f01_capture(tmp_path_factory: pytest.TempPathFactory, f01_optics: Optics) -> Path:
    """A small .lfp of an F01 in a folder of its own."""
    scene = Scene(slope0=5.0, middle=(220, 200), finest_px=60)
    path = tmp_path_factory.mktemp("f01") / "IMG_0001.lfp"
    return write_capture(path, f01_optics, F01, photograph(f01_optics, F01, scene))

"""Scenes with truth on disk, in the benchmark's layout, as scoring needs them.

Of a scene only the truth must be there: views, camera and masks are used where they are.
"""

from __future__ import annotations

import logging
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from epinet.camera import Camera
from epinet.errors import InputError
from epinet.io import hci
from epinet.io.images import image_files, read_image, read_mask
from epinet.io.names import folder_name, is_shown
from epinet.io.parameters import Parameters, read_parameters
from epinet.io.pfm import read_pfm
from epinet.io.problems import Problems, listed
from epinet.io.truth import checked_truth
from epinet.metrics.metric import Mask, Metric, Resolution
from epinet.metrics.stratified import NUMBERED
from epinet.predict.batch import FOLDERS_DEEP

LOGGER = logging.getLogger(__name__)
STRATIFIED = ("backgammon", "dots", "pyramids", "stripes")
TRAINING = ("boxes", "cotton", "dino", "sideboard")
TEST = ("bedroom", "bicycle", "herbs", "origami")
BENCHMARK_SCENES = STRATIFIED + TRAINING + TEST
"""The scenes that are submitted; the truth of TEST is not public."""
BENCHMARK_SIDE_PX = 512

HIGH_RESOLUTION_SCENES = frozenset({"backgammon", "dots", "stripes"})
"""Where the official site scores all pixels against the truth of 10 times the resolution."""

_BENCHMARK_VIEWS = 9
_TRUTH = {"low": "gt_disp_lowres.pfm", "high": "gt_disp_highres.pfm"}


@dataclass(frozen=True)
class Scene:
    """A scene with truth; what is large is read when it is asked for."""

    name: str
    folder: Path
    truth: NDArray[np.float32]
    """(H, W) in px per adjacent view; NaN where unknown."""
    camera: Camera | None = None
    views: int = _BENCHMARK_VIEWS
    """Rows and columns of its grid."""

    @property
    def size(self) -> tuple[int, int]:
        """(height, width) in px."""
        return self.truth.shape[0], self.truth.shape[1]

    @property
    def has_high_resolution(self) -> bool:
        """Whether there is truth of a higher resolution."""
        return (self.folder / _TRUTH["high"]).exists()

    def resolution(self, metric: Metric) -> Resolution | None:
        """Of the truth to score the metric against; None where it is not for this scene.

        That of the benchmark, or the low one where truth or masks of the high one are missing.
        """
        if metric.scene not in (None, self.name):
            return None
        high = self.benchmark_resolution(metric) == "high" and self.has_high_resolution
        if high and not self.missing_masks(metric, "high"):
            return "high"
        return None if self.missing_masks(metric, "low") else "low"

    def benchmark_resolution(self, metric: Metric) -> Resolution:
        """Of the truth that the official site scores the metric against."""
        if metric.truth == "scene":
            return "high" if self.name in HIGH_RESOLUTION_SCENES else "low"
        return metric.truth

    def missing_masks(self, metric: Metric, resolution: Resolution) -> list[str]:
        """Files that the metric needs and the scene lacks."""
        paths = [self._mask_file(name, resolution) for name in metric.masks]
        return [path.name for path in paths if not path.exists()]

    def truth_of(self, resolution: Resolution) -> NDArray[np.float32]:
        """(k H, k W) truth, k = 1 for the low resolution.

        Raises:
            InputError: it cannot be used, or is no whole multiple of the low one in size.
        """
        if resolution == "low":
            return self.truth
        path = self.folder / _TRUTH["high"]
        truth = checked_truth(read_pfm(path), None, path)
        (height, width), k = self.size, truth.shape[0] // self.size[0]
        if truth.shape != (k * height, k * width):
            raise InputError(
                f"{path}: {truth.shape[1]}x{truth.shape[0]} px; it must be 10 times, or another "
                f"whole multiple of, the {width}x{height} px of {_TRUTH['low']}"
            )
        return truth

    def masks_of(
        self, names: Collection[str], resolution: Resolution, size: tuple[int, ...]
    ) -> dict[str, Mask]:
        """Masks (H, W) by name, of the resolution's size.

        Raises:
            InputError: all that cannot be read or are of another size.
        """
        problems = Problems()
        masks: dict[str, Mask] = {}
        for name in sorted(names):
            path = self._mask_file(name, resolution)
            with problems.gather():
                mask: Mask = read_image(path)[..., 0] if name in NUMBERED else read_mask(path)
                if mask.shape != size:
                    raise InputError(
                        f"{path}: the mask is {mask.shape[1]}x{mask.shape[0]} px, "
                        f"the truth {size[1]}x{size[0]} px"
                    )
                masks[name] = mask
        problems.raise_any()
        return masks

    def centre_view(self) -> NDArray[np.uint8] | None:
        """(H, W, 3) the view that the truth belongs to; None where it is not there.

        Raises:
            InputError: it cannot be read.
        """
        centre = (self.views - 1) // 2 * (self.views + 1)
        for path in image_files(self.folder):
            if path.stem.lower() == f"input_cam{centre:03d}":
                image = read_image(path)
                if image.dtype == np.uint16:
                    image = (image // 257).astype(np.uint8)
                return np.broadcast_to(image, (*image.shape[:2], 3))
        return None

    def _mask_file(self, name: str, resolution: Resolution) -> Path:
        if name in ("invalid", "valid"):
            return self.folder / f"{name}_mask.png"
        return self.folder / f"mask_{name}_{resolution}res.png"


def scene_folders(folder: Path) -> dict[str, list[Path]]:
    """Folders that are scenes, with truth or without, by their names.

    Raises:
        InputError: there is none.
    """
    if not folder.is_dir():
        what = "not a folder" if folder.exists() else "no such folder"
        raise InputError(f"{folder}: {what}; give a scene with truth, or a folder of scenes")
    found: dict[str, list[Path]] = {}
    level = [folder]
    for _ in range(FOLDERS_DEEP + 1):
        scenes = [path for path in level if _is_scene(path)]
        for path in scenes:
            found.setdefault(folder_name(path), []).append(path)
        inside = [path for path in level if path not in scenes]
        entries = [p for path in inside for p in path.iterdir() if is_shown(p)]
        level = sorted(p for p in entries if p.is_dir())
    if not found:
        raise InputError(
            f"{folder}: no scene in it: none of its folders holds {_TRUTH['low']} or views named "
            "input_Cam000.png ..."
        )
    return found


def find_scenes(folder: Path, names: Sequence[str] = ()) -> list[Scene]:
    """The scenes of a folder, or the one that it is.

    Args:
        folder: a scene, or a folder of scenes, perhaps sorted into folders.
        names: of the scenes meant; none means all that have truth.

    Raises:
        InputError: all that is missing or wrong: no scene, no truth, unknown names, bad files.
    """
    problems = Problems()
    scenes = gather_scenes(scene_folders(folder), names, problems)
    problems.raise_any()
    return scenes


def gather_scenes(
    folders: Mapping[str, Sequence[Path]],
    names: Sequence[str],
    problems: Problems,
) -> list[Scene]:
    """The scenes that can be scored against; what is wrong with others goes to `problems`.

    The log says which scenes are left out.

    Args:
        folders: by the scenes' names, see `scene_folders`.
        names: of the scenes meant; none means all that have truth, or all where none has it.
        problems: takes what is wrong.
    """
    if not folders:
        return []
    with_truth = {
        name: having
        for name, paths in folders.items()
        if (having := [path for path in paths if (path / _TRUTH["low"]).exists()])
    }
    without = sorted(set(folders) - set(with_truth))
    if not names and with_truth and without:
        LOGGER.info("left out: %s (no truth: %s is missing)", listed(without, 12), _TRUTH["low"])
    scenes = []
    for name in dict.fromkeys(names or sorted(with_truth or folders)):
        with problems.gather():
            scenes.append(read_scene(only_folder({**folders, **with_truth}, name)))
    return scenes


def only_folder(folders: Mapping[str, Sequence[Path]], name: str) -> Path:
    """The folder of a scene.

    Args:
        folders: by the scenes' names, see `scene_folders`.

    Raises:
        InputError: there is none of that name, or more than one.
    """
    paths = folders.get(name, ())
    if not paths:
        raise InputError(f"scene {name}: not there; there are {listed(sorted(folders))}")
    if len(paths) > 1:
        both = " and ".join(str(path) for path in paths)
        raise InputError(f"{both}: scenes of one name; give the folder of one as --data")
    return paths[0]


def read_scene(folder: Path) -> Scene:
    """Read a scene's truth, and its camera if it is known.

    Raises:
        InputError: there is no truth, or it or the camera cannot be used.
    """
    path = folder / _TRUTH["low"]
    if not path.exists():
        raise InputError(
            f"{folder}: no truth to score against ({path.name} is missing); give a scene that has "
            "it"
        )
    problems = Problems()
    parameters = Parameters()
    truth: NDArray[Any] | None = None
    with problems.gather():
        truth = checked_truth(read_pfm(path), None, path)
    if (folder / "parameters.cfg").exists():
        with problems.gather():
            parameters = read_parameters(folder / "parameters.cfg")
    problems.raise_any()
    assert truth is not None
    views = parameters.side or _BENCHMARK_VIEWS
    scene = Scene(folder_name(folder), folder, truth, parameters.camera, views)
    if scene.has_high_resolution:
        scene.truth_of("high")
    return scene


def _is_scene(folder: Path) -> bool:
    return any((folder / name).exists() for name in _TRUTH.values()) or hci.recognises(folder)

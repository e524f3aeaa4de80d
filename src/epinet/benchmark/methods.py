"""Which methods are meant, and the maps of those that have to be run first."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from epinet.benchmark.evaluate import Method
from epinet.benchmark.maps import MapFile, Size, find_maps, result_map, scenes_with_maps
from epinet.benchmark.scenes import (
    BENCHMARK_SCENES,
    BENCHMARK_SIDE_PX,
    Scene,
    gather_scenes,
    only_folder,
    scene_folders,
)
from epinet.errors import InputError
from epinet.io.atomic import check_writable
from epinet.io.images import image_files, read_image
from epinet.io.names import folder_name
from epinet.io.problems import Problems, listed
from epinet.metrics.disparity import BORDER_PX
from epinet.metrics.metric import Comparison, Metric, Resolution
from epinet.networks.registry import known
from epinet.networks.weights import shipped_weights
from epinet.predict.batch import Options, Progress, Reading, predict_all
from epinet.predict.estimator import Estimator, load_model

LOGGER = logging.getLogger(__name__)
WEIGHTS_SUFFIX = ".safetensors"


@dataclass(frozen=True)
class Target:
    """What a user names as a method."""

    name: str
    what: str
    """A folder of maps, or a model: its name, that of shipped weights, or a weights file."""

    @property
    def is_model(self) -> bool:
        """Whether it must be run; otherwise its maps are there."""
        names = {*known(), *shipped_weights()}
        return self.what in names or self.what.endswith(WEIGHTS_SUFFIX)

    def load(self, device: str | None = None) -> Estimator:
        """The model, ready to predict.

        Raises:
            InputError: it cannot be used.
        """
        if self.what in known():
            return load_model(model=self.what, device=device)
        return load_model(self.what, device)


def named_targets(texts: Sequence[str]) -> list[Target]:
    """Methods from `WHAT` or `NAME=WHAT`; without a name, that of the folder, file or model.

    Example:
        >>> [target.name for target in named_targets(["sweepnet", "theirs=results/maps"])]
        ['sweepnet', 'theirs']
    """
    targets = []
    for text in texts:
        name, equals, what = text.partition("=")
        if not equals or not name or "/" in name or Path(text).exists():
            name, what = "", text
        targets.append(Target(name or _name_of(what), what))
    return targets


@dataclass(frozen=True)
class Prepared:
    """Scenes and methods, all checked, before any model has run."""

    scenes: tuple[Scene, ...]
    names: tuple[str, ...]
    """Of the methods, in the order given."""
    methods: Mapping[str, Method]
    """Those whose maps are there."""
    models: Mapping[str, Estimator]
    """Those that must be run."""

    def run(self, folder: Path, *, progress: Progress) -> list[Method]:
        """All methods; models are run into folder/<method>/<scene>, what is done there is kept.

        Raises:
            InputError: all scenes that a model could not predict.
        """
        problems = Problems()
        methods = dict(self.methods)
        folders = {scene.name: scene.folder for scene in self.scenes}
        for name, estimator in self.models.items():
            with problems.gather():
                maps = run_model(estimator, folders, folder / name, progress=progress)
                source = ", ".join(Path(w.source).name for w in estimator.weights)
                methods[name] = Method(name, f"weights {source}", maps)
        problems.raise_any()
        return [methods[name] for name in self.names]


def prepare(
    texts: Sequence[str],
    data: Path,
    scene_names: Sequence[str] = (),
    metrics: Sequence[Metric] = (),
    *,
    border_px: int = BORDER_PX,
    device: str | None = None,
) -> Prepared:
    """Find and check scenes and methods; the log says which scenes and maps are left out.

    Args:
        texts: the methods, see `named_targets`.
        data: a scene with truth, or a folder of them.
        scene_names: of the scenes meant; none means all with truth and a map by every method.
        metrics: whose masks must be usable where they are.
        border_px: will be left out on each side; something must remain.
        device: to run models on; None takes a GPU where there is one.

    Raises:
        InputError: all that is wrong with any scene, map or model, a scene asked for that lacks
            truth or a map, and no scene that is left.
    """
    problems = Problems()
    found: dict[str, list[Path]] = {}
    with problems.gather():
        found = scene_folders(data)
    targets = named_targets(texts)
    scenes = gather_scenes(found, scene_names, problems)
    if not scene_names:
        scenes = _with_estimates(scenes, targets)
    for scene in scenes:
        _check_pictures(scene, metrics, problems)
    problems += [
        f"{scene.folder}: a border of {border_px} px leaves nothing of {scene.size[1]}x"
        f"{scene.size[0]} px with truth; give a smaller --border"
        for scene in scenes
        if not Comparison(scene.truth, scene.truth, border_px=border_px).scored.any()
    ]
    methods: dict[str, Method] = {}
    models: dict[str, Estimator] = {}
    names = tuple(target.name for target in targets)
    problems += [
        f"method {name}: given more than once; tell them apart by NAME=..."
        for name in sorted({name for name in names if names.count(name) > 1})
    ]
    if any(target.is_model for target in targets):
        for scene in scenes:
            with problems.gather():
                _check_views(scene.folder, scene.size, "its truth has")
    for target in targets:
        with problems.gather():
            if target.is_model:
                models[target.name] = target.load(device)
            elif found:
                folder = Path(target.what)
                sizes = {scene.name: scene.size for scene in scenes}
                maps = find_maps(folder, sizes)
                methods[target.name] = Method(target.name, str(folder.resolve()), maps)
    problems.raise_any()
    return Prepared(tuple(scenes), names, methods, models)


def _with_estimates(scenes: list[Scene], targets: Sequence[Target]) -> list[Scene]:
    """Those of the scenes that every method has maps of, or views to see.

    A method that has none of them leaves all, so that it is told what it lacks.
    """
    for target in targets:
        folder = Path(target.what)
        if target.is_model:
            having = [scene for scene in scenes if image_files(scene.folder)]
            why = f"no views for {target.name} to see"
        else:
            held = scenes_with_maps(folder)
            having = [scene for scene in scenes if scene.name in held]
            why = f"no maps of them in {folder}"
        if having and len(having) < len(scenes):
            lacking = [scene.name for scene in scenes if scene not in having]
            LOGGER.info("left out: %s (%s)", listed(lacking, 12), why)
            scenes = having
    return scenes


def _check_pictures(scene: Scene, metrics: Sequence[Metric], problems: Problems) -> None:
    """Masks and centre view, before long work instead of after it."""
    with problems.gather():
        scene.centre_view()
    wanted: dict[Resolution, set[str]] = {}
    for metric in metrics:
        if metric.masks and (resolution := scene.resolution(metric)) is not None:
            wanted.setdefault(resolution, set()).update(metric.masks)
    for resolution, names in wanted.items():
        with problems.gather():
            scene.masks_of(names, resolution, scene.truth_of(resolution).shape)


def run_model(
    estimator: Estimator, folders: Mapping[str, Path], output: Path, *, progress: Progress
) -> dict[str, MapFile]:
    """Predict scenes, folders by name, into output/<scene>.

    Raises:
        InputError: all scenes that could not be predicted.
    """
    outcomes = list(
        predict_all(
            estimator,
            list(folders.values()),
            output,
            reading=Reading("hci"),
            options=Options(),
            names=list(folders),
            progress=progress,
        )
    )
    problems = [problem for outcome in outcomes for problem in outcome.problems]
    if problems:
        raise InputError(problems)
    return {outcome.name: result_map(outcome.folder) for outcome in outcomes}


def maps_to_submit(
    what: str,
    data: Path | None,
    folder: Path,
    output: Path,
    *,
    device: str | None = None,
    progress: Progress,
) -> dict[str, MapFile]:
    """Maps of the benchmark's 12 scenes with run times, from a folder or by running a model.

    Args:
        what: as in `Target`.
        data: folder of the scenes, for a model.
        folder: takes a model's results.
        output: the zip that they are for; where it cannot be written, no model is run.
        device: to run a model on; None takes a GPU where there is one.
        progress: told of the model's work.

    Raises:
        InputError: all scenes or maps that are missing or cannot be used, or an unwritable path.
    """
    target, size = Target("submission", what), (BENCHMARK_SIDE_PX, BENCHMARK_SIDE_PX)
    if not target.is_model:
        sizes = dict.fromkeys(BENCHMARK_SCENES, size)
        return find_maps(Path(what), sizes, complete=True)
    if data is None:
        raise InputError(f"{what}: a model needs the scenes; give their folder as --data")
    found = scene_folders(data)
    problems = Problems()
    folders: dict[str, Path] = {}
    for name in BENCHMARK_SCENES:
        if name not in found:
            problems.append(f"{data}: scene {name} is missing")
            continue
        with problems.gather():
            folders[name] = only_folder(found, name)
            _check_views(folders[name], size, "the benchmark's scenes have")
    problems.raise_any()
    check_writable(output.parent)
    return run_model(target.load(device), folders, folder, progress=progress)


def _check_views(folder: Path, size: Size, what_has: str) -> None:
    views = image_files(folder)
    if not views:
        raise InputError(f"{folder}: no views in it for a model to see")
    height, width = read_image(views[0]).shape[:2]
    if (height, width) != size:
        raise InputError(
            f"{folder}: views of {width}x{height} px; {what_has} {size[1]}x{size[0]} px"
        )


def _name_of(what: str) -> str:
    return Path(what).stem if what.endswith(WEIGHTS_SUFFIX) else folder_name(Path(what))

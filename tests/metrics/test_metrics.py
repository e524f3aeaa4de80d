"""Every metric: by hand where an answer is known, and against plain loops on noise."""

import math
from collections.abc import Callable

import numpy as np
import pytest

from epinet.camera import Camera
from epinet.errors import InputError
from epinet.metrics.catalogue import benchmark_metrics
from epinet.metrics.metric import Comparison, Metric

METRICS = {metric.id: metric for metric in benchmark_metrics()}
CAMERA = Camera(100, 35, 50, 2000, 24, 20)


def score(id_: str, estimate, truth=0.0, *, masks=(), border=0, scale=1, camera=None):
    """A metric's score; numbers stand for flat maps, names for masks of everything."""
    shape = np.broadcast_shapes(np.shape(estimate), np.shape(truth))
    everywhere = np.ones(shape, bool)
    named = masks if isinstance(masks, dict) else dict.fromkeys(masks, everywhere)
    maps = (np.broadcast_to(m, shape).astype(float) for m in (estimate, truth))
    return METRICS[id_].score(Comparison(*maps, named, border, scale, camera))


def half(shape=(4, 6)):
    """A mask of the left half."""
    mask = np.zeros(shape, bool)
    mask[:, : shape[1] // 2] = True
    return mask


# By hand.


ROW = np.array([[0, 0.005, 0.02, -0.02, 0.05, 0.08, -0.5, 0.07, np.nan, np.inf]])


@pytest.mark.parametrize(
    ("id_", "expected"),
    [
        ("badpix_0.07", 40),  # .07 itself is good; the missing two are bad
        ("badpix_0.03", 60),
        ("badpix_0.01", 80),
        ("mse_x100", 100 * (0.005**2 + 2 * 0.02**2 + 0.05**2 + 0.08**2 + 0.5**2 + 0.07**2) / 8),
        ("rmse_px", math.sqrt((0.005**2 + 2 * 0.02**2 + 0.05**2 + 0.08**2 + 0.25 + 0.07**2) / 8)),
        ("mae_px", (0.005 + 0.02 + 0.02 + 0.05 + 0.08 + 0.5 + 0.07) / 8),
        ("q25_x100", 100 * (0.005 + 0.75 * 0.015)),  # a quarter of the way through the 8 sorted
        ("missing", 20),
    ],
)
def test_scores_of_all_pixels_by_hand(id_, expected):
    assert score(id_, ROW) == pytest.approx(expected)


def test_thresholds_can_be_chosen():
    loose = benchmark_metrics((0.4,))[0]
    assert (loose.id, loose.name) == ("badpix_0.4", "BadPix(.4)")
    assert loose.score(Comparison(ROW, 0 * np.nan_to_num(ROW), border_px=0)) == pytest.approx(30)
    with pytest.raises(InputError, match="positive"):
        benchmark_metrics((0.07, -1, math.nan))


def test_run_time_is_what_the_method_states():
    truth = np.zeros((4, 4))
    assert METRICS["runtime"].score(Comparison(truth, truth, seconds=2.5)) == 2.5
    assert METRICS["runtime"].score(Comparison(truth, truth)) is None


@pytest.mark.parametrize(
    ("id_", "mask"),
    [
        ("discontinuities", "discontinuities"),
        ("badpix_planes", "planes"),
        ("badpix_smooth_surfaces", "smooth_surfaces"),
        ("badpix_occluded", "occluded"),
        ("stripes_low_texture", "low_texture"),
        ("stripes_high_contrast", "high_contrast"),
        ("stripes_low_contrast", "low_contrast"),
    ],
)
def test_badpix_of_regions_by_hand(id_, mask):
    estimate = np.zeros((4, 6))
    estimate[0] = 0.1  # bad
    estimate[1, 0] = np.nan  # bad, in the mask
    estimate[3] = 0.06  # good
    assert score(id_, estimate, masks={mask: half()}) == pytest.approx(100 * 4 / 12)
    assert score(id_, estimate) is None


def test_matchable_pixels_are_all_but_the_invalid():
    estimate = np.where(half(), 1.0, 0.0)
    estimate[0, 5] = 1
    assert score("badpix_matchable", estimate, masks={"invalid": half()}) == pytest.approx(100 / 12)


def test_fine_structures_by_hand():
    estimate = np.zeros((4, 6))
    estimate[0] = 0.2  # nearer than the truth: fat
    estimate[1] = -0.2  # farther: thin
    estimate[2] = 0.14  # neither
    estimate[3, 0] = np.nan  # both, in the mask
    fat = score("fine_fattening", estimate, masks={"fine_surrounding": half()})
    thin = score("fine_thinning", estimate, masks={"fine": half()})
    assert fat == thin == pytest.approx(100 * 4 / 12)
    assert score("fine_fattening", 0.2, np.zeros((4, 6)), masks=("fine_surrounding",)) == 100
    assert score("fine_thinning", 0.2, np.zeros((4, 6)), masks=("fine",)) == 0


BUMPINESS = {
    "bumpiness_planes": ("planes",),
    "bumpiness_smooth_surfaces": ("smooth_surfaces",),
    "pyramids_bumpiness_slanted": ("pyramids", "sphere_in", "sphere_out"),
    "pyramids_bumpiness_parallel": ("plane",),
}


@pytest.mark.parametrize("id_", BUMPINESS)
def test_bumpiness_by_hand(id_):
    masks = BUMPINESS[id_]
    rows, cols = np.mgrid[:12, :14].astype(float)
    assert score(id_, 3 + 0.2 * rows - 0.1 * cols, masks=masks, border=3) == pytest.approx(0)
    # d2/dx2 = .002; the kernel doubles each slope, so the Hessian holds .008.
    assert score(id_, 0.001 * cols**2, masks=masks, border=3) == pytest.approx(0.8)
    # In both directions, and mixed: sqrt(8^2 + 8^2 + 2 * 4^2) thousandths.
    bowl = 0.001 * (rows**2 + cols**2 + rows * cols)
    assert score(id_, bowl, masks=masks, border=3) == pytest.approx(0.1 * math.sqrt(160))
    assert score(id_, cols**2, masks=masks, border=3) == pytest.approx(5)  # clipped
    assert score(id_, cols**2, cols**2, masks=masks, border=3) == 0
    assert score(id_, np.full((12, 14), np.nan), masks=masks, border=3) == pytest.approx(5)


def test_slanted_pyramids_are_any_of_three_masks():
    cols = np.arange(30.0) * np.ones((12, 1))
    bumpy = np.where(cols < 15, 0, 0.001 * cols**2)
    nothing = np.zeros((12, 30), bool)
    right = nothing.copy()
    right[4:8, 20:26] = True
    left = right[:, ::-1]
    masks = {"pyramids": nothing, "sphere_in": left, "sphere_out": right}
    assert score("pyramids_bumpiness_slanted", bumpy, masks=masks) == pytest.approx(0.4)


def tilted(degrees: float, size=(20, 24)) -> np.ndarray:
    """Disparity of the plane Z = Z0 + x tan(angle)."""
    pitch = CAMERA.sensor_size_mm / max(size) / CAMERA.focal_length_mm
    slope = (np.arange(size[1]) - (size[1] - 1) / 2) * pitch
    depth = CAMERA.focus_distance_mm / (1 - slope * math.tan(math.radians(degrees)))
    return np.broadcast_to(CAMERA.disparity_px(depth), size).copy()


@pytest.mark.parametrize("region", ["planes", "smooth_surfaces"])
def test_normals_by_hand(region):
    flat, tilt = np.zeros((20, 24)), tilted(10)
    true, benchmark = f"normal_angle_{region}", f"mae_{region}"
    given = {"masks": (region,), "border": 2, "camera": CAMERA}
    assert score(true, flat, tilt, **given) == pytest.approx(10, abs=0.01)
    assert score(true, tilted(-5), tilt, **given) == pytest.approx(15, abs=0.01)
    # The toolkit's x is k x + (k 11.5 pitch / f) Z with k = 24 / (2 * 23).
    t, k, half_view = math.tan(math.radians(10)), 24 / 46, 11.5 * 0.35 / 24
    expected = math.degrees(math.atan(t / k / (1 + t * half_view)))
    assert score(benchmark, tilt, flat, **given) == pytest.approx(expected, abs=0.01)
    for id_ in (true, benchmark):
        assert score(id_, tilt, tilt, **given) == 0
        assert score(id_, np.full((20, 24), np.nan), tilt, **given) == 180
        assert score(id_, np.full((20, 24), -1e6), tilt, **given) == 180  # beyond infinity
        assert score(id_, tilt, tilt, masks=(region,), border=2) is None  # no camera


def backgammon() -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Foreground at 2 from the left, background at 0 to the right, of 40 columns."""
    truth = np.zeros((10, 40))
    truth[:, :20] = 2
    fat, thin = np.zeros((2, 10, 40), bool)
    fat[:, 20:24] = thin[:, 16:20] = True
    return truth, {"foreground_fattening": fat, "foreground_thinning": thin}


def test_backgammon_by_hand():
    truth, masks = backgammon()
    estimate = truth.copy()
    estimate[:, 20] = 1.1  # nearer than half-way: fat
    estimate[:, 21] = 0.9
    estimate[:, 18:20] = 0.9  # farther than half-way: thin
    estimate[0, 22] = estimate[0, 17] = np.nan
    assert score("backgammon_fattening", estimate, truth, masks=masks) == pytest.approx(27.5)
    assert score("backgammon_thinning", estimate, truth, masks=masks) == pytest.approx(52.5)
    assert score("backgammon_fattening", truth, truth, masks=masks) == 0


def test_backgammon_of_high_resolution_looks_farther_for_the_foreground():
    truth, masks = backgammon()
    truth[:, :10] = -7
    large = {name: mask.repeat(2, 0).repeat(2, 1) for name, mask in masks.items()}
    estimate = np.where(large["foreground_fattening"], 1.1, 0)
    truth = truth.repeat(2, 0).repeat(2, 1)  # column 14 of the low one is foreground
    assert score("backgammon_fattening", estimate, truth, masks=large, scale=2) == 100


def dots() -> dict[str, np.ndarray]:
    """Two boxes with dots of sizes 1, 2 and 9, four pixels each."""
    boxes, sizes = np.zeros((2, 8, 20), np.uint8)
    boxes[:, :10], boxes[:, 10:] = 1, 2
    for left in (0, 10):
        for k, size in enumerate((1, 2, 9)):
            sizes[2:4, left + 3 * k : left + 3 * k + 2] = size
    return {"boxes": boxes, "dots_by_size": sizes, "background": sizes == 0}


def test_dots_by_hand():
    masks = dots()
    estimate = np.zeros((8, 20))
    estimate[2, 0:2] = 0.5  # half of a dot: missed
    estimate[2, 3] = 9  # a quarter: found
    estimate[2:4, 10:12] = np.nan  # missed
    estimate[2:4, 16:18] = 9  # the ninth size does not count
    assert score("dots_missed", estimate, masks=masks) == 50
    assert score("dots_background_mse_x100", estimate, masks=masks) == 0
    assert score("dots_background_mse_x100", 0.1, np.zeros((8, 20)), masks=masks) == pytest.approx(
        1
    )


# Laws.


@pytest.mark.parametrize("metric", METRICS.values(), ids=METRICS)
def test_every_metric_says_what_it_is(metric: Metric):
    assert metric.name and metric.unit and metric.source
    assert metric.definition.endswith(".")


@pytest.mark.parametrize("id_", [id_ for id_, metric in METRICS.items() if metric.masks])
def test_without_its_mask_a_score_is_absent(id_):
    comparison = noise()
    for name in METRICS[id_].masks:
        masks = {other: mask for other, mask in comparison.masks.items() if other != name}
        lacking = Comparison(comparison.estimate, comparison.truth, masks, 3, camera=CAMERA)
        assert METRICS[id_].score(lacking) is None
    empty = {name: np.zeros((20, 24), bool) for name in comparison.masks}
    if "invalid" not in METRICS[id_].masks:
        nothing = Comparison(comparison.estimate, comparison.truth, empty, 3, camera=CAMERA)
        assert METRICS[id_].score(nothing) is None


def test_shapes_must_agree():
    with pytest.raises(ValueError, match="differ"):
        Comparison(np.zeros((4, 4)), np.zeros((4, 5)))
    with pytest.raises(ValueError, match="planes"):
        Comparison(np.zeros((4, 4)), np.zeros((4, 4)), {"planes": np.zeros((8, 8), bool)})


# Against plain loops.


def noise(seed: int = 0) -> Comparison:
    """Maps of 24x20 px with holes in both, errors that grow to the right, every mask at random."""
    rng = np.random.default_rng(seed)
    truth = rng.normal(0, 0.5, (20, 24))
    estimate = truth + rng.normal(0, np.logspace(-4.5, 0.5, 24), truth.shape)
    estimate[rng.random(truth.shape) < 0.02] = np.nan
    estimate[10, 15] = np.inf
    truth[rng.random(truth.shape) < 0.02] = np.nan
    names = {name for metric in METRICS.values() for name in metric.masks}
    masks = {name: rng.random(truth.shape) < 0.6 for name in sorted(names)}
    masks["boxes"] = np.arange(24) // 6 * np.ones((20, 1), int)
    masks["dots_by_size"] = rng.integers(0, 11, truth.shape)
    return Comparison(estimate, truth, masks, 3, 1, CAMERA, 1.5)


def pixels(c: Comparison, *masks: str):
    """(row, col) of the pixels scored, one by one."""
    for row in range(c.border_px, c.truth.shape[0] - c.border_px):
        for col in range(c.border_px, c.truth.shape[1] - c.border_px):
            inside = not masks or any(c.masks[name][row, col] for name in masks)
            if inside and not math.isnan(c.truth[row, col]):
                yield row, col


def share(flags: list[bool]) -> float:
    return 100 * sum(flags) / len(flags)


def slow_badpix(threshold: float, *masks: str) -> Callable[[Comparison], float]:
    def compute(c: Comparison) -> float:
        good = [abs(c.estimate[p] - c.truth[p]) <= threshold for p in pixels(c, *masks)]
        return 100 - share(good)

    return compute


def slow_errors(c: Comparison, *masks: str) -> list[float]:
    errors = [abs(c.estimate[p] - c.truth[p]) for p in pixels(c, *masks)]
    return [error for error in errors if math.isfinite(error)]


def slow_mse(*masks: str) -> Callable[[Comparison], float]:
    def compute(c: Comparison) -> float:
        errors = slow_errors(c, *masks)
        return 100 * sum(error**2 for error in errors) / len(errors)

    return compute


def slow_q25(c: Comparison) -> float:
    errors = sorted(slow_errors(c))
    place = 0.25 * (len(errors) - 1)
    low = math.floor(place)
    return 100 * (errors[low] + (place - low) * (errors[low + 1] - errors[low]))


KERNEL = [[3 / 16, 10 / 16, 3 / 16], [0, 0, 0], [-3 / 16, -10 / 16, -3 / 16]]


def slow_slope(image: np.ndarray, row: int, col: int, *, down: bool) -> float:
    total = 0.0
    for i in range(3):
        for j in range(3):
            weight = KERNEL[i][j] if down else KERNEL[j][i]
            total -= weight * image[row + i - 1, col + j - 1]
    return total


def slow_hessian(image: np.ndarray, row: int, col: int) -> float:
    total = 0.0
    for first in (True, False):
        slopes = np.zeros((3, 3))
        for i in range(3):
            for j in range(3):
                slopes[i, j] = slow_slope(image, row + i - 1, col + j - 1, down=first)
        for second in (True, False):
            total += slow_slope(slopes, 1, 1, down=second) ** 2
    return math.sqrt(total)


def slow_bumpiness(*masks: str) -> Callable[[Comparison], float]:
    def compute(c: Comparison) -> float:
        estimate = np.where(np.isfinite(c.estimate), c.estimate, np.nan)
        bumps = []
        for p in pixels(c, *masks):
            if math.isnan(slow_hessian(c.truth, *p)):
                continue
            bump = slow_hessian(estimate - c.truth, *p)
            bumps.append(0.05 if math.isnan(bump) else min(bump, 0.05))
        return 100 * sum(bumps) / len(bumps)

    return compute


def slow_normal(disparity: np.ndarray, row: int, col: int, *, toolkit: bool) -> np.ndarray:
    height, width = disparity.shape
    longer = max(height, width)
    points = np.full((3, 3, 3), np.nan)
    for i in range(3):
        for j in range(3):
            y, x = row + i - 1, col + j - 1
            z = float(CAMERA.depth_mm(disparity[y, x]))
            if toolkit:
                rays = [x / (longer - 1) * 0.5, y / (longer - 1) * 0.5]
            else:
                rays = [(x - (width - 1) / 2) / longer, (y - (height - 1) / 2) / longer]
            if math.isfinite(z):
                points[i, j] = [ray * CAMERA.sensor_size_mm * z / 100 for ray in rays] + [z]
    down, right = (
        np.array([slow_slope(points[..., k], 1, 1, down=d) for k in range(3)])
        for d in (True, False)
    )
    normal = np.cross(down, right)
    return normal / np.linalg.norm(normal)


def slow_angle(mask: str, *, toolkit: bool) -> Callable[[Comparison], float]:
    def compute(c: Comparison) -> float:
        angles = []
        for p in pixels(c, mask):
            true = slow_normal(c.truth, *p, toolkit=toolkit)
            given = slow_normal(c.estimate, *p, toolkit=toolkit)
            if np.isnan(true).any():
                continue
            missing = np.isnan(given).any()
            angles.append(180 if missing else math.degrees(math.acos(min(1, given @ true))))
        angles.sort()
        middle = len(angles) // 2
        return angles[middle] if len(angles) % 2 else (angles[middle - 1] + angles[middle]) / 2

    return compute


def slow_fine(mask: str, sign: int) -> Callable[[Comparison], float]:
    def compute(c: Comparison) -> float:
        good = [sign * (c.truth[p] - c.estimate[p]) <= 0.15 for p in pixels(c, mask)]
        finite = [math.isfinite(c.estimate[p]) for p in pixels(c, mask)]
        return 100 - share([g and f for g, f in zip(good, finite, strict=True)])

    return compute


def slow_backgammon(mask: str, column: int, sign: int) -> Callable[[Comparison], float]:
    def compute(c: Comparison) -> float:
        bad = []
        for row, col in pixels(c, mask):
            half_way = (c.truth[row, column] + c.truth[row, col]) / 2
            value = c.estimate[row, col]
            if not math.isnan(half_way):
                bad.append(not math.isfinite(value) or sign * value > sign * half_way)
        return share(bad)

    return compute


def slow_missed(c: Comparison) -> float:
    missed = []
    for box in range(1, 4):
        for size in range(1, 9):
            errors = [
                abs(c.estimate[p] - c.truth[p])
                for p in np.ndindex(c.truth.shape)
                if c.masks["boxes"][p] == box
                and c.masks["dots_by_size"][p] == size
                and not math.isnan(c.truth[p])
            ]
            missed.append(2 * sum(not error <= 0.4 for error in errors) >= len(errors))
    return share(missed)


def slow_matchable(c: Comparison) -> float:
    seen = [p for p in pixels(c) if not c.masks["invalid"][p]]
    return 100 - share([abs(c.estimate[p] - c.truth[p]) <= 0.07 for p in seen])


SLOW: dict[str, Callable[[Comparison], float]] = {
    **{f"badpix_{t}": slow_badpix(t) for t in (0.07, 0.03, 0.01)},
    "mse_x100": slow_mse(),
    "q25_x100": slow_q25,
    "rmse_px": lambda c: math.sqrt(slow_mse()(c) / 100),
    "mae_px": lambda c: sum(slow_errors(c)) / len(slow_errors(c)),
    "missing": lambda c: 100 - share([math.isfinite(c.estimate[p]) for p in pixels(c)]),
    "runtime": lambda c: 1.5,
    "discontinuities": slow_badpix(0.07, "discontinuities"),
    "fine_fattening": slow_fine("fine_surrounding", -1),
    "fine_thinning": slow_fine("fine", 1),
    **{id_: slow_bumpiness(*masks) for id_, masks in BUMPINESS.items()},
    **{f"mae_{m}": slow_angle(m, toolkit=True) for m in ("planes", "smooth_surfaces")},
    **{f"normal_angle_{m}": slow_angle(m, toolkit=False) for m in ("planes", "smooth_surfaces")},
    **{f"badpix_{m}": slow_badpix(0.07, m) for m in ("planes", "smooth_surfaces", "occluded")},
    "badpix_matchable": slow_matchable,
    "backgammon_fattening": slow_backgammon("foreground_fattening", 14, 1),
    "backgammon_thinning": slow_backgammon("foreground_thinning", 24 - 11, -1),
    "dots_background_mse_x100": slow_mse("background"),
    "dots_missed": slow_missed,
    **{
        f"stripes_{m}": slow_badpix(0.07, m)
        for m in ("low_texture", "high_contrast", "low_contrast")
    },
}


def test_every_metric_has_a_slow_version():
    assert set(SLOW) == set(METRICS)


@pytest.mark.parametrize("seed", [0, 1])
@pytest.mark.parametrize("id_", METRICS)
def test_as_the_slow_version(id_, seed):
    comparison = noise(seed)
    expected = SLOW[id_](comparison)
    assert METRICS[id_].score(comparison) == pytest.approx(expected, rel=1e-4)
    assert 0 < expected < (4.9 if id_ in BUMPINESS else 180)

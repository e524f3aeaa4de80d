"""The peers are competent: known scenes are recovered, and their parts do what they say."""

import numpy as np
import pytest
import torch
from scipy.optimize import linprog

from benchmarks.peers import plane_sweep, structure_tensor
from benchmarks.peers.keras_weights import write_keras
from benchmarks.peers.methods import disparity_range
from benchmarks.peers.tables import markdown
from benchmarks.peers.total_variation import EDGE, smoothed
from epinet.camera import Camera
from epinet.lightfield import LightField
from epinet.networks.epinet import Epinet, EpinetConfig
from epinet.networks.epinet.keras import read_keras

SIDE, FAR_PX, NEAR_PX = 72, -1.3, 1.9


def texture(seed):
    """A smooth colour picture known between its pixels: waves of at least 4 px."""
    rng = np.random.default_rng(seed)
    waves = [
        (rng.uniform(-1.5, 1.5, 2), rng.uniform(0, 2 * np.pi), rng.uniform(-1, 1, 3))
        for _ in range(24)
    ]

    def at(x, y):
        colours = sum(
            np.sin(kx * x + ky * y + phase)[..., None] * c for (kx, ky), phase, c in waves
        )
        return 0.5 + 0.08 * colours

    return at


@pytest.fixture(scope="module")
def two_planes():
    """A near square before a far wall, every view computed from the planes' own pictures."""
    wall, square = texture(1), texture(2)
    y, x = np.mgrid[:SIDE, :SIDE].astype(float)

    def on_square(x, y):
        return (np.abs(x - SIDE / 2) < 14) & (np.abs(y - SIDE / 2) < 14)

    views = np.zeros((9, 9, SIDE, SIDE, 3), np.float32)
    for row in range(9):
        for col in range(9):
            there = [(x + d * (col - 4), y + d * (row - 4)) for d in (NEAR_PX, FAR_PX)]
            near = on_square(*there[0])[..., None]
            views[row, col] = np.where(near, square(*there[0]), wall(*there[1])).clip(0, 1)
    truth = np.where(on_square(x, y), NEAR_PX, FAR_PX).astype(np.float32)
    return LightField(views, truth=truth)


@pytest.mark.parametrize("method", [structure_tensor, plane_sweep])
def test_two_planes_are_found(two_planes, method):
    estimate = method.estimate(two_planes, (-2.0, 2.5))
    assert estimate.shape == two_planes.size
    assert estimate.dtype == np.float32
    error = np.abs(estimate - two_planes.truth)[10:-10, 10:-10]
    assert np.median(error) < 0.01
    assert np.mean(error > 0.07) < 0.15  # the edge of the square, where half of the views see it
    y, x = np.abs(np.mgrid[10 - SIDE / 2 : SIDE / 2 - 10, 10 - SIDE / 2 : SIDE / 2 - 10])
    inside = np.maximum(x, y) < 8
    assert error[inside].max() < 0.05


def test_a_shear_reaches_beyond_one_pixel(two_planes):
    """Without shears (a range inside one pixel) the near square cannot be found."""
    slopes, _ = structure_tensor.slopes(two_planes, (-0.5, 0.5))
    assert np.abs(slopes).max() <= 0.5


def one_dimensional_optimum(datum, weight):
    """Least total variation plus weighted distance, as a linear programme."""
    n = len(datum)
    steps = np.diff(np.eye(n), axis=0)
    # Unknowns: the map, bounds of its steps, bounds of its distances.
    cost = np.concatenate([np.zeros(n), np.ones(n - 1), weight])
    blocks = []
    for sign in (1, -1):
        blocks.append(np.hstack([sign * steps, -np.eye(n - 1), np.zeros((n - 1, n))]))
        blocks.append(np.hstack([sign * np.eye(n), np.zeros((n, n - 1)), -np.eye(n)]))
    zero = np.zeros(n - 1)
    bounds = np.concatenate([zero, datum, zero, -datum])
    free = [(None, None)] * n + [(0, None)] * (2 * n - 1)
    return linprog(cost, A_ub=np.vstack(blocks), b_ub=bounds, bounds=free).fun


def test_total_variation_reaches_the_optimum():
    rng = np.random.default_rng(3)
    datum = np.repeat([0.0, 2.0, 1.0], 12) + rng.normal(0, 0.3, 36)
    trust = rng.uniform(0, 1, 36)
    u = smoothed(*(a.astype(np.float32)[:, None] for a in (datum, trust, np.zeros(36))))[:, 0]
    reached = np.abs(np.diff(u)).sum() + (trust * np.abs(u - datum)).sum()
    best = one_dimensional_optimum(datum, trust)
    assert best - 1e-3 <= reached <= 1.01 * best


def test_what_is_not_trusted_is_filled_up_to_the_edges_of_the_picture():
    gray = np.zeros((48, 48), np.float32)
    gray[:, 22:] = 1
    wanted = np.where(gray > 0, 3, 1).astype(np.float32)
    trust = np.ones_like(wanted)
    trust[8:40, 10:30] = 0
    datum = np.where(trust > 0, wanted, -5)
    assert np.exp(-EDGE) < 1e-6  # a step costs nearly nothing there
    found = smoothed(datum, trust, gray)
    np.testing.assert_allclose(found, wanted, atol=0.15)


def test_the_guided_filter_is_ridge_regression_in_every_window():
    rng = np.random.default_rng(4)
    side = 2 * plane_sweep.RADIUS_PX + 1
    guide, image = (rng.random((60, 60, c)).astype(np.float32) for c in (3, 1))
    image = image[..., 0] + guide @ np.array([1, -2, 0.5], np.float32)
    filtered = plane_sweep.GuidedFilter(guide)(image)
    at = np.array([30, 28])
    values = []
    for y, x in np.ndindex(side, side):  # every window that holds the pixel
        top, left = at - plane_sweep.RADIUS_PX * 2 + (y, x)
        window = (slice(top, top + side), slice(left, left + side))
        g, p = guide[window].reshape(-1, 3).astype(float), image[window].ravel().astype(float)
        centred = g - g.mean(0)
        covariance = centred.T @ centred / len(g) + plane_sweep.EPSILON * np.eye(3)
        slope = np.linalg.solve(covariance, centred.T @ (p - p.mean()) / len(g))
        values.append(slope @ (guide[*at] - g.mean(0)) + p.mean())
    assert filtered[*at] == pytest.approx(np.mean(values), abs=1e-3)


def test_weights_written_for_keras_are_read_again(tmp_path):
    net = Epinet(EpinetConfig(views=5, stream_width=6)).eval()
    for tensor in net.state_dict().values():
        if tensor.is_floating_point():
            tensor.uniform_(0.5, 1.5)
    write_keras(tmp_path / "weights.h5", net)
    again = read_keras(tmp_path / "weights.h5").net.state_dict()
    for name, tensor in net.state_dict().items():
        if "num_batches" not in name:
            assert torch.equal(tensor, again[name]), name


def test_the_stated_range_is_searched(two_planes):
    camera = Camera(100, 35, 11, 2300, SIDE, SIDE, -3.0, 2.0)
    stated = LightField(two_planes.views, camera=camera)
    assert disparity_range(stated) == (-3.0, 2.0)
    low, high = disparity_range(two_planes)  # measured
    assert -3 < low < FAR_PX < NEAR_PX < high < 3.5


def test_the_table_averages_over_scenes_and_leaves_out_what_is_not_known():
    def scene(seconds, scores):
        return {"methods": {"SweepNet": {"cpu_s": seconds} | scores}}

    scored = {"scores": {"badpix_0.07": 4.0}}
    report = {"sets": {"mine": {"a": scene(1.0, scored), "b": scene(2.0, {})}}}
    for method in ("structure tensor", "plane sweep", "Keras EPINET", "EPINET"):
        for s in report["sets"]["mine"].values():
            s["methods"][method] = {}
    row = next(line for line in markdown(report).splitlines() if "SweepNet" in line)
    assert row == "| mine (2) | SweepNet | 4.00 | - | - | - | 1.50 | - |"

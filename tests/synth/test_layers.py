"""The layer generator against a plain slow renderer and the laws of light fields."""

import numpy as np
import pytest
import torch
from scipy.ndimage import map_coordinates

from epinet.synth.demo import render_demo
from epinet.synth.layer_textures import TEXELS_PER_PX
from epinet.synth.layers import LayerScenes, draw_scenes


@pytest.fixture(scope="module")
def scenes() -> LayerScenes:
    return draw_scenes(torch.Generator().manual_seed(5), 6, (48, 60), (-3, 3), layers=5)


def plain_pixel(
    scenes: LayerScenes, b: int, du: int, dv: int, col: int, row: int
) -> tuple[float, float]:
    """Colour and disparity at one view pixel: each layer's point by iteration."""
    height, width = scenes.size
    x_view, y_view = col - (width - 1) / 2, row - (height - 1) / 2
    colour, nearest = 0.0, -np.inf
    for layer in range(scenes.planes.shape[1]):
        a, slope_x, slope_y = scenes.planes[b, layer].tolist()
        x, y = x_view, y_view
        for _ in range(200):  # (x, y) is seen at (x - d du, y - d dv)
            d = a + slope_x * x + slope_y * y
            x, y = x_view + d * du, y_view + d * dv
        texture, coverage = (
            map_coordinates(
                canvas.numpy().astype(float),
                [
                    [(canvas.shape[0] - 1) / 2 + TEXELS_PER_PX * y],
                    [(canvas.shape[1] - 1) / 2 + TEXELS_PER_PX * x],
                ],
                order=1,
                mode="reflect",
            )[0]
            for canvas in scenes.canvases[b, layer]
        )
        if layer == 0:
            colour, nearest = texture, d
        elif d > nearest:
            colour += coverage * (texture - colour)
            nearest = d if coverage > 0.5 else nearest
    return colour, nearest


def test_views_and_truth_equal_a_plain_renderer(scenes):
    offsets = [(0, 0), (-4, 4), (3, -2), (4, 0)]
    views, disparity = scenes.render(offsets)
    rng = np.random.default_rng(0)
    for _ in range(150):
        b, p = rng.integers(6), rng.integers(len(offsets))
        row, col = rng.integers(48), rng.integers(60)
        dv, du = offsets[p]
        colour, d = plain_pixel(scenes, b, du, dv, col, row)
        assert views[b, p, 0, row, col].item() == pytest.approx(colour, abs=2e-3)
        assert disparity[b, p, row, col].item() == pytest.approx(d, abs=1e-3)


def warp_residual(view: np.ndarray, centre: np.ndarray, d: np.ndarray, dv: int, du: int) -> float:
    """Median difference of a view, sampled where the disparity says, to the centre view."""
    y, x = np.mgrid[: d.shape[0], : d.shape[1]].astype(float)
    at = [y - d * dv, x - d * du]
    inside = (at[0] > 1) & (at[0] < d.shape[0] - 2) & (at[1] > 1) & (at[1] < d.shape[1] - 2)
    seen = map_coordinates(view, at, order=3, mode="nearest")
    return float(np.median(np.abs(seen - centre)[inside]))


@pytest.mark.parametrize("offset", [(4, 0), (0, -4), (-4, 4), (3, 3)])
def test_truth_explains_the_views_and_shifted_truth_does_not(scenes, offset):
    views, disparity = scenes.render([(0, 0), offset])
    for b in range(6):
        centre, view = views[b, :, 0].double().numpy()
        truth = disparity[b, 0].double().numpy()
        right = warp_residual(view, centre, truth, *offset)
        assert right < 0.006  # the bilinear sampling of canvas and view
        contrast = np.std(centre)
        if contrast > 0.05:
            assert warp_residual(view, centre, truth + 0.3, *offset) > 2 * right
            assert warp_residual(view, centre, -truth, *offset) > 2 * right


def test_truth_of_a_view_is_the_centres_truth_seen_from_there(scenes):
    """A point visible in both views has the same disparity in both, shifted by itself."""
    _, disparity = scenes.render([(0, 0), (0, 2)])
    for b in range(6):
        centre, view = disparity[b].double().numpy()
        y, x = np.mgrid[:48, :60].astype(float)
        seen = map_coordinates(view, [y, x - 2 * centre], order=1, mode="nearest")
        agree = np.abs(seen - centre) < 0.01
        hidden = seen > centre + 0.01  # something nearer stands before it
        assert np.mean(agree[:, 12:-12] | hidden[:, 12:-12]) > 0.95


def test_disparities_stay_in_the_range_asked_for():
    scenes = draw_scenes(torch.Generator().manual_seed(2), 8, (64, 64), (-1.5, 0.5))
    _, disparity = scenes.render([(0, 0)])
    assert disparity.min() > -1.6
    assert disparity.max() < 0.6
    assert disparity.amax() - disparity.amin() > 1


def test_the_same_seed_gives_the_same_scene():
    one, two, other = (
        draw_scenes(torch.Generator().manual_seed(s), 2, (32, 32)).render([(0, 0), (1, 2)])[0]
        for s in (7, 7, 8)
    )
    assert torch.equal(one, two)
    assert not torch.equal(one, other)


def test_demo_is_a_colour_light_field_with_truth():
    lf = render_demo(seed=3, size=(48, 64))
    assert lf.grid == (9, 9)
    assert lf.size == (48, 64)
    assert lf.views.std() > 5
    assert lf.truth is not None and np.isfinite(lf.truth).all()

"""The weighted median is exact: against a plain loop and scipy's, and by its laws."""

import numpy as np
import pytest
import torch
from scipy.ndimage import median_filter

from epinet.refine import median as module
from epinet.refine.median import GRAIN, weighted_median


def by_loops(values, guide, trust, window, spacing, sigma):
    """The definition, pixel by pixel, in double precision."""
    height, width = values.shape
    out = values.copy()
    steps = range(-(window // 2) * spacing, window // 2 * spacing + 1, spacing)
    for y, x in np.ndindex(height, width):
        pairs = []
        for v, u in ((y + dy, x + dx) for dy in steps for dx in steps):
            if 0 <= v < height and 0 <= u < width and np.isfinite(values[v, u]):
                distance = ((guide[v, u].astype(float) - guide[y, x]) ** 2).sum()
                weight = np.exp(-distance / (2 * sigma**2)) * float(trust[v, u])
                pairs.append((values[v, u], round(weight / GRAIN)))
        pairs.sort()
        sums = np.cumsum([weight for _, weight in pairs])
        if pairs and sums[-1] > 0:
            out[y, x] = pairs[int(np.argmax(2 * sums >= sums[-1]))][0]
    return out


def picture(rng, size, channels=3):
    """Patches of few colours with some noise: like and unlike neighbours."""
    patches = rng.integers(0, 3, (size[0] // 4 + 1, size[1] // 4 + 1, channels)) / 4 + 0.2
    large = patches.repeat(4, 0).repeat(4, 1)[: size[0], : size[1]]
    return (large + rng.normal(0, 0.03, large.shape)).clip(0, 1).astype(np.float32)


def scene(seed=0, size=(19, 23), channels=3):
    rng = np.random.default_rng(seed)
    values = rng.normal(size=size).astype(np.float32)
    trust = rng.uniform(0, 1, size).astype(np.float32)
    return values, picture(rng, size, channels), trust


def tensors(*arrays):
    return [torch.from_numpy(np.ascontiguousarray(a)) for a in arrays]


@pytest.mark.parametrize(
    ("window", "spacing", "sigma", "channels"),
    [(5, 1, 0.03, 3), (11, 1, 0.1, 1), (3, 3, 0.06, 3), (15, 2, 0.5, 3), (1, 1, 0.03, 3)],
)
def test_it_is_what_a_plain_loop_finds(window, spacing, sigma, channels):
    values, guide, trust = scene(1, channels=channels)
    trust[trust < 0.2] = 0
    values[2, 3] = values[10, 10] = np.nan
    trust[14:, 12:] = 0
    found = weighted_median(
        *tensors(values, guide, trust), window_px=window, spacing_px=spacing, sigma=sigma
    )
    expected = by_loops(values, guide, trust, window, spacing, sigma)
    np.testing.assert_array_equal(found.values.numpy(), expected)


def test_of_a_picture_in_one_colour_it_is_the_plain_median():
    values, _, _ = scene(2)
    found = weighted_median(*tensors(values, np.ones((*values.shape, 3), np.float32)), window_px=7)
    inner = (slice(3, -3), slice(3, -3))
    np.testing.assert_array_equal(found.values.numpy()[inner], median_filter(values, 7)[inner])
    assert found.weights[9, 9] == 49 and found.weights[0, 0] == 16


def test_chunks_and_chosen_pixels_change_nothing(monkeypatch):
    values, guide, trust = tensors(*scene(3))
    whole = weighted_median(values, guide, trust)
    monkeypatch.setattr(module, "NEIGHBOURS_AT_ONCE", 1000)
    for part, all_ in zip(weighted_median(values, guide, trust), whole, strict=True):
        assert torch.equal(part, all_)
    pixels = torch.tensor([5, 200, 17, 436])
    chosen = weighted_median(values, guide, trust, pixels=pixels)
    assert torch.equal(chosen.values, whole.values.flatten()[pixels])
    assert len(weighted_median(values, guide, pixels=pixels[:0]).values) == 0


def test_a_constant_stays():
    _, guide, trust = tensors(*scene(4))
    flat = torch.full(guide.shape[:2], 0.1)
    assert torch.equal(weighted_median(flat, guide, trust).values, flat)


def test_it_follows_any_rising_scale():
    values, guide, trust = tensors(*scene(5))
    found = weighted_median(values, guide, trust).values
    for rising in (lambda d: 4 * d, lambda d: d / 3 + 0.7, torch.exp):
        assert torch.equal(weighted_median(rising(values), guide, trust).values, rising(found))


def test_it_keeps_the_order_of_maps():
    values, guide, trust = tensors(*scene(6))
    raised = values + torch.rand(values.shape, generator=torch.Generator().manual_seed(0))
    low, high = (weighted_median(v, guide, trust).values for v in (values, raised))
    assert (low <= high).all() and (low < high).any()


def test_a_step_along_an_edge_of_the_picture_stays_and_specks_go():
    right = np.arange(30)[None, :].repeat(24, 0) > 13
    guide = np.where(right[..., None], [0.8, 0.6, 0.5], [0.3, 0.5, 0.6]).astype(np.float32)
    step = np.where(right, np.float32(1.5), np.float32(-0.25))
    specks = step.copy()
    specks[::7, ::5] += 3
    for values in (step, specks):
        found = weighted_median(*tensors(values, guide)).values
        np.testing.assert_array_equal(found.numpy(), step)


def test_where_nothing_is_trusted_values_stay():
    values, guide, trust = tensors(*scene(7))
    found = weighted_median(values, guide, 0 * trust)
    assert torch.equal(found.values, values) and not found.weights.any()


def test_what_does_not_fit_is_refused():
    values, guide, _ = tensors(*scene(8))
    for window in (4, 17, -1):
        with pytest.raises(ValueError, match="odd and at most 15"):
            weighted_median(values, guide, window_px=window)
    with pytest.raises(ValueError, match="do not fit"):
        weighted_median(values[1:], guide)

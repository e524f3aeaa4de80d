"""Refocusing against the pictures that a lens of so many views gives by definition."""

import numpy as np
import pytest

from epinet.effects.refocus import all_in_focus, plane_through, refocus
from epinet.errors import InputError
from epinet.lightfield import LightField

INNER = (slice(12, -12), slice(12, -12))
"""What all views show."""


def light(samples):
    """sRGB to light by the standard's definition, sample by sample."""
    s = np.asarray(samples, float)
    return np.where(s <= 0.04045, s / 12.92, ((s + 0.055) / 1.055) ** 2.4)


def levels(found, expected):
    """Largest difference in 8-bit levels, inside."""
    return np.abs(found.astype(int) - expected.astype(int))[INNER].max()


def everywhere(disparity):
    return np.full((48, 64), disparity, np.float32)


def samples(light):
    """Light to 8-bit sRGB by the standard's definition."""
    s = np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)
    return np.round(255 * s)


@pytest.mark.parametrize("d0", [-1.5, 0.0, 0.8, 1.37])
def test_a_plane_in_focus_is_the_centre_view(views_of, d0):
    lf = views_of(d0)
    assert levels(refocus(lf, d0, everywhere(d0)), lf.views[3, 3]) <= 4


@pytest.mark.parametrize("aperture", [1, 2.2, 3])
def test_a_plane_out_of_focus_is_the_mean_of_its_shifts_in_light(views_of, pattern, aperture):
    d0, focus = 0.4, -0.5
    found = refocus(views_of(d0), focus, everywhere(d0), aperture)
    rows, cols = np.mgrid[:48, :64].astype(float)
    total, weight = 0, 0
    for down in range(-3, 4):
        for right in range(-3, 4):
            share = np.clip(aperture + 0.5 - np.hypot(down, right), 0, 1)
            shift = d0 - focus
            total = total + share * light(pattern(cols + shift * right, rows + shift * down))
            weight += share
    assert levels(found, samples(total / weight)) <= 3


def test_far_out_of_focus_there_are_no_gaps_between_views(views_of, pattern):
    """The mean over all viewpoints, 9 x 9 for each of the views, not only over the views."""
    d0, focus, finer = 3.0, -4.5, 9
    lf = views_of(d0)
    found = refocus(lf, focus, everywhere(d0), 1)
    rows, cols = np.mgrid[:48, :64].astype(float)
    within = (np.arange(finer) - finer // 2) / finer
    total, weight, coarse = 0, 0, 0
    for down in range(-3, 4):
        for right in range(-3, 4):
            share = np.clip(1.5 - np.hypot(down, right), 0, 1)
            if not share:
                continue
            shift = d0 - focus
            coarse = coarse + share * light(pattern(cols + shift * right, rows + shift * down))
            weight += share
            for y in down + within:
                for x in right + within:
                    seen = light(pattern(cols + shift * x, rows + shift * y))
                    total = total + share * seen / finer**2
    assert levels(found, samples(total / weight)) <= 4
    assert levels(samples(coarse / weight), samples(total / weight)) > 8


def test_blur_grows_with_the_aperture_and_keeps_the_light(views_of):
    lf = views_of(1.0)
    pictures = [refocus(lf, -0.5, everywhere(1.0), aperture)[INNER] for aperture in (0, 1, 2, 3)]
    contrasts = [p.std() for p in pictures]
    assert contrasts == sorted(contrasts, reverse=True) and contrasts[-1] < 0.5 * contrasts[0]
    means = [light(p / 255).mean() for p in pictures]
    np.testing.assert_allclose(means, means[0], rtol=0.03)


def test_aperture_0_is_the_centre_view_to_the_bit(views_of):
    lf = views_of(0.7)
    np.testing.assert_array_equal(refocus(lf, 2.0, everywhere(0.7), 0), lf.views[3, 3])


def test_views_that_are_not_there_do_not_darken(views_of):
    lf = views_of(0.5)
    star = np.zeros((7, 7), dtype=bool)
    star[3], star[:, 3] = True, True
    views = np.where(star[..., None, None, None], lf.views, 0).astype(np.uint8)
    assert (
        levels(refocus(LightField(views, present=star), 0.5, everywhere(0.5)), lf.views[3, 3]) <= 4
    )


def test_a_tilted_plane_of_focus_holds_a_tilted_plane_sharp(views_of):
    d0, slope = -0.6, 0.02
    lf = views_of(d0, slope)
    focus = plane_through([(10, 5, d0 + 10 * slope), (50, 40, d0 + 50 * slope)], lf.size)
    assert focus[40, 50] == pytest.approx(d0 + 50 * slope)
    exact = plane_through(
        [(10, 5, d0 + 10 * slope), (50, 5, d0 + 50 * slope), (10, 45, d0 + 10 * slope)], lf.size
    )
    assert levels(refocus(lf, exact, exact), lf.views[3, 3]) <= 4
    assert levels(refocus(lf, d0, exact), lf.views[3, 3]) > 25


def two_layers(pattern, noise):
    """A near square before a wall, in noise; the clean centre view and its disparity."""
    rng = np.random.default_rng(0)
    rows, cols = np.mgrid[:48, :64].astype(float)
    views = np.empty((7, 7, 48, 64, 3))
    for down in range(-3, 4):
        for right in range(-3, 4):
            x, y = cols + 1.0 * right, rows + 1.0 * down
            near = (np.abs(x - 32) < 10) & (np.abs(y - 24) < 10)
            wall = 0.3 * pattern(cols - right, rows - down)
            views[down + 3, right + 3] = np.where(near[..., None], 0.6 + 0.4 * pattern(x, y), wall)
            if (down, right) == (0, 0):
                disparity = np.where(near, 1.0, -1.0).astype(np.float32)
    clean = np.round(255 * views[3, 3])
    noisy = views + rng.normal(0, noise, views.shape)
    return LightField(np.round(255 * np.clip(noisy, 0, 1)).astype(np.uint8)), clean, disparity


def test_all_in_focus_takes_the_noise_and_keeps_the_edges(pattern):
    lf, clean, disparity = two_layers(pattern, noise=0.04)
    found = all_in_focus(lf, disparity)
    before = (lf.views[3, 3] - clean)[INNER].std()
    assert (found - clean)[INNER].std() < 0.35 * before
    # Without knowing what is hidden, the near square bleeds over the wall.
    bled = refocus(lf, disparity, disparity)
    worst = np.abs(found - clean)[INNER].max()
    assert worst < 40 < np.abs(bled - clean)[INNER].max()


def test_what_cannot_be_is_refused(views_of):
    lf = views_of(0.0)
    with pytest.raises(InputError, match="aperture"):
        refocus(lf, 0.0, everywhere(0), -1)
    with pytest.raises(InputError, match="64x48 px"):
        refocus(lf, np.zeros((64, 48)), everywhere(0))
    with pytest.raises(InputError, match="finite"):
        refocus(lf, np.nan, everywhere(0))
    with pytest.raises(InputError, match="one to three points"):
        plane_through([], lf.size)
    for again in ([(1, 1, 0.0), (1, 1, 0.5)], [(0, 0, 0.0), (5, 5, 0.1), (20, 20, 0.5)]):
        with pytest.raises(InputError, match="not lie on one line"):
            plane_through(again, lf.size)

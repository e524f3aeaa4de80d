"""Views at the lenslets: demosaicing, denoising and sub-pixel sampling in one linear step.

Pixels of different lenslets see different things, so filters that run over the sensor mix what
does not belong together. Here each lenslet is by itself: the colours seen in the wanted directions
are estimated from its own pixels only, as the linear estimate of least mean square error (Wiener
interpolation, or kriging; Trussell and Hartwig, "Mathematics for demosaicking", 2002) for a
texture of natural statistics at any disparity of a plausible range. The weights depend only on
where a lenslet's centre lies between the pixels, so one matrix serves all lenslets that lie alike.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from epinet.raw.bayer import Image
from epinet.raw.lenslets import LensletGrid
from epinet.raw.vignetting import Falloff

Floats = NDArray[np.float64]

_PLACES = 8
"""Distinguished positions of a centre per pixel."""
_RIM = 0.98
"""Share of a lenslet's radius within which pixels count."""
_DARKEST = 0.15

_MAX_SLOPE = 1.25
"""Largest disparity that is reckoned with, in view pixels per sensor pixel."""
_TEXTURE_LENGTH_PX = 4.0
"""Distance, in pixels of a view, over which textures stay alike."""
_GRAY_SD, _COLOUR_SD, _NOISE_SD = 0.2, 0.1, 0.004
_LEVEL_SD, _TINT_SD = 3.0, 0.3
"""Prior standard deviations in shares of white: of the texture's gray and of each colour about
it, of the noise, of the unknown mean gray and mean colours."""


def sample_lenslets(
    image: Image,
    grid: LensletGrid,
    falloff: Falloff,
    pattern: NDArray[np.intp],
    index: NDArray[np.intp],
    directions: Floats,
    *,
    devignetted: bool,
    progress: Callable[[float], None],
) -> Image:
    """Colours (N, D, 3) that N lenslets see in D directions.

    Args:
        image: (H, W) mosaic with black at 0 and white balanced.
        falloff: of the lenslets, for how much noise is in their outer pixels.
        pattern: colours of the mosaic, as `bayer.mosaic` gives them.
        index: (N, 2) whole numbers (i, j) of lenslets, all of their pixels inside the image.
        directions: (D, 2) places (x, y) within a lenslet's image, from its centre, in pixels.
        devignetted: the image has been divided by a white image; else the falloff is divided out.
        progress: called with shares of the work.
    """
    estimator = _Estimator(grid, falloff, pattern, directions, devignetted)
    places = np.round(grid.centres(index[:, 0], index[:, 1]) * _PLACES).astype(np.intp)
    period = 2 * _PLACES
    key = places[:, 1] % period * period + places[:, 0] % period
    order = np.argsort(key, kind="stable")
    groups = np.split(order, np.flatnonzero(np.diff(key[order])) + 1)
    out = np.empty((len(index), 3 * len(directions)), np.float32)
    for group in groups:
        phase = places[group[0]] % period
        corner = (places[group] - phase) // _PLACES
        x, y, weights = estimator.weights(phase / _PLACES)
        out[group] = image[corner[:, 1, None] + y, corner[:, 0, None] + x] @ weights
        progress(len(group) / len(index))
    return out.reshape(len(index), len(directions), 3)


class _Estimator:
    """Makes the weights for a lenslet from where its centre lies."""

    def __init__(
        self,
        grid: LensletGrid,
        falloff: Falloff,
        pattern: NDArray[np.intp],
        directions: Floats,
        devignetted: bool,
    ) -> None:
        self._radius = grid.pitch_px / 2
        self._falloff, self._pattern = falloff, pattern
        self._directions, self._devignetted = directions, devignetted
        half = int(np.ceil(self._radius))
        self._y, self._x = (a.ravel() for a in np.mgrid[-half : half + 1, -half : half + 1])
        self._distance_px, self._alike = _likeness(8 * self._radius, grid.row_height_px)
        self._between = self._likeness(
            np.hypot(self._x[:, None] - self._x, self._y[:, None] - self._y)
        )

    def _likeness(self, distance_px: Floats) -> Floats:
        return np.interp(distance_px, self._distance_px, self._alike)

    def weights(
        self, centre: Floats
    ) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.float32]]:
        """Pixels x, y (P) and their weights (P, 3 * D) for a lenslet centred at (x, y)."""
        nearest = np.round(centre).astype(np.intp)
        x, y = nearest[0] + self._x, nearest[1] + self._y
        dx, dy = x - centre[0], y - centre[1]
        distance = np.hypot(dx, dy)
        brightness = self._falloff.at(distance)
        used = (distance < _RIM * self._radius) & (brightness > _DARKEST)
        x, y, dx, dy, brightness = (a[used] for a in (x, y, dx, dy, brightness))
        colour = self._pattern[y % 2, x % 2]
        known = self._covariance(self._between[np.ix_(used, used)], colour[:, None] == colour)
        known[np.diag_indices_from(known)] += (_NOISE_SD / brightness) ** 2
        to_x, to_y = self._directions.T
        across = self._likeness(np.hypot(to_x[:, None] - dx, to_y[:, None] - dy))
        same = colour == np.arange(3)[:, None]
        wanted = self._covariance(across[:, None, :], same[None, :, :])
        weights = np.linalg.solve(known, wanted.reshape(-1, len(x)).T)
        if not self._devignetted:
            weights /= brightness[:, None]
        return x, y, weights.astype(np.float32)

    def _covariance(self, alike: Floats, same_colour: NDArray[np.bool_]) -> Floats:
        texture = alike * (_GRAY_SD**2 + same_colour * _COLOUR_SD**2)
        return np.asarray(texture + _LEVEL_SD**2 + same_colour * _TINT_SD**2)


def _likeness(reach_px: float, view_px: float, slopes: int = 16) -> tuple[Floats, Floats]:
    """Correlation of the texture within a lenslet by distance: its mean over disparities.

    A texture that moves by s view pixels per sensor pixel looks in a lenslet as in a view, at s
    times the distance; along a view it is a Matérn process of order 3/2.
    """
    distance = np.linspace(0, reach_px, 2000)
    total = np.zeros_like(distance)
    for slope in np.linspace(0, _MAX_SLOPE, slopes):
        scaled = np.sqrt(3) * slope * distance / _TEXTURE_LENGTH_PX
        total += (1 + scaled) * np.exp(-scaled)
    return distance, total / slopes

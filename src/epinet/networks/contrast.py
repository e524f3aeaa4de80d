"""Local contrast: what weights trained on it see instead of plain gray.

Disparity shows in texture, whatever its brightness and strength; plain gray makes a network learn
every contrast anew and fail on dark walls. So each view is brought to the same local mean and
standard deviation. The network itself is unchanged.
"""

from __future__ import annotations

from torch import Tensor

from epinet.squares import box_mean

WINDOW_PX = 25
"""Mean and deviation are taken over this square, about the network's field of view."""
FLOOR = 0.005
"""Deviations well below this (about one gray level of 255) count as noise and stay faint."""
MEAN, DEVIATION = 0.5, 0.15


def local_contrast(views: Tensor) -> Tensor:
    """Views (..., H, W), each around MEAN with about DEVIATION in every WINDOW_PX square.

    Every view is normalised by itself, so a surface looks alike in all views that see it.
    """
    images = views.reshape(-1, 1, *views.shape[-2:])
    mean, unit = _mean_and_unit(images)
    return (MEAN + (images - mean) / unit).view(views.shape)


def contrast_unit(images: Tensor) -> Tensor:
    """What is 1 in the local contrast of images (N, 1, H, W), in their own units."""
    return _mean_and_unit(images)[1]


def _mean_and_unit(images: Tensor) -> tuple[Tensor, Tensor]:
    mean, deviation = local_statistics(images, WINDOW_PX, FLOOR)
    return mean, deviation / DEVIATION


def local_statistics(images: Tensor, side: int, floor: float) -> tuple[Tensor, Tensor]:
    """Mean and standard deviation, with `floor` beneath it, of the square around each pixel."""
    mean = box_mean(images, side)
    variance = (box_mean(images * images, side) - mean * mean).clamp_min(0)
    return mean, (variance + floor**2).sqrt()

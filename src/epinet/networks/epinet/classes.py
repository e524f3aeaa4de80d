"""Classification of the disparity from EPINET's features, beside its map and while training only.

The error of one number tells a network little of where to look; which of many disparities a pixel
has tells it more. Two classifiers look on: one reads what the last layer reads, the other what each
stream gives, by weights of its own. They fall away when weights are saved.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn

from epinet.networks.epinet.layers import Layers

LIMIT_PX, CLASSES = 4.5, 65
"""Classes are spaced evenly from -LIMIT_PX to LIMIT_PX; disparities beyond belong to the last."""

DEVIATION_PX = 0.15
"""A pixel belongs to the classes around its disparity by a Gaussian of this deviation."""

STREAMS = 0.5
"""What the classifiers of the streams, taken together, count beside the other."""

STREAM_CUT_PX = 8
"""So many pixels more on each side than the map have the features of the streams."""

NAME = "classes"
"""Of the classifiers in the network that they are added to."""


class Classes(nn.Module):
    """Classifiers for a network of `streams` streams of a width."""

    centres: Tensor

    def __init__(self, streams: int, width: int) -> None:
        super().__init__()
        self.last = nn.Conv2d(streams * width, CLASSES, 2)
        self.streams = nn.ModuleList(nn.Conv2d(width, CLASSES, 1) for _ in range(streams))
        centres = torch.linspace(-LIMIT_PX, LIMIT_PX, CLASSES)
        self.register_buffer("centres", centres, persistent=False)

    def cross_entropy(self, streams: list[Tensor], hidden: Tensor, disparity: Tensor) -> Tensor:
        """(B, 1, P, P) of the features of `Layers.features` with the disparities (B, 1, P, P)."""
        wanted = self.wanted(disparity)
        cut = slice(STREAM_CUT_PX, -STREAM_CUT_PX)
        loss = _cross_entropy(self.last(hidden), wanted)
        for classifier, features in zip(self.streams, streams, strict=True):
            own = _cross_entropy(classifier(features[..., cut, cut]), wanted)
            loss = loss + STREAMS / len(streams) * own
        return loss

    def wanted(self, disparity: Tensor) -> Tensor:
        """(B, 65, P, P) share of each class in disparities (B, 1, P, P)."""
        inside = disparity.clamp(-LIMIT_PX, LIMIT_PX)
        distance = (self.centres.view(1, -1, 1, 1) - inside) / DEVIATION_PX
        return (-0.5 * distance**2).softmax(1)


def add_classes(net: Layers) -> None:
    """Let classifiers look on."""
    net.add_module(NAME, Classes(net.config.streams, net.config.stream_width))


def classes_of(net: Layers) -> Classes:
    """The classifiers that `add_classes` gave it."""
    classes = net.get_submodule(NAME)
    assert isinstance(classes, Classes)
    return classes


def remove_classes(net: Layers) -> None:
    """Leave the published network; does nothing where there are no classifiers."""
    net._modules.pop(NAME, None)


def _cross_entropy(scores: Tensor, wanted: Tensor) -> Tensor:
    return -(wanted * scores.float().log_softmax(1)).sum(1, keepdim=True)

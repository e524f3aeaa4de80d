"""Batch normalisation after every hidden convolution, while training only.

The published network normalises every second convolution, and not the hidden layer of its end,
whose inputs are all positive: there, training can shut most units for good. A normalisation
behind a convolution is linear once its statistics stand, so it folds into the convolution's
weights, and what is left is the published network.
"""

from __future__ import annotations

import copy
from collections.abc import Iterator
from typing import TypeVar

import torch
from torch import Tensor, nn

from epinet.networks.epinet.layers import Layers, batch_norm

L = TypeVar("L", bound=Layers)


class NormedConv(nn.Module):
    """A convolution with batch normalisation that can be folded into it."""

    def __init__(self, conv: nn.Conv2d) -> None:
        super().__init__()
        self.conv = conv
        self.norm = batch_norm(conv.out_channels)

    def forward(self, x: Tensor) -> Tensor:
        normed: Tensor = self.norm(self.conv(x))
        return normed

    @torch.no_grad()
    def folded(self) -> nn.Conv2d:
        """A convolution that does in one what the two do in eval mode."""
        conv, norm = copy.deepcopy(self.conv), self.norm
        assert norm.running_var is not None and norm.running_mean is not None
        assert conv.bias is not None
        gain = norm.weight / (norm.running_var + norm.eps).sqrt()
        conv.weight.mul_(gain.view(-1, 1, 1, 1))
        conv.bias.sub_(norm.running_mean).mul_(gain).add_(norm.bias)
        return conv


def add_norms(net: Layers) -> None:
    """Put a normalisation behind every convolution that has none, but the last."""
    for sequence in _unnormed(net):
        conv = sequence[0]
        assert isinstance(conv, nn.Conv2d)
        sequence[0] = NormedConv(conv)


def without_norms(net: L) -> L:
    """The published network that gives what `net` gives in eval mode; a copy."""
    plain = copy.deepcopy(net)
    for sequence in _unnormed(plain):
        if isinstance(sequence[0], NormedConv):
            sequence[0] = sequence[0].folded()
    return plain


@torch.no_grad()
def calibrate_norms(net: Layers, stacks: Tensor) -> None:
    """Set the norms so that they change nothing of trained weights.

    Args:
        stacks: (B, S, N, H, W) training input, whose statistics they take.
    """

    def identity(module: nn.Module, _: object, out: Tensor) -> None:
        norm = norms[module]
        assert norm.running_mean is not None and norm.running_var is not None
        variance, mean = torch.var_mean(out.float(), (0, 2, 3), correction=0)
        norm.running_mean.copy_(mean)
        norm.running_var.copy_(variance)
        norm.weight.copy_((variance + norm.eps).sqrt())
        norm.bias.copy_(mean)

    normed = [m for m in net.modules() if isinstance(m, NormedConv)]
    norms: dict[nn.Module, nn.BatchNorm2d] = {m.conv: m.norm for m in normed}
    hooks = [m.conv.register_forward_hook(identity) for m in normed]
    was_training = net.training
    net.eval()
    net(stacks)
    net.train(was_training)
    for hook in hooks:
        hook.remove()


def _unnormed(net: Layers) -> Iterator[nn.Sequential]:
    """The sequences that begin with a convolution without a norm behind it."""
    for part in (*net.streams, net.merge):
        assert isinstance(part, nn.Sequential)
        for block in part:
            assert isinstance(block, nn.Sequential)
            yield block
    yield net.head

"""The optimiser of a recipe, with what trains this network fastest: Muon."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

import torch
from torch import Tensor
from torch.optim import AdamW, Optimizer, RMSprop

from epinet.networks.base import Network
from epinet.train.parallel import ALONE, Team
from epinet.train.precision import computes_bf16
from epinet.train.recipe import Recipe

NEWTON_SCHULZ = (3.4445, -4.7750, 2.0315)
"""a, b, c of the iteration x -> ax + b(xx')x + c(xx')^2 x, which draws singular values to 1."""

ITERATIONS = 5


class Muon(Optimizer):
    """Momentum whose steps are orthogonalised (Jordan et al., 2024, "Muon").

    The weights of a layer are a matrix (outputs, inputs); its step is the nearest matrix with
    singular values of about 1, so that it moves all directions of the layer alike. Adam's steps
    in this network, whose hidden layers sum hundreds of positive inputs, mostly shift those sums
    up or down together, until many units never fire again.

    Args:
        params: tensors of at least two dimensions, the first of them the outputs.
        lr: a step has the root mean square of AdamW's at this rate, about 0.2 lr.
        team: processes with the same parameters and gradients, each of which orthogonalises its
            share of the steps.
    """

    def __init__(
        self,
        params: Iterable[Tensor],
        lr: float,
        momentum: float = 0.95,
        weight_decay: float = 0.0,
        team: Team = ALONE,
    ) -> None:
        super().__init__(params, {"lr": lr, "momentum": momentum, "weight_decay": weight_decay})
        self.team = team

    @torch.no_grad()
    def step(self, closure: Callable[[], float] | None = None) -> None:  # type: ignore[override]
        for group in self.param_groups:
            lr, momentum = group["lr"], group["momentum"]
            params = [p for p in group["params"] if p.grad is not None]
            directions = []
            for k, p in enumerate(params):
                state = self.state[p]
                if "mean" not in state:
                    state["mean"] = torch.zeros_like(p)
                mean = state["mean"]
                mean.lerp_(p.grad, 1 - momentum)
                ahead = p.grad.lerp(mean, momentum).flatten(1)
                is_mine = k % self.team.size == self.team.rank
                directions.append(orthogonalised(ahead) if is_mine else torch.zeros_like(ahead))
            self.team.add(directions)
            for p, direction in zip(params, directions, strict=True):
                size = 0.2 * max(direction.shape) ** 0.5
                p.mul_(1 - lr * group["weight_decay"])
                p.add_(direction.view_as(p), alpha=-lr * size)


def orthogonalised(matrix: Tensor) -> Tensor:
    """About the nearest matrix whose singular values are all 1 (they come out in 0.7..1.2).

    Args:
        matrix: (M, N).

    Returns:
        (M, N) of the same type; computed in bfloat16 where the device does so itself.
    """
    a, b, c = NEWTON_SCHULZ
    x = matrix.bfloat16() if computes_bf16(matrix.device) else matrix.float()
    x = x if matrix.shape[0] <= matrix.shape[1] else x.T
    x = x / (x.norm() + 1e-7)
    for _ in range(ITERATIONS):
        square = x @ x.T
        x = a * x + (b * square + c * square @ square) @ x
    upright: Tensor = x if matrix.shape[0] <= matrix.shape[1] else x.T
    return upright.to(matrix.dtype)


class Optimisers:
    """One optimiser, or Muon for the hidden layers beside AdamW for the rest.

    Muon's matrices are the hidden convolutions; the first layers, the last one, biases and
    batch-norm stay AdamW's, at `ADAM_RATE` of the rate.
    """

    ADAM_RATE = 0.3

    def __init__(self, net: Network[Any], recipe: Recipe, team: Team = ALONE) -> None:
        rate, decay = recipe.learning_rate, recipe.weight_decay
        parameters = list(net.parameters())
        self.parts: list[tuple[Optimizer, float]]
        if recipe.optimiser == "rmsprop":  # Keras' defaults, as in the reference
            keras = RMSprop(parameters, lr=rate, alpha=0.9, eps=1e-7, weight_decay=decay)
            self.parts = [(keras, 1.0)]
        elif recipe.optimiser == "adamw":
            self.parts = [(AdamW(parameters, lr=rate, weight_decay=decay), 1.0)]
        else:
            hidden = net.hidden_weights()
            ours = {id(p) for p in hidden}
            rest = [p for p in parameters if id(p) not in ours]
            self.parts = [
                (Muon(hidden, lr=rate, weight_decay=decay, team=team), 1.0),
                (AdamW(rest, lr=rate, weight_decay=decay), self.ADAM_RATE),
            ]

    def step(self, rate: float) -> None:
        """One step at a learning rate."""
        for optimiser, share in self.parts:
            for group in optimiser.param_groups:
                group["lr"] = rate * share
            optimiser.step()

    def state(self) -> list[dict[str, Any]]:
        return [optimiser.state_dict() for optimiser, _ in self.parts]

    def load(self, states: list[dict[str, Any]]) -> None:
        for (optimiser, _), state in zip(self.parts, states, strict=True):
            optimiser.load_state_dict(state)

"""Each kind of surface against a plain slow search along the ray, from its definition alone."""

import math
from collections.abc import Callable

import numpy as np
import pytest
import torch

from epinet.synth.draw import draw_scenes
from epinet.synth.generator import bank, generator
from epinet.synth.options import Options
from epinet.synth.scenes import Scenes
from epinet.synth.surfaces import Rays

OPTIONS = Options(size=(64, 80), disparity_px=(-3, 3), surfaces=(90, 90))
SPAN = np.linspace(12, -12, 24001)
RAYS = 32


@pytest.fixture(scope="module")
def scenes() -> Scenes:
    return draw_scenes(generator(11), 24, OPTIONS, bank(OPTIONS, 1, 0))


def first_change(
    inside: Callable[[np.ndarray], np.ndarray], counts: Callable[[np.ndarray], np.ndarray], *ray
) -> float:
    """Going down the ray in d: the first point, to 1e-9, where `inside` changes and `counts`."""
    x, y, du, dv = ray

    def at(d: np.ndarray) -> np.ndarray:
        return np.stack([x + d * du, y + d * dv, d])

    holds = inside(at(SPAN))
    for change in np.nonzero(holds[1:] != holds[:-1])[0]:
        high, low = SPAN[change], SPAN[change + 1]
        while high - low > 1e-9:
            middle = (high + low) / 2
            same = inside(at(np.array([middle])))[0] == holds[change]
            high, low = (middle, low) if same else (high, middle)
        if counts(at(np.array([high])))[0]:
            return high
    return math.nan


def local(group, b: int, k: int) -> Callable[[np.ndarray], np.ndarray]:
    centre, matrix = (t[b, k].double().numpy() for t in (group.centre, group.matrix))
    return lambda p: matrix @ (p - centre[:, None])


def is_in_quadric(group, b: int, k: int) -> Callable[[np.ndarray], np.ndarray]:
    e = group.shape[b, k].double().numpy()
    to_local = local(group, b, k)

    def inside(p: np.ndarray) -> np.ndarray:
        q = to_local(p)
        return q[0] ** 2 + q[1] ** 2 < e[0] + e[1] * q[2] + e[2] * q[2] ** 2

    return inside


def is_between_ends(group, b: int, k: int) -> Callable[[np.ndarray], np.ndarray]:
    """Quadrics are open at their ends."""
    to_local = local(group, b, k)
    return lambda p: np.abs(to_local(p)[2]) <= 1


def is_in_box(group, b: int, k: int) -> Callable[[np.ndarray], np.ndarray]:
    to_local = local(group, b, k)
    return lambda p: (np.abs(to_local(p)) < 1).all(0)


def is_behind_relief(group, b: int, k: int) -> Callable[[np.ndarray], np.ndarray]:
    a, per_x, per_y = group.coefficients[b, k].double().numpy()
    waves = group.waves[b, k].double().numpy()

    def behind(p: np.ndarray) -> np.ndarray:
        height = a + per_x * p[0] + per_y * p[1]
        for amplitude, fx, fy, phase in waves:
            height = height + amplitude * np.sin(fx * p[0] + fy * p[1] + phase)
        return p[2] < height

    return behind


def is_behind_plane(group, b: int, k: int) -> Callable[[np.ndarray], np.ndarray]:
    a, per_x, per_y = group.coefficients[b, k].double().numpy()
    return lambda p: p[2] < a + per_x * p[0] + per_y * p[1]


DEFINITIONS = {
    "planes": is_behind_plane,
    "quadrics": is_in_quadric,
    "boxes": is_in_box,
    "reliefs": is_behind_relief,
}


def everywhere(p: np.ndarray) -> np.ndarray:
    return np.ones(p.shape[1], bool)


def rays_towards(group, b: int, k: int, rng: np.random.Generator, count: int) -> np.ndarray:
    """(4, count) x, y, du, dv, aimed at the surface's middle or at the picture."""
    du, dv = rng.integers(-4, 5, (2, count)).astype(float)
    if hasattr(group, "centre"):
        cx, cy, cd = group.centre[b, k].double().numpy()
        x0, x1, y0, y1 = group.bounds[b, k, :4].double().numpy()
        x = cx - cd * du + rng.uniform(-0.6, 0.6, count) * (x1 - x0)
        y = cy - cd * dv + rng.uniform(-0.6, 0.6, count) * (y1 - y0)
        return np.stack([x, y, du, dv])
    return np.stack([rng.uniform(-40, 40, count), rng.uniform(-32, 32, count), du, dv])


@pytest.mark.parametrize("name", DEFINITIONS)
def test_hits_are_where_the_definition_says(name: str, scenes: Scenes) -> None:
    group = getattr(scenes, name)
    rng = np.random.default_rng(3)
    errors, missed = [], 0
    for k in range(min(30, group.exists.shape[1])):
        for b in range(scenes.count):
            if not group.exists[b, k] or (name == "planes" and group.cut[b, k]):
                continue
            numbers = rays_towards(group, b, k, rng, RAYS)
            rays = Rays(*torch.from_numpy(numbers).float()[:, None, :, None, None])
            arguments = (scenes.bank.silhouettes, 127) if name == "planes" else ()
            found = group.scenes(slice(b, b + 1)).hit(k, rays, *arguments)
            hit, d = (t.expand(1, RAYS, 1, 1).flatten().tolist() for t in found[:2])
            inside = DEFINITIONS[name](group, b, k)
            counts = is_between_ends(group, b, k) if name == "quadrics" else everywhere
            for ray, is_hit, found_at in zip(numbers.T, hit, d, strict=True):
                at = first_change(inside, counts, *ray)
                missed += is_hit == math.isnan(at)
                if is_hit and not math.isnan(at):
                    errors.append(abs(found_at - at))
    assert len(errors) > 100
    assert missed <= 0.01 * len(errors)  # rays that touch an edge
    assert np.quantile(errors, 0.99) < 1e-4
    assert max(errors) < 5e-3  # at grazing rays the error is the root of rounding

"""Silhouettes: laws that every tile obeys, and each family."""

import itertools

import pytest
import torch
from torch import Tensor
from torch.nn import functional as F

from epinet.errors import InputError
from epinet.synth.dice import Dice
from epinet.synth.silhouettes import FAMILIES, HELD_OUT, draw_silhouettes

KINDS = [(thin, repeating) for thin in (False, True) for repeating in (False, True)]
EVERY = [
    pytest.param(kind, family, id=name)
    for families in (FAMILIES, HELD_OUT)
    for kind, members in families.items()
    for name, family in members.items()
]


def seeded(seed: int = 0) -> torch.Generator:
    return torch.Generator().manual_seed(seed)


def drawn(family, seed: int, n: int, side: int) -> Tensor:
    return family.draw(Dice(seeded(seed), torch.device("cpu")), n, side)


def eroded(surface: Tensor, reach: int) -> Tensor:
    """(n, H, W) where every texel within a square of `reach` is surface; beyond the tile too."""
    holes = (~surface).float()[:, None]
    return F.max_pool2d(holes, 2 * reach + 1, 1, reach)[:, 0] == 0


@pytest.mark.parametrize("held_out", [False, True])
@pytest.mark.parametrize(("thin", "repeating"), KINDS)
def test_the_same_state_draws_the_same_tiles(thin, repeating, held_out):
    how = {"thin": thin, "repeating": repeating, "held_out": held_out}
    tiles = draw_silhouettes(seeded(1), 12, 128, **how)
    assert tiles.shape == (12, 128, 128) and tiles.dtype == torch.uint8
    assert torch.equal(tiles, draw_silhouettes(seeded(1), 12, 128, **how))
    assert not torch.equal(tiles, draw_silhouettes(seeded(2), 12, 128, **how))
    assert all(not torch.equal(a, b) for a, b in itertools.combinations(tiles, 2))


@pytest.mark.skipif(not torch.cuda.is_available(), reason="no GPU")
@pytest.mark.parametrize("held_out", [False, True])
@pytest.mark.parametrize(("thin", "repeating"), KINDS)
def test_a_gpu_draws_the_same_tiles(thin, repeating, held_out):
    how = {"thin": thin, "repeating": repeating, "held_out": held_out}
    here, there = (
        draw_silhouettes(seeded(3), 40, 128, device=d, **how).cpu() for d in ("cpu", "cuda")
    )
    # a texel right on an edge may fall on its other side
    assert ((here.int() - there.int()).abs() > 2).float().mean() < 1e-3


@pytest.mark.parametrize("held_out", [False, True])
@pytest.mark.parametrize(("thin", "repeating"), KINDS)
def test_tiles_are_neither_empty_nor_full(thin, repeating, held_out):
    tiles = draw_silhouettes(seeded(), 60, 256, thin=thin, repeating=repeating, held_out=held_out)
    area = (tiles > 40).float().mean((1, 2))
    assert (area > 0.001).all() and (area < 0.95).all()
    if not repeating:
        inside = tiles[:, 2:-2, 2:-2]
        assert inside.sum() == tiles.sum() and (inside.amax((1, 2)) > 0).all()


def test_edges_are_hard_or_a_few_texels_wide():
    """No veil and no broad edge: what half covers a pixel has no one disparity."""
    tiles = draw_silhouettes(seeded(), 300, 96, thin=False, repeating=True)
    between = (tiles > 0) & (tiles < 255)
    soft = between.float().mean((1, 2))
    assert soft.median() < 0.1 and soft.max() > 0.1
    # every such texel has a hole nearby, or is one of an edge that never reaches full cover
    holes = F.max_pool2d(F.pad((tiles == 0).float()[:, None], (7,) * 4, mode="circular"), 15, 1)
    assert (holes[:, 0][between] > 0).float().mean() > 0.99


def test_no_training_family_is_held_out():
    names = [
        [name for members in families.values() for name in members]
        for families in (FAMILIES, HELD_OUT)
    ]
    assert not set(names[0]) & set(names[1])
    draws = [
        {f.draw for members in families.values() for f in members.values()}
        for families in (FAMILIES, HELD_OUT)
    ]
    assert not draws[0] & draws[1]
    assert set(FAMILIES) == set(HELD_OUT) == set(KINDS)
    assert all(len(members) >= 3 for members in HELD_OUT.values())


@pytest.mark.parametrize(("kind", "family"), EVERY)
def test_a_family_draws_finite_shapes_that_differ(kind, family):
    for n, side in ((6, 64), (4, 256)):
        distance = drawn(family, 5, n, side)
        assert torch.isfinite(distance).all()
        surface = distance > 0
        area = surface.float().mean((1, 2))
        assert (area > 0).all() and (area < 1).all()
        assert not any(torch.equal(a, b) for a, b in itertools.combinations(distance, 2))


@pytest.mark.parametrize(("kind", "family"), [p for p in EVERY if not p.values[0][1]])
def test_a_single_thing_leaves_the_border_free_by_itself(kind, family):
    """Shapes are not cut off by the free border, save for a one-texel soft edge."""
    surface = drawn(family, 6, 8, 192) > 0
    assert surface[:, 3:-3, 3:-3].sum() >= surface.sum()


@pytest.mark.parametrize(("kind", "family"), [p for p in EVERY if p.values[0][1]])
def test_no_seam_where_a_tile_repeats(kind, family):
    surface = (drawn(family, 7, 30, 128) > 0).float()
    for axis in (1, 2):
        changes = (surface.roll(-1, axis) - surface).abs().mean((0, 3 - axis))
        inside = changes[:-1]
        # one texel more or less, as lattices may have a line right at the seam
        assert changes[-1] <= inside.max() * 1.25 + 1 / 128


def test_a_single_thing_put_side_by_side_has_empty_seams():
    tiles = draw_silhouettes(seeded(), 20, 128, thin=False, repeating=False)
    assert tiles[:, :2].sum() == tiles[:, -2:].sum() == tiles[:, :, :2].sum() == 0


@pytest.mark.parametrize(("kind", "family"), [p for p in EVERY if p.values[0][0]])
def test_thin_things_vanish_under_erosion(kind, family):
    """8 texels at most: a square of 17 fits nowhere but where several cross, as twigs do."""
    surface = drawn(family, 8, 10, 384) > 0
    assert surface.float().mean() < 0.45
    assert eroded(surface, 8).float().mean() < 0.005


@pytest.mark.parametrize(("kind", "family"), [p for p in EVERY if not p.values[0][0]])
def test_solid_things_survive_erosion(kind, family):
    surface = drawn(family, 8, 10, 384) > 0
    left = eroded(surface, 4).flatten(1).any(1)
    assert left.float().mean() >= 0.9


def test_a_tile_too_small_is_refused():
    with pytest.raises(InputError, match="64"):
        draw_silhouettes(seeded(), 1, 32, thin=True, repeating=False)

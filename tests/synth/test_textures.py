"""Textures: laws that every tile obeys, each family, photographs."""

import itertools

import numpy as np
import pytest
import torch
from PIL import Image

from epinet.errors import InputError
from epinet.synth import textures
from epinet.synth.dice import Dice
from epinet.synth.textures import FAMILIES, HELD_OUT, Photographs, draw_textures

EVERY = {**FAMILIES, **HELD_OUT}


def seeded(seed: int = 0) -> torch.Generator:
    return torch.Generator().manual_seed(seed)


def dice(seed: int = 0) -> Dice:
    return Dice(seeded(seed), torch.device("cpu"))


@pytest.mark.parametrize("held_out", [False, True])
def test_the_same_state_draws_the_same_tiles_in_range(held_out):
    tiles = draw_textures(seeded(3), 24, 64, held_out=held_out)
    assert tiles.shape == (24, 3, 64, 64) and tiles.dtype == torch.float32
    assert torch.equal(tiles, draw_textures(seeded(3), 24, 64, held_out=held_out))
    assert not torch.equal(tiles, draw_textures(seeded(4), 24, 64, held_out=held_out))
    assert torch.isfinite(tiles).all() and tiles.min() >= 0 and tiles.max() <= 1


@pytest.mark.skipif(not torch.cuda.is_available(), reason="no GPU")
@pytest.mark.parametrize("held_out", [False, True])
def test_a_gpu_draws_the_same_tiles(held_out):
    here, there = (
        draw_textures(seeded(3), 40, 96, held_out=held_out, device=d).cpu() for d in ("cpu", "cuda")
    )
    # a texel right on an edge may fall on its other side
    assert ((here - there).abs() > 1e-3).float().mean() < 1e-3


def test_tiles_are_dark_and_bright_gray_and_colourful():
    tiles = draw_textures(seeded(), 200, 32)
    mean = tiles.mean((1, 2, 3))
    assert (mean < 0.12).sum() > 5 and (mean > 0.75).sum() > 5
    colours = tiles.mean((2, 3))
    spread = colours.amax(1) - colours.amin(1)
    assert (spread < 1e-3).float().mean() > 0.1  # gray
    assert (spread > 0.2).float().mean() > 0.05
    assert spread.median() < 0.15


def test_no_training_family_is_held_out():
    assert len(HELD_OUT) >= 4
    assert not set(FAMILIES) & set(HELD_OUT)
    assert not {f.draw for f in FAMILIES.values()} & {f.draw for f in HELD_OUT.values()}


@pytest.mark.parametrize("side", [48, 256])
@pytest.mark.parametrize("name", EVERY)
def test_a_family_draws_finite_patterns_that_differ(name, side):
    tiles = EVERY[name].draw(dice(1), 8 if side < 256 else 3, side)
    assert torch.isfinite(tiles).all()
    assert (tiles.flatten(1).float().std(1) > 1e-3).all()
    assert all(not torch.equal(a, b) for a, b in itertools.combinations(tiles, 2))
    assert torch.equal(tiles, EVERY[name].draw(dice(1), len(tiles), side))


def smallest_periods(tile: torch.Tensor) -> list[int]:
    """The smallest exact period along each axis, in texels; the side where there is none."""
    side = len(tile)
    return [
        next(p for p in range(1, side + 1) if torch.equal(tile, tile.roll(p, axis)))
        for axis in (0, 1)
    ]


@pytest.mark.parametrize("name", ["repeats", "wallpaper"])
def test_exactly_repeating_tiles_have_a_whole_number_of_equal_periods(name):
    tiles = FAMILIES[name].draw(dice(2), 16, 96)
    for tile in tiles:
        assert all(p <= 48 and 96 % p == 0 for p in smallest_periods(tile))


def test_noise_does_not_repeat():
    assert smallest_periods(FAMILIES["noise"].draw(dice(), 1, 96)[0]) == [96, 96]


@pytest.mark.parametrize("name", [name for name, f in EVERY.items() if f.wraps])
def test_no_seam_where_a_tile_wraps(name):
    side = 96
    tiles = EVERY[name].draw(dice(4), 24, side).float()
    for axis in (1, 2):
        steps = (tiles.roll(-1, axis) - tiles).abs()
        mean = steps.mean((0, 3 - axis))  # of each of the lines between two rows or columns
        seam, inside = mean[-1], mean[:-1]
        assert seam <= inside.max() * 1.2, name


def test_a_gradient_has_a_seam():
    """The law above can fail."""
    tiles = FAMILIES["gradients"].draw(dice(), 24, 96)
    steps = (tiles.roll(-1, 2) - tiles).abs().mean((0, 1))
    assert steps[-1] > 3 * steps[:-1].max()


def test_contrast_zero_is_flat():
    tiles = draw_textures(seeded(), 40, 32, contrast=(0, 0))
    assert torch.equal(tiles, tiles[..., :1, :1].expand_as(tiles))
    assert tiles[:, :, 0, 0].std() > 0.1  # of many colours


def test_contrast_bounds_the_amplitude(monkeypatch):
    monkeypatch.setattr(textures, "GRAINED", 0.0)
    spreads = []
    for bounds in ((0, 0.02), (0.1, 0.2), (0.9, 1)):
        tiles = draw_textures(seeded(), 48, 64, contrast=bounds)
        span = (tiles.amax((2, 3)) - tiles.amin((2, 3))).amax(1)
        assert span.max() <= bounds[1] + 1e-3
        assert (span > 0).all()
        assert span.median() > 0.5 * bounds[0]
        spreads.append(tiles.flatten(2).std(2).mean())
    assert spreads[0] < 0.2 * spreads[1] and spreads[1] < 0.4 * spreads[2]


def test_grain_leaves_little_of_a_pattern_flat(monkeypatch):
    def flat_tiles() -> float:
        tiles = draw_textures(seeded(), 100, 64, contrast=(0.5, 1)).mean(1)
        return float(
            ((tiles.diff(dim=-1).abs() < 1e-4).float().mean((-2, -1)) > 0.2).float().mean()
        )

    grained = flat_tiles()
    monkeypatch.setattr(textures, "GRAINED", 0.0)
    assert grained < 0.5 * flat_tiles()


def test_small_contrasts_are_common_and_so_are_full_ones(monkeypatch):
    monkeypatch.setattr(textures, "GRAINED", 0.0)
    tiles = draw_textures(seeded(), 300, 16)
    span = (tiles.amax((2, 3)) - tiles.amin((2, 3))).amax(1)
    assert (span < 0.05).float().mean() > 0.1
    assert (span > 0.5).float().mean() > 0.25


@pytest.mark.parametrize(
    "wrong",
    [{"side": 8}, {"contrast": (0.5, 0.2)}, {"contrast": (0, 1.5)}, {"photograph_share": 2}],
)
def test_impossible_arguments_are_refused(wrong):
    with pytest.raises(InputError):
        draw_textures(seeded(), 1, **{"side": 32, **wrong})


@pytest.fixture
def photographs(tmp_path):
    """Two pictures, each of two colours, one of them in a folder inside, and a damaged file."""
    (tmp_path / "inside").mkdir()
    for file, red, size in (("a.png", 200, (90, 120)), ("inside/b.png", 100, (40, 30))):
        image = np.zeros((*size, 3), np.uint8)
        image[..., 0] = red
        image[:, size[1] // 2 :, 1] = 50
        Image.fromarray(image).save(tmp_path / file)
    (tmp_path / "c.jpg").write_bytes(b"no picture")
    (tmp_path / "notes.txt").write_text("not an image")
    return tmp_path


def test_photographs_are_found_and_unreadable_ones_counted(photographs):
    found = Photographs.from_folder(photographs)
    assert len(found.pictures) == 2 and found.skipped == 1
    assert {tuple(p.shape) for p in found.pictures} == {(3, 90, 120), (3, 40, 30)}


def test_crops_hold_what_the_photographs_hold(photographs):
    crops = Photographs.from_folder(photographs).draw(dice(), 30, 32) * 255
    red = crops[:, 0]
    assert (red - red[:, :1, :1]).abs().max() < 0.01
    assert {round(v) for v in red[:, 0, 0].tolist()} == {100, 200}
    assert crops[:, 1].min() >= -0.01 and crops[:, 1].max() <= 50.01
    assert crops[:, 1].std((1, 2)).max() > 10  # some show the border between the colours
    assert crops[:, 2].max() < 0.01


def test_crops_are_not_enlarged_where_the_photograph_suffices(tmp_path):
    noise = np.random.default_rng(0).integers(0, 256, (64, 64, 3)).astype(np.uint8)
    Image.fromarray(noise).save(tmp_path / "noise.png")
    crops = Photographs.from_folder(tmp_path).draw(dice(), 20, 64)
    pixels = torch.from_numpy(noise).permute(2, 0, 1) / 255
    turned = [torch.rot90(p, k, (1, 2)) for p in (pixels, pixels.flip(2)) for k in range(4)]
    for crop in crops:
        assert min((crop - t).abs().max() for t in turned) < 1e-6


def test_photographs_take_their_share(photographs):
    found = Photographs.from_folder(photographs)
    tiles = draw_textures(seeded(), 60, 32, photographs=found, photograph_share=0.5)
    # no made tile has blue of exactly 0 everywhere
    share = (tiles[:, 2].amax((1, 2)) < 1e-6).float().mean()
    assert 0.3 < share < 0.7
    every = draw_textures(seeded(), 8, 32, photographs=found, photograph_share=1, contrast=(0, 0))
    assert every.flatten(2).std(2).max() < 1e-6


def test_16_bit_and_gray_photographs_are_read(tmp_path):
    Image.fromarray(np.full((40, 40), 257 * 60, np.uint16)).save(tmp_path / "deep.png")
    Image.fromarray(np.full((40, 40), 60, np.uint8)).save(tmp_path / "gray.png")
    for picture in Photographs.from_folder(tmp_path).pictures:
        assert picture.shape == (3, 40, 40) and (picture == 60).all()


def test_a_folder_without_pictures_is_refused_by_name(tmp_path):
    with pytest.raises(InputError, match="none was found") as raised:
        Photographs.from_folder(tmp_path)
    assert str(tmp_path) in str(raised.value)
    (tmp_path / "broken.png").write_bytes(b"\x89PNG")
    with pytest.raises(InputError, match="1 found could not be read"):
        Photographs.from_folder(tmp_path)
    with pytest.raises(InputError, match="not a folder"):
        Photographs.from_folder(tmp_path / "missing")

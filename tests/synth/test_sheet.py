"""The page of scenes shows what it says."""

import numpy as np
import pytest
from matplotlib.colors import to_rgb

from epinet.angular import star_positions
from epinet.io.images import read_image
from epinet.lightfield import LightField
from epinet.synth import sheet
from epinet.synth.sheet import MASKS, save_sheet


def light_field(size=(30, 40), masks=(), truth=True) -> LightField:
    """All black but for the views' centre row, in which view k of a row has brightness k."""
    views = np.zeros((5, 5, *size, 3), np.uint8)
    views[2, :, size[0] // 2] = np.array([50, 100, 150, 200, 250])[:, None, None]
    present = np.zeros((5, 5), bool)
    present[tuple(zip(*star_positions(5), strict=True))] = True
    area = np.zeros(size, bool)
    area[5:15, 5:15] = True
    map_ = np.linspace(-1, 1, size[0] * size[1], dtype=np.float32).reshape(size)
    return LightField(
        views * present[..., None, None, None],
        present,
        truth=map_ if truth else None,
        masks=dict.fromkeys(masks, area),
    )


def has_colour(picture, colour) -> bool:
    return bool((picture == np.round(255 * np.array(to_rgb(colour)))).all(axis=2).any())


def test_the_epi_runs_through_the_views_of_the_centre_row():
    row = sheet._row(light_field())
    assert row.line == 15
    assert row.epi.shape == (5, 40, 3)
    np.testing.assert_allclose(255 * row.epi[:, 7, 0], [50, 100, 150, 200, 250], atol=1e-3)


@pytest.mark.parametrize("masks", [(), ("planes", "valid"), tuple(MASKS)])
def test_every_mask_has_its_colour_in_picture_and_legend(tmp_path, masks):
    save_sheet(tmp_path / "sheet.png", [light_field(masks=masks, truth=False)])
    picture = read_image(tmp_path / "sheet.png")
    for name, (_, colour) in MASKS.items():
        assert has_colour(picture, colour) == (name in masks)


def test_each_scene_adds_a_row(tmp_path):
    sizes = ((30, 40), (40, 40), (60, 20))
    heights = []
    for count in (1, 2, 3):
        save_sheet(tmp_path / "sheet.png", (light_field(size) for size in sizes[:count]))
        heights.append(read_image(tmp_path / "sheet.png").shape[0])
    wide, square, tall = np.diff([0, *heights])
    assert wide < square < tall


def test_a_scene_without_truth(tmp_path):
    save_sheet(tmp_path / "sheet.png", [light_field(truth=False)])
    assert (tmp_path / "sheet.png").exists()

"""Real light fields, known to be in order."""

from pathlib import Path

import pytest

from epinet.inspect import Arrangement, check_order, estimate_range
from epinet.inspect.order import CLASSES
from epinet.io import read_light_field
from epinet.lightfield import LightField

RANGES_PX = {
    # antinous: its truth. The others: the reference implementation's maps, mirrors left out.
    "antinous": (-3.1, 2.55),
    "dino": (-1.6, 1.3),
    "kitchen": (-1.5, 1.3),
    "lytro_2067": (-0.05, 1.4),
}


@pytest.fixture(scope="module", params=RANGES_PX)
def lf(request: pytest.FixtureRequest, real: Path) -> tuple[str, LightField]:
    return request.param, read_light_field(real / request.param)


def test_order_is_right_and_found_again(lf: tuple[str, LightField]) -> None:
    name, views = lf
    assert check_order(views).is_consistent
    # Reversal is the hardest; the other six differ in exact symmetries, so one scene does.
    reversal = [Arrangement().reversed]
    others = [a for simplest in CLASSES[1:] for a in (simplest, simplest.reversed)]
    for arrangement in reversal + (others if name == "lytro_2067" else []):
        shuffled = arrangement.apply(views)
        corrected = check_order(shuffled).correction.apply(shuffled)
        assert (corrected.views == views.views).all(), arrangement


def test_range(lf: tuple[str, LightField]) -> None:
    name, views = lf
    measured = estimate_range(views)
    assert measured is not None and not measured.hits_limit
    assert (measured.min_px, measured.max_px) == pytest.approx(RANGES_PX[name], abs=0.3)

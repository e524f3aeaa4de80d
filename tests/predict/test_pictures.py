"""Names in pictures."""

import io
import warnings

from matplotlib.figure import Figure

from epinet.benchmark.figures import run_time_bars
from epinet.predict.pictures import drawable

NAMES = ["场景", "Küche", "K\udcfcche", "a\nb\x1b", r"$\x$", "a$b"]


def test_every_name_can_be_drawn_without_a_warning() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for name in NAMES:
            figure = Figure()
            figure.suptitle(drawable(name), parse_math=False)
            figure.savefig(io.BytesIO(), format="png")
        run_time_bars([(name, True, 1.0) for name in NAMES])
    assert drawable("Küche_场") == "Küche_?"
    assert drawable("a\nb") == r"a\nb"

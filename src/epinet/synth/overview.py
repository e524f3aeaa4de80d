"""Pictures and statistics of a data set on disk."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from itertools import islice
from pathlib import Path

from epinet.io import read_light_field
from epinet.io.atomic import atomic_path
from epinet.lightfield import LightField
from epinet.synth.dataset import SHEETS, STATISTICS, read_record
from epinet.synth.sheet import SCENES_PER_PAGE, save_sheet
from epinet.synth.statistics import Statistics


def write_overview(out: Path, advance: Callable[[float], None] = lambda share: None) -> Statistics:
    """Write sheet.png (and sheet_2.png: the first 16 scenes), statistics.json and statistics.png.

    Raises:
        InputError: no data set of ours, a scene that cannot be read, or an unwritable file.
    """
    names = read_record(out)["scenes"]
    statistics = Statistics()

    def counted() -> Iterator[LightField]:
        for name in names:
            lf = read_light_field(out / name)
            statistics.add(lf)
            yield lf
            advance(1 / len(names))

    scenes = counted()
    for page, sheet in enumerate(SHEETS):
        if page * SCENES_PER_PAGE < len(names):
            with atomic_path(out / sheet) as temporary:
                save_sheet(temporary, islice(scenes, SCENES_PER_PAGE))
    for _ in scenes:  # those that no sheet shows
        pass
    numbers, plot = (out / name for name in STATISTICS)
    with atomic_path(numbers) as temporary:
        temporary.write_text(json.dumps(statistics.report(), indent=1) + "\n", encoding="utf-8")
    with atomic_path(plot) as temporary:
        statistics.save_plot(temporary)
    return statistics

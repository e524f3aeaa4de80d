"""Pictures and statistics of a data set on disk."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

from epinet.io import read_light_field
from epinet.io.atomic import atomic_path
from epinet.synth.dataset import SHEETS, STATISTICS, read_record
from epinet.synth.sheet import SCENES_PER_PAGE, save_sheet
from epinet.synth.statistics import Statistics


def write_overview(out: Path, advance: Callable[[float], None] = lambda share: None) -> Statistics:
    """Write sheet.png (and sheet_2.png: the first 16 scenes), statistics.json and statistics.png.

    Raises:
        InputError: no data set of ours, a scene that cannot be read, or an unwritable file.
    """
    scenes = [out / name for name in read_record(out)["scenes"]]
    for page, sheet in enumerate(SHEETS):
        if shown := scenes[page * SCENES_PER_PAGE : (page + 1) * SCENES_PER_PAGE]:
            with atomic_path(out / sheet) as temporary:
                save_sheet(temporary, map(read_light_field, shown))
    statistics = Statistics()
    for scene in scenes:
        statistics.add(read_light_field(scene))
        advance(1 / len(scenes))
    numbers, plot = (out / name for name in STATISTICS)
    with atomic_path(numbers) as temporary:
        temporary.write_text(json.dumps(statistics.report(), indent=1) + "\n", encoding="utf-8")
    with atomic_path(plot) as temporary:
        statistics.save_plot(temporary)
    return statistics

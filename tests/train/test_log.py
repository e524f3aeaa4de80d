"""The logs of a run that goes on: what they keep, and what they never read."""

import json

import numpy as np
import pytest

from epinet.io.images import write_png
from epinet.train.log import Log


def test_a_log_goes_on_from_a_step_whatever_stands_in_it(tmp_path):
    good = [json.dumps({"step": step, "loss": 1 / (step + 1)}) for step in (0, 20, 40)]
    bad = [
        "[" * 50_000,
        '{"step": 1' + "0" * 400 + "}",
        '{"step": NaN}',
        "[]",
        '{"step": "20"}',
        '{"step": 20, "note": "\xff"}',
    ]
    lines = [*good[:2], *bad, good[2]]
    unfinished = b'{"step": 20, "lo\xff'
    (tmp_path / "log.jsonl").write_bytes(
        "".join(f"{x}\n" for x in lines).encode("latin-1") + unfinished
    )
    with Log(tmp_path, 20) as log:
        log.write(21, {"loss": 2.0})
    kept = (tmp_path / "log.jsonl").read_text().splitlines()
    assert kept == [*good[:2], json.dumps({"step": 21, "loss": 2.0})]


def test_pictures_half_written_are_not_shown(tmp_path):
    pytest.importorskip("tensorboard")
    write_png(tmp_path / "pictures" / "a.png", np.zeros((8, 8), np.uint8))
    (tmp_path / "pictures" / ".scene_00000.48f936ee.png").write_bytes(b"")
    with Log(tmp_path, 0) as log:
        log.show(1, tmp_path / "pictures")

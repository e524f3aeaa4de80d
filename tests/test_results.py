"""The page of results says what the saved runs and the weights say."""

import runpy
from pathlib import Path

ROOT = Path(__file__).parent.parent


def test_the_page_is_what_its_script_writes():
    script = runpy.run_path(str(ROOT / "benchmarks" / "write_results.py"))
    assert (ROOT / "docs" / "results.md").read_text() == script["page"]()

"""Real light fields, where there are any."""

import os
from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def real() -> Path:
    """The folder named by EPINET_LIGHTFIELDS; the test is skipped without."""
    folder = os.environ.get("EPINET_LIGHTFIELDS")
    if not folder:
        pytest.skip("EPINET_LIGHTFIELDS names no folder of real light fields")
    return Path(folder)

"""Real light fields, where there are any, and what the library logs."""

import logging
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


@pytest.fixture
def log(caplog: pytest.LogCaptureFixture) -> pytest.LogCaptureFixture:
    """What the library logs from the level INFO on, in `log.messages`."""
    caplog.set_level(logging.INFO, "epinet")
    return caplog

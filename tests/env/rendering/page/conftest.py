"""A browser without a window, if the machine has one."""

from __future__ import annotations

import shutil
from collections.abc import Iterator

import pytest

from albot_benchmarks.page import BROWSERS


@pytest.fixture(scope="session")
def browser() -> Iterator:
    """Chromium, driven by playwright."""
    found = next(filter(None, map(shutil.which, BROWSERS)), None)
    if found is None:
        pytest.skip(f"no browser: install one of {', '.join(BROWSERS)}")
    from playwright.sync_api import sync_playwright

    with sync_playwright() as driver:
        started = driver.chromium.launch(
            executable_path=found, args=["--no-sandbox", "--disable-gpu"]
        )
        yield started
        started.close()

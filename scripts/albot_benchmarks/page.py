"""How fast a page opens, seeks and plays, in a browser without a window.

    python -m albot_benchmarks.page PAGE.html

It needs playwright (extra `test`) and Chromium.
"""

from __future__ import annotations

import json
import shutil
import time
from pathlib import Path
from typing import Any

import click

from albot_core.errors import InputError

BROWSERS = ("chromium", "chromium-browser", "google-chrome")
"""Names of the browser's command."""
SEEKS, SCRUBBING = 100, 3000
"""Number of random seeks, and time of scrubbing from beginning to end (ms)."""
_SEEK = f"""(async () => {{
  const times = [];
  for (let k = 0; k < {SEEKS}; k++) {{
    const begin = performance.now();
    player.seek(Math.floor((player.episode.steps * ((k * 61) % {SEEKS})) / {SEEKS}));
    player.draw();
    times.push(performance.now() - begin);
    await new Promise((done) => requestAnimationFrame(done));
  }}
  times.sort((a, b) => a - b);
  return times;
}})()"""
_SCRUB = f"""(async () => {{
  const begin = performance.now();
  let frames = 0;
  for (let at = 0; at < {SCRUBBING}; at = performance.now() - begin, frames++) {{
    player.seek(Math.floor((at / {SCRUBBING}) * (player.episode.steps - 1)));
    await new Promise((done) => requestAnimationFrame(done));
  }}
  return (1000 * frames) / {SCRUBBING};
}})()"""


def measure_page(page: Path) -> dict[str, Any]:
    """Return a page's size (MB), steps, time to open (s), times to seek (ms), and frames a second.

    Raises:
        InputError: There is no such file, or no browser.
    """
    if not page.is_file():
        raise InputError(page, "a page of `albot play --html`", "no such file")
    browser = next(filter(None, map(shutil.which, BROWSERS)), None)
    if browser is None:
        raise InputError("browser", f"one of {', '.join(BROWSERS)}", "none")
    from playwright.sync_api import sync_playwright

    with sync_playwright() as driver:
        started = driver.chromium.launch(
            executable_path=browser, args=["--no-sandbox", "--disable-gpu"]
        )
        tab = started.new_page(viewport={"width": 1400, "height": 1000})
        begin = time.perf_counter()
        tab.goto(page.resolve().as_uri())
        tab.wait_for_selector("html[data-ready]", timeout=60_000)
        opened = time.perf_counter() - begin
        seeks = tab.evaluate(_SEEK)
        facts = {
            "megabytes": page.stat().st_size / 1e6,
            "steps": tab.evaluate("player.episode.steps - 1"),
            "open_s": opened,
            "seek_median_ms": seeks[len(seeks) // 2],
            "seek_slowest_ms": seeks[-1],
            "scrub_frames_per_s": tab.evaluate(_SCRUB),
        }
        started.close()
    return facts


@click.command()
@click.argument("page", type=click.Path(path_type=Path))
def main(page: Path) -> None:
    """Print how fast PAGE is, as one JSON object."""
    click.echo(json.dumps(measure_page(page)))


if __name__ == "__main__":
    main()

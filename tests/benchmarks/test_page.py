"""The benchmark of pages, on a page of a few steps."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from albot_benchmarks import page as module
from albot_benchmarks.page import BROWSERS, measure_page
from albot_core.errors import InputError
from albot_env.recording.writer import EpisodeWriter
from albot_env.rendering.page import write_page
from albot_env.tasks.explore.env import ExploreEnv


@pytest.mark.skipif(not any(map(shutil.which, BROWSERS)), reason="no browser")
def test_a_page_is_measured(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "_SCRUB", module._SCRUB.replace("3000", "200"))
    env = ExploreEnv("square-loop", mapper="odometry")
    env.recorder = EpisodeWriter(tmp_path / "a.mcap")
    env.reset(seed=1)
    for _ in range(5):
        env.step(env.action_space.sample())
    env.close()
    write_page(tmp_path / "a.mcap", tmp_path / "a.html")
    found = measure_page(tmp_path / "a.html")
    assert found["steps"] == 5
    assert found["megabytes"] == (tmp_path / "a.html").stat().st_size / 1e6
    assert 0 < found["seek_median_ms"] <= found["seek_slowest_ms"]
    assert found["scrub_frames_per_s"] > 1
    assert found["open_s"] > 0


def test_no_page_or_no_browser_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(InputError, match="no such file"):
        measure_page(tmp_path / "none.html")
    (tmp_path / "a.html").touch()
    monkeypatch.setattr(module, "BROWSERS", ("no-such-browser",))
    with pytest.raises(InputError, match="expected one of no-such-browser, found none"):
        measure_page(tmp_path / "a.html")

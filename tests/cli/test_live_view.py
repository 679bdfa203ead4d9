"""The live view: how often an episode is shown, on a clock that the test turns."""

from __future__ import annotations

import sys
from typing import cast

import pytest
from rich.progress import Progress, TextColumn

from albot_cli import live_view
from albot_cli.progress import progress
from albot_env.rendering.frame import Frame

STEP = 0.002
"""Time that a step of the episode takes (s)."""


class Clock:
    """Time that passes only when told."""

    def __init__(self) -> None:
        self.now = 0.0

    def monotonic(self) -> float:
        return self.now

    def sleep(self, seconds: float) -> None:
        self.now += seconds


class SlowViewer:
    """A viewer that takes its time over every frame."""

    def __init__(self, clock: Clock, cost: float) -> None:
        self.shown = 0
        self._clock = clock
        self._cost = cost

    def show(self, frame: Frame) -> bool:
        self.shown += 1
        self._clock.now += self._cost
        return True

    def close(self) -> None:
        """Nothing to close."""


def _watch(monkeypatch: pytest.MonkeyPatch, cost: float, speed: float) -> tuple[Clock, SlowViewer]:
    """Watch 500 steps of 0.1 s; the clock at their end, and the viewer."""
    clock = Clock()
    monkeypatch.setattr(live_view, "time", clock)
    viewer = SlowViewer(clock, cost)
    watched = live_view.LiveView(viewer, Progress(TextColumn("")), "", 500, speed, frame_rate=20.0)
    for step in range(1, 501):
        clock.now += STEP
        assert watched.step(0.1 * step, lambda: cast("Frame", None))
    return clock, viewer


def test_a_slow_viewer_leaves_the_episode_time_to_run(monkeypatch: pytest.MonkeyPatch) -> None:
    clock, viewer = _watch(monkeypatch, cost=0.1, speed=1000.0)
    # One second of steps, with 0.05 s of them between frames.
    assert 15 <= viewer.shown <= 20
    assert clock.now == pytest.approx(500 * STEP + viewer.shown * 0.1)


def test_an_episode_is_shown_at_the_speed_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    clock, viewer = _watch(monkeypatch, cost=0.0, speed=10.0)
    assert clock.now == pytest.approx(50.0 / 10.0, rel=0.01)
    assert 80 <= viewer.shown <= 100


@pytest.mark.parametrize("title", ["albot1 in random:office:42", "run{1}.mcap", "[bold]a[/b]"])
def test_titles_stand_below_the_stage_as_they_are(
    title: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with live_view.open_live_view(title, total=3, speed=1.0, headless=True) as watched:
        assert watched.step(0.1, lambda: cast("Frame", None))
    assert title in capsys.readouterr().err


def test_so_do_descriptions_before_a_progress_bar(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    monkeypatch.setenv("TERM", "xterm")
    with progress("random:office:0..9 [/b]", 3) as tell:
        tell(1, "random:ring:1")
    shown = capsys.readouterr().err
    assert "random:office:0..9 [/b]" in shown
    assert "random:ring:1" in shown

"""How far a long work has come, where there is no terminal."""

from __future__ import annotations

import math

import pytest

from albot_cli import progress as progress_module
from albot_cli.progress import progress


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """The seconds that the progress goes by, in place of the clock's."""
    now = [100.0]
    monkeypatch.setattr(progress_module.time, "monotonic", lambda: now[0])
    return now


def test_a_line_is_told_now_and_then(
    clock: list[float], capsys: pytest.CaptureFixture[str]
) -> None:
    with progress("train", 100_000, "samples", start=1000, every=10.0) as update:
        for seconds, done in ((0, 1000), (9.9, 5000), (10, 21_000), (15, 30_000), (20, 41_000)):
            clock[0] = 100.0 + seconds
            update(done, f"at {seconds}")
    out, err = capsys.readouterr()
    assert out == ""
    assert err.splitlines() == [
        "train: 21,000 of 100,000 samples, 2,000 samples/s, 0:00:40 left, at 10",
        "train: 41,000 of 100,000 samples, 2,000 samples/s, 0:00:30 left, at 20",
    ]


def test_what_has_not_begun_has_no_rate_and_what_is_slow_has_one(
    clock: list[float], capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(progress_module, "EVERY", 60.0)
    with progress("evaluate", 40, "episodes") as update:
        clock[0] += 60.0
        update(0)
        clock[0] += 60.0
        update(6)
    assert capsys.readouterr().err.splitlines() == [
        "evaluate: 0 of 40 episodes",
        "evaluate: 6 of 40 episodes, 0.05 episodes/s, 0:11:20 left",
    ]


def test_who_wants_quiet_has_it(clock: list[float], capsys: pytest.CaptureFixture[str]) -> None:
    with progress("train", 10, "samples", every=math.inf) as update:
        clock[0] += 1e9
        update(10)
    assert capsys.readouterr().err == ""

"""How far a long work has come, where there is no terminal."""

from __future__ import annotations

import io
import math
import sys

import click
import pytest

from albot_cli import progress as progress_module
from albot_cli.progress import can_redraw, progress, progress_board


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


def test_each_of_several_works_has_its_own_rate_since_its_beginning(
    clock: list[float], capsys: pytest.CaptureFixture[str]
) -> None:
    with progress_board("samples", every=10.0) as begin:
        first = begin("seed 0", 1000)
        clock[0] += 10.0
        first(100)
        second = begin("seed 1", 1000, 500)
        clock[0] += 10.0
        first(200)
        second(900)
    assert capsys.readouterr().err.splitlines() == [
        "seed 0: 100 of 1,000 samples, 10 samples/s, 0:01:30 left",
        "seed 0: 200 of 1,000 samples, 10 samples/s, 0:01:20 left",
        "seed 1: 900 of 1,000 samples, 40 samples/s, 0:00:02 left",
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


@pytest.mark.parametrize("start", [0, 100])
def test_no_time_is_left_when_more_is_done_than_asked_for(
    start: int, clock: list[float], capsys: pytest.CaptureFixture[str]
) -> None:
    with progress("train", 100, "samples", every=0.0, start=start) as update:
        clock[0] += 10.0
        update(150)
    assert capsys.readouterr().err.endswith(" samples/s, 0:00:00 left\n")


def test_who_wants_quiet_has_it(clock: list[float], capsys: pytest.CaptureFixture[str]) -> None:
    with progress("train", 10, "samples", every=math.inf) as update:
        clock[0] += 1e9
        update(10)
    assert capsys.readouterr().err == ""


def test_the_time_left_goes_by_the_share_that_is_told(
    clock: list[float], capsys: pytest.CaptureFixture[str]
) -> None:
    with progress("warm-up", 10, "parts", every=0.0) as update:
        clock[0] += 30.0
        update(1, share=0.75)
    assert capsys.readouterr().err == "warm-up: 1 of 10 parts, 0.033 parts/s, 0:00:10 left\n"


@pytest.mark.parametrize("as_json", [True, False])
def test_where_a_program_reads_no_progress_is_shown(
    as_json: bool, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("TERM", "xterm")
    for is_terminal in (False, True):
        monkeypatch.setattr(sys.stderr, "isatty", lambda seen=is_terminal: seen)
        with click.Context(click.Command("x")) as context:
            context.params["as_json"] = as_json
            with progress("train", 10, "samples", every=0.0) as update:
                update(5)
        assert ("train" in capsys.readouterr().err) == (not as_json)


class _Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


@pytest.mark.parametrize(("name", "redraws"), [("xterm", True), ("dumb", False), ("", True)])
def test_a_dumb_terminal_cannot_draw_again(
    name: str, redraws: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("TERM", name)
    assert can_redraw(_Terminal()) == redraws
    assert not can_redraw(io.StringIO())
    assert not can_redraw(None)

"""Watching: how often an episode is shown, what keys do, and how the terminal is left behind."""

from __future__ import annotations

import select
import signal
import sys
import termios
from collections.abc import Sequence
from pathlib import Path
from typing import cast

import numpy as np
import pytest
from gymnasium.spaces import Box

from albot_cli import watch as module
from albot_cli.episodes import PlayedEpisode, RecordedEpisode
from albot_cli.keyboard import Keyboard
from albot_cli.progress import progress
from albot_cli.watch import open_viewer, watch
from albot_core.errors import InputError
from albot_env.rendering.controls import Controls
from albot_env.rendering.frame import Frame
from albot_env.rendering.viewer import Footer, NullViewer
from albot_env.rendering.window import Window
from tests.cli.terminal import MAIN, Terminal

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

    lasting = False

    def __init__(self, clock: Clock, cost: float) -> None:
        self.shown = 0
        self._clock = clock
        self._cost = cost

    def show(self, frame: Frame, footer: Footer | None = None) -> bool:
        self.shown += 1
        self._clock.now += self._cost
        return True

    def keys(self) -> Sequence[str]:
        return ()

    def held(self) -> frozenset[str]:
        return frozenset()

    def close(self) -> None:
        """Nothing to close."""


class FakeEpisode:
    """An episode of steps of 0.1 s that take `STEP` to run."""

    def __init__(self, clock: Clock, steps: int = 500, took: float = 0.1) -> None:
        self.step, self.steps, self.time, self.contacts = 0, steps, 0.0, 0
        self.duration = None
        self.frame = cast("Frame", None)
        self._clock, self._took = clock, took

    @property
    def over(self) -> bool:
        return self.step >= self.steps

    def advance(self) -> None:
        self._clock.now += STEP
        self.step += 1
        self.time = self.step * self._took

    def jump(self, steps: int, seconds: float) -> None:
        raise NotImplementedError


def _watch(
    monkeypatch: pytest.MonkeyPatch, cost: float, speed: float, took: float = 0.1
) -> tuple[Clock, SlowViewer]:
    """Watch 500 steps; the clock at their end, and the viewer."""
    clock = Clock()
    monkeypatch.setattr(module, "time", clock)
    # Annotated, as the checks of types would ask the fake for what it never computes.
    episode: PlayedEpisode = FakeEpisode(clock, took=took)
    viewer = SlowViewer(clock, cost)
    watch(episode, viewer, Controls(speed, recorded=False))
    assert episode.over
    return clock, viewer


def test_a_slow_viewer_leaves_the_episode_time_to_run(monkeypatch: pytest.MonkeyPatch) -> None:
    clock, viewer = _watch(monkeypatch, cost=0.1, speed=1000.0)
    # One second of steps, with 0.05 s of them between frames.
    assert 15 <= viewer.shown <= 22
    assert clock.now == pytest.approx(500 * STEP + viewer.shown * 0.1, abs=0.1)


@pytest.mark.parametrize("cost", [0.0, 0.03])
def test_an_episode_is_shown_at_the_speed_asked_for(
    monkeypatch: pytest.MonkeyPatch, cost: float
) -> None:
    clock, viewer = _watch(monkeypatch, cost=cost, speed=10.0)
    assert clock.now == pytest.approx(50.0 / 10.0, rel=0.05)
    assert 50 <= viewer.shown <= 105


def test_nobody_waits_for_minutes_between_two_stops(monkeypatch: pytest.MonkeyPatch) -> None:
    clock, _ = _watch(monkeypatch, cost=0.0, speed=100.0, took=300.0)
    assert clock.now == pytest.approx(500 * module.LONGEST_STEP / 100, rel=0.1)


@pytest.mark.parametrize("title", ["albot1 in random:office:42", "run{1}.mcap", "[bold]a[/b]"])
def test_without_a_terminal_lines_tell_how_far_it_is(
    title: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(module, "EVERY", 0.0)
    with open_viewer(title, 3, headless=True) as (viewer, update):
        assert isinstance(viewer, NullViewer)
        update()
        update()
    lines = capsys.readouterr().err.splitlines()
    assert [line.split(", ")[0] for line in lines] == [f"{title}: {k} of 3 steps" for k in (1, 2)]


def test_descriptions_stand_before_a_progress_bar_as_they_are(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    monkeypatch.setenv("TERM", "xterm")
    with progress("random:office:0..9 [/b]", 3) as update:
        update(1, "random:ring:1")
    shown = capsys.readouterr().err
    assert "random:office:0..9 [/b]" in shown
    assert "random:ring:1" in shown


class TypedWindow(Window):
    """A window in which the next key is pressed as soon as the one before it is seen to work."""

    def __init__(self, keys: Sequence[int]) -> None:
        super().__init__("test", rate=1e6)
        self.footers: list[Footer] = []
        self.steps: list[int] = []
        self._typed = list(keys)

    def show(self, frame: Frame, footer: Footer | None = None) -> bool:
        assert footer is not None
        self.footers.append(footer)
        self.steps.append(frame.steps)
        if self._typed:
            press(self._typed.pop(0))
        return super().show(frame, footer)


def press(key: int) -> None:
    """Press a key in a window and let it go."""
    import pygame

    for kind in (pygame.KEYDOWN, pygame.KEYUP):
        pygame.event.post(pygame.event.Event(kind, key=key))


@pytest.fixture
def dummy(monkeypatch: pytest.MonkeyPatch) -> None:
    """A display that nobody sees."""
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")


def test_keys_pause_step_seek_and_change_the_speed(dummy: None, episode_file: Path) -> None:
    import pygame

    keys = (pygame.K_SPACE, pygame.K_n, pygame.K_n, pygame.K_b, pygame.K_PLUS, pygame.K_MINUS)
    keys += (pygame.K_HOME, pygame.K_RIGHT, pygame.K_LEFT, pygame.K_END, pygame.K_x, pygame.K_b)
    episode = RecordedEpisode(episode_file, seekable=True)
    assert episode.steps > 3
    # So slow that it takes no step of its own while the test runs.
    window = TypedWindow((*keys, pygame.K_q))
    watch(episode, window, Controls(1e-9, recorded=True))
    window.close()
    end = episode.steps
    # Shown after the one step that is due at once, and after each key.
    assert window.steps == [1, 1, 2, 3, 2, 2, 2, 0, end, 0, end, end, end - 1]
    how = [footer.status.split(" · ")[0] for footer in window.footers]
    assert how == ["playing", *["paused"] * 7, "the end", "paused", "the end", "the end", "paused"]
    speeds = [footer.status.split(" · ")[1] for footer in window.footers]
    assert speeds[4:7] == ["×1e-09", "×2e-09", "×2e-09"]  # No key makes it as slow as that.
    assert f"step {end} of {end} · 0:0{end / 10} of 0:0{end / 10}" in window.footers[8].status
    assert window.footers[0].keys.endswith("? keys · q close")
    assert [window.footers[k].share for k in (7, 8)] == [0.0, 1.0]


def test_a_recorded_episode_looks_the_same_whichever_way_one_came(episode_file: Path) -> None:
    straight, about = (RecordedEpisode(episode_file, seekable=True) for _ in range(2))
    straight.jump(3, 0.0)
    about.jump(0, np.inf)
    assert about.over
    about.jump(0, -np.inf)
    assert about.step == 0
    about.jump(5, 0.0)
    about.jump(-2, 0.0)
    one, other = about.frame, straight.frame
    assert (one.steps, one.figures, one.terms) == (3, other.figures, other.terms)
    np.testing.assert_array_equal(one.path, other.path)
    np.testing.assert_array_equal(one.snapshot.segments, other.snapshot.segments)
    assert about.contacts == straight.contacts
    about.jump(-100, 0.0)
    assert about.step == 0
    assert about.contacts == 0
    about.jump(0, 0.25)
    assert about.time == pytest.approx(0.3)
    about.jump(0, -0.15)
    assert about.time == pytest.approx(0.1)


@pytest.mark.parametrize(
    ("held", "speed", "turn", "says"),
    [
        (["K_UP"], 1, 0, False),
        (["K_UP", "K_LEFT"], 1, 1, False),
        (["K_DOWN", "K_RIGHT"], -1, -1, False),
        (["K_LEFT", "K_RIGHT"], 0, 0, False),
        (["K_RETURN"], 0, 0, True),
        ([], 0, 0, False),
    ],
)
def test_arrows_drive_and_enter_speaks(
    dummy: None, held: list[str], speed: int, turn: int, says: bool
) -> None:
    import pygame

    window, driver = Window("test"), Keyboard()
    driver.reset(np.random.default_rng(0), Box(-1, 1, (4,)))
    driver.listen(window)
    for name in held:
        pygame.event.post(pygame.event.Event(pygame.KEYDOWN, key=getattr(pygame, name)))
    for _ in range(2):  # For as long as they are held.
        action = driver.act(None, {})
        assert (np.sign(action[0]), np.sign(action[1]), action[2] > 0.5) == (speed, turn, says)
        assert action[3] == -1  # It declares home, and claims nothing besides.
    for name in held:
        press(getattr(pygame, name))
    # A key that was only touched counts once.
    assert (driver.act(None, {})[2] > 0.5) == says
    assert not driver.act(None, {})[:2].any()
    window.close()


def test_who_drives_must_be_heard() -> None:
    with pytest.raises(InputError, match="a window or a terminal with keys"):
        Keyboard().listen(NullViewer())


def test_keys_in_a_terminal(episode_file: Path) -> None:
    with Terminal(episode_file.parent, "play", episode_file.name, "--speed", "0.001") as terminal:
        terminal.wait_for(r"space pause · n step · b back · arrows 10 s · \+/- speed · \? keys")
        terminal.type("?")
        terminal.wait_for(r"home, end +to the beginning, to the end")
        terminal.type("h")
        terminal.wait_for("[\u2801-\u28ff]{3}")
        terminal.type(" ")
        terminal.wait_for(r"paused · ×0.001 · step (\d+) of")
        terminal.type("\x1b[H")
        terminal.wait_for(r"paused · ×0.001 · step 0 of")
        for keys, seen in (("n", "step 1 of"), ("n", "step 2 of"), ("b", "step 1 of")):
            terminal.type(keys)
            terminal.wait_for(seen)
        terminal.type("+")
        terminal.wait_for("×0.002")
        terminal.type("\x1b")  # The beginning of a key whose end comes later.
        terminal.type("OF")
        terminal.wait_for(r"the end · ×0.002 · step (\d+) of \1 · .* of ")
        terminal.type("echo lost\nq and more")
        assert terminal.finish() == 0
        assert "echo lost" not in terminal.shown
        assert "m driven" in terminal.shown  # The summary.
        assert termios.tcgetattr(terminal.own_end) == terminal.settings
        assert not select.select([terminal.own_end], [], [], 0)[0]


def test_ctrl_c_after_the_last_step_closes_and_breaks_nothing_off(episode_file: Path) -> None:
    with Terminal(episode_file.parent, "play", episode_file.name, "--speed", "1000") as terminal:
        terminal.wait_for("the end · ×1000")
        terminal.type("\x03")
        assert terminal.finish() == 0
        assert "m driven" in terminal.shown  # The summary.
        assert "stopped" not in terminal.shown
        assert termios.tcgetattr(terminal.own_end) == terminal.settings


def test_a_terminal_that_is_too_small_says_how_large_it_must_be(episode_file: Path) -> None:
    arguments = ("play", episode_file.name, "--speed", "1000")
    with Terminal(episode_file.parent, *arguments, size=(40, 12)) as terminal:
        terminal.wait_for("too small: 40 × 12 characters")
        terminal.wait_for("needed: 60 × 16")
        terminal.wait_for("the end")
        terminal.type("q")
        assert terminal.finish() == 0


def test_a_terminal_that_cannot_redraw_gets_lines_and_waits_for_no_key(
    episode_file: Path,
) -> None:
    every = "import albot_cli.watch as w\nw.EVERY = 0.0\n"
    arguments = ("play", episode_file.name)
    with Terminal(
        episode_file.parent, *arguments, code=every + MAIN, environment={"TERM": "dumb"}
    ) as terminal:
        terminal.wait_for(r"watched.mcap: \d+ of 40 steps, .* steps/s, 0:00:00 left")
        assert terminal.finish() == 0
        assert "m driven" in terminal.shown
        assert not any("\u2801" <= character <= "\u28ff" for character in terminal.shown)


BROKEN = "import albot_env.rendering.terminal as t\ndef draw_text(*_): raise RuntimeError('torn')\n"


@pytest.mark.parametrize("how", ["Ctrl-C", "SIGTERM", "exception"])
def test_the_terminal_is_left_as_it_was(episode_file: Path, how: str) -> None:
    code = f"{BROKEN}t.draw_text = draw_text\n{MAIN}" if how == "exception" else MAIN
    arguments = ("play", episode_file.name, "--speed", "0.001")
    with Terminal(episode_file.parent, *arguments, code=code) as terminal:
        if how != "exception":
            terminal.wait_for("playing")
            assert termios.tcgetattr(terminal.own_end) != terminal.settings
        if how == "Ctrl-C":
            terminal.type("\x03")
        if how == "SIGTERM":
            terminal.process.send_signal(signal.SIGTERM)
        assert terminal.finish() == {"Ctrl-C": 130, "SIGTERM": 143, "exception": 1}[how]
        assert termios.tcgetattr(terminal.own_end) == terminal.settings


def test_a_person_drives_in_a_terminal(tmp_path: Path) -> None:
    arguments = ("play", "--agent", "keyboard", "--world", "square-loop", "--mapper", "odometry")
    with Terminal(tmp_path, *arguments, "--speed", "4") as terminal:
        terminal.wait_for("arrows drive · enter: I was here")
        terminal.wait_for("0.0 m driven")
        for _ in range(8):
            terminal.type("\x1b[A")
            terminal.wait_for("m driven")
        terminal.wait_for(r"(0\.[3-9]|[1-9]\.\d) m driven")
        terminal.type("q")
        assert terminal.finish() == 0
    frame = RecordedEpisode(tmp_path / "episode.mcap", seekable=False).frame
    assert (frame.agent, frame.environment) == ("keyboard", "Albot/Explore-v0")

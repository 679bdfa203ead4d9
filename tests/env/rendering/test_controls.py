"""The controls, and the names of keys that terminals send."""

from __future__ import annotations

import os
import pty
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from albot_env.rendering.controls import FASTEST, SLOWEST, Controls
from albot_env.rendering.terminal_keyboard import TerminalKeyboard


def test_what_has_run_cannot_be_gone_back_in() -> None:
    controls = Controls(1.0, recorded=False)
    for key in ("b", "left", "home", "end", "right", "x"):
        controls.press(key)
    assert controls.take_jump() is None
    assert not controls.paused
    line = controls.footer(step=0, steps=10, time=0.0, duration=None, over=False)
    assert line.keys == "space pause · n step · +/- speed · ? keys · q close"
    assert line.status == "playing · ×1 · step 0 of 10 · 0:00.0"


@pytest.mark.parametrize("speed", [1.0, 1e-3, 1e6])
def test_the_speed_has_bounds_but_those_that_were_asked_for(speed: float) -> None:
    controls = Controls(speed, recorded=False)
    seen = []
    for key in ("+", "=", *"+" * 30, *"-" * 60):
        controls.press(key)
        seen.append(controls.speed)
    assert max(seen) == max(speed, FASTEST)
    assert min(seen) <= SLOWEST or speed > FASTEST


@pytest.mark.parametrize("key", ["?", "h"])
def test_a_key_shows_all_keys_and_hides_them(key: str) -> None:
    for recorded in (False, True):
        controls = Controls(1.0, recorded=recorded, more="arrows drive · enter: home")
        shown = []
        for _ in range(3):
            footer = controls.footer(step=0, steps=1, time=0.0, duration=None, over=False)
            shown.append(footer.help)
            controls.press(key)
        assert shown[0] == shown[2] == ()
        assert shown[1][:2] == ("arrows drive", "enter: home")
        assert any(line.startswith("home, end") for line in shown[1]) == recorded
        assert any(line.startswith("?, h") for line in shown[1])


@pytest.mark.parametrize("more", ["", "arrows drive · enter: I was here"])
@pytest.mark.parametrize("recorded", [False, True])
def test_the_line_of_keys_fits_a_terminal(recorded: bool, more: str) -> None:
    if recorded and more:
        pytest.skip("nobody drives in a recorded episode")
    controls = Controls(1.0, recorded=recorded, more=more)
    footer = controls.footer(step=99999, steps=99999, time=9999.0, duration=9999.0, over=True)
    assert len(footer.keys) <= 80
    assert len(footer.status) <= 80


@pytest.fixture
def typed(monkeypatch: pytest.MonkeyPatch) -> Iterator[int]:
    """The person's end of a terminal that is standard input."""
    person, ours = pty.openpty()
    with open(ours, encoding="utf-8") as stream:  # noqa: PTH123
        monkeypatch.setattr(sys, "stdin", stream)
        yield person
    os.close(person)


@pytest.mark.parametrize(
    ("sent", "names"),
    [
        ("qn +", ["q", "n", "space", "+"]),
        ("\x1b[A\x1bOD\x1b[1~\x1b[F\n", ["up", "left", "home", "end", "enter"]),
        ("\x1bq", ["q"]),
        ("ä\x1b[15~b", ["ä", "\x1b[15~", "b"]),
    ],
)
def test_what_terminals_send(typed: int, sent: str, names: list[str]) -> None:
    keyboard = TerminalKeyboard()
    assert keyboard.there
    assert list(keyboard.keys()) == []
    os.write(typed, sent.encode())
    assert list(keyboard.keys()) == names
    assert keyboard.held() == frozenset(names)
    keyboard.close()
    assert not keyboard.there
    assert list(keyboard.keys()) == []


def test_a_key_may_come_in_pieces(typed: int) -> None:
    keyboard = TerminalKeyboard()
    pieces = {"\x1b": [], "[": [], "C": ["right"], "\x1b[5": [], "~x": ["\x1b[5~", "x"]}
    for piece, names in pieces.items():
        os.write(typed, piece.encode())
        assert list(keyboard.keys()) == names
    keyboard.close()


def test_without_a_terminal_there_are_no_keys(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    (tmp_path / "a").write_text("q")
    with (tmp_path / "a").open(encoding="utf-8") as stream:
        monkeypatch.setattr(sys, "stdin", stream)
        keyboard = TerminalKeyboard()
        assert not keyboard.there
        assert list(keyboard.keys()) == []
        keyboard.close()

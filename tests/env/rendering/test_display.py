"""Whether there is a display for a window."""

from __future__ import annotations

import sys

import pytest

from albot_env.rendering.display import display_found

VARIABLES = "DISPLAY", "WAYLAND_DISPLAY"


@pytest.mark.parametrize(
    ("platform", "variable", "found"),
    [
        ("linux", None, False),
        ("linux", "DISPLAY", True),
        ("linux", "WAYLAND_DISPLAY", True),
        ("win32", None, True),
        ("darwin", None, True),
    ],
)
def test_a_display_is_there_by_the_system_or_by_its_variable(
    platform: str, variable: str | None, found: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in VARIABLES:
        monkeypatch.delenv(name, raising=False)
    if variable is not None:
        monkeypatch.setenv(variable, ":0")
    monkeypatch.setattr(sys, "platform", platform)
    assert display_found() is found

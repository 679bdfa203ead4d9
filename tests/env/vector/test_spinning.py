"""How long torch's threads spin."""

from __future__ import annotations

import os

import pytest

from albot_env.vector.spinning import SPINS, spin_briefly


def test_who_has_said_how_long_keeps_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("GOMP_SPINCOUNT", "7")
    spin_briefly()
    assert os.environ["GOMP_SPINCOUNT"] == "7"


def test_else_it_is_short(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("GOMP_SPINCOUNT", "7")  # So that it is as before in the end.
    monkeypatch.delenv("GOMP_SPINCOUNT")
    spin_briefly()
    assert os.environ["GOMP_SPINCOUNT"] == str(SPINS)

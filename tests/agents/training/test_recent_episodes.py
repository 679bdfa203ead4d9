"""Success rate and mean return during training: of the first that began, however long they last."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from albot_agents.training import curriculum, recent_episodes
from albot_agents.training.curriculum import Curriculum
from albot_agents.training.plan_file import read_plan
from albot_agents.training.recent_episodes import ENOUGH, EndedEpisode, RecentEpisodes
from tests.agents.training.tiny import plan_file

SHORT, LONG = 10, 100
"""Lengths of episodes that succeed, and of those that fail (steps)."""


def _train(rows: int, steps: int, chance: float) -> tuple[list[float | None], list[float | None]]:
    """The success rate after each step, and that of the episodes which ended last."""
    rng = np.random.default_rng(1)
    recent, ended = RecentEpisodes(rows), list[bool]()
    successes = rng.random(rows) < chance
    left = np.where(successes, SHORT, LONG)
    rates: list[float | None] = []
    biased: list[float | None] = []
    for _ in range(steps):
        left -= 1
        over = np.flatnonzero(left == 0)
        recent.step(EndedEpisode(k, float(successes[k]), bool(successes[k])) for k in over.tolist())
        ended += successes[over].tolist()
        successes[over] = rng.random(len(over)) < chance
        left[over] = np.where(successes[over], SHORT, LONG)
        rates.append(recent.success_rate)
        biased.append(float(np.mean(ended[-500:])) if ended else None)
    return rates, biased


def test_early_endings_do_not_pass_for_success() -> None:
    """Half of the episodes succeed, and those are the short ones."""
    rates, biased = _train(rows=1000, steps=600, chance=0.5)
    assert biased[SHORT - 1 : LONG - 1] == [1.0] * (LONG - SHORT)
    assert rates[: LONG - 1] == [None] * (LONG - 1)
    known = [rate for rate in rates[LONG - 1 :] if rate is not None]
    assert len(known) == len(rates) - LONG + 1
    # Four standard errors of 500 episodes.
    assert np.abs(np.array(known) - 0.5).max() < 4 * np.sqrt(0.25 / 500)


def test_where_all_succeed_nothing_delays_the_rate() -> None:
    rates, biased = _train(rows=ENOUGH, steps=SHORT, chance=1.0)
    assert rates == biased == [None] * (SHORT - 1) + [1.0]


@given(
    lengths=st.lists(st.lists(st.integers(1, 6), min_size=1, max_size=5), min_size=1, max_size=5),
    steps=st.integers(1, 30),
)
def test_the_first_that_began_are_counted(lengths: list[list[int]], steps: int) -> None:
    """By a list of all episodes: each is known by its return, its place in the list."""
    episodes = []  # (step at which it began, row, step at which it ended)
    for row, cycle in enumerate(lengths):
        began = 0
        for length in cycle * 30:
            episodes.append((began, row, began + length))
            began += length
    episodes.sort()
    recent = RecentEpisodes(len(lengths))
    for step in range(1, steps + 1):
        recent.step(
            EndedEpisode(row, float(k), None)
            for k, (_, row, end) in enumerate(episodes)
            if end == step
        )
        open_ones = [k for k, (_, _, end) in enumerate(episodes) if end > step]
        assert list(recent._returns) == [float(k) for k in range(open_ones[0])]
    assert recent.success_rate is None


def test_a_stage_ends_by_those_that_ended_last(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As it did when the shipped agents were trained; what is shown waits for the long ones."""
    monkeypatch.setattr(curriculum, "RECENT", 4)
    monkeypatch.setattr(recent_episodes, "ENOUGH", 1)
    stages = [{"until_success": 1.0}, {}]
    course = Curriculum(read_plan(plan_file(tmp_path / "plan.yml", curriculum=stages)), 0)
    ends: dict[str, list[bool]] = {"first": [True, False], "both": [True, True]}

    def step(which: str) -> None:
        infos: list[dict[str, Any]] = [{"is_success": True}, {"is_success": False}]
        taken = np.zeros((2, 1)), np.array((1.0, -1.0)), np.array(ends[which]), infos
        monkeypatch.setattr(course.venv, "step_wait", lambda: taken)
        course.step_wait()

    course.reset()
    for _ in range(4):
        assert not course.is_over(0)
        step("first")
    assert course.is_over(0)
    # The first row's first episode began with the second's, before it by the order of the rows.
    assert (course.success_rate, course.mean_return) == (1.0, 1.0)
    step("both")
    assert not course.is_over(0)
    shown = [course.success_rate, course.mean_return]
    course.reset()
    shown.append(course.success_rate)
    course.close()
    assert shown == pytest.approx([5 / 6, (5 * 1.0 - 5.0) / 6, None])

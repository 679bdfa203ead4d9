"""A violation becomes a simpler one of the same invariant, in bounded time."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from albot_env.recording.reader import EpisodeReader
from albot_env.tasks.explore.env import ExploreVectorEnv
from albot_stress.episodes import Episode
from albot_stress.running import Checks, run_episode
from albot_stress.shrinking import ShrinkTask, shrink, simpler

EPISODE = Episode(
    world="random:office:12?people=4&boxes=2",
    agent="random",
    mapper="odometry",
    odometer="poor",
    faults="laser-dropout:at=0.1m+frozen-odometer:at=0.1m",
    seed=12,
    steps=40,
)
CHECKS = Checks(replays=0.0)
Step = tuple[Any, Any, Any, Any, dict[str, Any]]


def broken_after(
    monkeypatch: pytest.MonkeyPatch, moment: float, *, only_with_people: bool = False
) -> None:
    """Let rewards not be the sums of their terms from some moment (s) on."""
    whole = ExploreVectorEnv.step

    def step(self: ExploreVectorEnv, actions: Any) -> Step:
        result = whole(self, actions)
        _, rows = self.obstacle_outlines
        moving = rows[:, 1] > rows[:, 0]
        wrong = result[4]["time"] > moment
        result[1][wrong & (moving if only_with_people else True)] += 1
        return result

    monkeypatch.setattr(ExploreVectorEnv, "step", step)


def shrunk(seconds: float = 60.0, record: Path | None = None) -> Any:
    [violation] = run_episode(EPISODE, checks=CHECKS).violations
    return shrink(ShrinkTask(violation=violation, checks=CHECKS, seconds=seconds, record=record))


def test_what_has_nothing_to_do_with_it_goes(monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    broken_after(monkeypatch, 0.75)
    record = tmp_path / "violation.mcap"
    found = shrunk(record=record)
    assert found.violation.invariant == "reward" == found.original.invariant
    episode = found.violation.episode
    assert (episode.mapper, episode.odometer, episode.faults) == ("none", "ideal", None)
    assert not episode.movables
    assert episode.seed == 0
    assert episode.world.startswith("random:office:0?rooms=2")
    assert (episode.steps, found.violation.step) == (8, 8)
    assert len(list(EpisodeReader(record).moments())) == 9
    [again] = run_episode(episode, checks=CHECKS).violations
    assert (again.step, again.what) == (8, found.violation.what)


def test_what_is_needed_stays(monkeypatch: pytest.MonkeyPatch):
    broken_after(monkeypatch, 0.75, only_with_people=True)
    episode = shrunk().violation.episode
    assert episode.movables
    assert ("people" in episode.world) != ("boxes" in episode.world)


def test_time_is_bounded(monkeypatch: pytest.MonkeyPatch):
    broken_after(monkeypatch, 0.75)
    found = shrunk(seconds=0.0)
    assert found.tried <= 1
    assert dataclasses.replace(found.violation.episode, steps=40) == EPISODE


def test_another_error_is_not_the_same(monkeypatch: pytest.MonkeyPatch):
    """Worlds that cannot be made raise an InputError, which is not the one that is shrunk."""
    whole = ExploreVectorEnv.step

    def step(self: ExploreVectorEnv, actions: Any) -> Step:
        result = whole(self, actions)
        if result[4]["time"].max() > 0.75:
            raise RuntimeError("the wheels fell off")
        return result

    monkeypatch.setattr(ExploreVectorEnv, "step", step)
    found = shrunk()
    assert found.violation.what.startswith("RuntimeError: the wheels fell off")
    assert found.violation.step == 8


def test_simpler_episodes_are_valid_specs():
    """Each differs from the one that it is simpler than; a world by name has no smaller one."""
    for episode in simpler(EPISODE):
        assert episode != EPISODE
        assert episode.command(3)
    named = dataclasses.replace(EPISODE, world="square-loop", seed=0)
    assert {each.world for each in simpler(named)} == {"square-loop"}
    assert np.all([each.seed == 0 for each in simpler(named)])

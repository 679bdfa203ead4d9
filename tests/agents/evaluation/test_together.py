"""Episodes in a batch are those of single environments, to the last bit."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from albot_agents.benchmark.cell import EpisodeResult
from albot_agents.evaluation.plan import Trial
from albot_agents.evaluation.together import can_run_together, run_together
from albot_agents.evaluation.trial import run_trial
from albot_agents.registry import find_agent
from albot_env.tasks.core import journeys
from albot_env.tasks.core.journeys import JourneyCache, JourneySpec
from albot_env.tasks.explore_and_home.task import ExploreAndHomeConfig
from albot_env.tasks.homing.outward_journey import (
    OutwardJourney,
    OutwardJourneyConfig,
    OutwardJourneys,
)
from albot_env.tasks.homing.task import HomingConfig

EXPLORE, HOMING = "Albot/Explore-v0", "Albot/Homing-v0"
TRIP = "Albot/ExploreAndHome-v1"


def trials(task: str, agent: str, **settings: Any) -> list[Trial]:
    """Three episodes, of which two are in the same world."""
    made = find_agent(agent).environment(task, {"odometer": "poor", **settings})
    places = (("random:maze:1", 1), ("random:apartment:2", 7), ("random:maze:1", 3))
    return [
        Trial(task=task, agent=agent, world=world, seed=seed, settings=made)
        for world, seed in places
    ]


@pytest.mark.parametrize(
    ("task", "agent", "settings"),
    [
        (EXPLORE, "exploring", {"max_episode_steps": 40}),
        (EXPLORE, "gap-explorer", {"max_episode_steps": 25}),
        # They declare home at different times, so that some go on with another episode.
        (TRIP, "random", {"config": ExploreAndHomeConfig(shortest=5.0, longest=9.0)}),
    ],
)
def test_episodes_are_those_that_run_alone(task: str, agent: str, settings: dict[str, Any]) -> None:
    planned = trials(task, agent, **settings)
    steps: list[int] = []
    together = run_together(planned, steps.append)
    for trial, found in zip(planned, together, strict=True):
        alone = run_trial(trial)
        assert found.trial is trial
        assert found.path.tobytes() == alone.path.tobytes()
        assert np.array_equal(found.coverage_curve, alone.coverage_curve)
        kept = (EpisodeResult.of(each, agent, trial.world).to_plain() for each in (found, alone))
        assert next(kept) == next(kept)
    assert steps == list(range(max(len(found.path) for found in together)))


def test_lengths_differ_where_episodes_end_by_themselves() -> None:
    config = ExploreAndHomeConfig(shortest=5.0, longest=9.0)
    lengths = {len(found.path) for found in run_together(trials(TRIP, "random", config=config))}
    assert len(lengths) > 1


def test_no_journey_is_made_for_robots_that_have_ended(monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[JourneySpec] = []
    travel = OutwardJourneys.travel

    def counted(self: OutwardJourneys, spec: JourneySpec) -> OutwardJourney:
        made.append(spec)
        return travel(self, spec)

    monkeypatch.setattr(OutwardJourneys, "travel", counted)
    monkeypatch.setattr(journeys, "_LATEST", JourneyCache())
    outing = OutwardJourneyConfig(shortest=3.0, longest=5.0, away=1.0)
    planned = trials(HOMING, "random", config=HomingConfig(outing=outing))
    lengths = {len(found.path) for found in run_together(planned)}
    assert len(lengths) > 1
    assert len(made) == len(planned)


def test_batches_are_for_tasks_of_one_length_without_journeys() -> None:
    assert can_run_together(EXPLORE)
    for task in (TRIP, HOMING, "Albot/PlaceRecognition-v0", "Albot/Probe-Detour-v0"):
        assert not can_run_together(task)

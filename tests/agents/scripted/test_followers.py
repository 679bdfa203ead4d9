"""Followers and the decision stump: what their few lines do."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from gymnasium.spaces import Box, Discrete

from albot_agents.agent import EnvironmentConfigs
from albot_agents.evaluation.plan import Trial
from albot_agents.evaluation.trial import run_trial
from albot_agents.registry import find_agent, make_agent
from albot_agents.scripted.followers import OnwardFollower
from albot_agents.scripted.trained_round_trip import Skill, TrainedRoundTrip
from albot_core.errors import InputError
from albot_core.sensing.reading import LaserGeometry
from albot_env.tasks.core.actions import (
    ActionConfig,
    ClaimingActionConfig,
    DeclaringActionConfig,
    MissionActionConfig,
)
from albot_env.tasks.core.observation import HOMING_PARTS, ObservationConfig
from albot_env.tasks.core.parts.beliefs import observe_home
from albot_env.tasks.core.parts.scales import scale_ranges
from albot_env.tasks.core.wayfinding import WayfindingConfig
from albot_env.tasks.homing.outward_journey import OutwardJourneyConfig
from albot_env.tasks.homing.task import HomingConfig
from albot_env.tasks.place_recognition.spaces import FEATURES, ArrivalsObservationConfig

CONFIG = ObservationConfig(parts=HOMING_PARTS)
CONFIGS = EnvironmentConfigs(CONFIG, DeclaringActionConfig())
AHEAD, LEFT, BEHIND = (5.0, 0.0), (0.0, 5.0), (-5.0, -0.1)
EXIT = (np.cos(0.5), -np.sin(0.5))


def _seen(home: tuple[float, float], near: int | None = None, **hints: Any) -> dict[str, Any]:
    """An observation of home, of hints, and of something 0.3 m away along a beam."""
    shown = {name: np.zeros(shape, np.float32) for name, shape in CONFIG.shapes.items()}
    observe_home(np.array((*home, 0.0)), CONFIG.scales.home, shown["home"])
    shown["laser"][:] = -1.0
    if near is not None:
        shown["laser"][near] = 0.7
    for name in ("way", "exit"):
        point = hints.get(name)
        shown[name][-1] = -1.0 if point is None else 1.0
        if point is not None:
            observe_home(np.array((*point, 0.0)), CONFIG.scales.home, shown[name][:3])
    return shown


def _act(name: str, shown: dict[str, Any]) -> tuple[float, float, bool]:
    """Speed (m/s), turn rate (rad/s) and declaration of an agent."""
    agent = make_agent(name, CONFIGS)
    agent.reset(np.random.default_rng(0), Box(-1, 1, (3,), np.float32))
    action = np.asarray(agent.act(shown, {}))
    scales = CONFIGS.actions
    return float(action[0]) * scales.speed, float(action[1]) * scales.turn_rate, action[2] > 0


@pytest.mark.parametrize("name", ["home-vector", "hint-follower"])
def test_a_follower_drives_turns_and_declares(name: str) -> None:
    assert _act(name, _seen(AHEAD)) == pytest.approx((0.5, 0.0, False), abs=1e-3)
    assert _act(name, _seen(LEFT)) == pytest.approx((0.0, 1.0, False))
    assert _act(name, _seen(BEHIND))[1] < 0.0
    assert _act(name, _seen((0.29, 0.0))) == (0.0, 0.0, True)
    assert not _act(name, _seen((0.31, 0.0)))[2]


@pytest.mark.parametrize("name", ["home-vector", "hint-follower"])
@pytest.mark.parametrize(("beam", "away"), [(20, 1.0), (89, 1.0), (91, -1.0), (160, -1.0)])
def test_a_follower_turns_away_from_what_is_near(name: str, beam: int, away: float) -> None:
    """Beams run from right to left, so what is right of the middle makes it turn left."""
    assert _act(name, _seen(AHEAD, near=beam)) == pytest.approx((0.15, away, False), abs=1e-5)


def test_the_hint_follower_takes_the_way_then_the_exit_then_home() -> None:
    follows = {"home-vector": 0.0, "hint-follower": 0.5}
    for name, bearing in follows.items():
        both = _seen(AHEAD, way=(np.cos(0.5), np.sin(0.5)), exit=EXIT)
        assert _act(name, both)[1] == pytest.approx(1.5 * bearing, abs=1e-3)
        exit_only = _seen(AHEAD, exit=EXIT)
        assert _act(name, exit_only)[1] == pytest.approx(-1.5 * bearing, abs=1e-3)


def test_hints_must_be_shown_to_their_follower() -> None:
    bare = EnvironmentConfigs(ObservationConfig(), ActionConfig())
    make_agent("home-vector", bare)
    with pytest.raises(InputError, match="hint-follower: expected observations with the part"):
        make_agent("hint-follower", bare)


@pytest.mark.parametrize(("name", "comes_home"), [("home-vector", False), ("hint-follower", True)])
def test_the_way_leads_round_walls_and_the_home_vector_ends_at_one(
    name: str, comes_home: bool
) -> None:
    outing = OutwardJourneyConfig(shortest=12.0, longest=16.0, away=3.0)
    settings = {"config": HomingConfig(outing=outing), "max_episode_steps": 400}
    trial = Trial(
        task="Albot/Homing-v0",
        agent=name,
        world="random:office:6?rooms=4",
        seed=6,
        settings={"mapper": "albot1", **settings},
    )
    info = run_trial(trial).info
    assert info["is_success"] == info["declared"] == comes_home


ONWARD = OnwardFollower.OBSERVATIONS
EXPLORES = EnvironmentConfigs(ONWARD, ClaimingActionConfig())


def _explores(
    onward: tuple[float, float] | None, near: int | None = None, known: bool = False
) -> tuple[float, float, bool]:
    """Speed (m/s), turn rate (rad/s) and claim where this point lies on the way on."""
    shown = {name: np.zeros(shape, np.float32) for name, shape in ONWARD.shapes.items()}
    shown["onward"][-1], shown["place"][:] = -1.0, (1.0 if known else -1.0, -1.0)
    if onward is not None:
        shown["onward"][-1] = 1.0
        observe_home(np.array((*onward, 0.0)), ONWARD.scales.home, shown["onward"][:3])
    shown["laser"][:] = -1.0
    if near is not None:
        shown["laser"][near] = 0.8
    agent = make_agent("onward-follower", EXPLORES)
    agent.reset(np.random.default_rng(0), Box(-1, 1, (3,), np.float32))
    action, scales = np.asarray(agent.act(shown, {})), EXPLORES.actions
    return float(action[0]) * scales.speed, float(action[1]) * scales.turn_rate, action[2] > 0


def test_the_onward_follower_drives_to_the_hint_and_looks_round_without_one() -> None:
    assert _explores((2.0, 0.0)) == pytest.approx((0.6, 0.0, False), abs=1e-3)
    assert _explores((0.0, -2.0)) == pytest.approx((0.0, -1.5, False))
    assert _explores(None) == pytest.approx((0.0, 1.5, False))
    assert _explores((2.0, 0.0), known=True)[2]
    assert _explores((2.0, 0.0), near=80) == pytest.approx((0.08, 1.5, False), abs=1e-5)
    # What is beside it, in a doorway, does not make it turn away.
    assert _explores((2.0, 0.0), near=5) == pytest.approx((0.6, 0.0, False), abs=1e-3)
    bare = EnvironmentConfigs(ObservationConfig(), ActionConfig())
    with pytest.raises(InputError, match="onward-follower: expected observations with the part"):
        make_agent("onward-follower", bare)


def test_the_onward_follower_enters_the_rooms_of_a_building() -> None:
    entry = find_agent("onward-follower")
    settings = entry.environment("Albot/Explore-v0", {"max_episode_steps": 1200})
    assert settings["config"].observations == ONWARD
    trial = Trial(
        task="Albot/Explore-v0",
        agent="onward-follower",
        world="random:office:6?rooms=4",
        seed=6,
        settings=settings,
    )
    info = run_trial(trial).info
    assert info["rooms_entered"] >= 4
    assert info["coverage"] > 0.8


@pytest.mark.parametrize("name", ["explore-and-home", "onward-round-trip"])
def test_whoever_explores_is_home_in_time_with_enough_ground_covered(name: str) -> None:
    settings = find_agent(name).environment("Albot/ExploreAndHome-v1", {})
    assert settings["config"].hints
    trial = Trial(
        task="Albot/ExploreAndHome-v1",
        agent=name,
        world="random:office:6?rooms=4",
        seed=6,
        settings=settings,
    )
    info = run_trial(trial).info
    assert info["is_success"]
    assert info["farthest_distance_home"] > 5.0


@pytest.mark.parametrize("name", ["exploring", "homing"])
def test_each_of_the_two_is_shown_what_it_saw_in_its_training(name: str) -> None:
    """In the mission's observations, and in those of its own task, it drives the same way."""
    file = find_agent(name).file
    assert file is not None
    own = file.observation_config
    assert own is not None
    shown = EnvironmentConfigs(TrainedRoundTrip.OBSERVATIONS, MissionActionConfig())
    skill = Skill(name, shown)
    alone = make_agent(name, EnvironmentConfigs(own, file.actions))
    rng = np.random.default_rng(3)
    skill.reset(np.random.default_rng(1))
    alone.reset(np.random.default_rng(1), Box(-1, 1, (3,), np.float32))
    for _ in range(20):
        parts = {
            part: rng.uniform(-1, 1, shape).astype(np.float32)
            for part, shape in TrainedRoundTrip.OBSERVATIONS.shapes.items()
        }
        ranges = rng.uniform(0.1, 12.0, len(parts["laser"]))
        seen = {part: parts[part] for part in own.shapes}
        for config, its in ((TrainedRoundTrip.OBSERVATIONS, parts), (own, seen)):
            its["laser"] = np.empty(len(ranges), np.float32)
            scale_ranges(ranges, config.scales.laser, its["laser"])
        (command, says), expected = skill.act(parts), np.asarray(alone.act(seen, {}))
        np.testing.assert_allclose(command, expected[:2] * (1.0, 2.0), atol=1e-4)
        assert says == (expected[2] > MissionActionConfig().threshold)


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"laser_range": 8.0}, r"exploring: expected laser_range 10 or more, found 8"),
        (
            {"laser_sectors": 18},
            r"exploring: expected the part laser .*36.*, found \(18,\)",
        ),
        (
            {"laser": LaserGeometry(mount=(0.2, 0.0, 0.0))},
            r"exploring: expected laser Laser.*mount",
        ),
        ({"home_range": 50.0}, r"exploring: expected home_range 100.0, found 50.0"),
        ({"wayfinding": WayfindingConfig(stay=2.0)}, r"exploring: expected wayfinding .*stay=3.0"),
    ],
)
def test_they_are_shown_nothing_else(changes: dict[str, Any], expected: str) -> None:
    seen = replace(TrainedRoundTrip.OBSERVATIONS, **changes)
    with pytest.raises(InputError, match=expected):
        make_agent("explore-and-home", EnvironmentConfigs(seen, MissionActionConfig()))


def test_the_decision_stump_names_the_arrival_that_agrees_most_if_it_agrees_enough() -> None:
    config = ArrivalsObservationConfig(most=3)
    agent = make_agent("decision-stump", EnvironmentConfigs(config, ActionConfig()))
    agent.reset(np.random.default_rng(0), Discrete(4))
    parts = {"arrivals": np.ones((3, len(FEATURES)), np.float32), "mask": np.array((1, 1, -1))}
    agreed = parts["arrivals"][:, FEATURES.index("agreed")]
    for shares, answer in (((0.2, 0.29, 1), 0), ((0.2, 0.31, 1), 2), ((0.9, 0.31, 1), 1)):
        agreed[:] = shares
        assert agent.act(parts, {}) == answer

"""Observations: their scale, and that they hold nothing but what the readings say."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from albot_agents.agent import EnvironmentConfigs
from albot_agents.registry import make_agent
from albot_core.errors import InputError
from albot_core.geometry.poses import compose, relative
from albot_core.mappers.mapper import RouteHome, require
from albot_core.mappers.registry import make_mapper
from albot_env.recording.reader import EpisodeReader
from albot_env.recording.writer import EpisodeWriter
from albot_env.tasks.core.actions import ActionConfig
from albot_env.tasks.core.observation import HOMING_PARTS, ObservationConfig
from albot_env.tasks.core.parts.beliefs import (
    CONFIDENCE,
    HOME,
    TIME_LEFT,
    observe_confidence,
    observe_time,
)
from albot_env.tasks.core.parts.sensors import LASER
from albot_env.tasks.explore.task import ExploreConfig
from tests.env.conftest import drive
from tests.env.tasks.oracles import Coverage, Wayfinding, observe, observe_ranges

CONFIG = ObservationConfig()
ACTIONS = ActionConfig()


@given(st.floats(0.0, 30.0))
@settings(deadline=None)
def test_ranges_are_what_the_laser_part_was_made_of(distance: float) -> None:
    scaled = observe_ranges(CONFIG, np.full(3, distance))
    assert LASER.decode(scaled, CONFIG.scales) == pytest.approx(
        np.full(3, distance), rel=1e-5, abs=1e-6
    )


def test_near_is_one_far_is_minus_one_and_nothing_is_far() -> None:
    scaled = observe_ranges(CONFIG, np.array((0.0, 30.0, 80.0, np.inf)))
    assert scaled.tolist() == [1.0, -1.0, -1.0, -1.0]


def test_near_is_better_resolved_than_far() -> None:
    near, next_to_it, far, beyond = observe_ranges(CONFIG, np.array((0.5, 0.6, 20.0, 20.1)))
    assert near - next_to_it > 10 * (far - beyond) > 0


def test_parts_and_the_flat_form_hold_the_same(make_env) -> None:
    flat = drive(make_env(), 10)
    parts = drive(make_env(observation="dict"), 10)
    for (one, _), (other, _) in zip(flat, parts, strict=True):
        taken_apart = CONFIG.split(one)
        assert taken_apart.keys() == other.keys()
        assert all(np.array_equal(taken_apart[name], other[name]) for name in other)


def test_a_flat_observation_of_another_length_is_refused() -> None:
    with pytest.raises(InputError, match="observation: expected shape"):
        CONFIG.split(np.zeros(7, np.float32))


def test_home_is_seen_where_it_is(make_env) -> None:
    env = make_env(odometer="ideal", observation="dict")
    env.reset(seed=1, options={"start": 0})
    for _ in range(25):
        observation, _, _, _, info = env.step(np.array((1, 0, -1), np.float32))
    cosine, sine, _ = observation["home"]
    assert (cosine, sine) == pytest.approx((-1, 0), abs=1e-3)
    home = CONFIG.decode(HOME, observation)
    assert home == pytest.approx((-info["path_length"], 0.0), abs=0.01)


def test_observations_are_a_function_of_the_readings_alone(make_env, tmp_path: Path) -> None:
    """Recorded readings, replayed to a fresh mapper without any world, give the same ones."""
    env = make_env(mapper="albot1", observation="dict")
    env.recorder = EpisodeWriter(tmp_path / "a.mcap")
    seen = drive(env, 60)
    env.close()

    assert_replayed(seen, tmp_path / "a.mcap", CONFIG)


def assert_replayed(seen: list[tuple[Any, Any]], path: Path, config: ObservationConfig) -> None:
    """A fresh mapper makes the same observations of the readings recorded."""
    mapper, ground = make_mapper("albot1"), Coverage(config.coverage, 20.0)
    wayfinding = Wayfinding(config.wayfinding, config.coverage, 20.0)
    moments = list(EpisodeReader(path).moments())
    assert len(moments) == len(seen)
    for moment, (observation, _) in zip(moments, seen, strict=True):
        mapper.update(moment.reading)
        ground.follow(moment.reading.motion, mapper.estimate.pose, moment.reading.laser)
        home, laser = (
            compose(mapper.estimate.pose, mapper.estimate.home_from_robot),
            moment.reading.laser,
        )
        motion, known = moment.reading.motion, require(mapper, RouteHome).way_home
        wayfinding.follow(motion, mapper.estimate.pose, laser, home, ground, known)
        again = observe(config, moment.reading, mapper, ground, wayfinding=wayfinding)
        assert again.keys() == observation.keys()
        for name, part in observation.items():
            np.testing.assert_array_equal(again[name], part, err_msg=name)


@pytest.mark.parametrize("sectors", [None, 20])
def test_the_way_home_is_a_function_of_the_readings_too(make_env, tmp_path: Path, sectors) -> None:
    config = replace(
        ObservationConfig(parts=(*HOMING_PARTS, "shortcut", "path", "frontier", "onward")),
        laser_sectors=sectors,
    )
    env = make_env(mapper="albot1", observation="dict", config=ExploreConfig(observations=config))
    env.recorder = EpisodeWriter(tmp_path / "a.mcap")
    seen = [env.reset(seed=5, options={"start": 0})]
    for goal in ((8.0, 2.5), (8.2, 1.5), (4.0, 2.0)):
        while np.hypot(*(goal - seen[-1][1]["pose"][:2])) > 0.3:
            ahead = relative(seen[-1][1]["pose"], np.array((*goal, 0.0)))
            turn = np.arctan2(ahead[1], ahead[0])
            speed = 0.6 * max(0.0, np.cos(turn))
            action = np.array((speed, np.clip(turn, -0.5, 0.5), -1.0))
            observation, _, _, _, info = env.step(action)
            seen.append((observation, info))
    env.close()
    assert {observation["exit"][5] for observation, _ in seen} == {-1.0, 1.0}
    assert {observation["way"][3] for observation, _ in seen} == {-1.0, 1.0}
    confident = [observation["confidence"][0] for observation, _ in seen]
    assert max(confident) == 1.0
    assert min(confident) < 0.99
    assert_replayed(seen, tmp_path / "a.mcap", env.observation_config)


def test_confidence_falls_with_travel_as_a_normal_distribution_widens() -> None:
    near = [observe_confidence(travel, 0.05, 1.0) for travel in (0.0, 20.0, 60.0, np.inf)]
    inside = [1.0, 1 - np.exp(-0.5), 1 - np.exp(-0.5 / 9), 0.0]
    assert near == pytest.approx([2 * share - 1 for share in inside])


@given(st.floats(1.0, 300.0))
@settings(deadline=None)
def test_travel_and_time_are_read_back(number: float) -> None:
    confidence = np.float32([observe_confidence(number, CONFIG.home_drift, CONFIG.home_near)])
    if number > 5.0:  # Nearer home the confidence is all but 1.
        assert CONFIDENCE.decode(confidence, CONFIG.scales) == pytest.approx(number, rel=1e-2)
    shown = np.float32([observe_time(number, CONFIG.scales.time)])
    assert TIME_LEFT.decode(shown, CONFIG.scales) == pytest.approx(number, rel=1e-4)
    assert CONFIDENCE.decode(np.array([-1.0]), CONFIG.scales) > 1e3


def test_a_sector_shows_its_nearest_beam() -> None:
    config = replace(CONFIG, laser_sectors=4)
    ranges = np.full(181, 9.0)
    ranges[44], ranges[45], ranges[180] = 1.0, 2.0, 3.0
    expected = observe_ranges(CONFIG, np.array((1.0, 2.0, 9.0, 3.0)))
    assert observe_ranges(config, ranges).tolist() == expected.tolist()


def test_only_the_parts_asked_for_are_shown(make_env) -> None:
    parts = ("home", "laser", "place")
    config = replace(CONFIG, parts=parts, laser_sectors=12)
    env = make_env(config=ExploreConfig(observations=config))
    whole = drive(make_env(), 5)
    for (few, _), (all_of_it, _) in zip(drive(env, 5), whole, strict=True):
        shown, others = config.split(few), CONFIG.split(all_of_it)
        assert list(shown) == ["laser", "home", "place"]
        assert env.observation_space.contains(few)
        assert shown["home"].tolist() == others["home"].tolist()
        assert shown["laser"].max() == others["laser"].max()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"parts": ("lasr",)}, "did you mean laser"),
        ({"parts": ()}, "each once, found"),
        ({"parts": ("home", "home")}, "each once, found"),
        ({"laser_sectors": 0}, "1 to the laser's 181 beams"),
        ({"laser_sectors": 500}, "1 to the laser's 181 beams"),
        ({"home_drift": 0.0}, "home_drift"),
    ],
)
def test_observations_that_cannot_be_are_refused(change, message) -> None:
    with pytest.raises(InputError, match=message):
        replace(CONFIG, **change)


def test_who_needs_a_part_is_told_that_it_is_missing() -> None:
    with pytest.raises(InputError, match="gap-explorer: expected observations with the part laser"):
        make_agent("gap-explorer", EnvironmentConfigs(replace(CONFIG, parts=("home",)), ACTIONS))
    with pytest.raises(InputError, match="oracle: expected every beam"):
        make_agent("oracle", EnvironmentConfigs(replace(CONFIG, laser_sectors=5), ACTIONS))

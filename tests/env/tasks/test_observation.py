"""Observations: their scale, and that they hold nothing but what the readings say."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from albot_core.errors import InputError
from albot_core.registry import make_mapper
from albot_env.recording.reader import EpisodeReader
from albot_env.recording.writer import EpisodeWriter
from albot_env.tasks.coverage import Coverage
from albot_env.tasks.observation import ObservationConfig
from tests.env.conftest import drive

CONFIG = ObservationConfig()


@given(st.floats(0.0, 30.0))
@settings(deadline=None)
def test_ranges_are_what_the_laser_part_was_made_of(distance: float) -> None:
    scaled = CONFIG.observe_ranges(np.full(3, distance))
    assert CONFIG.ranges(scaled) == pytest.approx(np.full(3, distance), rel=1e-5, abs=1e-6)


def test_near_is_one_far_is_minus_one_and_nothing_is_far() -> None:
    scaled = CONFIG.observe_ranges(np.array((0.0, 30.0, 80.0, np.inf)))
    assert scaled.tolist() == [1.0, -1.0, -1.0, -1.0]


def test_near_is_better_resolved_than_far() -> None:
    near, next_to_it, far, beyond = CONFIG.observe_ranges(np.array((0.5, 0.6, 20.0, 20.1)))
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
        observation, _, _, _, info = env.step(np.array((1, 0), np.float32))
    cosine, sine, scaled = observation["home"]
    assert (cosine, sine) == pytest.approx((-1, 0), abs=1e-3)
    assert CONFIG.home_distance(scaled) == pytest.approx(info["path_length"], abs=0.01)


def test_observations_are_a_function_of_the_readings_alone(make_env, tmp_path: Path) -> None:
    """Recorded readings, replayed to a fresh mapper without any world, give the same ones."""
    env = make_env(mapper="albot1", observation="dict")
    env.recorder = EpisodeWriter(tmp_path / "a.mcap")
    seen = drive(env, 60)
    env.close()

    mapper, ground = make_mapper("albot1"), Coverage(CONFIG.coverage, 20.0)
    moments = list(EpisodeReader(tmp_path / "a.mcap").moments())
    assert len(moments) == len(seen)
    for moment, (observation, _) in zip(moments, seen, strict=True):
        mapper.update(moment.reading)
        ground.follow(moment.reading.motion, mapper.pose, moment.reading.laser)
        again = CONFIG.observe(moment.reading, mapper, ground)
        for name, part in observation.items():
            assert np.array_equal(again[name], part), name

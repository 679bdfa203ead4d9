"""What exploring is worth, and what the truth in `info` says."""

from __future__ import annotations

import gymnasium
import numpy as np
import pytest

from albot_core.errors import InputError
from albot_env.tasks.core.observation import ObservationConfig
from albot_env.tasks.explore.reward import ExploreWeights
from albot_env.tasks.explore.task import ExploreConfig

AHEAD = np.array((1.0, 0.0, -1.0), np.float32)
STILL = np.array((0.0, 0.0, -1.0), np.float32)
TURN = np.array((0.0, 1.0, -1.0), np.float32)


def test_standing_still_costs_time_and_earns_nothing(make_env) -> None:
    env = make_env()
    env.reset(seed=1, options={"start": 0})
    # The first look covers what is in view; a second one from there finds next to nothing.
    for _ in range(20):
        _, reward, _, _, info = env.step(STILL)
    assert info["reward_terms"]["time"] == pytest.approx(-0.01 * 0.1)
    assert reward == pytest.approx(-0.001, abs=5e-4)
    assert info["path_length"] == pytest.approx(0.0, abs=1e-6)


def test_driving_through_the_doorway_enters_the_other_room_once(make_env) -> None:
    env = make_env(odometer="ideal")
    _, info = env.reset(seed=1, options={"start": 0})
    assert (info["room"], info["rooms_entered"]) == ("west", 1)
    rooms = []
    for _ in range(60):
        _, _, _, _, info = env.step(AHEAD)
        rooms.append((info["room"], info["reward_terms"]["room"]))
    assert rooms[-1][0] == "east"
    assert sum(earned for _, earned in rooms) == 1.0
    assert info["rooms_entered"] == 2
    assert info["pose"][0] - 2.0 == pytest.approx(info["path_length"], abs=1e-3)


def test_a_wall_is_a_collision_and_ends_nothing(make_env) -> None:
    env = make_env()
    env.reset(seed=1, options={"start": (1.0, 1.0, np.pi)})
    hits = []
    for _ in range(30):
        _, _, terminated, truncated, info = env.step(AHEAD)
        hits.append(info["collided"])
        assert info["reward_terms"]["collision"] == (-0.1 if info["collided"] else 0.0)
        assert not (terminated or truncated)
    assert hits[-1]
    assert not hits[0]


def test_coverage_grows_and_never_passes_one(make_env) -> None:
    env = make_env()
    _, info = env.reset(seed=1, options={"start": 0})
    shares = [info["coverage"]]
    for k in range(300):
        turn = 0.0 if k % 60 < 30 else 0.9
        _, _, _, _, info = env.step(np.array((0.5, turn, -1), np.float32))
        shares.append(info["coverage"])
    assert (np.diff(shares) >= 0).all()
    assert 0 < shares[0] < 0.3 < shares[-1] <= 1


def test_no_ground_is_covered_behind_a_wall_that_a_beam_misses(make_env) -> None:
    """Turning, the robot misses a beam every few steps; it covers what one without errors does."""
    shares = []
    for laser in ("ideal", "lms-200"):
        env = make_env(laser=laser)
        env.reset(seed=1, options={"start": (1.0, 1.0, 0.0)})
        shares.append([env.step(TURN)[-1]["coverage"] for _ in range(300)])
    assert shares[0] == shares[1]
    assert shares[0][0] < shares[0][-1] < 0.25


def test_weights_scale_their_terms(make_env) -> None:
    weights = ExploreWeights(coverage=1.0, time=0.0)
    plain, scaled = make_env(), make_env(config=ExploreConfig(weights=weights))
    for env in (plain, scaled):
        env.reset(seed=1, options={"start": 0})
    earned = 0.0
    for _ in range(10):
        one = plain.step(AHEAD)[-1]["reward_terms"]
        other = scaled.step(AHEAD)[-1]["reward_terms"]
        assert other["coverage"] == pytest.approx(50 * one["coverage"])
        assert other["time"] == 0.0
        earned += other["coverage"]
    assert earned > 0


def test_a_weight_that_is_no_number_is_refused() -> None:
    with pytest.raises(InputError, match=r"ExploreWeights\.room"):
        ExploreWeights(room=float("nan"))


def test_position_error_is_that_of_the_odometer(make_env) -> None:
    env = make_env(odometer="ideal")
    env.reset(seed=1, options={"start": 1})
    for _ in range(30):
        _, _, _, _, info = env.step(np.array((0.6, 0.2, -1), np.float32))
    assert info["position_error"] < 0.01
    # The start faces west: what is ahead in the map lies towards smaller x in the world.
    assert info["belief"][0] > 0.5
    assert info["pose"][0] < 8.0


def test_no_configuration_is_the_usual_one(make_env) -> None:
    assert make_env(config=None).observation_config == make_env().observation_config


def test_time_left_is_not_shown_where_none_is_given(make_env) -> None:
    config = ExploreConfig(observations=ObservationConfig(parts=("motion", "time_left")))
    with pytest.raises(InputError, match=r"ObservationConfig\.parts: .*Explore-v0.*time_left"):
        make_env(config=config)


def test_there_is_room_for_every_reading_that_may_be_claimed() -> None:
    """Compiled code writes them where it is told to: without room beyond the end of an array."""
    env = gymnasium.make("Albot/Explore-v0", world="square-loop", mapper="albot1")
    env.reset(seed=1)
    task = env.unwrapped._robot  # type: ignore[attr-defined]
    rooms = {task._judge.table.points.shape[1]}
    while len(rooms) < 3:
        env.step(np.array((0.0, 1.0, -1.0), np.float32))
        rooms.add(task._judge.table.points.shape[1])
        assert max(rooms) > task.steps[0]
    env.close()

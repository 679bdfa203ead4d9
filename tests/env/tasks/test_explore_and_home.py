"""What exploring and coming home in time is worth, and when it is over."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from albot_core.errors import InputError
from albot_core.mappers.registry import make_mapper
from albot_core.robot import CONTROL_STEP
from albot_env.recording.reader import EpisodeReader
from albot_env.recording.writer import EpisodeWriter
from albot_env.tasks.core.observation import HOMING_PARTS, ObservationConfig
from albot_env.tasks.core.parts.scales import make_log_scale, scaled
from albot_env.tasks.explore_and_home.env import ExploreAndHomeEnv
from albot_env.tasks.explore_and_home.reward import ExploreAndHomeWeights
from albot_env.tasks.explore_and_home.task import ExploreAndHomeConfig
from albot_maps import World
from tests.env.quick import drawn_actions
from tests.env.tasks.oracles import Coverage, observe

STILL = np.array((0, 0, -1), np.float32)
AHEAD = np.array((1, 0, -1), np.float32)
DECLARE = np.array((0, 0, 1), np.float32)


def _make(world: str | World, **config: Any) -> ExploreAndHomeEnv:
    settings = {"shortest": 6.0, "longest": 6.0, "claims": False, **config}
    return ExploreAndHomeEnv(world, mapper="none", config=ExploreAndHomeConfig(**settings))


def _look_around(env: ExploreAndHomeEnv, steps: int = 40) -> dict[str, Any]:
    """Turn on the spot."""
    for _ in range(steps):
        info = env.step(np.array((0, 0.9, -1), np.float32))[4]
    return info


def test_who_declares_at_once_has_not_explored(two_rooms: World) -> None:
    env = _make(two_rooms)
    env.reset(seed=1, options={"start": 0})
    _, _, terminated, truncated, info = env.step(DECLARE)
    assert (terminated, truncated) == (True, False)
    assert (info["declared"], info["is_success"], info["spl"]) == (True, False, 0.0)
    assert info["reward_terms"]["false_declaration"] == -5.0
    assert info["reward_terms"]["success"] == info["reward_terms"]["late"] == 0.0


@pytest.mark.parametrize(
    ("rule", "success"),
    [
        # Of the 40 m² a robot sees 13 from the spot: half of the disc of 2 m at once.
        ({"ground": 10.0}, True),
        ({"ground": 15.0}, False),
        ({"ground": 40.0, "share": 0.25}, True),
        ({"ground": 40.0, "share": 0.4}, False),
    ],
)
def test_enough_must_be_covered(two_rooms: World, rule: dict[str, float], success: bool) -> None:
    env = _make(two_rooms, **rule)
    env.reset(seed=1, options={"start": 0})
    assert 0.27 < _look_around(env)["coverage"] < 0.35
    _, _, terminated, _, info = env.step(DECLARE)
    assert (terminated, info["is_success"]) == (True, success)
    assert info["reward_terms"]["success"] == (10.0 if success else 0.0)
    assert info["reward_terms"]["false_declaration"] == (0.0 if success else -5.0)


def test_home_is_where_it_set_out(two_rooms: World) -> None:
    env = _make(two_rooms, share=0.0)
    env.reset(seed=1, options={"start": 0})
    for _ in range(25):
        info = env.step(AHEAD)[4]
    assert info["distance_home"] > 1
    assert info["distance_home"] == pytest.approx(info["path_length"], abs=0.02)
    info = env.step(DECLARE)[4]
    assert (info["declared"], info["is_success"]) == (True, False)


def test_a_spent_budget_ends_the_episode_without_success(two_rooms: World) -> None:
    """Also at home, with enough covered: only a declaration counts."""
    env = _make(two_rooms, share=0.0, shortest=1.0, longest=1.0)
    _, info = env.reset(seed=1)
    assert info["time_left"] == pytest.approx(1.0)
    for step in range(10):
        _, reward, terminated, truncated, info = env.step(STILL)
        assert (terminated, truncated) == (step == 9, False)
        assert info["time_left"] == pytest.approx(0.9 - 0.1 * step)
    assert (info["is_success"], info["declared"]) == (False, False)
    assert info["reward_terms"]["late"] == -5.0
    assert reward == pytest.approx(-5.0, abs=0.1)


def test_a_declaration_with_the_last_step_counts(two_rooms: World) -> None:
    env = _make(two_rooms, share=0.0, shortest=0.1, longest=0.1)
    env.reset(seed=1)
    _, _, terminated, _, info = env.step(DECLARE)
    assert (terminated, info["is_success"], info["reward_terms"]["late"]) == (True, True, 0.0)


def test_the_robot_knows_the_time_that_is_left(two_rooms: World) -> None:
    env = _make(two_rooms)
    observation, _ = env.reset(seed=1)
    for step in range(60):
        part = env.observation_config.split(observation)["time_left"]
        left = scaled(6.0 - 0.1 * step, make_log_scale(30.0, 600.0))
        assert part == pytest.approx(np.array([left]), abs=1e-6)
        observation = env.step(STILL)[0]
    assert env.observation_config.split(observation)["time_left"].tolist() == [-1.0]


def test_observations_are_a_function_of_the_readings_and_the_time(
    two_rooms: World, tmp_path: Path
) -> None:
    seen_parts = ObservationConfig(parts=(*HOMING_PARTS, "frontier", "time_left"))
    config = ExploreAndHomeConfig(
        observations=seen_parts, hints=True, claims=False, shortest=6.0, longest=6.0
    )
    env = ExploreAndHomeEnv(two_rooms, mapper="albot1", observation="dict", config=config)
    env.recorder = EpisodeWriter(tmp_path / "trip.mcap")
    seen = [env.reset(seed=3)[0]]
    seen += [env.step(np.array((0.6, 0.2, -1), np.float32))[0] for _ in range(30)]
    env.close()
    mapper, ground = make_mapper("albot1"), Coverage(env.observation_config.coverage, 20.0)
    moments = list(EpisodeReader(tmp_path / "trip.mcap").moments())
    for step, (moment, observation) in enumerate(zip(moments, seen, strict=True)):
        mapper.update(moment.reading)
        ground.follow(moment.reading.motion, mapper.estimate.pose, moment.reading.laser)
        left = (60 - step) * CONTROL_STEP
        again = observe(env.observation_config, moment.reading, mapper, ground, left)
        assert again.keys() == observation.keys()
        for name, part in observation.items():
            np.testing.assert_array_equal(again[name], part, err_msg=name)


def test_budgets_are_drawn_within_their_range(two_rooms: World) -> None:
    env = _make(two_rooms, shortest=3.0, longest=9.0)
    budgets = np.array([env.reset(seed=seed)[1]["time_left"] for seed in range(30)])
    assert (budgets >= 3 - 1e-9).all()
    assert (budgets <= 9 + 1e-9).all()
    assert np.ptp(budgets) > 3


@pytest.mark.parametrize("declares", [False, True])
def test_progress_sums_to_the_potential_at_the_end(two_rooms: World, declares: bool) -> None:
    """It is the way home that is left, weighed by the share of the budget that is spent."""
    env = _make(two_rooms, weights=ExploreAndHomeWeights(progress=0.7))
    env.reset(seed=2)
    rng, total, pulls = np.random.default_rng(3), 0.0, []
    for step in range(60):
        action = drawn_actions("Albot/ExploreAndHome-v1", rng)[:3]
        if declares and step == 49:
            action[2] = 1
        _, _, terminated, _, info = env.step(action)
        pulls.append(info["reward_terms"]["progress"])
        total += pulls[-1]
        if terminated:
            break
    assert step == (49 if declares else 59)
    assert max(map(abs, pulls)) > 0.01
    spent = (step + 1) / 60
    assert total == pytest.approx(-0.7 * info["distance_home"] * spent, abs=1e-9)


def test_exploring_is_worth_what_it_is_in_its_own_task(two_rooms: World) -> None:
    env = _make(two_rooms)
    before = env.reset(seed=1, options={"start": 0})[1]
    rooms = 0.0
    for _ in range(55):
        info = env.step(AHEAD)[4]
        gained = (info["coverage"] - before["coverage"]) * two_rooms.reachable_area
        assert info["reward_terms"]["coverage"] == pytest.approx(0.02 * gained)
        rooms += info["reward_terms"]["room"]
        before = info
    assert rooms == 1.0


def test_the_way_back_counts_from_the_farthest_point(two_rooms: World) -> None:
    """Straight out and straight back is a detour of nothing, whatever was driven before."""
    env = _make(two_rooms, share=0.0, shortest=60.0, longest=60.0)
    env.reset(seed=1, options={"start": 0})
    for _ in range(30):
        info = env.step(AHEAD)[4]
    farthest = info["farthest_distance_home"]
    assert farthest == info["distance_home"] > 2
    assert info["soft_spl"] == 0.0
    while info["distance_home"] > 0.1:
        info = env.step(np.array((-1, 0, -1), np.float32))[4]
    assert info["soft_spl"] == pytest.approx(1 - info["distance_home"] / farthest, abs=0.1)
    for _ in range(30):  # on past home and back, for the wheels do not stop at once
        info = env.step(STILL)[4]
    info = env.step(DECLARE)[4]
    assert info["is_success"]
    assert info["spl"] == pytest.approx(farthest / info["farthest_distance_home"], abs=0.15)


def test_a_detour_counts_in_the_share_of_the_way_back_too(two_rooms: World) -> None:
    env = _make(two_rooms, share=0.0, shortest=60.0, longest=60.0)
    env.reset(seed=1, options={"start": 0})
    for _ in range(30):
        env.step(AHEAD)
    for _ in range(30):  # Until the wheels stand still.
        info = env.step(STILL)[4]
    farthest, places = info["farthest_distance_home"], [info["pose"][:2]]
    for speed in (-1, 0.6, -1, 0.6, -1):
        for _ in range(20):
            info = env.step(np.array((speed, 0, -1), np.float32))[4]
            places.append(info["pose"][:2])
    driven = np.hypot(*np.diff(places, axis=0).T).sum()
    assert info["farthest_distance_home"] == farthest
    back = 1 - info["distance_home"] / farthest
    assert driven > 1.2 * farthest
    assert back > 0.2
    assert info["soft_spl"] == pytest.approx(back * farthest / driven, rel=0.02)


@pytest.mark.parametrize(
    ("wrong", "found"),
    [
        (lambda: ExploreAndHomeConfig(shortest=5.0, longest=4.0), "longest"),
        (lambda: ExploreAndHomeConfig(shortest=0.0), "shortest"),
        (lambda: ExploreAndHomeConfig(share=1.5), "share"),
        (lambda: ExploreAndHomeConfig(ground=-1.0), "ground"),
        (lambda: ExploreAndHomeWeights(late=float("nan")), "late"),
        (lambda: ObservationConfig(time_range=-1.0), "time_range"),
    ],
)
def test_settings_that_are_none_are_refused(wrong: Any, found: str) -> None:
    with pytest.raises(InputError, match=found):
        wrong()

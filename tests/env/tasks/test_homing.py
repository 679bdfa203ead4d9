"""What coming home is worth, how far it is, and where robots begin."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from albot_core.errors import InputError
from albot_env.recording.reader import EpisodeReader
from albot_env.recording.writer import EpisodeWriter
from albot_env.tasks.core import journeys as journeys_module
from albot_env.tasks.core.journeys import JourneyCache
from albot_env.tasks.core.observation import ObservationConfig
from albot_env.tasks.core.way_home import success_weighted
from albot_env.tasks.homing.env import HomingEnv
from albot_env.tasks.homing.outward_journey import OutwardJourneyConfig, OutwardJourneys
from albot_env.tasks.homing.reward import HomingWeights
from albot_env.tasks.homing.task import HomingConfig
from albot_maps import World
from tests.env.quick import STROLL, drawn_actions

STILL = np.array((0, 0, -1), np.float32)
DECLARE = np.array((0, 0, 1), np.float32)
NEAR = HomingConfig(outing=OutwardJourneyConfig(shortest=0.0, longest=0.0, away=0.0))
"""The journey out is over before it begins."""
FAR = HomingConfig(outing=OutwardJourneyConfig(shortest=3.0, longest=3.0, away=3.0))


def _make(world: str | World, **options: Any) -> HomingEnv:
    return HomingEnv(world, **{"mapper": "none", "config": STROLL, **options})


@pytest.mark.parametrize(
    ("success", "geodesic", "driven", "spl"),
    [(1, 10, 10, 1), (1, 10, 20, 0.5), (1, 10, 8, 1), (0, 10, 10, 0), (1, 0, 0, 1), (1, 0, 2, 0)],
)
def test_spl_by_hand(success: float, geodesic: float, driven: float, spl: float) -> None:
    assert success_weighted(float(success), float(geodesic), float(driven)) == spl


@given(st.floats(0, 1), st.floats(0, 100), st.floats(0, 100))
def test_spl_is_a_share_of_success(success: float, geodesic: float, driven: float) -> None:
    assert 0 <= success_weighted(success, geodesic, driven) <= success


def test_home_declared_at_home_is_a_success(two_rooms: World) -> None:
    env = _make(two_rooms, config=NEAR)
    _, info = env.reset(seed=1)
    assert not (info["is_success"] or info["declared"])
    _, reward, terminated, truncated, info = env.step(DECLARE)
    assert (terminated, truncated, info["is_success"], info["declared"]) == (
        True, False, True, True,
    )  # fmt: skip
    assert info["reward_terms"]["success"] == 10.0
    assert info["reward_terms"]["false_declaration"] == 0.0
    assert info["spl"] == pytest.approx(1.0, abs=0.05)
    assert reward > 9


def test_home_declared_elsewhere_ends_without_success(two_rooms: World) -> None:
    env = _make(two_rooms, config=FAR)
    _, info = env.reset(seed=1)
    assert info["distance_home"] >= 3.0
    _, reward, terminated, _, info = env.step(DECLARE)
    assert (terminated, info["is_success"], info["spl"]) == (True, False, 0.0)
    assert info["reward_terms"]["false_declaration"] == -5.0
    assert info["reward_terms"]["success"] == 0.0
    assert reward < -4


@pytest.mark.parametrize("declare", [-1.0, 0.0, 0.5])
def test_half_a_declaration_is_none(two_rooms: World, declare: float) -> None:
    env = _make(two_rooms, config=NEAR)
    env.reset(seed=1)
    _, _, terminated, _, info = env.step(np.array((0, 0, declare), np.float32))
    assert not (terminated or info["declared"])


def test_home_is_home_within_the_radius(two_rooms: World) -> None:
    for radius, home in ((0.3, False), (9.0, True)):
        config = HomingConfig(outing=FAR.outing, radius=radius)
        env = _make(two_rooms, config=config)
        env.reset(seed=1)
        assert env.step(DECLARE)[4]["is_success"] is home


@pytest.mark.parametrize("declares", [False, True])
def test_progress_sums_to_a_difference_of_potentials(two_rooms: World, declares: bool) -> None:
    """However the robot drives, and whether it declares."""
    weight = 0.7
    weights = HomingWeights(progress=weight)
    env = _make(two_rooms, config=HomingConfig(weights=weights, outing=FAR.outing))
    _, info = env.reset(seed=2)
    begin = -weight * info["distance_home"]
    rng, total = np.random.default_rng(3), 0.0
    for step in range(40):
        action = drawn_actions("Albot/Homing-v0", rng)
        if declares and step == 39:
            action[2] = 1
        info = env.step(action)[4]
        total += info["reward_terms"]["progress"]
    assert total == pytest.approx(-weight * info["distance_home"] - begin, abs=1e-9)
    assert abs(info["distance_home"] - info["initial_distance_home"]) > 0.05


def _aversion(info: dict[str, Any]) -> float:
    """How far a robot looks away from where its way home turns, by numpy's own angles."""
    to = info["next_turn_home"] - info["pose"][:2]
    return float(1 - np.cos(np.arctan2(to[1], to[0]) - info["pose"][2])) / 2


@pytest.mark.parametrize("declares", [False, True])
def test_facing_sums_to_a_difference_of_potentials(two_rooms: World, declares: bool) -> None:
    weight = 0.7
    weights = HomingWeights(facing=weight)
    env = _make(two_rooms, config=HomingConfig(weights=weights, outing=FAR.outing))
    _, info = env.reset(seed=2)
    begin, total = -weight * _aversion(info), 0.0
    for step in range(20):
        action = np.array((0, 0.8, 1 if declares and step == 19 else -1), np.float32)
        info = env.step(action)[4]
        total += info["reward_terms"]["facing"]
    assert total == pytest.approx(-weight * _aversion(info) - begin, abs=1e-9)
    assert abs(begin + weight * _aversion(info)) > 0.05


def test_the_way_counts_from_where_the_agent_begins(two_rooms: World) -> None:
    env = _make(two_rooms, config=FAR)
    _, info = env.reset(seed=4)
    assert info["way_driven"] == 0.0
    assert info["path_length"] == pytest.approx(info["outward_length"])
    assert info["outward_length"] >= 3.0
    assert info["initial_distance_home"] == info["distance_home"]
    places = [info["pose"][:2]]
    for _ in range(20):
        info = env.step(np.array((0.4, 0.5, -1), np.float32))[4]
        places.append(info["pose"][:2])
    driven = np.hypot(*np.diff(places, axis=0).T).sum()
    assert info["way_driven"] == pytest.approx(driven)
    assert info["path_length"] == pytest.approx(info["outward_length"] + driven)
    covered = np.clip(1 - info["distance_home"] / info["initial_distance_home"], 0, 1)
    detour = info["initial_distance_home"] / max(info["initial_distance_home"], driven)
    assert info["soft_spl"] == pytest.approx(covered * detour)


def test_a_detour_counts_in_the_share_of_the_way_too(two_rooms: World) -> None:
    env = _make(two_rooms, config=FAR)
    _, info = env.reset(seed=4)
    initial = info["initial_distance_home"]
    for _ in range(400):
        if info["way_driven"] > 1.5 * initial:
            break
        # Home until it is near, then round in circles.
        to = info["next_turn_home"] - info["pose"][:2]
        bearing = np.arctan2(to[1], to[0]) - info["pose"][2]
        turn = np.clip(np.arctan2(np.sin(bearing), np.cos(bearing)), -1, 1)
        near = info["distance_home"] < 1.0
        action = (0.5, 1.0) if near else (np.cos(bearing) > 0.8, turn)
        info = env.step(np.array((*action, -1), np.float32))[4]
    covered = 1 - info["distance_home"] / initial
    assert info["way_driven"] > 1.5 * initial
    assert covered > 0.4
    assert info["soft_spl"] == pytest.approx(covered * initial / info["way_driven"])


def test_where_home_is_in_sight_it_is_as_far_as_the_crow_flies(two_rooms: World) -> None:
    env = _make(two_rooms, config=STROLL)
    _, info = env.reset(seed=4)
    apart = info["start"][:2] - info["pose"][:2]
    assert info["distance_home"] == pytest.approx(np.hypot(*apart))
    assert info["next_turn_home"] == pytest.approx(info["start"][:2])


@pytest.mark.parametrize("mapper", ["none", "odometry", "albot1"])
def test_a_robot_begins_with_what_it_has_seen(two_rooms: World, mapper: str) -> None:
    """Its map is filled, and its belief is off by what the odometer did on the way."""
    env = _make(two_rooms, mapper=mapper, config=FAR, odometer="poor")
    _, info = env.reset(seed=5)
    assert info["coverage"] > 0.3
    assert 0 < info["position_error"] < 2
    assert info["updates"] > (0 if mapper != "none" else -1)
    assert (info["surfaces"] > 0) == (mapper != "none")
    assert info["time"] == 0.0


def test_kept_journeys_are_those_that_would_be_made(
    two_rooms: World, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whoever asks first, and whatever was driven in between."""
    ours, nobodys = JourneyCache(), JourneyCache()
    monkeypatch.setattr(journeys_module, "JOURNEY_CACHE", ours)
    one, other = (_make(two_rooms, journeys=2, mapper="odometry") for _ in range(2))
    other.reset(seed=11)
    for _ in range(5):
        other.step(np.array((1, 0.3, -1), np.float32))
    begins = []
    for seed in range(5):
        seen, info = one.reset(seed=seed)
        monkeypatch.setattr(journeys_module, "JOURNEY_CACHE", nobodys)
        again, twin = other.reset(seed=seed)
        nobodys.clear()
        monkeypatch.setattr(journeys_module, "JOURNEY_CACHE", ours)
        assert np.array_equal(seen, again)
        assert np.array_equal(info["pose"], twin["pose"])
        begins.append(tuple(info["pose"]))
    assert 2 <= len(set(begins)) <= 4  # Two journeys from each of two starts.


def test_robots_that_see_otherwise_share_journeys(
    two_rooms: World, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(journeys_module, "JOURNEY_CACHE", JourneyCache())
    made = []
    travel = OutwardJourneys.travel
    monkeypatch.setattr(
        OutwardJourneys, "travel", lambda *given: (made.append(1), travel(*given))[1]
    )
    short = OutwardJourneyConfig(shortest=2.0, longest=3.0, away=1.0)
    blind = HomingConfig(outing=short, observations=ObservationConfig(parts=("home",)))
    for settings in ({"config": HomingConfig(outing=short)}, {"config": blind}):
        begun = [_make(two_rooms, journeys=1, **settings).reset(seed=k)[1] for k in (1, 1, 2)]
        assert np.array_equal(begun[0]["pose"], begun[1]["pose"])
    assert len(made) <= 2  # One from each start.
    longer = HomingConfig(outing=OutwardJourneyConfig(shortest=3.0, longest=4.0, away=1.0))
    _make(two_rooms, journeys=1, config=longer).reset(seed=1)
    _make(two_rooms, journeys=1, odometer="poor", config=longer).reset(seed=1)
    assert len(made) > 2


def test_ground_covered_on_the_way_is_known_whoever_the_journey_was_made_for(
    two_rooms: World, monkeypatch: pytest.MonkeyPatch
) -> None:
    short = OutwardJourneyConfig(shortest=2.0, longest=3.0, away=1.0)
    blind = HomingConfig(outing=short, observations=ObservationConfig(parts=("home",)))
    patches = []
    for configs in ([HomingConfig(outing=short)], [blind, HomingConfig(outing=short)]):
        monkeypatch.setattr(journeys_module, "JOURNEY_CACHE", JourneyCache())
        for config in configs:
            env = _make(two_rooms, journeys=1, config=config)
            observation, _ = env.reset(seed=1)
        patches.append(env.observation_config.split(observation)["coverage"])
    assert np.array_equal(*patches)
    assert (patches[0] > 0).any()


def test_new_journeys_are_all_different(two_rooms: World) -> None:
    env = _make(two_rooms)
    assert len({tuple(env.reset(seed=seed)[1]["pose"]) for seed in range(4)}) == 4


def test_a_robot_that_is_shut_in_says_that_its_journey_was_cut_short() -> None:
    cell = np.array([[0, 0, 1.2, 0], [1.2, 0, 1.2, 1.2], [1.2, 1.2, 0, 1.2], [0, 1.2, 0, 0]])
    world = World(name="cell", walls=cell, starts=np.array(((0.6, 0.6, 0.0),)))
    outing = OutwardJourneyConfig(shortest=4.0, longest=4.0, away=3.0)
    env = _make(world, config=HomingConfig(outing=outing))
    _, info = env.reset(seed=1)
    assert info["outward_cut_short"]
    assert info["distance_home"] < 1.0
    assert not _make(world, config=NEAR).reset(seed=1)[1]["outward_cut_short"]


def test_things_that_move_are_where_the_journey_left_them() -> None:
    world = "random:apartment:1?people=1&boxes=1&doors=1"
    one, other = (_make(world, journeys=1) for _ in range(2))
    one.reset(seed=3)
    before = one._robot.dynamic_obstacles(0)
    for _ in range(10):
        one.step(STILL)
    assert not np.array_equal(one._robot.dynamic_obstacles(0), before)
    one.reset(seed=3)
    other.reset(seed=4)
    assert np.array_equal(one._robot.dynamic_obstacles(0), other._robot.dynamic_obstacles(0))


def test_an_episode_can_be_recorded(two_rooms: World, tmp_path: Any) -> None:
    env = _make(two_rooms)
    env.agent, env.recorder = "chance", EpisodeWriter(tmp_path / "home.mcap")
    env.reset(seed=1)
    env.step(STILL)
    env.step(DECLARE)
    env.close()
    moments = list(EpisodeReader(tmp_path / "home.mcap").moments())
    assert [None if m.action is None else m.action.tolist() for m in moments] == [
        None, [0, 0, -1], [0, 0, 1],
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("wrong", "found"),
    [
        (lambda: OutwardJourneyConfig(shortest=5.0, longest=4.0), "longest"),
        (lambda: OutwardJourneyConfig(away=-1.0), "away"),
        (lambda: OutwardJourneyConfig(longest=2e9), r"longest: expected a number within \[0, 1000"),
        (lambda: HomingConfig(radius=0.0), "radius"),
        (lambda: HomingWeights(success=float("inf")), "success"),
        (lambda: _make("square-loop", journeys=-1), "journeys"),
    ],
)
def test_settings_that_are_none_are_refused(wrong: Any, found: str) -> None:
    with pytest.raises(InputError, match=found):
        wrong()

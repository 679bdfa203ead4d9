"""Every check finds what it is for, and nothing where nothing is wrong."""

from __future__ import annotations

import math
from dataclasses import fields

import numpy as np
import pytest
from gymnasium import spaces

from albot_core.errors import InputError
from albot_env.stress.checks import (
    Limits,
    all_keys,
    check_body,
    check_info,
    check_inside,
    check_laser,
    check_movables,
    check_observation,
    check_obstacles,
    check_readings,
    check_reward,
)
from albot_env.stress.geometry import ray_ranges

BOX = np.array([[0.0, 0, 4, 0], [4, 0, 4, 3], [4, 3, 0, 3], [0, 3, 0, 0]])
BEARINGS = np.radians(np.arange(-90.0, 91.0))
POSE = np.array((1.0, 1.0, 0.3))
LIMITS = Limits()
INFO = {"pose": POSE, "room": "hall", "time": 0.1, "reward_terms": {"room": 1.0, "time": -0.1}}
KEYS = all_keys(INFO)


def test_an_observation_in_its_space():
    space = spaces.Box(-1, 1, (3,), np.float32)
    good = np.zeros(3, np.float32)
    assert check_observation(good, space) == []
    assert check_observation(good + 2, space) == ["the observation lies outside its space"]
    assert check_observation(good[:2], space) == ["the observation lies outside its space"]
    assert check_observation(good * np.nan, space) == ["observation holds nan"]


def test_an_observation_by_part():
    space = spaces.Dict({"laser": spaces.Box(-1, 1, (2,), np.float32)})
    assert check_observation({"laser": np.zeros(2, np.float32)}, space) == []
    wrong = check_observation({"laser": np.full(2, np.inf, np.float32)}, space)
    assert wrong == ["observation laser holds inf"]


def test_an_info_of_the_same_keys():
    assert check_info(INFO, KEYS) == []
    assert check_info({**INFO, "speed": 1.0}, KEYS) == [
        "info has the key speed, which the reset lacks"
    ]
    assert check_info({**INFO, "reward_terms": {"room": 1.0}}, KEYS) == [
        "info lacks the key reward_terms.time of the reset"
    ]


@pytest.mark.parametrize(
    ("key", "value", "wrong"),
    [
        ("time", math.nan, "info time holds nan"),
        ("pose", np.array((0, np.inf, 0)), "info pose holds inf"),
        ("reward_terms", {"room": -np.inf, "time": 0.0}, "info reward_terms.room holds -inf"),
    ],
)
def test_an_info_that_is_not_finite(key: str, value: object, wrong: str):
    assert check_info({**INFO, key: value}, KEYS) == [wrong]


def test_a_reward_is_the_sum_of_its_terms():
    terms = {"room": 1.0, "time": -0.1}
    assert check_reward(0.9, terms) == []
    assert check_reward(0.9 + 1e-6, terms) != []
    assert check_reward(math.nan, terms) == ["the reward is nan"]


def test_a_body_that_touches_a_wall_is_not_in_it():
    near = np.array((2.0, LIMITS.radius - LIMITS.overlap + 1e-6))
    assert check_body(BOX, near, near, LIMITS) == []
    deep = near - (0, 2e-6)
    assert "deep in wall 0" in check_body(BOX, deep, deep, LIMITS)[0]


def test_a_body_that_has_gone_through_a_wall():
    inside, outside = np.array((3.0, 1.0)), np.array((5.0, 1.0))
    wrong = check_body(BOX, inside, outside, LIMITS)
    assert wrong == ["went through wall 1, (4.00, 0.00) to (4.00, 3.00), from (3.000, 1.000) "
                     "to (5.000, 1.000)"]  # fmt: skip


def test_what_a_laser_may_say():
    ways = ray_ranges(BOX, POSE, BEARINGS)
    for error in (-0.039, 0.039):
        assert check_laser(BOX, POSE, BEARINGS, ways + error, LIMITS) == []


def test_a_beam_through_a_wall():
    ranges = ray_ranges(BOX, POSE, BEARINGS)
    beyond = f"beam 17 sees {ranges[17] + 0.05:.3f} m, through a surface at {ranges[17]:.3f} m"
    ranges[17] += 0.05
    assert check_laser(BOX, POSE, BEARINGS, ranges, LIMITS) == [beyond]


def test_a_beam_is_shorter_only_because_of_a_thing():
    thing = np.array([[2.0, 0.5, 2.0, 1.5]])
    ahead, seen = np.zeros(1), np.array((1.0,))
    pose = np.array((1.0, 1.0, 0.0))
    assert check_laser(np.concatenate((BOX, thing)), pose, ahead, seen, LIMITS) == []
    assert check_laser(BOX, pose, ahead, seen, LIMITS) == [
        "beam 0 sees 1.000 m, nothing is before 3.000 m"
    ]
    [through] = check_laser(np.concatenate((BOX, thing)), pose, ahead, seen * 3, LIMITS)
    assert through == "beam 0 sees 3.000 m, through a surface at 1.000 m"


def test_a_body_that_touches_a_thing_is_not_in_it():
    thing = np.array([[0.0, 0, 1, 0]])
    touching = np.array((0.5, LIMITS.radius - LIMITS.obstacle_overlap + 1e-6))
    assert check_obstacles(thing, touching, LIMITS) == []
    assert "deep in something that moves" in check_obstacles(thing, touching - (0, 2e-6), LIMITS)[0]
    assert check_obstacles(np.empty((0, 4)), touching, LIMITS) == []


def test_a_box_at_a_wall_is_not_in_it():
    box = np.array([[[1.0, 0], [1.5, 0], [1.5, 0.5], [1, 0.5]]])
    shallow, deep = (box - (0, LIMITS.box_overlap + depth) for depth in (-1e-6, 1e-6))
    assert check_movables("box", BOX, box, shallow, LIMITS) == []
    assert check_movables("box", BOX, box[:0], box[:0], LIMITS) == []
    assert check_movables("box", BOX, box, deep, LIMITS) == [
        "box 0 stands 0.060 m deep in wall 0, (0.00, 0.00) to (4.00, 0.00)"
    ]


def test_a_box_that_has_gone_through_a_wall():
    box = np.array([[[1.0, 0], [1.5, 0], [1.5, 0.5], [1, 0.5]]])
    wrong = check_movables("box", BOX, box, box - (0, 0.6), LIMITS)
    assert wrong == ["box 0 went through wall 0, (0.00, 0.00) to (4.00, 0.00)"]


def test_a_beam_that_grazes_the_end_of_a_wall_may_miss_it():
    wall = np.array([[2.0, 1.0, 2.0, 2.0], [5.0, -5, 5, 5]])
    pose, ahead = np.array((1.0, 1.0, 0.0)), np.zeros(1)
    assert ray_ranges(wall, pose, ahead)[0] == 1.0
    assert check_laser(wall, pose, ahead, np.array((4.0,)), LIMITS) == []
    assert check_laser(wall, pose, ahead + 0.01, np.array((4.0,)), LIMITS) != []


def test_a_few_lost_beams_are_chance_and_many_are_a_hole():
    ranges = ray_ranges(BOX, POSE, BEARINGS)
    most = LIMITS.most_lost(len(BEARINGS))
    ranges[:most] = LIMITS.max_range
    assert check_laser(BOX, POSE, BEARINGS, ranges, LIMITS) == []
    ranges[most] = LIMITS.max_range
    assert check_laser(BOX, POSE, BEARINGS, ranges, LIMITS) == [
        f"{most + 1} beams see nothing where surfaces are; {most} may be lost by chance"
    ]


def test_how_many_may_be_lost_is_the_binomial_distributions():
    most = LIMITS.most_lost(181)

    def beyond(count: int) -> float:
        return sum(math.comb(181, k) * 0.001**k * 0.999 ** (181 - k) for k in range(count + 1, 182))

    assert beyond(most) <= 1.1e-12 < beyond(most - 1)
    assert Limits(dropout=0.0).most_lost(181) == 0
    assert LIMITS.most_lost(0) == 0


@pytest.mark.parametrize("name", [field.name for field in fields(Limits)])
@pytest.mark.parametrize("value", [-1.0, math.nan, math.inf])
def test_limits_are_numbers_from_0(name: str, value: float):
    with pytest.raises(InputError, match=name):
        Limits(**{name: value})


def test_a_robot_within_a_box_is_found():
    """However far it is from the sides."""
    box = np.array([[[0.0, 0.0], [4.0, 0.0], [4.0, 3.0], [0.0, 3.0]]])
    assert check_inside("box", box, np.array((2.0, 1.5))) == [
        "stands inside box 0, at (2.000, 1.500)"
    ]
    assert check_inside("box", box, np.array((4.1, 1.5))) == []
    assert check_inside("box", box[:0], np.array((2.0, 1.5))) == []


def test_a_reading_holds_distances():
    motion, ranges = np.zeros(3), np.array((1.0, np.inf, 0.0))
    assert check_readings(motion, ranges, ranges) == []
    assert check_readings(motion) == []
    assert check_readings(motion, np.array((1.0, -0.5)), np.array((np.nan,))) == [
        "beam 1 says -0.5 m", "sonar 0 says nan m",
    ]  # fmt: skip
    [wrong] = check_readings(np.array((np.inf, 0.0, 0.0)))
    assert wrong.startswith("the odometer says [inf")

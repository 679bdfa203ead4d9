"""Doors among robots: their times, their swing, and what is in its way."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
import shapely

from albot_core.robot import CONTROL_STEP
from albot_maps import Box, Door
from tests.env.sim.obstacle_scene import Scene, inside, world_of

DOOR = Door(
    hinge=(4.0, 3.0),
    heading=0.0,
    width=1.0,
    opening=2.0,
    turn_rate=0.5,
    open_for=(3.0, 3.0),
    shut_for=(2.0, 2.0),
)


def test_a_door_is_shut_and_open_as_long_as_it_says_and_swings_in_between():
    scene = Scene(world_of(doors=[DOOR]))
    angles = []
    for _ in range(400):
        scene.steps(1)
        angles.append(float(scene.doors[0]))
    assert min(angles) == pytest.approx(0.0, abs=1e-9)
    assert max(angles) == pytest.approx(2.0, abs=1e-9)
    turns = np.abs(np.diff(angles))
    assert turns.max() == pytest.approx(0.5 * CONTROL_STEP)
    states = ["shut" if a < 1e-6 else "open" if a > 2 - 1e-6 else "swings" for a in angles]
    changes = [k for k, (first, second) in enumerate(pairwise(states)) if first != second]
    lasted = {"shut": set(), "open": set(), "swings": set()}
    for first, second in pairwise(changes):
        lasted[states[second]].add(second - first)
    assert lasted["shut"] <= {20, 21, 22}
    assert lasted["open"] <= {30, 31, 32}
    assert lasted["swings"] <= {39, 40}
    assert all(lasted.values())


@pytest.mark.parametrize("opening", [1.5, -1.5])
def test_the_leaf_hangs_on_its_hinge_and_sweeps_its_side(opening):
    door = Door(hinge=(4.0, 3.0), heading=0.5, width=1.2, opening=opening, shut_for=(0.0, 1.0))
    sweep = door.sweep.buffer(3e-3)
    scene = Scene(world_of(doors=[door]))
    for _ in range(200):
        scene.steps(1)
        x1, y1, x2, y2 = scene.segments[0]
        assert (x1, y1) == (4.0, 3.0)
        assert math.hypot(x2 - x1, y2 - y1) == pytest.approx(1.2)
        assert sweep.contains(shapely.Point(x2, y2).buffer(1e-4))


def test_a_door_draws_its_times_from_their_range():
    door = Door(hinge=(4.0, 3.0), heading=0.0, width=1.0, shut_for=(1.0, 4.0), open_for=(0.0, 0.0))
    scene = Scene(world_of(doors=[door]))
    shut, lasts = 0, []
    for _ in range(3000):
        scene.steps(1)
        if abs(scene.doors[0]) < 1e-9:
            shut += 1
        elif shut:
            lasts.append(shut * CONTROL_STEP)
            shut = 0
    assert min(lasts[1:]) >= 1.0
    assert max(lasts) <= 4.3
    assert np.std(lasts) > 0.4


@pytest.mark.parametrize(("thing", "radius"), [("robot", 0.25), ("box", 0.25 * math.sqrt(2))])
def test_a_door_waits_for_what_is_in_its_way_and_goes_on_when_it_is_gone(thing, radius):
    """Open at 2 rad, it would shut onto what stands at 0.8 m and 1 rad."""
    spot = 4.0 + 0.8 * math.cos(1.0), 3.0 + 0.8 * math.sin(1.0)
    door = Door(hinge=(4.0, 3.0), heading=0.0, width=1.0, opening=2.0, open_for=(0.1, 0.1))
    scene = Scene(world_of(doors=[door], boxes=[Box(at=(7.0, 1.0))]))
    while scene.doors[0] < 2.0 - 1e-6:
        scene.steps(1)
    index = ("robot", "door", "box").index(thing)
    scene.lift(index, *spot)
    scene.steps(100)
    gap = 0.8 * math.sin(scene.doors[0] - 1.0) - radius
    assert 0.05 <= gap <= 0.05 + 0.8 * CONTROL_STEP
    assert not scene.robots.touched.any()
    scene.lift(index, 2.0, 5.0)
    scene.steps(20)
    assert scene.doors[0] == pytest.approx(0.0, abs=1e-9)


def test_a_robot_that_drives_into_a_swinging_leaf_is_never_pushed_through_a_wall():
    """It stands in the corner behind the door, and drives at the leaf again and again."""
    door = Door(
        hinge=(0.9, 0.0),
        heading=0.0,
        width=0.9,
        opening=math.pi / 2,
        turn_rate=2.0,
        open_for=(0.0, 0.5),
        shut_for=(0.0, 0.5),
    )
    scene = Scene(world_of(start=(0.45, 0.45, 0.0), doors=[door]))
    rng = np.random.default_rng(3)
    for _ in range(300):
        scene.steps(4, *rng.uniform((-1.6, -3), (1.6, 3)))
        assert inside(scene, 0.2)
    assert scene.robots.touched[0, 1]

"""People among robots: their routes, their speed, and what they go round."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely

from albot_env.stress.checks import Limits
from albot_maps import Box, Door, Walker
from tests.env.sim.obstacle_scene import Scene, gap_of, world_of


def walk(scene: Scene, steps: int, index: int = 0) -> np.ndarray:
    """x, y, velocity x, y of a walker at each of so many steps."""
    states = []
    for _ in range(steps):
        scene.steps(1)
        states.append(scene.walkers[index])
    return np.array(states)


@pytest.mark.parametrize("closed", [True, False])
def test_a_walker_comes_by_all_its_waypoints_at_its_speed(closed):
    route = ((2.0, 2.0), (6.0, 2.0), (6.0, 4.5), (2.0, 4.5))
    walker = Walker(route=route, closed=closed, speed=(1.2, 1.2))
    states = walk(Scene(world_of(start=(0.4, 0.4, 0.0), walkers=[walker])), 600)
    for point in route:
        near = np.hypot(*(states[:, :2] - point).T) < 0.45
        visits = np.count_nonzero(near[1:] & ~near[:-1])
        assert visits >= 3
    assert np.median(np.hypot(*states[:, 2:].T)) == pytest.approx(1.2, rel=0.06)
    assert np.hypot(*states[:, 2:].T).max() <= 1.3 * 1.2 + 1e-9
    track = shapely.LineString([*route, route[0]] if closed else route)
    assert shapely.distance(shapely.points(states[:, :2]), track).max() < 0.35


def test_a_walker_who_is_slow_is_not_stuck():
    """What counts as no progress is a share of its own speed."""
    walker = Walker(route=((2.0, 2.0), (5.0, 2.0)), speed=(0.15, 0.15))
    states = walk(Scene(world_of(start=(0.4, 0.4, 0.0), walkers=[walker])), 450)
    assert states[:, 0].min() < 2.3
    assert states[:, 0].max() > 4.7


def test_a_walker_steps_around_a_robot_that_stands_in_its_way():
    walker = Walker(route=((1.0, 3.0), (7.0, 3.0)), speed=(1.2, 1.2))
    scene = Scene(world_of(start=(4.0, 3.0, 0.0), walkers=[walker]))
    states = walk(scene, 300)
    assert states[:, 0].min() < 1.5
    assert states[:, 0].max() > 6.5
    crossings = np.count_nonzero(np.diff(np.sign(states[:, 0] - 4.0)))
    assert crossings >= 4
    assert np.hypot(*(states[:, :2] - (4, 3)).T).min() > 0.5
    assert not scene.robots.touched.any()
    assert gap_of(scene, 4.0, 3.0) == 0.0


def test_a_walker_gets_through_the_narrowest_door_and_keeps_off_the_walls():
    walls = [[4.0, 0.0, 4.0, 2.625], [4.0, 3.375, 4.0, 6.0]]
    walker = Walker(route=((1.0, 3.0), (7.0, 3.0)), speed=(1.3, 1.3))
    scene = Scene(world_of(walls=walls, walkers=[walker]))
    states = walk(scene, 300)
    assert np.count_nonzero(np.diff(np.sign(states[:, 0] - 4.0))) >= 5
    lines = shapely.MultiLineString([((a, b), (c, d)) for a, b, c, d in scene.world.walls])
    assert shapely.distance(shapely.points(states[:, :2]), lines).min() > 0.25


def test_a_walker_keeps_off_a_wall_along_which_its_route_leads():
    """5 cm of room on the route; a step further off it there is more."""
    walker = Walker(route=((1.0, 0.3), (7.0, 0.3)), speed=(1.0, 1.0))
    states = walk(Scene(world_of(start=(4.0, 5.0, 0.0), walkers=[walker])), 300)
    settled = states[100:]
    midway = settled[np.abs(settled[:, 0] - 4.0) < 2.0]
    assert midway[:, 1].min() > 0.45
    assert midway[:, 1].max() < 0.8


def test_a_walker_turns_round_where_it_gets_no_further():
    """A corridor that the robot bars."""
    walls = [[2.0, 2.5, 6.0, 2.5], [2.0, 3.2, 6.0, 3.2]]
    walker = Walker(route=((1.0, 2.85), (7.0, 2.85)), speed=(1.0, 1.0), radius=0.2)
    scene = Scene(world_of(start=(4.0, 2.85, 0.0), walls=walls, walkers=[walker]))
    states = walk(scene, 400)
    side = np.sign(states[0, 0] - 4.0)
    assert (np.sign(states[:, 0] - 4.0) == side).all()
    assert np.count_nonzero(np.diff(np.sign(states[:, 2]))) >= 4


def test_people_in_a_narrow_corridor_push_the_robot_nowhere():
    """It stands where two of them cannot pass; they turn round, and do not sink into the walls."""
    walls = [[0.0, 1.0, 8.0, 1.0]]
    walkers = [Walker(route=((0.5, 0.5), (7.5, 0.5))) for _ in range(5)]
    scene = Scene(world_of(start=(4.0, 0.35, 0.0), walls=walls, walkers=walkers))
    travelled = np.zeros(5)
    for _ in range(600):
        before = scene.walkers
        scene.steps(1)
        travelled += np.hypot(*(scene.walkers - before)[:, :2].T)
        assert gap_of(scene, 4.0, 0.35) < 0.02
        beyond = np.maximum(-scene.segments[:, 1], scene.segments[:, 1] - 1.0)
        assert beyond.max() < 0.04
    assert travelled.min() > 10.0


def test_people_press_no_light_box_into_a_wall():
    """A robot drives about among three boxes and two people in a narrow room."""
    boxes = [
        Box(at=(1.6 + k, 0.35), heading=0.2, length=0.3, width=0.3, mass=0.5) for k in (0, 1, 2)
    ]
    routes = [((0.5, 1.2), (5.5, 1.2)), ((0.5, 1.0), (5.5, 1.0))]
    walkers = [Walker(route=route, speed=(1.0, 2.0)) for route in routes]
    for key in range(3):
        world = world_of(start=(0.6, 0.75, 0.0), size=(6.0, 1.5), boxes=boxes, walkers=walkers)
        scene = Scene(world, key)
        rng = np.random.default_rng(key)
        for step in range(1500):
            if step % 25 == 0:
                turn_rate = rng.uniform(-2, 2) * rng.integers(0, 2)
            scene.steps(1, 1.0, turn_rate)
            corners = scene.segments[:12]
            beyond = np.maximum(-corners, corners - (6.0, 1.5, 6.0, 1.5))
            assert beyond.max() < Limits().box_overlap


def test_walkers_pass_each_other_without_touching():
    routes = [((1.0, 3.0), (7.0, 3.0)), ((7.0, 3.0), (1.0, 3.0)), ((4.0, 1.0), (4.0, 5.0))]
    scene = Scene(
        world_of(start=(0.4, 5.5, 0.0), walkers=[Walker(route=route) for route in routes])
    )
    nearest = np.inf
    for _ in range(600):
        scene.steps(1)
        places = scene.walkers[:, :2]
        gaps = np.hypot(*(places[:, np.newaxis] - places).T) + 9 * np.eye(3)
        nearest = min(nearest, gaps.min())
    assert nearest > 0.46


@pytest.mark.parametrize("key", range(8))
def test_walkers_begin_on_their_routes_off_the_robot_and_off_the_doors(key):
    door = Door(hinge=(3.0, 3.0), heading=0.0, width=1.0, opening=math.pi)
    walkers = [Walker(route=((1.0, 3.5), (7.0, 3.5))) for _ in range(2)]
    scene = Scene(world_of(start=(5.0, 3.5, 0.0), doors=[door], walkers=walkers), key)
    for x, y, vx, vy in scene.walkers:
        assert (y, vx, vy) == (3.5, 0, 0)
        assert gap_of(scene, x, y) >= 1.0
        assert shapely.Point(x, y).distance(door.sweep) >= 0.25


def test_a_walker_on_whose_route_the_robot_stands_begins_off_it():
    """Routes are so long that the farthest waypoint is always free."""
    walker = Walker(route=((3.0, 3.0), (4.05, 3.0)))
    for x in (3.0, 3.5, 4.05):
        for key in range(5):
            scene = Scene(world_of(start=(x, 3.0, 0.0), walkers=[walker]), key)
            assert gap_of(scene, *scene.walkers[0, :2]) > 0.5

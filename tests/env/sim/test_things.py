"""Doors, boxes and walkers among robots: closed forms, laws, and rays that see them."""

from __future__ import annotations

import math
import sys
from itertools import pairwise
from pathlib import Path

import numpy as np
import pymunk
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from albot_env.sim import LMS_200
from albot_env.sim.rays import RayCaster
from albot_env.sim.space import PHYSICS_STEP
from albot_env.sim.thing_bodies import FLOOR_FRICTION, lever
from albot_env.sim.thing_kernels import SIDES
from albot_maps import Box, Door, Walker

sys.path.insert(0, str(Path(__file__).parent))
from things_scene import CONTROL_STEP, Scene, world_of

GRAVITY = 9.81
ROBOTS = pymunk.ShapeFilter(group=1)


def gap_of(scene: Scene, x: float, y: float) -> float:
    """Distance of the robot's middle from a point."""
    return math.hypot(scene.robot[0] - x, scene.robot[1] - y)


# Boxes


def test_a_box_slides_as_far_as_friction_lets_it():
    """v² / (2 μ g), straight on, and without turning; it is slowed after its first step."""
    scene = Scene(world_of(boxes=[Box(at=(3.0, 4.0))]))
    scene.body(1).velocity = 2.0, 0.0
    scene.steps(20)
    slid = scene.boxes[0] - (3, 4, 0)
    way = 2.0**2 / (2 * FLOOR_FRICTION * GRAVITY) + 2.0 * PHYSICS_STEP / 2
    assert slid[0] == pytest.approx(way, rel=0.02)
    assert slid[1:] == pytest.approx([0, 0], abs=1e-9)
    resting = scene.boxes
    scene.steps(5)
    assert np.array_equal(scene.boxes, resting)


@pytest.mark.parametrize(("length", "width"), [(0.5, 0.5), (1.2, 0.3)])
def test_a_box_that_spins_is_stopped_by_friction(length, width):
    """ω² I / (2 μ m g r), r the mean distance of its points from its middle."""
    box = Box(at=(3.0, 4.0), length=length, width=width)
    scene = Scene(world_of(boxes=[box]))
    scene.body(1).angular_velocity = 6.0
    scene.steps(30)
    inertia = (length**2 + width**2) / 12
    turned = 6.0**2 * inertia / (2 * FLOOR_FRICTION * GRAVITY * lever(length, width))
    assert scene.boxes[0, 2] == pytest.approx(turned + 6.0 * PHYSICS_STEP / 2, rel=0.02)


@pytest.mark.parametrize(("length", "width"), [(0.5, 0.5), (1.2, 0.3), (0.2, 3.0)])
def test_the_lever_is_the_mean_distance_of_the_points(length, width):
    points = (np.arange(1000) + 0.5) / 1000 - 0.5
    x, y = np.meshgrid(points * length, points * width)
    assert lever(length, width) == pytest.approx(np.hypot(x, y).mean(), rel=1e-5)


def test_a_robot_pushes_a_box_to_the_wall_and_no_further():
    scene = Scene(world_of(boxes=[Box(at=(3.0, 1.0), length=0.5, width=0.5)]))
    scene.steps(50, 0.5)
    assert scene.boxes[0, 0] == pytest.approx(scene.robot[0] + 0.5, abs=0.01)
    assert scene.robots.touched[0, 1]
    scene.steps(120, 1.6)
    assert scene.boxes[0, 0] == pytest.approx(7.75, abs=0.005)
    assert scene.robot[0] == pytest.approx(7.25, abs=0.01)


def test_a_box_that_is_too_heavy_stays():
    """The tyres push 0.6 times 13.5 kg; 0.4 times 25 kg is more."""
    scene = Scene(world_of(boxes=[Box(at=(2.0, 1.0), mass=25.0)]))
    scene.steps(60, 0.3)
    assert scene.boxes[0, 0] == pytest.approx(2.0, abs=0.03)
    assert scene.robot[0] < 1.53


# Doors

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


def inside(scene: Scene, clearance: float) -> bool:
    """Whether the robot's middle is so far inside the outer walls (m)."""
    x, y = scene.robot[:2]
    left, low, right, high = scene.world.bounds
    return min(x - left, y - low, right - x, high - y) >= clearance


# Walkers


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


# What is seen


def test_rays_see_each_thing_where_it_is():
    """A leaf, a box turned by 45° and a walker's nearest corner or side, straight ahead."""
    door = Door(hinge=(6.0, 1.5), heading=0.0, width=1.0, shut_for=(60.0, 60.0), turn_rate=3.0)
    box = Box(at=(3.0, 3.0), heading=math.pi / 4, length=0.6, width=0.6)
    walker = Walker(route=((3.0, 5.0), (7.0, 5.0)))
    scene = Scene(world_of(doors=[door], boxes=[box], walkers=[walker]))
    while scene.doors[0] > 1e-9:
        scene.steps(1)
    assert ahead(scene, (6.5, 0.3, math.pi / 2)) == pytest.approx(1.2, abs=1e-6)
    assert ahead(scene, (1.0, 3.0, 0.0)) == pytest.approx(2.0 - 0.3 * math.sqrt(2), abs=1e-6)
    x, y = scene.walkers[0, :2]
    assert ahead(scene, (1.0, y, 0.0)) == pytest.approx(x - 1 - 0.25, abs=1e-6)
    apothem = 0.25 * math.cos(math.pi / SIDES)
    slant = math.pi / SIDES
    back = 1.0
    place = x - back * math.cos(slant), y - back * math.sin(slant), slant
    assert ahead(scene, place) == pytest.approx(back - apothem, abs=1e-6)


def ahead(scene: Scene, pose: tuple[float, float, float]) -> float:
    """Range (m) of a beam from a pose straight ahead, to walls and things."""
    geometry = LMS_200.geometry
    walls = np.concatenate((scene.world.walls, scene.segments))
    x, y, heading = geometry.mount
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    robot = np.array([pose[0] - cos * x + sin * y, pose[1] - sin * x - cos * y, pose[2] - heading])
    return float(RayCaster(walls, geometry, indexed=False).scan(robot)[geometry.beams // 2])


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 2**64 - 1), st.integers(1, 30))
def test_what_rays_see_is_what_contacts_meet(key, steps):
    """Pymunk's own query along many rays gives the same ranges as the segments."""
    scene = crowd(key)
    scene.steps(steps, 0.6, 0.3)
    x, y, _ = scene.robot[:3]
    lines = shapely.MultiLineString([((a, b), (c, d)) for a, b, c, d in scene.segments])
    others = shapely.MultiLineString([((a, b), (c, d)) for a, b, c, d in scene.world.walls])
    for bearing in np.linspace(0.01, 6.28, 60):
        far = (x + 20 * math.cos(bearing), y + 20 * math.sin(bearing))
        hit = scene.floor.space.segment_query_first((x, y), far, 0.0, ROBOTS)
        ray = shapely.LineString([(x, y), far])
        met = [ray.intersection(shape) for shape in (lines, others)]
        near = min(shapely.Point(x, y).distance(each) for each in met if not each.is_empty)
        assert 20 * hit.alpha == pytest.approx(near, abs=2e-3)


def crowd(key: int) -> Scene:
    """A robot among two doors, three boxes and three people."""
    doors = [
        Door(
            hinge=(4.0, 2.5),
            heading=math.pi / 2,
            width=1.0,
            shut_for=(0.5, 3.0),
            open_for=(0.5, 3.0),
        )
    ]
    boxes = [
        Box(at=(1.5, 2.2)),
        Box(at=(6.0, 2.0), heading=0.4, length=1.0, width=0.3, mass=8.0),
        Box(at=(6.0, 5.4), mass=2.0),
    ]
    walkers = [
        Walker(route=((0.6, 3.0), (7.4, 3.0))),
        Walker(route=((1.0, 5.0), (3.0, 5.0), (3.0, 1.0)), closed=True, speed=(0.5, 2.0)),
        Walker(route=((7.0, 0.5), (7.0, 5.0)), radius=0.2),
    ]
    walls = [[4.0, 0.0, 4.0, 2.5], [4.0, 3.5, 4.0, 6.0]]
    return Scene(
        world_of(walls=walls, doors=doors, boxes=boxes, walkers=walkers), key, (1.0, 1.0, 0.0)
    )


# Seeds


def history(scene: Scene, seed: int, steps: int) -> np.ndarray:
    """The robot's state and all segments at each of so many steps of a random drive."""
    rng = np.random.default_rng(seed)
    rows = []
    for _ in range(steps):
        scene.steps(1, *rng.uniform((-0.5, -2), (1.6, 2)))
        rows.append(np.concatenate((scene.robot, scene.segments.ravel())))
    return np.array(rows)


def test_twins_move_alike_to_the_last_bit_whatever_was_before():
    first = history(crowd(5), 1, 300)
    scene = crowd(6)
    assert not np.array_equal(history(scene, 1, 300), first)
    scene.begin(5, (1.0, 1.0, 0.0))
    assert np.array_equal(history(scene, 1, 300), first)


def test_other_keys_begin_otherwise():
    starts = {tuple(crowd(key).segments.ravel()) for key in range(20)}
    assert len(starts) == 20


# Safety


@pytest.mark.parametrize("key", range(4))
def test_a_random_drive_among_people_stays_inside_the_walls(key):
    """So do the boxes and the people."""
    scene = crowd(key)
    rng = np.random.default_rng(key)
    speed, turn_rate = 1.0, 0.0
    for _ in range(1500):
        if rng.random() < 0.1:
            speed, turn_rate = rng.uniform((-1.6, -3), (1.6, 3))
        scene.steps(1, speed, turn_rate)
        assert np.isfinite(scene.robot).all()
        assert inside(scene, 0.2)
        # In one physics step a thing goes 13 cm at most, and is then pushed out.
        points = scene.segments.reshape(-1, 2)
        assert (points > -0.13).all()
        assert (points < np.array([8.13, 6.13])).all()
        places = np.concatenate((scene.boxes[:, :2], scene.walkers[:, :2]))
        assert (places > 0.1).all()
        assert (places < np.array([7.9, 5.9])).all()
    scene.steps(10)
    assert (scene.segments.reshape(-1, 2) > -0.02).all()
    assert scene.robots.touched[0, 1]

"""Obstacles together: rays that see them, twins, walls that hold them; closed forms of boxes."""

from __future__ import annotations

import math

import numpy as np
import pymunk
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from albot_env.sim import LMS_200
from albot_env.sim.laser import RayCaster
from albot_env.sim.obstacle_tables import SIDES
from albot_env.sim.obstacles import FLOOR_FRICTION, lever
from albot_env.sim.physics import PHYSICS_STEP, SHORT_STEPS
from albot_env.stress.checks import Limits
from albot_maps import Box, Door, Walker
from tests.env.sim.obstacle_scene import Scene, crowd, inside, world_of

ROBOTS = pymunk.ShapeFilter(group=1)
LIMITS = Limits()


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
    """Range (m) of a beam from a pose straight ahead, to walls and obstacles."""
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
        hit = scene.space.space.segment_query_first((x, y), far, 0.0, ROBOTS)
        ray = shapely.LineString([(x, y), far])
        met = [ray.intersection(shape) for shape in (lines, others)]
        near = min(shapely.Point(x, y).distance(each) for each in met if not each.is_empty)
        assert 20 * hit.alpha == pytest.approx(near, abs=2e-3)


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
        # In one of Chipmunk's steps a thing goes 3 cm at most, and is then pushed out.
        points = scene.segments.reshape(-1, 2)
        assert (points > -0.03).all()
        assert (points < np.array([8.03, 6.03])).all()
        places = np.concatenate((scene.boxes[:, :2], scene.walkers[:, :2]))
        assert (places > 0.1).all()
        assert (places < np.array([7.9, 5.9])).all()
    scene.steps(10)
    assert (scene.segments.reshape(-1, 2) > -0.02).all()
    assert scene.robots.touched[0, 1]


GRAVITY = 9.81
SOLVER_STEP = PHYSICS_STEP / SHORT_STEPS


def test_a_box_slides_as_far_as_friction_lets_it():
    """v² / (2 μ g), straight on, and without turning; it is slowed after its first step."""
    scene = Scene(world_of(boxes=[Box(at=(3.0, 4.0))]))
    scene.body(1).velocity = 2.0, 0.0
    scene.steps(20)
    slid = scene.boxes[0] - (3, 4, 0)
    way = 2.0**2 / (2 * FLOOR_FRICTION * GRAVITY) + 2.0 * SOLVER_STEP / 2
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
    assert scene.boxes[0, 2] == pytest.approx(turned + 6.0 * SOLVER_STEP / 2, rel=0.02)


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


@pytest.mark.parametrize(("side", "mass"), [(0.3, 0.5), (0.3, 2.0), (0.5, 0.5), (1.2, 0.5)])
def test_no_push_gets_a_box_through_a_wall(side, mass):
    """A light box between a heavy robot and a wall, met at any angle, in a narrow room."""
    box = Box(at=(2.5, 0.75), heading=0.2, length=side, width=min(side, 0.5), mass=mass)
    for key in range(2):
        scene = Scene(world_of(start=(0.6, 0.75, 0.0), size=(6.0, 1.5), boxes=[box]), key)
        rng = np.random.default_rng(key)
        pushed = 0
        for step in range(1500):
            if step % 25 == 0:
                turn_rate = rng.uniform(-2, 2) * rng.integers(0, 2)
            scene.steps(1, 1.0, turn_rate)
            pushed += int(scene.robots.touched[0, 0])
            beyond = np.maximum(-scene.segments, scene.segments - (6.0, 1.5, 6.0, 1.5))
            assert beyond.max() < LIMITS.box_overlap
        assert pushed > 150


def test_a_box_that_is_too_heavy_stays():
    """The tyres push 0.6 times 13.5 kg; 0.4 times 25 kg is more."""
    scene = Scene(world_of(boxes=[Box(at=(2.0, 1.0), mass=25.0)]))
    scene.steps(60, 0.3)
    assert scene.boxes[0, 0] == pytest.approx(2.0, abs=0.03)
    assert scene.robot[0] < 1.53

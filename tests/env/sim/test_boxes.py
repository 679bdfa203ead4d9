"""Boxes among robots: closed forms of sliding and spinning, and what pushes them."""

from __future__ import annotations

import numpy as np
import pytest

from albot_env.sim.obstacles import FLOOR_FRICTION, lever
from albot_env.sim.physics import PHYSICS_STEP
from albot_maps import Box
from tests.env.sim.obstacle_scene import Scene, world_of

GRAVITY = 9.81


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

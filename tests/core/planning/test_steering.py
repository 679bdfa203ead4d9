"""Steering: what is left between the robot and things."""

from __future__ import annotations

import numpy as np
import pytest

from albot_core.geometry.poses import inverse, transform_points
from albot_core.planning.steering import SteeringConfig, admissible_command


@pytest.mark.parametrize("bearing", [-1.47, -0.8, 0.0, 0.5, 1.3])
def test_many_small_steps_past_a_corner_do_not_end_in_touching_it(bearing: float) -> None:
    config = SteeringConfig()
    points = 0.285 * np.array(((np.cos(bearing), np.sin(bearing)),))
    motion = np.zeros(3)
    nearest = np.inf
    for _ in range(60):
        speed, turn_rate = admissible_command(np.array((0.1, 0.0)), points, motion, config)
        motion = np.array((speed * config.step, 0.0, turn_rate * config.step))
        points = transform_points(inverse(motion), points)
        nearest = min(nearest, float(np.hypot(*points[0])))
    assert nearest > config.robot.radius + 0.01

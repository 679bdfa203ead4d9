"""Times and poses as Foxglove has them."""

from __future__ import annotations

import math

import numpy as np
import pytest

from albot_env.recording.foxglove import nanoseconds, pose_of, time_of


@pytest.mark.parametrize("step", [0, 3, 29, 41, 82, 164, 343, 4_567, 36_001])
def test_a_time_is_the_nearest_nanosecond(step: int) -> None:
    """A tenth of a second is no binary fraction: cut off, 4.1 s are a nanosecond short."""
    stamp = step / 10
    assert nanoseconds(stamp) == step * 100_000_000
    assert nanoseconds(step * 0.1) == step * 100_000_000
    assert time_of(stamp) == {"sec": step // 10, "nsec": step % 10 * 100_000_000}


def test_a_heading_is_a_turn_about_the_vertical() -> None:
    pose = pose_of(np.array((1.0, -2.0, math.pi / 3)))
    assert pose["position"] == {"x": 1.0, "y": -2.0, "z": 0.0}
    turn = pose["orientation"]
    assert (turn["x"], turn["y"]) == (0.0, 0.0)
    assert (turn["z"], turn["w"]) == pytest.approx((0.5, math.sqrt(0.75)))

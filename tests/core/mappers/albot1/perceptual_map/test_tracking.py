"""Landmarks that are followed from view to view localise the robot together."""

from __future__ import annotations

import numpy as np
import pytest

from albot_core.geometry.poses import compose
from albot_core.mappers.albot1.config import Albot1Config
from albot_core.mappers.albot1.perceptual_map.memory import NOT_RECOGNIZED
from albot_core.mappers.albot1.perceptual_map.tracking import localize_jointly
from tests.core.mappers.albot1.perceptual_map.test_localization import scene

LIMITS = Albot1Config.tracked().limits


@pytest.mark.parametrize("pose", [(0.0, 0.0, 0.0), (0.3, 0.2, 0.8), (0.2, 0.1, -2.5)])
def test_the_robot_is_where_all_landmarks_lie_on_the_map(pose: tuple[float, ...]) -> None:
    """But for what the odometer's pose holds it back."""
    pm, view, pairs = scene(np.array(pose))
    pairs["end"][:4] = 0, 1, 0, 1
    view.pose[:] = pose
    localize_jointly(pm, view, pairs, LIMITS)
    np.testing.assert_allclose(view.pose, pose, atol=1e-9)
    view.pose[:] = compose(np.array(pose), np.array((0.05, -0.04, 0.03)))
    localize_jointly(pm, view, pairs, LIMITS)
    np.testing.assert_allclose(view.pose, pose, atol=0.02)


def test_without_a_landmark_the_robot_is_where_the_odometer_has_it() -> None:
    pm, view, pairs = scene(np.zeros(3))
    view.slots[:], view.pose[:] = NOT_RECOGNIZED, (0.3, -0.2, 0.4)
    localize_jointly(pm, view, pairs, LIMITS)
    np.testing.assert_allclose(view.pose, (0.3, -0.2, 0.4))

"""Small worlds with known answers."""

from __future__ import annotations

import numpy as np
import pytest

from albot_maps.world import World


@pytest.fixture(scope="session")
def box() -> World:
    """A square room of 10 m with its corner at the origin; the start is its middle, facing +x."""
    corners = np.array([(0.0, 0.0), (10.0, 0.0), (10.0, 10.0), (0.0, 10.0)])
    walls = np.hstack((corners, np.roll(corners, -1, axis=0)))
    return World(name="box", walls=walls, starts=np.array([[5.0, 5.0, 0.0]]))

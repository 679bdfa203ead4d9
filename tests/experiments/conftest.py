"""A journey that several tests follow."""

from __future__ import annotations

import numpy as np
import pytest

from albot_experiments.albot1_c1 import loop_from
from albot_experiments.tours import TourRecord, guided_tour
from albot_maps import load_world


@pytest.fixture(scope="session")
def ring_journey() -> TourRecord:
    """Once round the ring and on to the tour's second waypoint, in steps of 1 m and 45°."""
    world = load_world("office-ring")
    tour = loop_from(world.tours["single-loop"], 0)
    return guided_tour(world, tour, np.random.default_rng(0))

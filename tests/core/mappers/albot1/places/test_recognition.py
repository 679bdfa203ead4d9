"""When two places are taken for one (algorithm 6)."""

from __future__ import annotations

import numpy as np
import pytest

from albot_core.geometry.types import Pose
from albot_core.mappers.albot1.config import PlacesConfig
from albot_core.mappers.albot1.places.events import EventKind
from tests.core.mappers.albot1.building import RING, Walker, walls_of

AT_THE_WALL = -3.5
"""The y coordinate of a point in the first room, with all walls on one side (m)."""


class Standing(Walker):
    """A robot that stands at a pose of its map when places are compared."""

    at: Pose | None = None

    def pose(self, share: float = 0.0) -> np.ndarray:
        return super().pose(share) if self.at is None else self.at


def home_again(config: PlacesConfig) -> Standing:
    """A robot that has gone round the ring, and has not recognised the room yet."""
    walker = Standing(config)
    for room in RING:
        walker.go(room)
    return walker


@pytest.mark.parametrize("config", [PlacesConfig(), PlacesConfig.thesis()], ids=["ours", "thesis"])
@pytest.mark.parametrize(("heading", "side"), [(0.0, "left"), (np.pi, "right")])
def test_a_match_on_one_side_of_the_robot_is_refused_however_many_surfaces_match(
    config: PlacesConfig, heading: float, side: str
) -> None:
    assert (walls_of((0, 0))[:, 1::2].mean(1) > AT_THE_WALL).all()
    walker = home_again(config)
    walker.at = np.array([0.0, AT_THE_WALL, heading])
    assert not walker.recognize()
    event = walker.network.log.events[-1]
    assert (event.kind, event.other) == (EventKind.REFUSED, 0)
    assert event.matches == getattr(event, side) > config.min_matches
    assert event.probability == 0.0  # Nothing is weighed either.
    assert walker.network.current == 4
    # With walls on both sides it is the same place.
    walker.at = None
    assert walker.recognize()
    assert walker.network.current == 0

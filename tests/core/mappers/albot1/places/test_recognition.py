"""When two places are taken for one (algorithm 6)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from albot_core.geometry.poses import transform_segments
from albot_core.geometry.types import Pose, Segments
from albot_core.mappers.albot1.config import PlacesConfig
from albot_core.mappers.albot1.places.events import EventKind
from tests.core.mappers.albot1.building import RING, Walker, walls_of

AT_THE_WALL = -3.5
"""The y coordinate of a point in the first room, with all walls on one side (m)."""


class Standing(Walker):
    """A robot that stands at a pose of its map when places are compared."""

    at: Pose | None = None
    beside: Segments | None = None

    def seen(self) -> np.ndarray:
        return super().seen() if self.beside is None else self.beside

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


@pytest.mark.parametrize("first", [True, False])
def test_in_the_thesis_the_first_match_on_both_sides_is_enough(first: bool) -> None:
    """Ten walls match beside the robot, and six around it; to the letter the six are enough."""
    assert PlacesConfig.thesis().takes_first_match
    walker = home_again(replace(PlacesConfig.thesis(), takes_first_match=first))
    room = walls_of((0, 0))
    aside = transform_segments(np.array([0.0, 30.0, 0.0]), room)
    walker.beside = np.concatenate((aside, room[:6]))
    assert walker.recognize() == first
    event = walker.network.log.events[-1]
    assert (event.kind, event.matches) == (
        (EventKind.RECOGNIZED, 6) if first else (EventKind.REFUSED, 10)
    )
    if first:
        np.testing.assert_allclose(walker.network.frame, np.zeros(3), atol=1e-6)

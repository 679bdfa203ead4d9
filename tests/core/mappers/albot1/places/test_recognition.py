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


@pytest.mark.parametrize("keeps", [False, True])
def test_in_the_thesis_a_place_is_laid_where_it_was_found(keeps: bool) -> None:
    """The map is off by 0.2 m, at which as many surfaces match as where the place was found."""
    assert not PlacesConfig.thesis().keeps_believed_pose
    walker = home_again(replace(PlacesConfig.thesis(), keeps_believed_pose=keeps))
    off = np.array([0.2, 0.1, 0.0])
    walker.beside = transform_segments(off, walls_of((0, 0)))
    assert walker.recognize()
    expected = np.zeros(3) if keeps else off
    np.testing.assert_allclose(walker.network.frame, expected, atol=1e-6)


@pytest.mark.parametrize("within", [False, True])
def test_in_the_thesis_the_robot_need_not_stand_within_the_place(within: bool) -> None:
    """It sees the room's walls through the door, from the room beyond."""
    assert not PlacesConfig.thesis().must_stand_within
    walker = home_again(replace(PlacesConfig.thesis(), must_stand_within=within))
    (door, *_) = (d for d in walker.network.places[0].exits if d.leads_to == 1)
    middle = 0.5 * (door.line[:2] + door.line[2:])
    walker.at = np.array([middle[0] + 1.5, middle[1], np.pi])
    assert walker.recognize() != within

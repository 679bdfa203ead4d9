"""What a network says of exits and surfaces is held against the true floor."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from albot_core.geometry.poses import relative, transform_segments
from albot_core.geometry.types import Segments
from albot_core.mappers.albot1.mapper import Albot1
from albot_core.mappers.albot1.places.network_view import Exit, Network, Place
from albot_core.sensing.reading import Reading
from albot_experiments.albot1_places import Crossing, PlacedTour
from albot_experiments.albot1_truth import Judged, judge_network
from albot_experiments.tours import TourRecord
from albot_maps import Room, World
from albot_maps.world import Exit as Door
from tests.core.scenes import scan_from

WALLS = np.array(
    [
        (0.0, 0.0, 8.0, 0.0),
        (8.0, 0.0, 8.0, 6.0),
        (8.0, 6.0, 0.0, 6.0),
        (0.0, 6.0, 0.0, 0.0),
        (4.0, 0.0, 4.0, 2.5),
        (4.0, 3.5, 4.0, 6.0),
    ]
)
"""Two rooms of 4 × 6 m, with a door of 1 m in the middle of the wall between them."""
DOOR = np.array((4.0, 2.5, 4.0, 3.5))
IN_WEST, IN_EAST = np.array((1.5, 3.0, 0.0)), np.array((4.6, 3.0, 0.3))
"""Where the robot sets out, and where it begins the place behind the door."""


@pytest.fixture(scope="module")
def two_rooms() -> World:
    west, east = (np.array([(x, 0), (x + 4, 0), (x + 4, 6), (x, 6)], float) for x in (0, 4))
    return World(
        name="two rooms",
        walls=WALLS,
        starts=IN_WEST[None],
        rooms=(Room(name="W", boundary=west), Room(name="E", boundary=east)),
        exits=(Door(name="D", segment=DOOR, rooms=("W", "E")),),
    )


def walked() -> TourRecord:
    """A look round in the western room, the same in the eastern one, and a last view."""
    places = (1.5, 0.0), (1.5, np.pi), (6.0, 0.0), (6.0, np.pi), (6.5, 0.0)
    truth = np.array([(x, 3.0, heading) for x, heading in places])
    readings = tuple(
        Reading(stamp=float(k), motion=np.zeros(3), laser=scan_from(pose, WALLS))
        for k, pose in enumerate(truth)
    )
    return TourRecord(readings=readings, truth=truth)


class Remembered(Albot1):
    """A mapper that remembers a network."""

    remembered: Network

    @property
    def network(self) -> Network:
        return self.remembered


def room(pose: np.ndarray, walls: Segments, door: Segments, leads_to: int, number: int) -> Place:
    """A place as it truly is, in the frame of the pose at which it began."""
    frame = relative(pose, np.zeros(3))
    line = transform_segments(frame, door[None])[0]
    exits = (Exit(line=line, leads_to=leads_to, exit_there=0),)
    return Place(
        id=number, frame=np.zeros(3), surfaces=transform_segments(frame, walls), exits=exits
    )


def true_network() -> Network:
    west, east = WALLS[[0, 3, 4, 5, 2]], WALLS[[0, 1, 2, 4, 5]]
    return Network(
        places=(room(IN_WEST, west, DOOR, 1, 0), room(IN_EAST, east, DOOR[[2, 3, 0, 1]], 0, 1))
    )


def judged(world: World, network: Network, places: tuple[int, ...] = (0, 0, 1, 1, 1)) -> Judged:
    mapper, nowhere = Remembered(), np.full(4, np.nan)
    mapper.remembered = network
    placed = PlacedTour(
        journey=walked(),
        mapper=mapper,
        poses=walked().truth,
        places=np.array(places),
        crossings=(Crossing(view=4, exit="D", seen=nowhere, expected=nowhere),),
        frames={0: IN_WEST, 1: IN_EAST},
    )
    truth = judge_network(placed, world)
    return Judged(placed=placed, is_right=True, truth=truth)


def changed(place: Place, **fields: object) -> Network:
    """The true network with fields of its second place's exit, or of the place, changed."""
    west, east = true_network().places
    if "surfaces" in fields:
        return Network(places=(west, replace(east, **fields)))  # type: ignore[arg-type]
    return Network(
        places=(west, replace(east, exits=(replace(east.exits[0], **fields),)))  # type: ignore[arg-type]
    )


def test_a_network_that_is_the_floor_is_all_right(two_rooms: World) -> None:
    found = judged(two_rooms, true_network())
    assert found.is_reached
    assert found.truth.exits_right == found.truth.surfaces_on_walls == 1.0
    assert found.truth.exits_off == pytest.approx(0.0, abs=1e-9)
    assert found.truth.walls_described > 0.99


EAST = true_network().places[1]


@pytest.mark.parametrize(
    ("fields", "right"),
    [
        ({"line": EAST.exits[0].line + np.full(4, 0.5)}, 1.0),
        ({"line": EAST.exits[0].line + np.full(4, 1.5)}, 0.0),  # nor is it the other's partner
        ({"leads_to": 1}, 0.5),
        ({"exit_there": 1}, 0.5),
        ({"exit_there": 7}, 0.5),
    ],
)
def test_each_of_an_exit_s_three_values_is_judged(
    two_rooms: World, fields: dict[str, object], right: float
) -> None:
    found = judged(two_rooms, changed(EAST, **fields))
    assert found.truth.exits_right == right
    assert found.has_exits_right == found.is_reached == (right == 1.0)


def test_an_exit_missing_or_double_and_a_place_that_is_two_rooms_are_wrong(
    two_rooms: World,
) -> None:
    west, east = true_network().places
    missing = Network(places=(west, replace(east, exits=())))
    assert judged(two_rooms, missing).truth.exits_right == 0.0
    double = Network(places=(west, replace(east, exits=2 * east.exits)))
    assert judged(two_rooms, double).truth.exits_right == pytest.approx(2 / 3)
    assert judged(two_rooms, true_network(), (0, 1, 1, 1, 1)).truth.exits_right == 0.0


def test_walls_left_out_and_surfaces_that_are_no_walls_are_seen(two_rooms: World) -> None:
    less = judged(two_rooms, changed(EAST, surfaces=EAST.surfaces[:2]))
    assert less.truth.walls_described < 0.6
    assert less.truth.surfaces_on_walls == 1.0
    none = judged(two_rooms, changed(EAST, surfaces=np.empty((0, 4))))
    assert none.truth.walls_described == 0.0
    assert not none.is_described
    aside = EAST.surfaces + np.array((0.0, 1.0, 0.0, 1.0))
    moved = judged(two_rooms, changed(EAST, surfaces=np.concatenate((EAST.surfaces, aside))))
    assert moved.truth.walls_described > 0.99
    assert moved.truth.surfaces_on_walls < 0.9

"""What HSSH takes for evidence that two visits were to the same place."""

from __future__ import annotations

import numpy as np
import pytest

from albot_core.mappers.hssh.config import HsshConfig, PlaceConfig
from albot_core.mappers.hssh.visits import Visit, Visits

# The gateways of a room between (0, 0) and (4, 4): its two doors, east and west.
DOORS = np.array(((4.0, 1.5, 4.0, 2.5), (0.0, 2.5, 0.0, 1.5)))
SIDE = np.linspace(0.0, 4.0, 21)
WALLS = np.concatenate([
    np.stack((SIDE, np.zeros(21)), axis=1),
    np.stack((SIDE, np.full(21, 4.0)), axis=1),
])  # fmt: skip
BOTH = ((0, 0), (1, 1))


def visit(
    way: float = 0.0,
    *,
    unknown: tuple[int, ...] = (0,),
    walls: np.ndarray = WALLS,
    offset: tuple[float, float] = (0.0, 0.0),
) -> Visit:
    """A visit to the room after some way, with the odometry off by an offset."""
    return Visit(
        entered=int(way),
        way=way,
        arrived=1,
        left=0,
        middle=np.array((2.0, 2.0)) + offset,
        gateways=DOORS + np.tile(offset, 2),
        unknown=unknown,
        surface=walls + offset,
        open_ground=np.empty((0, 2)),
    )


def judged(
    earlier: Visit, later: Visit, common: tuple, *, closes_loop: bool, **places: float
) -> bool:
    """Whether the later visit can be to the place of the earlier one."""
    visits = Visits(HsshConfig(places=PlaceConfig(**places)))
    visits.begin(earlier)
    visits.begin(later)
    return visits.judge(0, common, closes_loop)


def test_a_room_seen_again_is_the_same():
    assert judged(visit(), visit(50.0), BOTH, closes_loop=True)
    assert judged(visit(), visit(50.0), BOTH, closes_loop=False)


@pytest.mark.parametrize("closes_loop", [True, False])
def test_places_not_seen_whole_need_common_walls(closes_loop):
    few, none = WALLS[:4], WALLS[:0]
    for walls in (few, none):
        later = visit(50.0, walls=walls)
        assert not judged(visit(), later, BOTH, closes_loop=closes_loop)
        assert judged(visit(), later, BOTH, closes_loop=closes_loop, evidence=0)
        # By the stars alone, as an experiment asks.
        assert judged(visit(), later, BOTH, closes_loop=closes_loop, overlap=0.0)
        whole = visit(unknown=()), visit(50.0, unknown=(), walls=walls)
        assert judged(*whole, BOTH, closes_loop=closes_loop)


def test_one_common_gateway_closes_no_loop_between_places_not_seen_whole():
    assert not judged(visit(), visit(50.0), BOTH[:1], closes_loop=True)
    whole = visit(unknown=()), visit(50.0, unknown=())
    assert judged(*whole, BOTH[:1], closes_loop=True)


@pytest.mark.parametrize("closes_loop", [True, False])
def test_the_odometer_errs_so_far_only(closes_loop):
    # 1 m, and 5 % of 50 m.
    assert judged(visit(), visit(50.0, offset=(3.4, 0.0)), BOTH, closes_loop=closes_loop)
    off = visit(50.0, offset=(3.6, 0.0))
    assert not judged(visit(), off, BOTH, closes_loop=closes_loop)
    assert judged(visit(), off, BOTH, closes_loop=closes_loop, drift=np.inf)

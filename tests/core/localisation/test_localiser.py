"""The localiser in buildings whose walls are known: when it decides, and when it must not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from albot_core.errors import InputError
from albot_core.localisation.config import LocaliserConfig
from albot_core.localisation.known_map import KnownMap
from albot_core.localisation.localiser import LOCALISED, LOST, UNDECIDED, Localiser
from tests.core.localisation.buildings import (
    BUILDING,
    OTHER,
    OTHER_TOUR,
    TOUR,
    TWINS,
    readings,
    snapshot,
)
from tests.core.mappers.slam.rooms import reading_from

CONFIG = LocaliserConfig()
KNOWN = KnownMap(snapshot(BUILDING, TOUR), CONFIG)
STARTS = (
    ((12, 2), (12, 5.2), (6.5, 5.5), (3, 6.5)),
    ((3, 7.5), (8.5, 5), (12.3, 5.2), (12.3, 8)),
    ((6.5, 1.5), (6.5, 5.5), (2, 5.5), (2, 1.5)),
)


def run(localiser: Localiser, found: list) -> list[tuple[int, float]]:
    """What the robot knows of its pose, and the error of it (m), at each reading."""
    rows = []
    for reading, pose in found:
        localiser.update(reading.laser, reading.motion)
        rows.append((localiser.standing, float(np.hypot(*(localiser.pose - pose)[:2]))))
    return rows


@pytest.mark.parametrize("way", STARTS)
def test_a_robot_finds_out_where_it_is(way):
    rows = run(Localiser(KNOWN, CONFIG), readings(way))
    standings = [standing for standing, _ in rows]
    assert standings[0] == UNDECIDED and standings[-1] == LOCALISED
    first = standings.index(LOCALISED)
    assert all(standing == LOCALISED for standing in standings[first:])
    assert max(error for _, error in rows[first:]) < 0.15


def test_one_look_never_decides_however_sure_it_is():
    localiser = Localiser(KNOWN, CONFIG)
    reading, pose = readings(STARTS[0])[0]
    for _ in range(30):
        localiser.update(reading.laser, np.zeros(3))
    assert localiser.standing == UNDECIDED
    assert np.hypot(*(localiser.hypotheses[0].pose - pose)[:2]) < 0.1
    for turn in np.arange(0.5, 6.5, 0.5):  # A look around, from the same place.
        seen = reading_from(pose + np.array((0.0, 0.0, turn)), np.array((0.0, 0.0, 0.5)), BUILDING)
        localiser.update(seen.laser, seen.motion)
    assert localiser.standing != LOCALISED


def test_between_two_like_halves_it_stays_undecided_and_says_so():
    twin = tuple((28 - x, 9 - y) for x, y in TOUR)
    known = KnownMap(snapshot(TWINS, TOUR, twin), CONFIG)
    localiser = Localiser(known, CONFIG)
    rows = run(localiser, readings((*STARTS[0], *STARTS[1]), TWINS))
    assert {standing for standing, _ in rows} == {UNDECIDED}
    first, second, *rest = localiser.hypotheses
    assert first.probability == pytest.approx(0.5, abs=0.4)
    assert first.probability + second.probability > 0.99
    assert sum(one.probability for one in rest) < 0.01
    # One is the other, turned about the middle.
    assert np.hypot(*(first.pose + second.pose - (28, 9, 0))[:2]) < 0.3


def test_a_robot_in_another_building_is_lost_and_never_sure():
    rows = run(Localiser(KNOWN, CONFIG), readings(OTHER_TOUR, OTHER))
    standings = [standing for standing, _ in rows]
    assert LOCALISED not in standings
    assert standings[-1] == LOST


def test_a_robot_that_is_carried_away_notices_and_finds_its_place_again():
    localiser = Localiser(KNOWN, CONFIG)
    run(localiser, readings(STARTS[0]))
    rows = run(localiser, readings((*STARTS[2], (2, 5.5), (12, 5.2), (12, 2))))
    standings = [standing for standing, _ in rows]
    assert LOST in standings
    assert standings[-1] == LOCALISED and rows[-1][1] < 0.15


def test_a_shut_door_and_new_furniture_do_not_mislead():
    changed = np.concatenate(
        (BUILDING, ((6, 4, 7, 4), (4.5, 8.2, 5.3, 8.2), (4.5, 8.2, 4.5, 8.9), (5.3, 8.2, 5.3, 8.9)))
    )
    rows = run(Localiser(KNOWN, CONFIG), readings((*STARTS[0], *STARTS[1]), changed))
    assert rows[-1][0] == LOCALISED and rows[-1][1] < 0.2
    assert all(error < 0.3 for standing, error in rows if standing == LOCALISED)


def test_without_the_second_look_a_first_one_would_decide():
    """What the rule is for: red if it no longer holds anything back."""
    hasty = replace(CONFIG, elsewhere=0.01, new_walls=1, certain=0.9)
    patient, quick = Localiser(KNOWN, CONFIG), Localiser(KNOWN, hasty)
    firsts = []
    for localiser in (patient, quick):
        standings = [standing for standing, _ in run(localiser, readings(STARTS[0]))]
        firsts.append(standings.index(LOCALISED))
    assert firsts[1] < firsts[0]


@pytest.mark.parametrize("after", [0, 1, 5, 40])
def test_a_restored_localiser_goes_on_as_if_never_stopped(after):
    found = readings(STARTS[0])
    one, other = Localiser(KNOWN, CONFIG), Localiser(KNOWN, CONFIG)
    run(one, found[:after])
    run(other, found[3:9])  # What it remembers must all be forgotten.
    other.restore(one.state())
    assert run(one, found[after:]) == run(other, found[after:])
    state, its = one.state(), other.state()
    assert all(np.array_equal(array, its[name]) for name, array in state.items())


@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("here", lambda array: array * np.nan),
        ("looks.counts", lambda array: array + 1),
        ("hypotheses.evidence", lambda array: array[:, :-1]),
        ("counts", lambda array: array + 7),
    ],
)
def test_a_state_that_no_localiser_made_is_refused(name, change):
    localiser = Localiser(KNOWN, CONFIG)
    run(localiser, readings(STARTS[0])[:8])
    state = localiser.state()
    with pytest.raises(InputError):
        localiser.restore({**state, name: change(state[name])})

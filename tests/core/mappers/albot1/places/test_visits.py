"""Visits: those of which nothing more can come are forgotten, and nobody sees a difference."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from albot_core.geometry.poses import relative
from albot_core.mappers.albot1 import handle_events
from albot_core.mappers.albot1.config import Albot1Config, PlacesConfig
from albot_core.mappers.albot1.mapper import Albot1
from albot_core.mappers.albot1.perceptual_map.memory import (
    CANDIDATE,
    NEVER,
    OBSERVED,
    VISIT,
    add_surface,
    count_reobserved,
    empty_map,
    remove_surface,
)
from albot_core.mappers.albot1.places.exits import CROSSING_SEEN, NOT_CROSSING, empty_exits
from albot_core.mappers.albot1.places.network import PlaceNetwork
from albot_core.mappers.albot1.places.place import LearnedPlace
from albot_core.mappers.albot1.places.recognition import _candidates, counting_visits
from albot_core.mappers.albot1.places.visits import (
    begin_visit,
    drop_candidates,
    keep_or_drop_candidate,
    marked_visits,
    may_compare,
    renumber_visits,
)
from albot_core.sensing.reading import Reading
from tests.core.scenes import FURNITURE, house_walk, scan_from, two_rooms

STABLE = np.full(2, 2, np.int8)


def test_visits_bear_other_numbers_and_nothing_else_changes() -> None:
    pm = empty_map()
    for visit in range(1, 6):
        for k in range(visit):
            add_surface(pm, np.array((visit, k, visit, k + 1.0)), STABLE)
        numbers = np.arange(visit + 2, dtype=np.int32)
        begin_visit(pm, numbers, np.where(numbers == 6, 5, numbers))
    for slot in range(1, 6):  # those of visits 2 and 3
        remove_surface(pm, slot)
    assert np.flatnonzero(marked_visits(pm)).tolist() == [1, 4, 5]
    pm.reobserved_in[6:8] = 6, 2
    pm.counts[CANDIDATE] = 5
    renumber_visits(pm, np.array((0, 1, -1, -1, 2, 3, 4)))
    assert pm.counts[[VISIT, CANDIDATE]].tolist() == [4, 3]
    assert pm.reobserved[:5, 1].tolist() == [0, 1, 4, 5, 6]
    assert pm.reobserved[:5, 2].tolist() == [0, 1, 2, 3, 3]  # The last counts for the one before.
    alive = pm.ids[: pm.counts[3]] >= 0
    old = {1: 1, 2: 4, 3: 5}
    for slot in np.flatnonzero(alive):
        assert pm.surfaces[slot, 0] == old[int(pm.marks[slot])]
    assert pm.reobserved_in[6:8].tolist() == [4, 0]


def test_the_first_visit_to_each_place_is_kept_and_the_present_one() -> None:
    network = PlaceNetwork(PlacesConfig.thesis())
    network.places |= {key: LearnedPlace(id=key, frame=np.zeros(3)) for key in (1, 2)}
    network.visits = [-1, 0, 1, 0, 1, 2, 1, 0]
    network.visit_transforms = [np.full(3, k) for k in range(8)]
    network.lost_since = 6
    wanted = np.zeros(8, np.bool_)
    wanted[3] = True
    assert network.keep_visits(wanted).tolist() == [0, 1, 2, 3, -1, 4, 5, 6]
    assert network.visits == [-1, 0, 1, 0, 2, 1, 0]
    assert [pose[0] for pose in network.visit_transforms] == [0, 1, 2, 3, 5, 6, 7]
    assert network.lost_since == 5


def test_of_visits_of_which_nothing_was_observed_the_last_to_each_place_is_a_candidate() -> None:
    network = PlaceNetwork(PlacesConfig.thesis())
    network.visits = [-1, 0, 1, 0, 1, 0, 2]
    reobserved = np.array((0, 0, 3, 0, 0, 0, 9), np.int32)
    gates = np.array((9, -1, -1, -1, -1, -1, 9), np.int32)
    assert _candidates(network, reobserved, gates) == [2, 4, 5]


def test_a_place_is_described_by_what_was_seen_of_it_last() -> None:
    config = replace(PlacesConfig.thesis(), max_surfaces=3)
    place = LearnedPlace(id=0, frame=np.zeros(3))
    walls = np.array([(0.0, k, 2.0, k) for k in range(5)])
    place.describe(walls[:3], config)
    place.describe(walls[3:], config)
    np.testing.assert_array_equal(place.surfaces, walls[2:])
    place.describe(walls[2:3] + 0.01, config)
    np.testing.assert_array_equal(place.surfaces, [*walls[3:], walls[2] + 0.01])


def test_a_robot_that_forgets_visits_maps_as_one_that_does_not(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """To and fro between two rooms; the odometer drifts, so that places become candidates."""
    path, house = house_walk(), np.concatenate((two_rooms(), FURNITURE))
    motions = relative(path[np.maximum(np.arange(len(path)) - 1, 0)], path)
    motions[1:, 2] += 0.004
    back = relative(path[-1], path[0])
    scans = [scan_from(pose, house) for pose in path]
    runs = []
    for every in (2, 10**9):
        monkeypatch.setattr(handle_events, "FORGET_VISITS_EVERY", every)
        mapper, seen, visits = Albot1(), [], []
        for lap in range(4):
            for k, (scan, motion) in enumerate(zip(scans, motions, strict=True)):
                way = back if lap and k == 0 else motion
                mapper.update(Reading(stamp=float(k), motion=way, laser=scan))
                seen.append(
                    np.concatenate(
                        (
                            mapper.estimate.pose,
                            mapper.estimate.home_from_robot,
                            mapper.snapshot().segments.ravel(),
                        )
                    )
                )
            visits.append(len(mapper.state()["places.visits"]))
        runs.append((np.concatenate(seen).tobytes(), mapper.events, visits[-1]))
    assert runs[0][:2] == runs[1][:2]
    assert runs[0][2] < runs[1][2] - 4


def test_candidates_that_need_no_surface_are_not_dropped() -> None:
    pm = empty_map()
    for gates in ((0, 3, NEVER), (0, 3, -1, NEVER), (0, -1, -2, -2, NEVER)):
        begin_visit(pm, np.array(gates, np.int32), np.arange(len(gates), dtype=np.int32))
        pm.counts[CANDIDATE] = 1
        drop_candidates(pm)
        assert pm.counts[CANDIDATE] == (np.argmin(gates) if min(gates) < 0 else 0)


@given(st.tuples(*3 * [st.floats(-2, 2)]), st.tuples(*3 * [st.floats(-2, 2)]))
def test_places_may_be_compared_once_the_robot_has_gone_or_turned_so_far(
    compared_from: tuple[float, float, float], pose: tuple[float, float, float]
) -> None:
    x, y, turn = relative(np.array(compared_from), np.array(pose))
    expected = np.hypot(x, y) >= 0.7 or abs(turn) >= 0.5
    assert may_compare(np.array(compared_from), np.array(pose), 0.7, 0.5) == expected
    assert may_compare(np.full(3, np.nan), np.array(pose), 0.7, 0.5)


@pytest.mark.parametrize("crossing", [NOT_CROSSING, CROSSING_SEEN])
@pytest.mark.parametrize("is_lost", [False, True])
@pytest.mark.parametrize("gone", [0.0, 5.0])
def test_places_are_compared_when_it_is_time_and_nowhere_between(
    crossing: int, is_lost: bool, gone: float
) -> None:
    pm, exits, limits = empty_map(), empty_exits(), Albot1Config().limits
    exits.counts[1] = crossing
    begin_visit(pm, np.array((0, 3, NEVER), np.int32), np.arange(3, dtype=np.int32))
    compared_from, here = np.zeros(3), np.array((gone, 0.0, 0.0))
    assert not keep_or_drop_candidate(pm, exits, compared_from, is_lost, here, True, limits)
    pm.counts[CANDIDATE] = 1
    is_time = crossing == NOT_CROSSING and gone > 0
    compares = keep_or_drop_candidate(pm, exits, compared_from, is_lost, here, False, limits)
    assert compares == is_time
    is_dropped = crossing == NOT_CROSSING and not is_time and not is_lost
    assert pm.counts[CANDIDATE] == (0 if is_dropped else 1)


@pytest.mark.parametrize("is_updated", [False, True])
@pytest.mark.parametrize("crossing", [NOT_CROSSING, CROSSING_SEEN])
def test_in_the_thesis_places_are_compared_at_every_update_and_only_there(
    is_updated: bool, crossing: int
) -> None:
    pm, exits, limits = empty_map(), empty_exits(), Albot1Config.thesis().limits
    exits.counts[1] = crossing
    begin_visit(pm, np.array((0, 3, NEVER), np.int32), np.arange(3, dtype=np.int32))
    here = np.zeros(3)  # Where places were compared last.
    assert not keep_or_drop_candidate(pm, exits, here, False, here, is_updated, limits)
    pm.counts[CANDIDATE] = 1
    assert keep_or_drop_candidate(pm, exits, here, False, here, is_updated, limits) == is_updated
    assert pm.counts[CANDIDATE] == 1


@pytest.mark.parametrize("config", [PlacesConfig(), PlacesConfig.thesis()], ids=["ours", "thesis"])
def test_surfaces_met_again_count_for_their_visit_and_in_the_thesis_for_their_place(
    config: PlacesConfig,
) -> None:
    """Two surfaces of the first visit to a place are met again, and two of the second."""
    network = PlaceNetwork(config)
    network.visits = [-1, 0, 1, 0, 2]
    counted_for = counting_visits(network)
    pm = empty_map()
    for visit in range(1, 5):
        for k in range(2):
            add_surface(pm, np.array((visit, k, visit, k + 1.0)), STABLE)
        size = visit + 2
        begin_visit(pm, np.full(size, 3, np.int32), np.append(counted_for, 5)[:size])
    for slot in (0, 1, 4, 5, 5):
        count_reobserved(pm, slot)
    if config.counts_by_place:
        assert pm.reobserved[:5, OBSERVED].tolist() == [0, 4, 0, 0, 0]
        assert pm.counts[CANDIDATE] == 1
    else:
        assert pm.reobserved[:5, OBSERVED].tolist() == [0, 2, 0, 2, 0]
        assert pm.counts[CANDIDATE] == 0

"""Visits: those of which nothing more can come are forgotten, and nobody sees a difference."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from albot_core.geometry.poses import relative
from albot_core.mappers.albot1 import attending
from albot_core.mappers.albot1.batch import Albot1Batch
from albot_core.mappers.albot1.config import Albot1Config, PlacesConfig
from albot_core.mappers.albot1.exits import GATE, NO_GATE, no_exits
from albot_core.mappers.albot1.following import has_cause_to_look
from albot_core.mappers.albot1.mapper import Albot1
from albot_core.mappers.albot1.memory import (
    NEVER,
    SUSPECT,
    VISIT,
    add_surface,
    empty_memory,
    remove_surface,
)
from albot_core.mappers.albot1.network import PlaceNetwork
from albot_core.mappers.albot1.places import Site
from albot_core.mappers.albot1.revisiting import _suspects
from albot_core.mappers.albot1.visits import (
    allay,
    begin_visit,
    is_time_to_look,
    marked_visits,
    renumber_visits,
)
from albot_core.sensing.reading import Reading
from tests.core.scenes import FURNITURE, house_walk, scan_from, two_rooms

STABLE = np.full(2, 2, np.int8)


def test_visits_bear_other_numbers_and_nothing_else_changes() -> None:
    memory = empty_memory()
    for visit in range(1, 6):
        for k in range(visit):
            add_surface(memory, np.array((visit, k, visit, k + 1.0)), STABLE)
        begin_visit(memory, np.arange(visit + 2, dtype=np.int32))
    for slot in range(1, 6):  # those of visits 2 and 3
        remove_surface(memory, slot)
    assert np.flatnonzero(marked_visits(memory)).tolist() == [1, 4, 5]
    memory.met_in[6:8] = 6, 2
    memory.counts[SUSPECT] = 5
    renumber_visits(memory, np.array((0, 1, -1, -1, 2, 3, 4)))
    assert memory.counts[[VISIT, SUSPECT]].tolist() == [4, 3]
    assert memory.met[:5, 1].tolist() == [0, 1, 4, 5, 6]
    alive = memory.ids[: memory.counts[3]] >= 0
    old = {1: 1, 2: 4, 3: 5}
    for slot in np.flatnonzero(alive):
        assert memory.surfaces[slot, 0] == old[int(memory.marks[slot])]
    assert memory.met_in[6:8].tolist() == [4, 0]


def test_the_first_visit_to_each_place_is_kept_and_the_present_one() -> None:
    network = PlaceNetwork(PlacesConfig.thesis())
    network.sites |= {key: Site(id=key, frame=np.zeros(3)) for key in (1, 2)}
    network.visits = [-1, 0, 1, 0, 1, 2, 1, 0]
    network.displacements = [np.full(3, k) for k in range(8)]
    network.lost_since = 6
    wanted = np.zeros(8, np.bool_)
    wanted[3] = True
    assert network.keep_visits(wanted).tolist() == [0, 1, 2, 3, -1, 4, 5, 6]
    assert network.visits == [-1, 0, 1, 0, 2, 1, 0]
    assert [pose[0] for pose in network.displacements] == [0, 1, 2, 3, 5, 6, 7]
    assert network.lost_since == 5


def test_of_visits_of_which_nothing_was_met_the_last_to_each_place_is_suspected() -> None:
    network = PlaceNetwork(PlacesConfig.thesis())
    network.visits = [-1, 0, 1, 0, 1, 0, 2]
    met = np.array((0, 0, 3, 0, 0, 0, 9), np.int32)
    needed = np.array((9, -1, -1, -1, -1, -1, 9), np.int32)
    assert _suspects(network, met, needed) == [2, 4, 5]


def test_a_place_is_described_by_what_was_seen_of_it_last() -> None:
    config = replace(PlacesConfig.thesis(), most_described=3)
    site = Site(id=0, frame=np.zeros(3))
    walls = np.array([(0.0, k, 2.0, k) for k in range(5)])
    site.describe(walls[:3], config)
    site.describe(walls[3:], config)
    np.testing.assert_array_equal(site.surfaces, walls[2:])
    site.describe(walls[2:3] + 0.01, config)
    np.testing.assert_array_equal(site.surfaces, [*walls[3:], walls[2] + 0.01])


def test_a_robot_that_forgets_visits_maps_as_one_that_does_not(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """To and fro between two rooms; the odometer drifts, so that places are suspected."""
    path, house = house_walk(), np.concatenate((two_rooms(), FURNITURE))
    motions = relative(path[np.maximum(np.arange(len(path)) - 1, 0)], path)
    motions[1:, 2] += 0.004
    back = relative(path[-1], path[0])
    scans = [scan_from(pose, house) for pose in path]
    runs = []
    for every in (2, 10**9):
        monkeypatch.setattr(attending, "VISITS_LOOKED_AFTER", every)
        mapper, seen, visits = Albot1(), [], []
        for lap in range(4):
            for k, (scan, motion) in enumerate(zip(scans, motions, strict=True)):
                way = back if lap and k == 0 else motion
                mapper.update(Reading(stamp=float(k), motion=way, laser=scan))
                seen.append(np.concatenate((mapper.pose, mapper.home, mapper.surfaces.ravel())))
            visits.append(len(mapper.state()["places.visits"]))
        runs.append((np.concatenate(seen).tobytes(), mapper.events, visits[-1]))
    assert runs[0][:2] == runs[1][:2]
    assert runs[0][2] < runs[1][2] - 4


def test_suspicions_that_need_nothing_to_be_met_are_not_allayed() -> None:
    memory = empty_memory()
    for needed in ((0, 3, NEVER), (0, 3, -1, NEVER), (0, -1, -2, -2, NEVER)):
        begin_visit(memory, np.array(needed, np.int32))
        memory.counts[SUSPECT] = 1
        allay(memory.met, memory.counts)
        assert memory.counts[SUSPECT] == (np.argmin(needed) if min(needed) < 0 else 0)


@given(st.tuples(*3 * [st.floats(-2, 2)]), st.tuples(*3 * [st.floats(-2, 2)]))
def test_it_is_time_to_look_once_the_robot_has_gone_or_turned_so_far(
    looked_from: tuple[float, float, float], pose: tuple[float, float, float]
) -> None:
    x, y, turn = relative(np.array(looked_from), np.array(pose))
    expected = np.hypot(x, y) >= 0.7 or abs(turn) >= 0.5
    assert is_time_to_look(np.array(looked_from), np.array(pose), 0.7, 0.5) == expected
    assert is_time_to_look(np.full(3, np.nan), np.array(pose), 0.7, 0.5)


@pytest.mark.parametrize("gate", [NO_GATE, GATE])
@pytest.mark.parametrize("is_lost", [False, True])
@pytest.mark.parametrize("gone", [0.0, 5.0])
def test_places_are_compared_when_it_is_time_and_nowhere_between(
    gate: int, is_lost: bool, gone: float
) -> None:
    batch = Albot1Batch(1, Albot1Config())
    robots, memory, exits = batch._robots, empty_memory(), no_exits()
    robots.is_lost[0], robots.looked_from[0] = is_lost, 0.0
    exits.counts[1] = gate
    begin_visit(memory, np.array((0, 3, NEVER), np.int32))
    here = np.array((gone, 0.0, 0.0))
    assert not has_cause_to_look(robots, 0, memory, exits, here, batch.config.limits)
    memory.counts[SUSPECT] = 1
    is_time = gate == NO_GATE and gone > 0
    looks = has_cause_to_look(robots, 0, memory, exits, here, batch.config.limits)
    assert looks == is_time
    is_allayed = gate == NO_GATE and not is_time and not is_lost
    assert memory.counts[SUSPECT] == (0 if is_allayed else 1)

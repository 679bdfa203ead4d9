"""Journeys that are made before a training begins are those that it would make."""

from __future__ import annotations

import copy
from dataclasses import replace
from typing import Any

import gymnasium
import numpy as np
import pytest

import albot_env  # noqa: F401  (registers the environments)
from albot_agents.training import journeys as prepared
from albot_agents.training.journeys import MadeJourneys, prepare_journeys
from albot_core.errors import InputError
from albot_env.tasks.core import journeys
from albot_env.tasks.core.journeys import JourneyCache
from albot_env.tasks.homing.outward_journey import OutwardJourneyConfig
from albot_env.tasks.homing.task import HomingConfig
from albot_maps import World, WorldSet

TASK = "Albot/Homing-v0"
SHORT = HomingConfig(outing=OutwardJourneyConfig(shortest=1.0, longest=2.0, away=0.5))


@pytest.fixture(autouse=True)
def _empty_shelf(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(journeys, "JOURNEY_CACHE", JourneyCache())


def settings(world: Any, **changes: Any) -> dict[str, Any]:
    return {"world": world, "mapper": "odometry", "journeys": 2, "config": SHORT, **changes}


def test_no_reset_makes_what_was_laid_in(two_rooms: World, monkeypatch: pytest.MonkeyPatch) -> None:
    """And the robots begin as if each journey had been made when it was drawn."""
    given = settings(two_rooms, threads=2)
    lazy = gymnasium.make_vec(TASK, num_envs=6, **given)
    wanted, _ = lazy.reset(seed=3)
    monkeypatch.setattr(journeys, "JOURNEY_CACHE", JourneyCache())
    monkeypatch.setattr(prepared, "FEWEST_JOURNEYS", 1)
    lines: list[str] = []
    batch: Any = gymnasium.make_vec(TASK, num_envs=6, **given)
    prepare_journeys(TASK, batch, given, lines.append)
    assert lines[0] == "0 of 4 journeys made"  # Two from each of two starts.
    assert lines[-1] == "4 of 4 journeys made"
    assert batch.missing_journeys() == []
    monkeypatch.setattr(type(batch.journeys), "travel", lambda *_: pytest.fail("made again"))
    seen, _ = batch.reset(seed=3)
    assert seen.tobytes() == wanted.tobytes()


def test_journeys_of_another_process_are_not_made_again(
    two_rooms: World, monkeypatch: pytest.MonkeyPatch
) -> None:
    """And a journey of another world or of another kind is none of them."""
    monkeypatch.setattr(prepared, "FEWEST_JOURNEYS", 1)
    given, made = settings(two_rooms, threads=2), MadeJourneys()
    batch: Any = gymnasium.make_vec(TASK, 2, **given)
    prepare_journeys(TASK, batch, given, made=made)
    assert len(made) == 4
    wanted, _ = batch.reset(seed=3)
    monkeypatch.setattr(journeys, "JOURNEY_CACHE", JourneyCache())
    monkeypatch.setattr(prepared, "LocalEngine", lambda *_: pytest.fail("made again"))
    sent, same = copy.deepcopy((made, two_rooms))  # As by a pipe.
    assert same is not two_rooms
    other: Any = gymnasium.make_vec(TASK, 2, **given | {"world": same})
    prepare_journeys(TASK, other, given, made=sent)
    assert other.missing_journeys() == []
    assert len(batch.missing_journeys()) == 4  # Its world is another object.
    seen, _ = other.reset(seed=3)
    assert seen.tobytes() == wanted.tobytes()
    shifted = replace(two_rooms, starts=two_rooms.starts + 0.1)
    walls = np.vstack((two_rooms.walls, [[1.0, 1.0, 1.0, 1.1]]))
    furnished = replace(two_rooms, walls=walls, glass=np.zeros(0, np.bool_))
    for changes in ({"world": shifted}, {"world": furnished}, {"odometer": "poor"}):
        batch = gymnasium.make_vec(TASK, 2, **given | changes)
        assert not any(sent.find(batch.journeys, spec) for spec in batch.missing_journeys())


def test_few_journeys_and_one_thread_are_no_reason_to_start_processes(
    two_rooms: World, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(prepared, "LocalEngine", lambda *_: pytest.fail("processes"))
    for given in (settings(two_rooms, threads=2), settings(two_rooms, threads=1, journeys=40)):
        batch: Any = gymnasium.make_vec(TASK, num_envs=2, **given)
        missing = len(batch.missing_journeys())
        prepare_journeys(TASK, batch, given)
        assert len(batch.missing_journeys()) == missing > 0


def test_what_cannot_be_kept_is_not_laid_in(two_rooms: World) -> None:
    for count, missing in ((0, 0), (2048, 4096), (2049, 0)):
        batch: Any = gymnasium.make_vec(TASK, 2, **settings(two_rooms, journeys=count))
        assert len(batch.missing_journeys()) == missing
    explorers: Any = gymnasium.make_vec("Albot/Explore-v0", 2, world=two_rooms, mapper="none")
    assert explorers.missing_journeys() == []


def test_environments_share_the_journeys_of_a_random_world() -> None:
    world = "random:ring:0?starts=1"
    first: Any = gymnasium.make_vec(TASK, 1, **settings(world, journeys=1))
    first.reset(seed=1)
    second: Any = gymnasium.make_vec(TASK, 1, **settings(world, journeys=1))
    assert second.missing_journeys() == []


def test_worlds_that_robots_share_are_gone_through_once(two_rooms: World) -> None:
    both = WorldSet((two_rooms, "random:maze:1"))
    batch: Any = gymnasium.make_vec(TASK, 3, **settings([both, both, two_rooms]))
    assert len(batch.missing_journeys()) == 2 * (len(two_rooms.starts) + 1)


def test_a_journey_that_cannot_be_made_is_left_to_its_reset(
    two_rooms: World, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(prepared, "FEWEST_JOURNEYS", 1)
    task = "Albot/PlaceRecognition-v0"
    given = {"world": "random:hall:1?porches=0", "mapper": "none", "journeys": 2, "threads": 2}
    batch: Any = gymnasium.make_vec(task, 2, **given)
    prepare_journeys(task, batch, given)
    assert len(batch.missing_journeys()) == 2
    with pytest.raises(InputError, match="two rooms"):
        batch.reset(seed=1)


def test_what_turns_out_too_heavy_is_not_laid_in(
    two_rooms: World, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The first journey shows that they would drive each other out."""
    monkeypatch.setattr(prepared, "FEWEST_JOURNEYS", 1)
    monkeypatch.setattr(prepared, "LocalEngine", lambda *_: pytest.fail("processes"))
    monkeypatch.setattr(journeys, "ASSUMED_BYTES", 1)
    monkeypatch.setattr(journeys, "JOURNEY_CACHE", JourneyCache(1000))
    given = settings(two_rooms, threads=2)
    batch: Any = gymnasium.make_vec(TASK, num_envs=2, **given)
    assert len(batch.missing_journeys()) == 4
    lines: list[str] = []
    prepare_journeys(TASK, batch, given, lines.append)
    assert lines[-1] == "1 of 4 journeys made; the others are made when needed"
    assert batch.missing_journeys() == []

"""A fleet whose robots come and go: what one senses depends on its own world alone."""

from __future__ import annotations

import numpy as np
import pytest

from albot_core.errors import InputError
from albot_env.sim import PIONEER_3DX, SCENES, SONARS, Sensors
from albot_env.sim import floors as floors_module
from albot_env.sim import register as register_module
from albot_env.sim.crew import Crew
from albot_env.sim.fleet import Fleet
from albot_maps import World, load_world

SENSORS = Sensors(sonar=SONARS["pioneer"], scenes=SCENES["paper"])
WORLDS = [load_world(f"random:ring:{seed}") for seed in range(6)]


def senses(fleet: Fleet, row: int, world: World, key: int) -> list[bytes]:
    """What a robot senses in a short drive from a world's start."""
    fleet.place(row, world, world.starts[0], key)
    seen = []
    for _ in range(5):
        fleet.drive(np.tile((0.3, 0.4), (len(fleet.poses), 1)), 2)
        fleet.locate()
        fleet.sense()
        parts = fleet.poses, fleet.motions, fleet.ranges, fleet.echoes, fleet.scenes
        seen.append(b"".join(part[row].tobytes() for part in parts))
    return seen


@pytest.fixture
def forgetful(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing is kept of worlds without robots."""
    monkeypatch.setattr(register_module, "KEPT", -3)
    monkeypatch.setattr(floors_module, "_KEPT", 0)


@pytest.mark.parametrize("kept", ["much", "little"])
def test_worlds_that_come_and_go_change_nothing(kept: str, request) -> None:
    if kept == "little":
        request.getfixturevalue("forgetful")
    fleet = Fleet(2, robot=PIONEER_3DX, sensors=SENSORS)
    fleet.place(1, WORLDS[0], WORLDS[0].starts[0], 9)
    for turn in range(3):
        for number, world in enumerate(WORLDS):
            alone = Fleet(1, robot=PIONEER_3DX, sensors=SENSORS)
            assert senses(fleet, 0, world, turn) == senses(alone, 0, world, turn), number


def test_robots_meet_the_walls_of_their_own_world(two_rooms: World, box: World) -> None:
    fleet = Fleet(2, robot=PIONEER_3DX, sensors=Sensors())
    for _ in range(3):  # Each time in the other's world.
        worlds = (two_rooms, box) if fleet.ranges.max() == np.inf else (box, two_rooms)
        for row, world in enumerate(worlds):
            fleet.place(row, world, world.starts[0], 1)
        fleet.locate()
        fleet.sense()
        for row, world in enumerate(worlds):
            alone = Fleet(1, robot=PIONEER_3DX, sensors=Sensors())
            alone.place(0, world, world.starts[0], 1)
            alone.locate()
            alone.sense()
            np.testing.assert_array_equal(fleet.ranges[row], alone.ranges[0])


def test_a_crew_does_all_rows_once_and_raises_what_its_threads_raise() -> None:
    crew = Crew(3)
    done = np.zeros(100, np.int64)

    def count(rows: np.ndarray, member: int) -> None:
        done[rows] += 1

    crew.share(np.arange(100), count)
    assert (done == 1).all()
    members: set[int] = set()
    crew.share(np.arange(10), lambda _, member: members.add(member), fewest=20)
    assert members == {0}

    def fail(rows: np.ndarray, member: int) -> None:
        if member == 2:
            raise ValueError("three")

    with pytest.raises(ValueError, match="three"):
        crew.share(np.arange(100), fail)
    crew.close()
    with pytest.raises(InputError, match="a whole number from 0, found -1"):
        Crew(-1)

"""The program that counts the kidnapped robots that notice it."""

from __future__ import annotations

import numpy as np
import pytest

from albot_core.geometry.poses import relative
from albot_env.sim.simulator import Simulator
from albot_maps import load_world
from albot_studies.kidnapped_robots import AFTER, Kidnapping, kidnap, measure, moved_after

WORLD = "random:office:7000?rooms=4"


def test_the_robot_is_moved_to_another_room_and_its_odometer_does_not_tell():
    world = load_world(WORLD)
    simulator, rng = Simulator(world, movables=False), np.random.default_rng(1)
    poses, motions = [], []
    for reading in moved_after(20, simulator, rng, AFTER):
        poses.append(simulator.pose)
        motions.append(reading.motion)
    assert len(poses) == 20 + AFTER
    rooms = [world.room_at(*pose[:2].tolist()) for pose in poses]
    assert rooms[19] != rooms[20] is not None
    assert not motions[20].any()
    steps = relative(np.array(poses[:-1]), np.array(poses[1:]))
    off = np.hypot(*(steps - motions[1:])[:, :2].T)
    assert off.argmax() == 19
    assert np.delete(off, 19).max() < 0.1


@pytest.mark.parametrize(
    ("noticed", "lost", "error", "found", "mistaken"),
    [
        (True, False, 0.5, True, False),
        (True, False, 3.0, False, True),
        (True, True, 3.0, False, False),
        (False, False, 9.0, False, False),
    ],
)
def test_what_is_counted(noticed, lost, error, found, mistaken):
    one = Kidnapping(seed=0, reading=9, false_alarm=False, noticed=noticed, lost=lost, error=error)
    assert (one.found, one.mistaken) == (found, mistaken)


def test_who_only_adds_up_motions_never_notices():
    outcome = kidnap(load_world(WORLD), 4, "odometry")
    assert (outcome.noticed, outcome.false_alarm, outcome.lost) == (False, False, False)
    assert outcome.error > 1.0


def test_albot1_notices():
    outcome = measure("random:office:SEED?rooms=8", range(7000, 7008), "albot1")
    assert outcome["count"] == len(outcome["runs"]) == 8
    assert outcome["false_alarm"] == 0
    assert outcome["noticed"] >= 6
    assert outcome["found"] + outcome["mistaken"] <= outcome["noticed"]


def test_readings_after_the_move_are_as_many_as_asked():
    few = measure("random:office:SEED?rooms=8", range(7001, 7002), "albot1", 5)
    assert few["readings_after"] == 5
    assert few["runs"][0]["lost"]
    assert not measure("random:office:SEED?rooms=8", range(7001, 7002), "albot1")["runs"][0]["lost"]

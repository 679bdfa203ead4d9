"""The ant's three strategies in turn, by a point that goes straight where the agent drives."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from albot_agents.registry import find_agent, make_agent
from albot_agents.scripted import sahabot_homing
from albot_agents.scripted.sahabot_homing import SahabotHoming
from albot_core.geometry.poses import transform_points
from albot_core.planning.navigator import KnownWay
from albot_core.planning.percept import Percept
from albot_core.sensing.reading import LaserGeometry
from albot_env.tasks.core.actions import ActionConfig

LASER = LaserGeometry(beams=4, spacing=np.pi / 4)


class PointRobot:
    """A robot with an exact home vector; landmarks within 1 m of the nest tell the way to it.

    Args:
        nest: Where the nest truly is: not where the home vector leads.
        sees: Whether there are landmarks.
    """

    def __init__(self, nest: tuple[float, float], *, sees: bool) -> None:
        self.nest, self.sees = np.array(nest), sees
        self.pose = np.array((6.0, 3.0, 0.7))
        self.path = [self.pose[:2].copy()]
        self.declared = False

    def percept(self) -> Percept:
        ranges = np.full(LASER.beams, np.inf)
        return Percept(ranges=ranges, laser=LASER, pose=self.pose.copy(), motion=np.zeros(3))

    def go(self, target: np.ndarray) -> np.int64:
        """Go up to 0.2 m towards a target in its frame, without turning."""
        to = transform_points(self.pose, target) - self.pose[:2]
        self.pose[:2] += to * min(1.0, 0.2 / max(float(np.hypot(*to)), 1e-9))
        self.path.append(self.pose[:2].copy())
        return np.int64(0)

    def declare(self) -> np.int64:
        self.declared = True
        return np.int64(0)

    def way(self) -> KnownWay | None:
        apart = self.nest - self.pose[:2]
        if not self.sees or np.hypot(*apart) > 1.0:
            return None
        cos, sin = np.cos(self.pose[2]), np.sin(self.pose[2])
        return KnownWay(np.array(((cos, sin), (-sin, cos))) @ apart, np.inf)

    @property
    def is_at_nest(self) -> bool:
        return bool(self.sees and np.hypot(*(self.nest - self.pose[:2])) < 0.25)


def come_home(robot: PointRobot, monkeypatch: pytest.MonkeyPatch, steps: int = 3000) -> None:
    """Let the agent drive the robot until it declares home."""
    agent = make_agent("sahabot-homing")
    assert isinstance(agent, SahabotHoming)
    monkeypatch.setattr(agent, "_decode", lambda _: robot.percept())
    monkeypatch.setattr(agent, "_declare", robot.declare)
    monkeypatch.setattr(agent, "_drive", lambda target, _: robot.go(target))
    monkeypatch.setattr(agent._driver, "command", lambda _, target: target)
    monkeypatch.setattr(sahabot_homing, "decode_known_way", lambda *_: robot.way())
    monkeypatch.setattr(sahabot_homing, "decode_recognition", lambda *_: robot.is_at_nest)
    agent.reset(np.random.default_rng(1), ActionConfig().space)
    for _ in range(steps):
        agent.act(None, {})
        if robot.declared:
            return


def test_by_an_exact_home_vector_it_goes_straight_to_the_nest(monkeypatch) -> None:
    robot = PointRobot((0.0, 0.0), sees=True)
    come_home(robot, monkeypatch)
    assert robot.declared and robot.is_at_nest
    lengths = np.hypot(*np.diff(robot.path, axis=0).T).sum()
    assert lengths == pytest.approx(np.hypot(6.0, 3.0), abs=0.3)


def test_landmarks_correct_the_home_vector(monkeypatch) -> None:
    robot = PointRobot((0.4, -0.3), sees=True)
    monkeypatch.setattr(SahabotHoming, "AT_NEST", 1.0)
    come_home(robot, monkeypatch)
    assert robot.declared and robot.is_at_nest


def test_where_no_landmark_is_in_view_it_searches_until_one_is(monkeypatch) -> None:
    robot = PointRobot((-1.2, 1.5), sees=True)
    monkeypatch.setattr(SahabotHoming, "AT_NEST", 3.0)
    come_home(robot, monkeypatch)
    assert robot.declared and robot.is_at_nest


def test_a_search_in_vain_ends_where_the_home_vector_does(monkeypatch) -> None:
    robot = PointRobot((0.0, 0.0), sees=False)
    come_home(robot, monkeypatch)
    assert robot.declared
    path = np.array(robot.path)
    arrived = int(np.argmax(np.hypot(*path.T) < SahabotHoming.ARRIVED))
    assert np.hypot(*path[arrived:].T).max() == pytest.approx(2.5, abs=0.3)
    assert np.hypot(*path[-1]) < SahabotHoming.ARRIVED


def test_in_an_environment_it_has_its_own_sensors() -> None:
    settings: dict[str, Any] = find_agent("sahabot-homing").environment("Albot/Homing-v0", {})
    chosen = {name: settings[name] for name in ("mapper", "laser", "compass")}
    assert chosen == {"mapper": "sahabot", "laser": "panoramic", "compass": "polarised"}

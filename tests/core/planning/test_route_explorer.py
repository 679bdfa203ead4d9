"""The route explorer: which directions are routes, and that it takes all of them, both ways."""

from __future__ import annotations

import math

import numpy as np
import pytest

from albot_core.errors import InputError
from albot_core.geometry.poses import compose, wrap_angle
from albot_core.planning.percept import Percept
from albot_core.planning.route_explorer import (
    RouteExplorer,
    RouteExplorerConfig,
    open_directions,
)
from albot_core.planning.steering import DIRECTIONS
from albot_env.sim.odometer import ODOMETERS
from albot_env.sim.sensors import Sensors
from albot_env.sim.simulator import Simulator
from albot_maps import World

QUARTER = math.pi / 2


def free(*openings: tuple[float, float]) -> np.ndarray:
    """Free distances of 3 m in openings (middle and half width, rad), and 1 m elsewhere."""
    distances = np.full(len(DIRECTIONS), 1.0)
    for middle, half in openings:
        distances[np.abs(wrap_angle(DIRECTIONS - middle)) < half] = 3.0
    return distances


@pytest.mark.parametrize(
    ("openings", "expected"),
    [
        ((), ()),
        (((0.0, 0.3), (math.pi, 0.3)), (0.0, math.pi)),  # A corridor; one opening wraps round.
        (((0.0, 0.3), (QUARTER, 0.2), (-QUARTER, 0.4)), (0.0, QUARTER, -QUARTER)),
        (((0.0, 1.1),), (-0.55, 0.55)),  # Too wide for one route.
        (((0.0, 4.0),), (0.0, QUARTER, math.pi, -QUARTER)),  # Open all round.
    ],
)
def test_each_opening_is_a_route_through_its_middle(openings, expected):
    found = open_directions(free(*openings), length=2.0, width=QUARTER)
    assert len(found) == len(expected)
    for bearing in expected:
        assert min(abs(float(wrap_angle(bearing - other))) for other in found) < 0.03
    assert open_directions(free(*openings), length=3.5, width=QUARTER) == []


def explored(walls, start, steps: int, **config) -> tuple[np.ndarray, RouteExplorer]:
    """The true poses of a robot that explores, with a perfect odometer, and its explorer."""
    world = World(name="drawn", walls=np.array(walls, float), starts=np.array((start,)))
    simulator = Simulator(world, sensors=Sensors(odometer=ODOMETERS["ideal"]))
    explorer = RouteExplorer(RouteExplorerConfig(**config))
    explorer.reset(np.random.default_rng(1))
    reading, pose = simulator.reset(np.random.default_rng(1)), np.zeros(3)
    truth = [simulator.pose]
    for _ in range(steps):
        laser = reading.required_laser("test")
        percept = Percept(
            ranges=np.minimum(laser.ranges, laser.geometry.max_range),
            laser=laser.geometry,
            pose=pose,
            motion=reading.motion,
        )
        reading = simulator.step(*explorer.command(percept).tolist())
        pose = compose(pose, reading.motion)
        truth.append(simulator.pose)
        assert not simulator.collided
    return np.array(truth), explorer


CORRIDOR = ((0, 0, 14, 0), (14, 0, 14, 1.8), (14, 1.8, 0, 1.8), (0, 1.8, 0, 0))


def directions_at(truth: np.ndarray, x: float) -> set[int]:
    """The directions in which the robot crossed a line across the corridor: 1 on, -1 back."""
    side = np.sign(truth[:, 0] - x)
    return set(np.sign(np.diff(side)[np.diff(side) != 0]).astype(int).tolist())


def test_it_turns_round_in_a_corridor_and_learns_the_way_back():
    start = (1.0, 0.9, 0.0)
    truth, explorer = explored(CORRIDOR, start, 700)
    assert directions_at(truth, 7.0) == {1, -1}
    # Where the way back is no route of its own, it has taken all at the end, and begins anew.
    first = int(np.argmax(truth[:, 0] > 11.0))
    _, careless = explored(CORRIDOR, start, first + 100, aligned=math.pi)
    _, careful = explored(CORRIDOR, start, first + 100)
    assert careless.rounds > careful.rounds == 0
    assert explorer.rounds <= 1


def test_it_takes_every_route_of_a_junction_in_both_directions():
    """A cross of four arms of 6 m; it begins at the end of one."""
    near, far = 0.9, 6.9
    corners = [
        (-near, -far), (near, -far), (near, -near), (far, -near), (far, near), (near, near),
        (near, far), (-near, far), (-near, near), (-far, near), (-far, -near), (-near, -near),
    ]  # fmt: skip
    walls = [(*one, *other) for one, other in zip(corners, corners[1:] + corners[:1], strict=True)]
    truth, _ = explored(walls, (-6.0, 0.0, 0.0), 1200)
    for axis, sign in ((0, 1), (0, -1), (1, 1), (1, -1)):
        out = sign * truth[:, axis] > 3.5
        assert 1 in np.diff(out.astype(int)) or out[0], (axis, sign)
        assert -1 in np.diff(out.astype(int)), (axis, sign)


@pytest.mark.parametrize("name", ["length", "taken", "narrow", "turn_cost"])
def test_parameters_are_checked(name):
    with pytest.raises(InputError, match=rf"RouteExplorerConfig\.{name}"):
        RouteExplorerConfig(**{name: -1.0})

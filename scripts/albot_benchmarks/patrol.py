"""A robot on patrol: from room to room of a building, for as long as one likes."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from albot_core.sensing.reading import Reading
from albot_env.sim.simulator import Simulator, StartStop, follow_leg
from albot_env.tasks.place_recognition.tours import StoppingRooms
from albot_maps import ROBOT_RADIUS, World
from albot_maps.geodesic import DistanceField

STEPS = StartStop(move=0.5, turn=np.radians(30.0))
"""About as far apart as the readings of real logs."""
_ROOM = 0.1
"""How much farther than it must the robot keeps from walls (m)."""


def patrol(world: World, rng: np.random.Generator) -> Iterator[Reading]:
    """What a robot senses that is guided from room to room, each drawn at random, without end.

    It stops anywhere in a room. The guide sees where the robot truly is, so that the odometer's
    errors, the Pioneer's, do not change the way.

    Raises:
        InputError: The world has no two rooms in which a robot can stop.
    """
    simulator, stops = Simulator(world, movables=False), StoppingRooms(world)
    yield simulator.reset(rng, world.starts[0])
    here = -1
    while True:
        here = int(rng.choice([room for room in stops.rooms if room != here]))
        goal = stops.point(here, rng)
        way = DistanceField(world.walls, ROBOT_RADIUS + _ROOM, goal).way(simulator.pose[:2])
        if not len(way):
            tight = DistanceField(world.walls, ROBOT_RADIUS, goal, tight=True)
            way = tight.way(simulator.pose[:2])
        for turn in way:
            yield from follow_leg(simulator, turn, STEPS)

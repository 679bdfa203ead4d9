"""What faults do to the robots' worlds, and to their places in them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from albot_core.geometry.types import Points, Pose, Segments
from albot_core.sensing.faults.fault import Clock, Fault, Strikes
from albot_env.faults.world_faults import HEAVY, Situation, WorldFault, with_boxes
from albot_env.tasks.core.row_arrays import Arrays
from albot_env.tasks.homing_by_map.changes import with_walls
from albot_maps import World
from albot_maps.movables import Box

WORLD_STREAM = 3
"""Number of the random stream of what strikes a robot's world; 2 is its readings'."""


class Relocation(NamedTuple):
    """What a step's strikes come to."""

    world: World
    """The robot's world from now on."""
    pose: Pose | None
    """Where the robot is put; None for where it is."""
    way: Segments | None
    """What is in the way of robots, if walls were moved or a door was shut for good; or None."""


@dataclass(eq=False)
class _Robot:
    """What has struck one robot."""

    base: World
    """Its world as it was when the episode began."""
    strikes: list[Strikes]
    boxes: list[Box | None]
    """What stands in an exit, by fault; None for nothing."""
    active: tuple[str, ...] = ()
    """Names of the faults that struck in the last step, or are under way."""
    struck: int = 0
    """Number of strikes that were possible."""
    walls: Segments | None = None
    """The walls, where some were moved."""
    travelled: float = 0.0
    """Distance driven when the episode began (m)."""
    made: World | None = field(default=None, repr=False)
    """The world at present; the same object until it changes."""

    @property
    def way(self) -> Segments:
        """What is in the way of robots for good, but for what they can push (m)."""
        kept = [_sides(box) for box in self.boxes[len(self.strikes) :] if box is not None]
        walls = self.base.walls if self.walls is None else self.walls
        return np.concatenate((walls, *kept))

    def begin(self, k: int, here: Situation, clock: Clock, put: Pose | None) -> Pose | None:
        """Begin a strike of the k-th fault, if it is possible.

        Args:
            k: The fault.
            here: Where it strikes.
            clock: When it does.
            put: Where the robot has been put in the same step; None for where it was.

        Returns:
            Where it is put now.
        """
        strikes = self.strikes[k]
        fault = strikes.fault
        assert isinstance(fault, WorldFault)
        change = fault.strike(here, strikes.values, strikes.rng)
        if change is None:
            strikes.end(clock)
            return put
        self.struck += 1
        self.active += (fault.name,)
        self.walls = self.walls if change.walls is None else change.walls
        if strikes.until < np.inf:
            self.boxes[k] = change.box
        else:  # It does not last; but what it has put into an exit stays.
            self.boxes += [] if change.box is None else [change.box]
            strikes.end(clock)
        return put if change.pose is None else change.pose

    def world(self) -> World:
        """Make the world at present."""
        world = self.base
        if self.walls is not None:
            changed = with_walls(self.base, self.walls, self.base.glass)
            assert changed is not None, "it was valid when it was changed"
            world = changed
        made = with_boxes(world, [box for box in self.boxes if box is not None])
        assert made is not None, "they had room when they came"
        return made


class FaultyWorlds:
    """Strikes the worlds of a batch of robots, each by its own schedule.

    Args:
        robots: Number of robots.
        faults: The faults of the world.
        stream: Selects the random streams, beside a robot's key.
    """

    def __init__(self, robots: int, faults: Sequence[WorldFault], stream: int) -> None:
        self._faults, self._stream = faults, stream
        self._robots: list[_Robot | None] = [None] * robots

    def begin(self, row: int, world: World, key: int) -> None:
        """Begin the episode of a robot; its key selects the random streams."""
        strikes = [Strikes(fault, (key, self._stream, k)) for k, fault in enumerate(self._faults)]
        self._robots[row] = _Robot(world, strikes, [None] * len(strikes), made=world)

    def has_begun(self, row: int) -> bool:
        """Whether a robot is in a world."""
        return self._robots[row] is not None

    def set_out(self, row: int, travelled: float) -> None:
        """Measure the distance that a robot drives from here (m)."""
        self._of(row).travelled = travelled

    def base(self, row: int) -> World:
        """Return a robot's world as it was when the episode began."""
        return self._of(row).base

    def moved_walls(self, row: int) -> Segments:
        """Return the walls of a robot's world that were moved, where they are now."""
        robot = self._of(row)
        if robot.walls is None:
            return np.empty((0, 4))
        return np.asarray(robot.walls[(robot.walls != robot.base.walls).any(axis=1)])

    def active(self, row: int) -> tuple[str, ...]:
        """Return the names of the faults that struck a robot in the last step, or are under way."""
        return self._of(row).active

    def struck(self, row: int) -> int:
        """Return the number of strikes on a robot."""
        return self._of(row).struck

    def _of(self, row: int) -> _Robot:
        robot = self._robots[row]
        assert robot is not None, "a robot is nowhere before it begins"
        return robot

    def strike(
        self, row: int, time: float, travelled: float, pose: Pose, home: Points
    ) -> Relocation | None:
        """Let the faults strike a robot that are due; return what they come to, None for nothing.

        Args:
            row: The robot.
            time: Time since the episode began (s).
            travelled: Distance that the robot has driven (m).
            pose: Its pose (world frame).
            home: Where its episode began (m).
        """
        robot = self._of(row)
        clock = Clock(time, travelled - robot.travelled)
        before, kept = (robot.walls, list(robot.boxes)), len(robot.boxes)
        put: Pose | None = None
        robot.active = ()
        for k, strikes in enumerate(robot.strikes):
            if strikes.is_on and strikes.is_over(clock):
                strikes.end(clock)
                robot.boxes[k] = None
            if strikes.begin(clock):
                here = Situation(robot.world(), pose if put is None else put, home)
                put = robot.begin(k, here, clock, put)
            elif strikes.is_on:
                robot.active += (strikes.fault.name,)
        is_changed = before[0] is not robot.walls or before[1] != robot.boxes
        if put is None and not is_changed:
            return None
        if is_changed:
            robot.made = robot.world()
        assert robot.made is not None
        for_good = robot.walls is not before[0] or len(robot.boxes) > kept
        return Relocation(robot.made, put, robot.way if for_good else None)

    def state(self, row: int) -> Arrays:
        """Return what the strikes on a robot depend on (copies)."""
        robot = self._of(row)
        names = "+".join(robot.active).encode()
        boxes = [
            (np.nan,) * 5 if box is None else (*box.at, box.heading, box.length, box.width)
            for box in robot.boxes
        ]
        walls = np.empty((0, 4)) if robot.walls is None else robot.walls
        return {
            "struck.strikes": np.array([each.state for each in robot.strikes]),
            "struck.boxes": np.array(boxes, np.float64).reshape(-1, 5),
            "struck.walls": np.array(walls),
            "struck.names": np.frombuffer(names, np.uint8).copy(),
            "struck.numbers": np.array((robot.struck, robot.travelled)),
        }

    def set_state(self, row: int, world: World, key: int, arrays: Arrays) -> World:
        """Give a robot with a key what `state` returned.

        Args:
            row: The robot.
            world: Its world as it was when the episode began.
            key: Its key.
            arrays: The state.

        Returns:
            The world of the state.
        """
        self.begin(row, world, key)
        robot = self._of(row)
        for strikes, state in zip(robot.strikes, arrays["struck.strikes"], strict=True):
            strikes.restore(state)
        robot.boxes = [_box_of(numbers) for numbers in arrays["struck.boxes"].tolist()]
        walls = arrays["struck.walls"]
        robot.walls = walls if len(walls) else None
        names = arrays["struck.names"].tobytes().decode()
        robot.active = tuple(names.split("+")) if names else ()
        struck, robot.travelled = arrays["struck.numbers"].tolist()
        robot.struck = int(struck)
        robot.made = robot.world() if robot.walls is not None or any(robot.boxes) else world
        return robot.made


def _sides(box: Box) -> Segments:
    return np.concatenate((box.corners, np.roll(box.corners, -1, axis=0)), axis=1)


def _box_of(numbers: list[float]) -> Box | None:
    x, y, heading, length, width = numbers
    if np.isnan(x):
        return None
    return Box(at=(x, y), heading=heading, length=length, width=width, mass=HEAVY)


def faults_of_world(faults: Sequence[Fault]) -> list[WorldFault]:
    """Return those faults that are faults of the world."""
    return [fault for fault in faults if isinstance(fault, WorldFault)]

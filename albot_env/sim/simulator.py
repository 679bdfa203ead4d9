"""The simulator: a robot with sensors in a world with real contacts."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from albot_core.errors import InputError
from albot_core.geometry.poses import wrap_angle
from albot_core.geometry.types import Points, Pose, Segments
from albot_core.ranges import POSITIVE, check_fields
from albot_core.robot import PIONEER_3DX, STANDSTILL, RobotConfig, Wheels
from albot_core.sensing.reading import Reading
from albot_env.sim.batch_simulator import BatchSimulator, draw_key
from albot_env.sim.drive import chord
from albot_env.sim.physics import PHYSICS_STEP, SUBSTEPS
from albot_env.sim.sensors import Sensors
from albot_maps.world import World

LONGEST_MANOEUVRE = 1000.0
"""Largest distance (m) of a start-stop move and largest angle (rad) of a start-stop turn."""

_USUAL = Sensors()

_PATIENCE = 3 * SUBSTEPS
"""Number of physics steps without progress after which a move or turn ends (0.3 s)."""
_PROGRESS = 0.1
"""Minimum ratio of body speed to wheel speed that counts as progress while touching a wall."""


class Simulator:
    """One robot in a world. Call `reset` first; each command returns a reading.

    The same world, configuration, generator state, start and commands give bit-identical
    readings.

    Args:
        world: The world; its walls are sensed by the sensors and stop the robot. It is checked for
            the robot (see `World.for_robot`).
        robot: Body and drive of the robot.
        sensors: The sensors that the robot carries.
        movables: Whether the world's doors, boxes and people are simulated.

    Raises:
        InputError: The world is not valid for a robot of this radius.
    """

    def __init__(
        self,
        world: World,
        *,
        robot: RobotConfig = PIONEER_3DX,
        sensors: Sensors = _USUAL,
        movables: bool = True,
    ) -> None:
        self._world = world.for_robot(robot.radius)
        self._batch = BatchSimulator(1, robot=robot, sensors=sensors, movables=movables)
        self._started = False
        self._start = np.zeros(3)
        self._key = 0
        self._ticks = 0

    @property
    def world(self) -> World:
        """The world that the robot is in."""
        return self._world

    @property
    def start(self) -> Pose:
        """Pose of the robot at the last reset, in the world frame."""
        return self._start.copy()

    @property
    def key(self) -> int:
        """The number that was drawn at the last reset; all noise is a function of it."""
        return self._key

    @property
    def pose(self) -> Pose:
        """True pose of the robot, in the world frame."""
        pose: Pose = self._batch.poses[0].copy()
        return pose

    @property
    def velocity(self) -> tuple[float, float]:
        """True speed along the heading (m/s) and turn rate (rad/s)."""
        _, _, heading, vx, vy, turn_rate = self._batch.states[0].tolist()
        direction, shortening = chord(heading, turn_rate * PHYSICS_STEP)
        along = vx * math.cos(direction) + vy * math.sin(direction)
        return along / shortening, turn_rate

    @property
    def time(self) -> float:
        """Simulated time since the reset (s)."""
        return self._ticks * PHYSICS_STEP

    @property
    def obstacles(self) -> Segments:
        """Current outlines of the dynamic obstacles around the robot (world frame)."""
        return self._batch.obstacles(0)

    @property
    def collided(self) -> bool:
        """Whether a wall or an obstacle pushed the robot during the last step, move or turn."""
        return bool(self._batch.collided[0])

    def reset(self, rng: np.random.Generator, start: Pose | None = None) -> Reading:
        """Put the robot at rest at `start` and start a new episode.

        Args:
            rng: One number is drawn from it; that number decides all noise until the next reset.
            start: Pose in the world frame; default: the world's first start.

        Returns:
            The first reading; its odometer motion is zero.

        Raises:
            InputError: `start` is not finite, or the robot would touch a wall, a box or the area
                that a door sweeps.
        """
        pose = self.world.starts[0] if start is None else np.asarray(start, dtype=np.float64)
        self._batch.check_start(self._world, pose)
        self._key = draw_key(rng)
        self._batch.place(0, self._world, pose, self._key)
        self._started = True
        self._start = pose.copy()
        self._ticks = 0
        return self._read()

    def step(self, speed: float, turn_rate: float) -> Reading:
        """Drive for one control step of 0.1 s.

        Args:
            speed: Commanded speed (m/s), positive forwards.
            turn_rate: Commanded turn rate (rad/s), positive counter-clockwise. Both commands are
                limited to what the robot can do.

        Raises:
            InputError: A command is not finite, or `reset` was not called.
        """
        _check_finite("step", speed=speed, turn_rate=turn_rate)
        return self._control(self._batch.robot.wheels_for(speed, turn_rate))

    def step_wheels(self, left: float, right: float) -> Reading:
        """Drive for one control step of 0.1 s at given wheel speeds (m/s), limited as in `step`.

        Raises:
            InputError: A command is not finite, or `reset` was not called.
        """
        _check_finite("step_wheels", left=left, right=right)
        return self._control(self._batch.robot.limited(Wheels(left, right)))

    def move(self, distance: float) -> Reading:
        """Start, drive straight for `distance` (m, negative is backwards) and stop.

        The distance is measured at the wheels. If a wall blocks the robot, the move ends after
        0.3 s without progress.

        Returns:
            One reading for the whole move.

        Raises:
            InputError: `distance` is not within ±1000 m, or `reset` was not called.
        """
        _check_manoeuvre("move", "distance", distance)
        config = self._batch.robot
        direction = math.copysign(1.0, distance)
        speeds = _start_stop(abs(distance), config.cruise_speed, config.acceleration)
        return self._manoeuvre(Wheels(direction * v, direction * v) for v in speeds)

    def turn(self, angle: float) -> Reading:
        """Start, turn on the spot by `angle` (rad, counter-clockwise) and stop.

        Returns:
            One reading for the whole turn.

        Raises:
            InputError: `angle` is not within ±1000 rad, or `reset` was not called.
        """
        _check_manoeuvre("turn", "angle", angle)
        config = self._batch.robot
        direction = math.copysign(1.0, angle)
        arm = config.wheel_base / 2
        speeds = _start_stop(abs(angle) * arm, config.cruise_turn_rate * arm, config.acceleration)
        return self._manoeuvre(Wheels(-direction * v, direction * v) for v in speeds)

    def _control(self, target: Wheels) -> Reading:
        """Run one control step towards the wheel speeds `target`."""
        self._check_reset()
        self._batch.clear_contacts()
        self._advance(target, SUBSTEPS)
        return self._read()

    def _manoeuvre(self, commands: Iterator[Wheels]) -> Reading:
        """Run wheel speeds from standstill to standstill; stop early if the robot is blocked."""
        self._check_reset()
        self._batch.clear_contacts()
        self._brake()
        held_up = 0
        for wheels in commands:
            self._advance(wheels, 1, at_once=True)
            held_up = held_up + 1 if self._held_up() else 0
            if held_up == _PATIENCE:
                break
        self._brake()
        return self._read()

    def _brake(self) -> None:
        """Ramp the wheel speeds down to zero."""
        while self._batch.wheels.any():
            self._advance(STANDSTILL, 1)

    def _advance(self, wheels: Wheels, steps: int, *, at_once: bool = False) -> None:
        """Run `steps` physics steps in which the wheels approach these speeds."""
        self._batch.drive(np.array((wheels,)), steps, at_once=at_once)
        self._ticks += steps

    def _held_up(self) -> bool:
        """Whether a wall keeps the body far slower than its wheels (see `_PROGRESS`)."""
        batch = self._batch
        rolled = batch.robot.motion_of(Wheels(*batch.wheels[0].tolist()))[0]
        return bool(batch.pushed[0]) and abs(self.velocity[0]) < _PROGRESS * abs(rolled)

    def _read(self) -> Reading:
        self._batch.locate()
        self._batch.sense()
        return self._batch.readings(np.array((self.time,)))[0]

    def _check_reset(self) -> None:
        if not self._started:
            raise InputError("Simulator", "a reset before anything else")


def _start_stop(distance: float, top_speed: float, acceleration: float) -> Iterator[float]:
    """Yield one wheel speed per physics step; they add up to `distance` and end at rest.

    Accelerate to the top speed, keep it, and brake as late as the acceleration allows:
    v = -a dt/2 + sqrt((a dt/2)² + 2 a r) is the highest speed from which, after one more
    step, the robot can still stop within the remaining distance r.
    """
    gain = acceleration * PHYSICS_STEP
    speed, rest = 0.0, distance
    while rest > 1e-12:
        stoppable = math.sqrt(gain * gain / 4 + 2 * acceleration * rest) - gain / 2
        speed = min(speed + gain, top_speed, stoppable, rest / PHYSICS_STEP)
        rest -= speed * PHYSICS_STEP
        yield speed


def _check_finite(method: str, **commands: float) -> None:
    for name, value in commands.items():
        if not math.isfinite(value):
            raise InputError(f"Simulator.{method}", "a finite number", str(value), place=name)


def _check_manoeuvre(method: str, name: str, value: float) -> None:
    if not abs(value) <= LONGEST_MANOEUVRE:
        expected = f"a number within ±{LONGEST_MANOEUVRE:g}"
        raise InputError(f"Simulator.{method}", expected, str(value), place=name)


@dataclass(frozen=True, kw_only=True)
class StartStop:
    """Longest move and largest turn between two stops (thesis, section 3.1.2)."""

    move: float = 1.0
    """Longest move (m)."""
    turn: float = np.radians(45.0)
    """Largest turn (rad)."""

    def __post_init__(self) -> None:
        check_fields(self, POSITIVE, "move", "turn")


THESIS_STEPS = StartStop()
"""At most one metre or 45° between two stops."""


def follow_leg(simulator: Simulator, waypoint: Points, steps: StartStop) -> Iterator[Reading]:
    """Turn towards a waypoint and drive there in start-stop steps (thesis, section 3.1.2).

    Yields one reading each time the robot stops.
    """
    to = waypoint - simulator.pose[:2]
    turn = float(wrap_angle(math.atan2(to[1], to[0]) - simulator.pose[2]))
    parts = int(np.ceil(abs(turn) / steps.turn - 1e-9))
    for _ in range(parts):
        yield simulator.turn(turn / parts)
    distance = float(np.hypot(*(waypoint - simulator.pose[:2])))
    parts = int(np.ceil(distance / steps.move - 1e-9))
    for _ in range(parts):
        yield simulator.move(distance / parts)

"""The sonar driver: straight on until an obstacle, then round it, by sonars alone.

The robot of Schmidt, Wong and Yeap moves in a straight line until it runs into an obstacle. There
it avoids the obstacle, of which their paper tells nothing, and moves straight on again.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

import numpy as np
from jaxtyping import Float64

from albot_core.geometry.poses import inverse, transform_points, wrap_angle
from albot_core.geometry.types import Points, Pose, Ranges
from albot_core.planning.steering import (
    DIRECTIONS,
    Command,
    SteeringConfig,
    admissible_command,
    free_distances,
)
from albot_core.ranges import POSITIVE, check_fields
from albot_core.robot import PIONEER_3DX, RobotConfig
from albot_core.sensing.reading import SonarGeometry

_AHEAD = len(DIRECTIONS) // 2
"""Which direction is straight ahead."""


@dataclass(frozen=True, kw_only=True)
class SonarDriverConfig:
    """How the robot drives by its sonars. All of it is ours."""

    speed: float = 0.8
    """Speed straight on (m/s)."""
    turn_rate: float = 1.5
    """Greatest turn rate on the spot (rad/s)."""
    ahead: float = 0.3
    """A robot path ends where less than this (m) is free ahead."""
    open: float = 0.8
    """A direction is open if so much is free in it (m)."""
    aside: float = math.radians(20.0)
    """A robot path ends where the target is farther to the side (rad)."""
    memory: float = 2.0
    """How long echoes are kept (s), that what lies beside and behind is known. Old ones close
    doors: jambs heard from afar are misplaced by up to half a cone."""
    reach: float = 2.5
    """Echoes from farther away are left out (m): a cone is too wide there to tell the way."""
    near: float = 0.3
    """Nearer echoes may come from anywhere in the cone (m), others from its middle."""
    patience: float = 6.0
    """Within this time (s) the robot must have come…"""
    headway: float = 0.3
    """…so far (m); else it goes some way in a direction drawn at random…"""
    detour: float = 1.5
    """…of this length (m)."""
    step: float = 0.1
    """Duration of a step (s)."""

    def __post_init__(self) -> None:
        check_fields(self, POSITIVE, *(field.name for field in fields(self)))


class SonarDriver:
    """Drives straight paths, towards a target or just on, and turns on the spot between them.

    Args:
        config: How it drives.
        robot: Body and drive of the robot.
    """

    _TURNED = math.radians(3.0)
    """A turn is over when no more is left (rad)."""
    _GAIN = 3.0
    """Turn rate for each radian that is left (1/s)."""
    _SLOWEST = 0.08
    """It creeps up to obstacles no slower than this (m/s)."""
    _CLEARED = 0.15
    """What lies so much nearer than an echo, on the way to it, is not there (m)."""

    def __init__(
        self,
        config: SonarDriverConfig = SonarDriverConfig(),
        robot: RobotConfig = PIONEER_3DX,
    ) -> None:
        self._config = config
        # The least clearance: echoes are misplaced, and doors are 0.9 m wide.
        self._steering = SteeringConfig(robot=robot, clearance=0.015)

    def reset(self, rng: np.random.Generator) -> None:
        """Begin anew."""
        self._rng = rng
        self._echoes = np.empty((0, 2))
        self._ages = np.empty(0)
        self._track = np.empty((0, 2))
        self._turn_left = 0.0
        self._detour_left = 0.0
        self._side = 0.0

    def command(
        self, ranges: Ranges, sonar: SonarGeometry, motion: Pose, target: Points | None = None
    ) -> Command:
        """How to drive next.

        Args:
            ranges: What the sonars hear (m); their reach or more where they hear nothing.
            sonar: Where they point.
            motion: How the robot moved in the last step.
            target: Where to (m, robot's frame); None for straight on.
        """
        self._listen(ranges, sonar, motion)
        free = free_distances(self._echoes, self._steering.radius)
        self._turn_left -= float(motion[2])
        self._detour_left -= float(motion[0])
        if abs(self._turn_left) <= self._TURNED:
            self._turn_left = 0.0
            self._begin_path(free, target)
        wanted = self._wanted(float(free[_AHEAD]))
        return admissible_command(wanted, self._echoes, motion, self._steering)

    def _begin_path(self, free: Float64[np.ndarray, "directions"], target: Points | None) -> None:
        """Choose another direction where the robot path is at its end."""
        if self._is_stuck():
            self._track = self._track[-1:]
            self._detour_left, self._side = self._config.detour, -self._side
            self._turn_left = float(self._rng.choice(DIRECTIONS[self._open(free)]))
            return
        on_detour = target is None or self._detour_left > 0.0
        bearing = 0.0 if on_detour or target is None else math.atan2(target[1], target[0])
        best = self._choose(free, bearing)
        if free[_AHEAD] < self._config.ahead or abs(best) > self._config.aside:
            self._turn_left = best

    def _choose(self, free: Float64[np.ndarray, "directions"], bearing: float) -> float:
        """The open direction next to the one wanted; along an obstacle, always to the same side.

        So the robot follows a wall until there is a way through it, whichever way it must turn
        (as in V. Lumelsky and A. Stepanov, Path-planning strategies for a point mobile automaton
        moving amidst unknown obstacles of arbitrary shape, Algorithmica 2, 1987).
        """
        is_open = self._open(free)
        off = np.asarray(wrap_angle(DIRECTIONS - bearing))
        if is_open[np.abs(off).argmin()]:
            self._side = 0.0
            return float(DIRECTIONS[np.abs(off).argmin()])
        if not self._side:
            nearest = np.where(is_open, np.abs(off), np.inf).argmin()
            self._side = 1.0 if off[nearest] > 0 else -1.0
        turn = np.where(is_open, (off * self._side) % (2 * np.pi), np.inf)
        return float(DIRECTIONS[turn.argmin()])

    def _open(self, free: Float64[np.ndarray, "directions"]) -> np.ndarray:
        """Which directions are open; where none is, the one with the most room."""
        is_open = free >= self._config.open
        return is_open if is_open.any() else free >= free.max()

    def _wanted(self, free: float) -> Command:
        """Turn on the spot while there is something left to turn, then drive straight on."""
        config = self._config
        if self._turn_left:
            rate = np.clip(self._GAIN * self._turn_left, -config.turn_rate, config.turn_rate)
            return np.array((0.0, rate))
        room = math.sqrt(self._steering.braking * max(free - config.ahead / 2, 0.0))
        return np.array((min(config.speed, max(room, self._SLOWEST)), 0.0))

    def _is_stuck(self) -> bool:
        """Whether the robot is still about where it was some time ago."""
        long = len(self._track) * self._config.step >= self._config.patience
        return long and bool(np.hypot(*self._track.T).max() < self._config.headway)

    def _listen(self, ranges: Ranges, sonar: SonarGeometry, motion: Pose) -> None:
        """Keep what is heard with what was heard before, as seen from where the robot is now."""
        config, back = self._config, inverse(motion)
        steps = round(config.patience / config.step)
        track = np.concatenate((self._track[-steps + 1 :], np.zeros((1, 2))))
        track[:-1] = transform_points(back, track[:-1])
        self._track = track
        old = transform_points(back, self._echoes)
        is_kept = self._ages < config.memory / config.step
        points = []
        for distance, bearing, place in zip(
            ranges.tolist(), sonar.bearings, sonar.places, strict=True
        ):
            if distance >= sonar.max_range:
                continue
            away = old - place
            aside = np.abs(wrap_angle(np.arctan2(away[:, 1], away[:, 0]) - bearing))
            is_before = np.hypot(*away.T) < distance - self._CLEARED
            is_kept &= ~(is_before & (aside < 0.5 * sonar.cone))
            if distance < config.reach:
                spread = sonar.cone / 2 if distance < config.near else 0.0
                points += [
                    (place[0] + distance * math.cos(angle), place[1] + distance * math.sin(angle))
                    for angle in (bearing - spread, bearing, bearing + spread)
                ]
        self._echoes = np.concatenate((old[is_kept], np.array(points).reshape(-1, 2)))
        self._ages = np.concatenate((self._ages[is_kept] + 1, np.zeros(len(points))))

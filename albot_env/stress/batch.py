"""Checks of a batch of environments after every step.

Compiled checks (`kernels`) look at every robot and find the suspects; the exact ones (`checks`)
look at these alone, and decide.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from gymnasium import spaces
from jaxtyping import Bool, Float64, Int64

from albot_core.errors import InputError
from albot_core.geometry.poses import compose
from albot_core.geometry.types import Pose, Segments
from albot_core.maps.layers import MapSnapshot
from albot_core.sensing.reading import Readings
from albot_env.sim.obstacle_tables import SIDES
from albot_env.stress.checks import (
    REACH,
    SLACK,
    Finding,
    Limits,
    all_keys,
    check_body,
    check_info,
    check_inside,
    check_laser,
    check_movables,
    check_observation,
    check_obstacles,
    check_readings,
    check_reward,
    check_sonar,
)
from albot_env.stress.kernels import (
    Echoes,
    Motion,
    Scans,
    Surroundings,
    Tolerances,
    find_suspects,
)
from albot_env.stress.maps import MOST_SURFACES, check_map, check_places
from albot_env.tasks.core.driving import DrivingTask
from albot_env.tasks.core.parts.sensors import LASER
from albot_env.tasks.core.vector import VectorEnv
from albot_maps import World

OUTLINES = ("box", "person")
"""What has an outline of several sides, in the order of the outlines."""
Infos = Mapping[str, Any]
DEFAULTS = Limits()
"""The default tolerances."""


class Step(NamedTuple):
    """What a batch returned for a step, and where everything is then."""

    observations: Any
    """The observations of all environments."""
    rewards: Float64[np.ndarray, "environments"]
    """Their rewards; zero after a reset."""
    infos: Infos
    """Their infos."""
    readings: Readings
    """Their readings."""
    outlines: Segments
    """Outlines of all moving obstacles (a copy)."""
    rows: Int64[np.ndarray, "environments 2"]
    """First row and end row of `outlines` of each environment."""


class BatchChecker:
    """Checks the episodes of a batch, from their reset on.

    Args:
        batch: The batch.
        worlds: The world of each environment, as it should be. Only what the task itself changes
            in a world is believed of the batch.
        share: Share of the beams and sonars that are compared with the surfaces at each step, in
            (0, 1]. They take turns: at 1/8, each is compared at every eighth step.
        maps_every: Number of steps between two looks at all of a map.
        limits: The tolerances; radius and laser range are those of the batch.

    Raises:
        InputError: The share is out of range, or the robots of the task do not drive.
    """

    def __init__(
        self,
        batch: VectorEnv[Any],
        worlds: Sequence[World],
        *,
        share: float = 1.0,
        maps_every: int = 25,
        limits: Limits = DEFAULTS,
    ) -> None:
        if not 0 < share <= 1:
            raise InputError("share", "a share of the beams within (0, 1]", str(share))
        if not issubclass(batch.task, DrivingTask):
            environment = batch.task.environment
            raise InputError("task", "one in which the robot drives", environment)
        self._batch = batch
        self._given = worlds
        self._stride = max(1, round(1 / share))
        self._config = batch.observation_config
        laser = batch.readings.laser
        reach = limits.max_range if laser is None else laser.max_range
        self._limits = replace(limits, radius=batch.robot_config.radius, max_range=reach)
        self._shows_ranges = (
            laser is not None
            and LASER.name in self._config.shapes
            and self._config.laser_sectors is None
        )
        self._tolerances = _tolerances(self._limits, batch.readings)
        self._turn = 0
        self._maps_every = maps_every
        self._versions = np.full(batch.num_envs, -1)

    def after_reset(self, observations: Any, infos: Infos) -> dict[int, list[Finding]]:
        """Check a reset of all environments; return what is wrong, by environment."""
        # Some tasks shut a door or move a wall at the beginning of an episode.
        changed = map(self._batch.changed_world, range(self._batch.num_envs))
        self._surround([new or given for new, given in zip(changed, self._given, strict=True)])
        self._keys = _keys(infos)
        step = self._step(observations, np.zeros(self._batch.num_envs), infos)
        self._before, self._old_outlines = infos["pose"][:, :2].copy(), step.outlines
        return self._check(step, rewarded=False)

    def _surround(self, worlds: Sequence[World]) -> None:
        """Take the worlds of an episode."""
        self._worlds = worlds
        walls, wall_rows = _stacked([world.walls for world in worlds])
        opaque, opaque_rows = _stacked([world.opaque for world in worlds])
        movables = [(len(m.doors), len(m.boxes), len(m.walkers)) for m in _movables(worlds)]
        self._movables = np.array(movables, np.int64).reshape(-1, 3)
        self._surroundings = Surroundings(
            walls=walls,
            wall_rows=wall_rows,
            opaque=opaque,
            opaque_rows=opaque_rows,
            outlines=np.empty((0, 4)),
            outline_rows=np.zeros((len(worlds), 2), np.int64),
            movables=self._movables,
            sides=SIDES,
        )

    def after_step(
        self, observations: Any, rewards: Float64[np.ndarray, "environments"], infos: Infos
    ) -> dict[int, list[Finding]]:
        """Check a step of all environments; return what is wrong, by environment."""
        return self._check(self._step(observations, rewards, infos), rewarded=True)

    def _step(self, observations: Any, rewards: np.ndarray, infos: Infos) -> Step:
        """Return what there is to check; without movables, nothing of them is left."""
        outlines, rows = self._batch.obstacle_outlines
        return Step(observations, rewards, infos, self._batch.readings, outlines.copy(), rows)

    def check_maps(self) -> dict[int, list[Finding]]:
        """Check the maps that have changed since the last time; return what is wrong."""
        versions = self._batch.map_versions
        changed = np.flatnonzero(versions != self._versions).tolist()
        self._versions = versions.copy()
        lost = self._batch.lost
        wrong = {
            row: _map_findings(self._batch.snapshot(row), lost=bool(lost[row])) for row in changed
        }
        return {row: findings for row, findings in wrong.items() if findings}

    def _check(self, step: Step, *, rewarded: bool) -> dict[int, list[Finding]]:
        """Return what is wrong after a reset or step, by environment."""
        suspect = self._suspects(step, rewarded=rewarded)
        wrong = {
            row: lines
            for row in np.flatnonzero(suspect).tolist()
            if (lines := self._examine(row, step, rewarded=rewarded))
        }
        self._before = step.infos["pose"][:, :2].copy()
        self._old_outlines = step.outlines
        self._turn += 1
        if self._turn % self._maps_every == 0:
            for row, findings in self.check_maps().items():
                wrong[row] = [*wrong.get(row, []), *findings]
        return wrong

    def _suspects(self, step: Step, *, rewarded: bool) -> Bool[np.ndarray, "environments"]:
        """Return which environments may have something wrong."""
        infos, readings = step.infos, step.readings
        suspect = np.full(self._batch.num_envs, _keys(infos) != self._keys)
        suspect |= _outside(step.observations, self._batch.single_observation_space)
        suspect |= _not_finite(infos, self._batch.num_envs)
        if rewarded:
            total = sum(values for _, values in _values(infos["reward_terms"]))
            suspect |= ~(np.abs(step.rewards - total) <= 1e-9)
        suspect |= _out_of_range(readings)
        suspect |= infos.get("surfaces", 0) > MOST_SURFACES
        outlines = step.outlines
        surroundings = self._surroundings._replace(outlines=outlines, outline_rows=step.rows)
        has_movables = (step.rows[:, 1] > step.rows[:, 0])[:, np.newaxis]
        surroundings = surroundings._replace(movables=self._movables * has_movables)
        poses = np.ascontiguousarray(infos["pose"])
        motion = Motion(before=self._before, poses=poses, outlines=self._old_outlines)
        find_suspects(
            self._turn,
            self._stride,
            surroundings,
            motion,
            _truthful(step),
            self._scans(step),
            _echoes(readings, self._batch.num_envs),
            self._tolerances,
            suspect,
        )
        return suspect

    def _scans(self, step: Step) -> Scans:
        """Return the ranges, and where they are in the observations."""
        laser, shown = step.readings.laser, step.observations
        first = -1
        if isinstance(shown, Mapping):
            shown = shown[LASER.name] if self._shows_ranges else np.empty((0, 0), np.float32)
            first = 0 if self._shows_ranges else -1
        elif self._shows_ranges:
            first = self._config.place_of(LASER).start
        scale, number = self._config.scales.laser, self._batch.num_envs
        if laser is None or step.readings.ranges is None:
            nothing = np.empty((number, 0))
            return Scans((0.0, 0.0, 0.0), np.empty((0, 2)), nothing, shown, -1, scale)
        bearings = laser.bearings
        directions = np.stack((np.cos(bearings), np.sin(bearings)), axis=-1)
        return Scans(laser.mount, directions, step.readings.ranges, shown, first, scale)

    def _examine(self, row: int, step: Step, *, rewarded: bool) -> list[Finding]:
        """Return what the exact checks find wrong in one environment."""
        observation, info = row_of(step.observations, row), info_of(step.infos, row)
        first, end = step.rows[row]
        obstacles, readings = step.outlines[first:end], step.readings
        ranges = None if readings.ranges is None else readings.ranges[row]
        echoes = None if readings.echoes is None else readings.echoes[row]
        reward = step.rewards[row]
        found = {
            "reward": check_reward(reward, info["reward_terms"]) if rewarded else [],
            "observation": check_observation(observation, self._batch.single_observation_space),
            "info": check_info(info, self._keys),
            "readings": check_readings(readings.motions[row], ranges, echoes),
            **self._check_places(row, step, info["pose"], obstacles),
        }
        if info.get("surfaces", 0) > MOST_SURFACES:
            found["map"] = [f"the map has {info['surfaces']} surfaces"]
        # A wrong observation has no ranges to check, and a reading with a fault no true ones.
        if not any(found.values()) and _truthful(step)[row]:
            found = self._check_ranges(row, observation, info["pose"], obstacles, readings)
        return [Finding(name, line) for name, lines in found.items() for line in lines]

    def _check_places(
        self, row: int, step: Step, pose: Pose, obstacles: Segments
    ) -> dict[str, list[str]]:
        """Return what is wrong with where the robot and all that moves are."""
        walls, limits = self._worlds[row].walls, self._limits
        before = self._outlines(row, self._old_outlines, step.rows)
        now = self._outlines(row, step.outlines, step.rows)
        movables = [
            check_movables(kind, walls, old, new, limits)
            for kind, old, new in zip(OUTLINES, before, now, strict=True)
        ]
        inside = [
            line
            for kind, corners in zip(OUTLINES, now, strict=True)
            for line in check_inside(kind, corners, pose[:2])
        ]
        return {
            "body": check_body(walls, self._before[row], pose[:2], limits),
            "obstacles": check_obstacles(obstacles, pose[:2], limits) + inside,
            "movables": [line for lines in movables for line in lines],
        }

    def _outlines(
        self, row: int, outlines: Segments, rows: Int64[np.ndarray, "environments 2"]
    ) -> list[Float64[np.ndarray, "movables corners 2"]]:
        """Return the corners (m) of the boxes and of the people of an environment."""
        first, end = rows[row]
        doors, boxes, _ = self._movables[row]
        corners = outlines[first:end, :2]
        people = corners[doors + 4 * boxes :]
        return [
            corners[doors : doors + 4 * boxes].reshape(-1, 4, 2),
            people.reshape(-1, SIDES, 2),
        ]

    def _check_ranges(
        self, row: int, observation: Any, pose: Pose, obstacles: Segments, readings: Readings
    ) -> dict[str, list[str]]:
        """Return what is wrong with the ranges of laser and sonars, read and observed."""
        world, reading = self._worlds[row], readings[row]
        of_laser: list[str] = []
        of_sonar: list[str] = []
        if reading.laser is not None:
            seen = np.concatenate((world.opaque, obstacles))
            laser = reading.laser.geometry
            mount, scans = compose(pose, np.array(laser.mount)), [reading.laser.ranges]
            if self._shows_ranges:
                scans.append(self._config.decode(LASER, observation))
            for ranges in scans:
                of_laser += check_laser(seen, mount, laser.bearings, ranges, self._limits)
        if reading.sonar is not None:
            surfaces = np.concatenate((world.walls, obstacles))
            of_sonar = check_sonar(surfaces, pose, reading.sonar, self._limits)
        return {"laser": list(dict.fromkeys(of_laser)), "sonar": of_sonar}


def row_of(observations: Any, row: int) -> Any:
    """Return the observation of one environment, flat or in parts."""
    if isinstance(observations, Mapping):
        return {name: rows[row] for name, rows in observations.items()}
    return observations[row]


def info_of(infos: Infos, row: int) -> dict[str, Any]:
    """Return the info of one environment, as its single form returns it."""
    return {
        name: info_of(values, row) if isinstance(values, Mapping) else values[row]
        for name, values in infos.items()
        if not name.startswith("_")
    }


def _truthful(step: Step) -> Bool[np.ndarray, "environments"]:
    """Return whose readings are of this moment, and without a fault."""
    count = len(step.rewards)
    faults = step.infos.get("fault")
    if faults is None:
        return np.ones(count, np.bool_)
    return np.asarray((faults == "") & (step.readings.stamps == step.infos["time"]))


def _map_findings(snapshot: MapSnapshot, *, lost: bool) -> list[Finding]:
    """Return what is wrong with the map of a robot."""
    places = check_places(snapshot.place_graph, lost=lost)
    found = {"map": check_map(snapshot), "places": places}
    return [Finding(name, line) for name, lines in found.items() for line in lines]


def _keys(infos: Infos) -> frozenset[str]:
    """Return the keys of the environments' infos (see `all_keys`)."""
    return frozenset(key for key in all_keys(infos) if key[0] != "_" and "._" not in key)


def _values(infos: Infos) -> list[tuple[str, Any]]:
    """Return the values of infos by key, without gymnasium's masks."""
    return [(key, values) for key, values in infos.items() if not key.startswith("_")]


def _movables(worlds: Sequence[World]) -> list[Any]:
    return [world.movables for world in worlds]


def _stacked(
    surfaces: Sequence[Segments],
) -> tuple[Float64[np.ndarray, "all 4"], Int64[np.ndarray, "robots 2"]]:
    """Return surfaces in one array, and the first row and end row of each."""
    ends = np.cumsum([len(each) for each in surfaces])
    counts = np.array([len(each) for each in surfaces], np.int64)
    return np.concatenate(surfaces), np.stack((ends - counts, ends), axis=1)


def _tolerances(limits: Limits, readings: Readings) -> Tolerances:
    """Return the limits as compiled checks need them."""
    beams = 0 if readings.laser is None else readings.laser.beams
    sonar = readings.sonar
    return Tolerances(
        radius=limits.radius,
        overlap=limits.overlap,
        obstacle_overlap=limits.obstacle_overlap,
        box_overlap=limits.box_overlap,
        range_error=limits.range_error,
        max_range=limits.max_range,
        echo_noise=limits.echo_noise,
        echo_share=limits.echo_share,
        echo_deviations=limits.echo_deviations,
        reach=0.0 if sonar is None else REACH * sonar.max_range,
        slack=SLACK,
        most_lost=np.array([limits.most_lost(number) for number in range(beams + 1)]),
    )


def _echoes(readings: Readings, number: int) -> Echoes:
    """Return the sonars' ranges."""
    sonar = readings.sonar
    if sonar is None or readings.echoes is None:
        return Echoes(np.empty((0, 3)), 0.0, 0.0, 0.0, np.empty((number, 0)))
    mounts = np.column_stack((np.array(sonar.places), sonar.bearings))
    return Echoes(mounts, sonar.cone / 2, sonar.min_range, sonar.max_range, readings.echoes)


def _outside(observations: Any, space: spaces.Space[Any]) -> Bool[np.ndarray, "environments"]:
    """Return which observations are not in their space."""
    if isinstance(space, spaces.Dict):
        parts = [_outside(observations[name], part) for name, part in space.spaces.items()]
        return np.asarray(np.any(parts, axis=0))
    assert isinstance(space, spaces.Box)
    if observations.shape[1:] != space.shape or observations.dtype != space.dtype:
        return np.ones(len(observations), np.bool_)
    inside = (observations >= space.low) & (observations <= space.high)
    return np.asarray(~inside.reshape(len(observations), -1).all(axis=1))


def _not_finite(infos: Infos, number: int) -> Bool[np.ndarray, "environments"]:
    """Return in which environments a number of the info is not finite."""
    wrong = np.zeros(number, np.bool_)
    for _, values in _values(infos):
        if isinstance(values, Mapping):
            wrong |= _not_finite(values, number)
        elif isinstance(values, np.ndarray) and values.dtype.kind == "f":
            wrong |= ~np.isfinite(values).reshape(number, -1).all(axis=1)
    return wrong


def _out_of_range(readings: Readings) -> Bool[np.ndarray, "environments"]:
    """Return which readings hold a number that is none, or a range below zero."""
    wrong = ~np.isfinite(readings.motions).all(axis=1)
    for ranges in (readings.ranges, readings.echoes):
        if ranges is not None:
            wrong |= ~(ranges >= 0).all(axis=1)
    return np.asarray(wrong)

"""Probes: robots that were led along a tour of a fixed scene, and are to come home."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import ClassVar

import numpy as np
from jaxtyping import Int64

from albot_core.errors import InputError, did_you_mean
from albot_core.geometry.types import Points, Pose
from albot_core.planning.leading import Driving
from albot_core.robot import CONTROL_STEP
from albot_env.sim.batch_simulator import draw_key
from albot_env.tasks.core.episode_state import RobotState
from albot_env.tasks.core.journeys import JourneySpec
from albot_env.tasks.core.observation import ObservationConfig, chosen_observations
from albot_env.tasks.core.row_arrays import Arrays
from albot_env.tasks.core.settings import Equipment, chosen_config
from albot_env.tasks.homing.outward_journey import Guide, Route
from albot_env.tasks.homing.task import WayHomeConfig, WayHomeTask
from albot_env.tasks.probe.scenes import (
    DETOUR,
    HIDDEN_GOAL,
    NO_CHOICE,
    RECTANGLE,
    SUNBURST,
    TRIANGLE_COMPLETION,
    Scene,
    Trial,
)
from albot_maps import World, load_world
from albot_maps.geodesic import DistanceField

LED = Driving(speed=0.7, turn_rate=np.radians(60.0))
"""Speeds at which robots are led."""


@dataclass(frozen=True, kw_only=True)
class ProbeConfig(WayHomeConfig):
    """Parameters of actions, observations, rewards, success and trials."""

    observations: ObservationConfig | None = None  # type: ignore[assignment]
    """Parts and scales of observations; None for `parts_by_map`, all that the mapper can give."""
    hints: bool = False
    """Whether what a planner has worked out may be observed (`HINTS`)."""
    trial: str = ""
    """Name of the only trial; empty for all trials of the scene."""


class TourGuide(Guide):
    """Leads robots along the tours of a scene's trials, which the numbers of journeys choose.

    Args:
        equipment: Equipment of the robots; of it, only body and obstacles matter.
        scene: Name of the scene's world.
        trials: The trials by name.
    """

    def __init__(self, equipment: Equipment, scene: str, trials: Mapping[str, Trial]) -> None:
        super().__init__(equipment)
        self._scene = scene
        self._tours = [trial.tour for trial in trials.values()]
        self.kind = (scene, *self._tours, equipment.robot, equipment.movables)

    def find_route(self, spec: JourneySpec) -> Route:
        """Return the way of a journey, which depends on nothing but `spec` and `kind`.

        Raises:
            InputError: The robot cannot follow the tour: it is too slow, or too wide.
        """
        world = spec.world
        name = self._tours[spec.number % len(self._tours)]
        waypoints = world.tours[name][1:]
        x, y = spec.start[:2].tolist()
        field = _field(self._scene, world.robot_radius, (x, y))
        commands = self._begin(spec)
        for waypoint in waypoints:
            steps = _patience(waypoint - self._robot.poses[0, :2])
            while (command := LED.command_towards(waypoint, self._robot.poses[0])) is not None:
                if steps == 0:
                    raise InputError(world.name, "a tour that the robot can follow", f"tour {name}")
                self._drive(command, commands)
                steps -= 1
        self._stop(commands)
        return Route(world=world, commands=np.array(commands), field=field, cut_short=False)


def _patience(leg: Points) -> int:
    """Return the number of control steps within which a leg (2,) (m) must be driven."""
    return round((30.0 + 10.0 * float(np.hypot(*leg)) / LED.speed) / CONTROL_STEP)


@lru_cache(maxsize=32)
def _loaded(name: str, robot_radius: float) -> World:
    """Return a world of the catalogue, the same object each time."""
    return load_world(name, robot_radius)


@lru_cache(maxsize=32)
def _field(name: str, robot_radius: float, home: tuple[float, float]) -> DistanceField:
    """Return the geodesic distances home (m) in a world of the catalogue."""
    return DistanceField(_loaded(name, robot_radius).walls, robot_radius, np.array(home))


class ProbeTask(WayHomeTask):
    """Robots that were led along a tour of a scene, and are to come home.

    Args:
        robots: Number of robots.
        equipment: Equipment of the robots.
        config: Parameters of actions, observations, rewards, success and trials.
        journeys: Number of tours, each with its noise; they lead through the trials in turn. 0
            for a trial and noise that are drawn each time.

    Raises:
        InputError: `journeys` is negative, the mapper or the trial is unknown, or hints are to be
            observed though `config.hints` is false.
    """

    scene: ClassVar[Scene]
    """The scene."""

    def __init__(
        self,
        robots: int,
        equipment: Equipment,
        *,
        config: ProbeConfig | None = None,
        journeys: int = 0,
    ) -> None:
        config = chosen_config(config, ProbeConfig, self.environment)
        trials = dict(self.scene.trials)
        if config.trial:
            if config.trial not in trials:
                found = f"{config.trial}{did_you_mean(config.trial, trials)}"
                expected = f"one of {', '.join(trials)}"
                raise InputError(self.environment, expected, found, place="config.trial")
            trials = {config.trial: trials[config.trial]}
        config = replace(config, observations=chosen_observations(config, equipment.spec))
        guide = TourGuide(equipment, self.scene.world, trials)
        super().__init__(robots, equipment, config=config, guide=guide, journeys=journeys)
        self._trials = trials
        self._given: list[World | None] = [None] * robots
        self._trial_names = np.full(robots, "", object)
        self._chosen = np.full(robots, NO_CHOICE, object)

    def check_start(self, world: World, start: Pose) -> None:
        """Check that a robot can start at a pose.

        Raises:
            InputError: The world is not the scene's, or the start is not the world's.
        """
        scene = _loaded(self.scene.world, world.robot_radius)
        if not np.array_equal(world.walls, scene.walls) or world.tours.keys() != scene.tours.keys():
            raise InputError(self.environment, self.scene.world, world.name, place="world")
        if not (start == scene.starts).all(axis=1).any():
            place, found = "options.start", str(start.tolist())
            raise InputError(self.environment, "the scene's own start", found, place=place)
        super().check_start(world, start)

    def begin(self, row: int, world: World, start: Pose, rng: np.random.Generator) -> None:
        """Start a robot's episode after its tour: where it was led, or carried."""
        journey = self._outward_journeys.draw(world, start, rng)
        name = list(self._trials)[journey.number % len(self._trials)]
        trial = self._trials[name]
        pose = self.scene.release(trial, rng)
        key = draw_key(rng) if self._shared else None
        after = self._world_of(name, world)
        if after is not world:
            x, y = start[:2].tolist()
            field = _field(trial.world, world.robot_radius, (x, y))
            journey = replace(journey, world=after, field=field)
        if pose is not None:
            body = journey.end.body._replace(pose=pose)
            journey = replace(journey, end=replace(journey.end, body=body))
        self._given[row], self._trial_names[row], self._chosen[row] = world, name, NO_CHOICE
        self._set_out_from(row, journey, key)

    def _world_of(self, trial: str, given: World) -> World:
        """Return the world in which the robot is to come home."""
        name = self.scene.trials[trial].world
        return _loaded(name, given.robot_radius) if name else given

    def _compute_rewards(self, rows: Int64[np.ndarray, "some"]) -> None:
        super()._compute_rewards(rows)
        scene = self.scene
        if not len(scene.points):
            return
        for row in rows.tolist():
            if not scene.keeps_first or self._chosen[row] == NO_CHOICE:
                self._chosen[row] = scene.chosen(self._state.poses[row, :2])

    @property
    def facts(self) -> dict[str, np.ndarray]:
        """The true values for `info`, one row per robot."""
        return super().facts | {"trial": self._trial_names, "choice": self._chosen}

    def given_world(self, row: int) -> World:
        """Return the world of a robot as it was given, before the change."""
        world = self._given[row]
        assert world is not None, "a robot is nowhere before it begins"
        return world

    def _task_state(self, row: int) -> Arrays:
        names = self._trial_names[row], self._chosen[row]
        trial, choice = (np.frombuffer(name.encode(), np.uint8).copy() for name in names)
        return {**super()._task_state(row), "probe.trial": trial, "probe.choice": choice}

    def set_state(self, row: int, world: World, state: RobotState) -> None:
        """Put a robot into a state; `world` is the one without the change."""
        trial = state.arrays["probe.trial"].tobytes().decode()
        super().set_state(row, self._world_of(trial, world), state)
        self._given[row], self._trial_names[row] = world, trial
        self._chosen[row] = state.arrays["probe.choice"].tobytes().decode()


class TriangleCompletionTask(ProbeTask):
    """The probe of path integration."""

    environment = "Albot/Probe-TriangleCompletion-v0"
    scene = TRIANGLE_COMPLETION


class SunburstTask(ProbeTask):
    """The probe of a shortcut."""

    environment = "Albot/Probe-Sunburst-v0"
    scene = SUNBURST


class DetourTask(ProbeTask):
    """The probe of a detour."""

    environment = "Albot/Probe-Detour-v0"
    scene = DETOUR


class RectangleTask(ProbeTask):
    """The probe of geometry against a feature."""

    environment = "Albot/Probe-Rectangle-v0"
    scene = RECTANGLE


class HiddenGoalTask(ProbeTask):
    """The probe of a hidden goal."""

    environment = "Albot/Probe-HiddenGoal-v0"
    scene = HIDDEN_GOAL


PROBES: Mapping[str, type[ProbeTask]] = {
    task.environment: task
    for task in (TriangleCompletionTask, SunburstTask, DetourTask, RectangleTask, HiddenGoalTask)
}
"""The probes by id of the environment."""

"""What the single and the vector environment need of a task, and the tables that all tasks keep."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any, ClassVar

import numpy as np
from jaxtyping import Bool, Float32, Float64, Int64

from albot_core.geometry.types import Points, Pose, Segments
from albot_core.maps.activity import Activity
from albot_core.maps.layers import MapSnapshot
from albot_core.sensing.reading import Readings
from albot_env.tasks.core.actions import ActionConfig, Numbers
from albot_env.tasks.core.episode_state import RobotState
from albot_env.tasks.core.journeys import Journeys
from albot_env.tasks.core.observation import ObservationConfig
from albot_env.tasks.core.state import BatchState, new_stats
from albot_maps import World


class Task(ABC):
    """Robots with a task. A single environment has one robot, a vector environment many.

    An environment calls `begin` and `observe` for an episode, then `act` and `observe` for each
    step, and reads the rest. Tasks in which the agent drives derive from `DrivingTask`.

    Args:
        robots: Number of robots.
        actions: The action config.
        observations: The observation config, fitted to the robots' sensors.
        state: Poses, beliefs and readings of the robots.
    """

    environment: ClassVar[str]
    """Id of the environment."""
    terms_of_reward: ClassVar[tuple[str, ...]] = ()
    """The names of the reward's terms."""
    journeys: Journeys[Any] | None = None
    """The journeys before each episode; None if robots start without one."""

    def __init__(
        self,
        robots: int,
        *,
        actions: ActionConfig,
        observations: ObservationConfig,
        state: BatchState,
    ) -> None:
        self.actions = actions
        """The action config."""
        self.observation_config = observations
        """The observation config, fitted to the sensors."""
        self._state = state
        self._stats = new_stats(robots, len(self.terms_of_reward))
        self._everyone: Int64[np.ndarray, "robots"] = np.arange(robots)
        self._worlds: list[World | None] = [None] * robots
        self.world_names = np.full(robots, None, object)
        """The name of each robot's world."""
        length = observations.flat_space.shape[0]
        self.observations: Float32[np.ndarray, "robots length"] = np.zeros(
            (robots, length), np.float32
        )
        """The observations, one row per robot; a new array after each `act`."""

    @abstractmethod
    def check_start(self, world: World, start: Pose) -> None:
        """Check that a robot can start at a pose.

        Raises:
            InputError: It cannot, or the task is impossible in this world.
        """

    @abstractmethod
    def begin(self, row: int, world: World, start: Pose, rng: np.random.Generator) -> None:
        """Start a robot's episode; call `observe` before anything else.

        The start must pass `check_start`.
        """

    @abstractmethod
    def act(self, numbers: Numbers) -> None:
        """Make one step of all robots with these actions."""

    @abstractmethod
    def observe(self, rows: Int64[np.ndarray, "some"] | None = None) -> None:
        """Fill in the observations of all robots, or of those in `rows`; compute their rewards."""

    @property
    @abstractmethod
    def ended(self) -> Bool[np.ndarray, "robots"]:
        """Which robots' episodes have ended by themselves."""

    @property
    @abstractmethod
    def facts(self) -> dict[str, np.ndarray]:
        """True values for `info`, one row per robot."""

    @property
    @abstractmethod
    def times(self) -> Float64[np.ndarray, "robots"]:
        """Simulated time since the start of each robot's episode (s)."""

    @property
    @abstractmethod
    def collided(self) -> Bool[np.ndarray, "robots"]:
        """Whether each robot touched something in the last step."""

    @property
    @abstractmethod
    def readings(self) -> Readings:
        """The latest readings of the robots; overwritten by the next `observe`."""

    @property
    @abstractmethod
    def rooms(self) -> np.ndarray:
        """Names of the rooms that the robots are truly in (robots,); empty between rooms."""

    @abstractmethod
    def room(self, row: int) -> str:
        """Return the name of the room that a robot is truly in; empty between rooms."""

    @property
    @abstractmethod
    def updates(self) -> Int64[np.ndarray, "robots"]:
        """Number of views that each mapper has added to its map."""

    @property
    @abstractmethod
    def lost(self) -> Bool[np.ndarray, "robots"]:
        """Whether each robot believes to be lost; never without a mapper that can tell."""

    @property
    @abstractmethod
    def map_versions(self) -> Int64[np.ndarray, "robots"]:
        """Number of changes of each map."""

    @abstractmethod
    def snapshot(self, row: int) -> MapSnapshot:
        """Return a robot's map."""

    @abstractmethod
    def activity(self, row: int) -> Activity | None:
        """Return the activity of a robot's attractor network; None if its mapper has none."""

    @abstractmethod
    def state(self, row: int) -> RobotState:
        """Return all that the future of a robot's episode depends on (copies)."""

    @abstractmethod
    def set_state(self, row: int, world: World, state: RobotState) -> None:
        """Put a robot into a state that robots of this task with the same equipment returned.

        Args:
            row: The robot.
            world: World of the state.
            state: The state; it is not changed.

        Raises:
            InputError: The state is from another kind of machine.
        """

    @property
    def claim_outcomes(self) -> Int64[np.ndarray, "robots"]:
        """What the claim of each robot would be now, if it were the first of its visit.

        1 if right, -1 if false, and 0 if it would not count. It is asked for whether or not the
        actions have a claim; in tasks that have no setting `claims` it is 0.
        """
        return np.zeros(len(self._everyone), np.int64)

    def matched_reading(self, row: int) -> int:
        """Return the earlier reading that a robot's mapper matches to its place; -1 for none."""
        return -1

    def dynamic_obstacles(self, row: int) -> Segments:
        """Return the outlines of the moving obstacles around a robot now (world frame)."""
        return np.empty((0, 4))

    @property
    def obstacle_outlines(self) -> tuple[Segments, Int64[np.ndarray, "robots 2"]]:
        """The outlines of all moving obstacles now, and each robot's first row and end row of them.

        The outlines are those of `dynamic_obstacles`; the next step overwrites them.
        """
        return np.empty((0, 4)), np.zeros((len(self._everyone), 2), np.int64)

    def most_steps(self, row: int) -> int | None:
        """Return the number of steps after which a robot's episode ends at the latest, if known."""
        return None

    def way_out(self, row: int) -> Points:
        """Return the true path that led a robot to where its episode began (world frame, m).

        It is empty where the episode began at home, or was continued from a state.
        """
        return np.empty((0, 2))

    @abstractmethod
    def close(self) -> None:
        """Stop the threads that the task has, if any."""

    def detach_observations(self) -> None:
        """Use a new array from now on, so that observations handed out do not change."""
        self.observations = self.observations.copy()

    @property
    def poses(self) -> Float64[np.ndarray, "robots 3"]:
        """True poses of the robots (world frame)."""
        return self._state.poses

    @property
    def beliefs(self) -> Float64[np.ndarray, "robots 3"]:
        """Estimated poses of the robots, in their maps' frames."""
        return self._state.beliefs

    @property
    def homes_in_robot(self) -> Float64[np.ndarray, "robots 3"]:
        """Estimated poses of home, in the robots' own frames."""
        return self._state.homes_in_robot

    @property
    def steps(self) -> Int64[np.ndarray, "robots"]:
        """Number of control steps of each robot."""
        return self._stats.steps

    @property
    def starts(self) -> Float64[np.ndarray, "robots 3"]:
        """Start poses (world frame): the origins of the maps' frames."""
        return self._stats.starts

    @property
    def path_lengths(self) -> Float64[np.ndarray, "robots"]:
        """True distances driven (m)."""
        return self._stats.path_lengths

    @property
    def rewards(self) -> Float64[np.ndarray, "robots"]:
        """Rewards of the last step: the sums of the terms."""
        return self._stats.rewards

    @property
    def terms(self) -> dict[str, Float64[np.ndarray, "robots"]]:
        """Terms of the last step's reward, by name."""
        return dict(zip(self.terms_of_reward, self._stats.terms.T, strict=True))

    def terms_of(self, row: int) -> dict[str, float]:
        """Return the terms of one robot's last reward, by name."""
        return dict(zip(self.terms_of_reward, self._stats.terms[row].tolist(), strict=True))

    @property
    def position_errors(self) -> Float64[np.ndarray, "robots"]:
        """Distance from each true position to the estimated one (m)."""
        return self._stats.position_errors

    def given_world(self, row: int) -> World:
        """Return the world of a robot as the environment was given it."""
        return self.world(row)

    def world(self, row: int) -> World:
        """Return the world that a robot is in."""
        world = self._worlds[row]
        assert world is not None, "a robot is nowhere before it begins"
        return world

"""Batched robots: they drive and map, each on its own, all in the same compiled loops.

A single environment has one robot, a vector environment many: what each gives is the same to the
last bit. A task is a subclass: it says what a step is worth and when an episode ends.
"""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np
from jaxtyping import Bool, Float32, Float64, Int64

from albot_core.errors import InputError
from albot_core.geometry.types import Pose, Segments
from albot_core.mappers.mapper import TRAVEL
from albot_core.maps.activity import Activity
from albot_core.maps.layers import EMPTY_MAP, MapSnapshot
from albot_core.sensing.reading import Readings
from albot_env.sim import PIONEER_3DX
from albot_env.sim.batch_simulator import BatchSimulator, draw_key
from albot_env.sim.simulator import CONTROL_STEP, SUBSTEPS
from albot_env.sim.thread_pool import MIN_ROWS_PER_THREAD, ThreadPool
from albot_env.tasks.core.actions import ActionConfig, Numbers
from albot_env.tasks.core.episode_snapshot import EpisodeSnapshot
from albot_env.tasks.core.journeys import Journeys
from albot_env.tasks.core.observation import ObservationConfig
from albot_env.tasks.core.observation_builder import ObservationBuilder
from albot_env.tasks.core.settings import Equipment
from albot_env.tasks.core.state import (
    BatchState,
    begin_stats,
    integrate_odometry,
    new_stats,
    update_all_stats,
)
from albot_maps import World

_MAPPER_STREAM = 1
"""Which of a robot's random streams its mapper draws from."""


class BatchedRobots:
    """Robots that drive, sense, map and observe, without a task.

    Args:
        robots: How many.
        equipment: What they set out with.
        actions: What actions ask for.
        observations: How they observe.

    Raises:
        InputError: There is no such mapper; or `time_left` is to be observed in a task without a
            budget, or no part at all.
    """

    environment: ClassVar[str] = "BatchedRobots"
    """Id of the environment."""
    has_budget: ClassVar[bool] = False
    """Whether robots are given a time, of which what is left can be observed."""
    terms_of_reward: ClassVar[tuple[str, ...]] = ()
    """The names of the reward's terms."""
    journeys: Journeys[Any] | None = None
    """What robots have behind them when an episode begins; None where they set out anew."""

    def __init__(
        self,
        robots: int,
        equipment: Equipment,
        *,
        actions: ActionConfig,
        observations: ObservationConfig,
    ) -> None:
        if "time_left" in observations.parts and not self.has_budget:
            expected = f"parts that {self.environment} has: no time is given to be back in"
            raise InputError("ObservationConfig.parts", expected, "time_left")
        sensors = equipment.sensors
        self.actions = actions
        """What actions ask for."""
        self._nothing: Int64[np.ndarray, "robots"] = np.zeros(robots, np.int64)
        self._never = np.zeros(robots, np.bool_)
        self._mappers = equipment.mappers(robots)
        self._threads = ThreadPool(equipment.threads)
        self.ground_laser = sensors.ground_laser.geometry
        """Where the beams point by which ground is found covered (see `Sensors.ground_laser`)."""
        laser = None if sensors.laser is None else sensors.laser.geometry
        sonar = None if sensors.sonar is None else sensors.sonar.geometry
        self.observing = observations = observations.fitted(laser, sonar)
        """How they observe with these sensors."""
        if not observations.shapes:
            expected = "a part that robots with these sensors have"
            raise InputError("ObservationConfig.parts", expected, ", ".join(observations.parts))
        self._simulator = BatchSimulator(
            robots,
            robot=PIONEER_3DX,
            sensors=sensors,
            threads=self._threads,
            movables=equipment.movables,
        )
        self._builder = ObservationBuilder(robots, observations, self.ground_laser)
        self._stats = new_stats(robots, len(self.terms_of_reward))
        self._cell_area = observations.coverage.cell**2
        self._everyone: Int64[np.ndarray, "robots"] = np.arange(robots)
        self._worlds: list[World | None] = [None] * robots
        self.world_names = np.full(robots, None, object)
        """The name of each robot's world."""
        mappers = self._mappers
        beliefs = np.zeros((robots, 3)) if mappers is None else mappers.poses
        self._state = BatchState(
            poses=self._simulator.poses,
            beliefs=beliefs,
            home_places=np.zeros((robots, 3)) if mappers is None else mappers.homes,
            ways_home=np.full((robots, 7), np.nan) if mappers is None else mappers.ways_home,
            places=np.zeros((robots, 2), np.bool_) if mappers is None else mappers.places,
            homes=np.zeros((robots, 3)),
            motions=self._simulator.motions,
            ranges=self._simulator.ranges,
            echoes=self._simulator.echoes,
        )
        length = observations.flat_space.shape[0]
        self.observations: Float32[np.ndarray, "robots length"] = np.zeros(
            (robots, length), np.float32
        )
        """What each observes, in one row; after each `drive` another array."""

    def check_start(self, world: World, start: Pose) -> None:
        """Raise InputError unless a robot can start there.

        Raises:
            InputError: It is not finite, too near to something, or nowhere that a robot can
                come to from the world's starts.
        """
        self._simulator.check_start(world, start)

    def begin(self, row: int, world: World, start: Pose, rng: np.random.Generator) -> None:
        """Let a robot set out anew with an empty map; call `observe` before all else.

        The start must be one (see `check_start`).
        """
        self._set_out(row, world, start, draw_key(rng))

    def _set_out(self, row: int, world: World, start: Pose, key: int) -> None:
        """Let a robot set out with an empty map; `key` decides all its noise."""
        self._simulator.place(row, world, start, key)
        stats = self._stats
        stats.reachable[row] = self._builder.begin(row, world)
        if self._mappers is not None:
            # A stream of its own: how often a mapper draws changes no other noise.
            self._mappers.reset(row, np.random.default_rng((key, _MAPPER_STREAM)))
        else:
            self._state.beliefs[row] = 0
            self._state.ways_home[row, TRAVEL] = 0
        self._worlds[row], self.world_names[row] = world, world.name
        begin_stats(row, start, stats)
        stats.before[row], stats.path_lengths[row] = start[:2], 0.0

    def episode_snapshot(self, row: int) -> EpisodeSnapshot:
        """The state of a robot at rest, and all that it knows."""
        return EpisodeSnapshot(
            start=self.starts[row].copy(),
            path_length=float(self.path_lengths[row]),
            body=self._simulator.snapshot(row),
            progress=self._builder.snapshot(row),
            belief=self.beliefs[row].copy(),
            way_home=self._state.ways_home[row].copy(),
            memory={} if self._mappers is None else self._mappers.state(row),
        )

    def restore(
        self, row: int, world: World, snapshot: EpisodeSnapshot, key: int | None = None
    ) -> None:
        """Give a robot the state and knowledge that another one had in this world, at step 0.

        `key` decides the noise from now on; by default it is the one it had, and what comes next
        is what would have come, but that it begins an empty occupancy grid.
        """
        body = snapshot.body if key is None else snapshot.body._replace(key=key)
        self._set_out(row, world, snapshot.start, body.key)
        self._simulator.restore(row, world, body)
        self._builder.restore(row, snapshot.progress)
        if self._mappers is None:
            self._state.beliefs[row] = snapshot.belief
            self._state.ways_home[row] = snapshot.way_home
        else:
            self._mappers.restore(row, snapshot.memory)
        stats = self._stats
        stats.before[row] = snapshot.body.pose[:2]
        stats.path_lengths[row] = snapshot.path_length

    def begin_return(self, row: int) -> None:
        """Let a robot know that from now on it is to go home."""
        if self._mappers is not None:
            self._mappers.begin_return(row)

    @property
    def at_rest(self) -> bool:
        """Whether no wheel turns."""
        return not self._simulator.wheels.any()

    def act(self, numbers: Numbers) -> None:
        """One control step of all robots with these actions."""
        self.drive(self.actions.commands(numbers))

    def drive(self, commands: Float64[np.ndarray, "robots 2"]) -> None:
        """One control step of all robots with speeds (m/s) and turn rates (rad/s)."""
        simulator = self._simulator
        simulator.clear_contacts()
        simulator.drive(simulator.robot.targets_for(commands), SUBSTEPS)
        steps = self._stats.steps
        steps += 1
        self.observations = np.empty_like(self.observations)

    def detach_observations(self) -> None:
        """Write observations elsewhere from now on: those handed out stay as they are."""
        self.observations = self.observations.copy()

    def observe(self, rows: Int64[np.ndarray, "some"] | None = None) -> None:
        """Let all robots, or some, sense, map and observe, and compute their rewards."""
        chosen = self._everyone if rows is None else rows
        self._simulator.locate(chosen)
        self._threads.share(chosen, self._observe, MIN_ROWS_PER_THREAD)

    def _observe(self, rows: Int64[np.ndarray, "some"], _: int) -> None:
        self._simulator.sense(rows)
        state = self._state
        if self._mappers is None:
            integrate_odometry(rows, state.motions, state.beliefs, state.ways_home[:, TRAVEL])
        else:
            self._mappers.update(rows, self.readings)
            if self.observing.shows_way_home:
                self._mappers.find_ways(rows)
        self._builder.observe(rows, state, self.observations)
        self._compute_rewards(rows)

    def _compute_rewards(self, rows: Int64[np.ndarray, "some"]) -> None:
        """Bring the statistics of some robots up to date, and compute what their step was worth."""
        update_all_stats(rows, self._cell_area, self._state, self._builder.progress, self._stats)

    @property
    def ended(self) -> Bool[np.ndarray, "robots"]:
        """Whose episode has ended by itself."""
        return self._never

    @property
    def facts(self) -> dict[str, np.ndarray]:
        """The truth in numbers, for `info`: a row for each robot."""
        return {
            "pose": self.poses,
            "start": self.starts,
            "belief": self.beliefs,
            "position_error": self.position_errors,
            "rooms_entered": self.rooms_entered,
            "coverage": self.coverages,
            "collided": self.collided,
            "path_length": self.path_lengths,
            "time": self.times,
            "updates": self.updates,
            "surfaces": self.surface_counts,
        }

    @property
    def readings(self) -> Readings:
        """What the robots sensed last. It is written over at the next `observe`."""
        return self._simulator.readings(self.times)

    def close(self) -> None:
        """Stop the threads."""
        self._threads.close()

    @property
    def poses(self) -> Float64[np.ndarray, "robots 3"]:
        """Where the robots truly are, in the world frame."""
        return self._state.poses

    @property
    def beliefs(self) -> Float64[np.ndarray, "robots 3"]:
        """Where they believe to be, in their maps' frames."""
        return self._state.beliefs

    @property
    def homes(self) -> Float64[np.ndarray, "robots 3"]:
        """Where they believe home to be, in their own frames."""
        return self._state.homes

    @property
    def times(self) -> Float64[np.ndarray, "robots"]:
        """Simulated time since each set out (s)."""
        return self.steps * CONTROL_STEP

    @property
    def collided(self) -> Bool[np.ndarray, "robots"]:
        """Whether each touched something in the last step."""
        return self._simulator.collided

    @property
    def steps(self) -> Int64[np.ndarray, "robots"]:
        """How many control steps each has taken."""
        return self._stats.steps

    @property
    def starts(self) -> Float64[np.ndarray, "robots 3"]:
        """Where each set out (world frame): the origin of its map's frame."""
        return self._stats.starts

    @property
    def path_lengths(self) -> Float64[np.ndarray, "robots"]:
        """How far each has truly driven (m)."""
        return self._stats.path_lengths

    @property
    def rewards(self) -> Float64[np.ndarray, "robots"]:
        """What the last step was worth to each: the sum of the terms."""
        return self._stats.rewards

    @property
    def terms(self) -> dict[str, Float64[np.ndarray, "robots"]]:
        """What the last step was worth, by the reward's terms."""
        return dict(zip(self.terms_of_reward, self._stats.terms.T, strict=True))

    def terms_of(self, row: int) -> dict[str, float]:
        """What the last step was worth to a robot, by the reward's terms."""
        return dict(zip(self.terms_of_reward, self._stats.terms[row].tolist(), strict=True))

    @property
    def position_errors(self) -> Float64[np.ndarray, "robots"]:
        """Distance from each true position to the believed one (m)."""
        return self._stats.position_errors

    @property
    def coverages(self) -> Float64[np.ndarray, "robots"]:
        """Share of the ground that can be reached which each has covered."""
        return self._stats.coverages

    @property
    def ranges(self) -> Float64[np.ndarray, "robots beams"]:
        """What the beams of `ground_laser` met last (m); infinite where nothing came back."""
        return self._state.ranges

    @property
    def rooms_entered(self) -> Int64[np.ndarray, "robots"]:
        """How many rooms each has been in."""
        return self._builder.progress.rooms_entered

    @property
    def updates(self) -> Int64[np.ndarray, "robots"]:
        """How often each mapper has added a view to its map."""
        return self._nothing if self._mappers is None else self._mappers.updates

    @property
    def surface_counts(self) -> Int64[np.ndarray, "robots"]:
        """How many surfaces each remembers."""
        return self._nothing if self._mappers is None else self._mappers.segment_counts

    @property
    def map_versions(self) -> Int64[np.ndarray, "robots"]:
        """How often each map has changed."""
        return self._nothing if self._mappers is None else self._mappers.map_versions

    def matched_reading(self, row: int) -> int:
        """The earlier reading that a robot believes was taken where it is now; -1 for none."""
        if self._mappers is None:
            return -1
        self._mappers.match_readings(np.array([row]))
        return int(self._mappers.matched_readings[row])

    def snapshot(self, row: int) -> MapSnapshot:
        """A robot's map."""
        return EMPTY_MAP if self._mappers is None else self._mappers.snapshot(row)

    def activity(self, row: int) -> Activity | None:
        """The activity of a robot's attractor network; None where its mapper has none."""
        return None if self._mappers is None else self._mappers.activity(row)

    def things(self, row: int) -> Segments:
        """The outlines of what moves around a robot, where it is now (world frame)."""
        return self._simulator.obstacles(row)

    def world(self, row: int) -> World:
        """The world that a robot is in."""
        world = self._worlds[row]
        assert world is not None, "a robot is nowhere before it begins"
        return world

    def room(self, row: int) -> str:
        """Name of the room that a robot is truly in; empty between rooms."""
        room: int = self._builder.progress.room.item(row)
        return self.world(row).rooms[room].name if room >= 0 else ""

    @property
    def rooms(self) -> np.ndarray:
        """Names of the rooms that the robots are truly in (robots,); empty between rooms."""
        return self._builder.rooms

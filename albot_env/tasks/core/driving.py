"""Tasks in which robots drive and map: independent robots in the same compiled loops.

A step, from top to bottom: `act` turns actions into speeds; `drive` runs the physics; `_observe`
takes the readings, gives them to the mappers, fills in the observations from their estimates, and
computes the rewards. Each task is a subclass, which defines the reward and the end of an episode.
"""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from jaxtyping import Bool, Float64, Int64

from albot_core.errors import InputError
from albot_core.geometry.types import Pose, Segments
from albot_core.mappers.mapper import TRAVEL, KeptWays
from albot_core.maps.activity import Activity
from albot_core.maps.layers import EMPTY_MAP, MapSnapshot
from albot_core.robot import CONTROL_STEP
from albot_core.sensing.reading import Readings
from albot_env.sim.batch_simulator import BatchSimulator, draw_key
from albot_env.sim.physics import SUBSTEPS
from albot_env.sim.thread_pool import MIN_ROWS_PER_THREAD, ThreadPool
from albot_env.tasks.core.actions import ActionConfig, Numbers
from albot_env.tasks.core.claims import ReadingMatcher
from albot_env.tasks.core.episode_snapshot import EpisodeSnapshot
from albot_env.tasks.core.episode_state import RobotState
from albot_env.tasks.core.faulty_readings import (
    FaultyReadings,
    TakenReadings,
    faults_of_readings,
)
from albot_env.tasks.core.faulty_world import WORLD_STREAM, FaultyWorlds, faults_of_world
from albot_env.tasks.core.observation import ObservationConfig, revealed
from albot_env.tasks.core.observation_builder import ObservationBuilder
from albot_env.tasks.core.parts.beliefs import TIME_LEFT
from albot_env.tasks.core.parts.part import Need
from albot_env.tasks.core.row_arrays import Arrays, copied_rows, put_rows
from albot_env.tasks.core.settings import Equipment
from albot_env.tasks.core.state import (
    BatchState,
    begin_stats,
    integrate_odometry,
    update_all_stats,
)
from albot_env.tasks.core.task import Task
from albot_maps import World

MAPPER_STREAM = 1
"""Number of the random stream of a robot's mapper."""
_KEPT_OF_BELIEFS = (
    "beliefs",
    "homes_in_map",
    "ways_home",
    "is_recognised",
    "is_lost",
    "homes_in_robot",
    "time_left",
)
"""The arrays of `BatchState` in a robot's state; the others belong to the simulator."""


class DrivingTask(Task):
    """Robots that drive, sense, map and observe, without a task.

    Args:
        robots: Number of robots.
        equipment: Their sensors, mapper and other equipment.
        actions: The action config.
        observations: The observation config.

    Raises:
        InputError: The mapper is unknown; `time_left` is to be observed in a task without a time
            budget; or the observations have no part.
    """

    environment: ClassVar[str] = "DrivingTask"
    starts_at_home: ClassVar[bool] = False
    """Whether episodes of the task must start at home, also with a saved map."""
    has_budget: ClassVar[bool] = False
    """Whether robots have a time budget, whose remainder can be observed."""

    def __init__(
        self,
        robots: int,
        equipment: Equipment,
        *,
        actions: ActionConfig,
        observations: ObservationConfig,
    ) -> None:
        if observations.needs(Need.TIME_BUDGET) and not self.has_budget:
            expected = f"parts that {self.environment} has: no time is given to be back in"
            raise InputError("ObservationConfig.parts", expected, TIME_LEFT.name)
        sensors = equipment.sensors
        self._nothing: Int64[np.ndarray, "robots"] = np.zeros(robots, np.int64)
        self._never = np.zeros(robots, np.bool_)
        self._mappers = mappers = equipment.mappers(robots)
        self._in_saved_map = equipment.saved_map is not None
        of_readings = faults_of_readings(equipment.faults)
        self._faults = equipment.faults
        self._faulty: FaultyReadings | None = None
        self._matcher: ReadingMatcher | None = mappers
        """Matches present readings with earlier ones, for the judge of claims."""
        if of_readings:
            self._faulty = FaultyReadings(robots, of_readings, *sensors.geometries)
            if mappers is not None:
                self._matcher = TakenReadings(robots, mappers, self._faulty)
        of_world = faults_of_world(equipment.faults)
        self._struck = FaultyWorlds(robots, of_world, WORLD_STREAM) if of_world else None
        self._threads = ThreadPool(equipment.threads)
        self.ground_laser = sensors.ground_laser.geometry
        """The beams that decide which ground is covered (see `Sensors.ground_laser`)."""
        spec = None if mappers is None else mappers.spec
        observations = revealed(observations, reveal=equipment.reveal)
        observations = observations.fitted(
            *sensors.geometries, spec, has_compass=sensors.compass is not None
        )
        if not observations.shapes:
            expected = "a part that robots with these sensors have"
            raise InputError("ObservationConfig.parts", expected, ", ".join(observations.parts))
        self._simulator = BatchSimulator(
            robots,
            robot=equipment.robot,
            sensors=sensors,
            threads=self._threads,
            movables=equipment.movables,
            control_steps=SUBSTEPS,
        )
        self._needs_way_home = observations.needs(Need.WAY_HOME)
        self._builder = ObservationBuilder(
            robots, observations, self.ground_laser, equipment.robot.radius, mappers
        )
        self._cell_area = observations.coverage.cell**2
        state = BatchState(
            poses=self._simulator.poses,
            beliefs=np.zeros((robots, 3)) if mappers is None else mappers.poses,
            homes_in_map=np.zeros((robots, 3)) if mappers is None else mappers.homes_in_map,
            ways_home=np.full((robots, 7), np.nan) if mappers is None else mappers.ways_home,
            is_recognised=np.zeros(robots, np.bool_) if mappers is None else mappers.is_recognised,
            is_lost=np.zeros(robots, np.bool_) if mappers is None else mappers.is_lost,
            homes_in_robot=np.zeros((robots, 3)),
            motions=self._simulator.motions,
            true_ranges=self._simulator.true_ranges,
            ranges=self._simulator.ranges,
            echoes=self._simulator.echoes,
            compasses=self._simulator.compasses,
            time_left=np.full(robots, np.inf),
            starts=np.zeros((robots, 3)),
            true_homes=np.zeros((robots, 3)),
        )
        super().__init__(robots, actions=actions, observations=observations, state=state)

    def check_start(self, world: World, start: Pose) -> None:
        """Check that a robot can start at a pose.

        Raises:
            InputError: The pose is not finite, too near to an obstacle, or not reachable from the
                world's starts.
        """
        self._simulator.check_start(world, start)
        if self.starts_at_home and not np.array_equal(start, self.home_of(world, start)):
            expected = "the world's first start, where the saved map was begun: it is home"
            raise InputError(self.environment, expected, str(start.tolist()), place="options.start")

    def home_of(self, world: World, start: Pose) -> Pose:
        """Return where home is in an episode: the start, or where the saved map was begun.

        It is also the frame of the robot's map.
        """
        if not self._in_saved_map:
            return start
        return np.asarray(world.starts[0], np.float64)

    def begin(self, row: int, world: World, start: Pose, rng: np.random.Generator) -> None:
        """Start a robot with an empty map; call `observe` before anything else.

        The start must pass `check_start`.
        """
        self._set_out(row, world, start, draw_key(rng))

    def _set_out(self, row: int, world: World, start: Pose, key: int) -> None:
        """Start a robot with an empty map; `key` is the seed of all its noise."""
        self._simulator.place(row, world, start, key)
        if self._faulty is not None:
            self._faulty.begin(row, key)
        if self._struck is not None:
            self._struck.begin(row, world, key)
        stats = self._stats
        stats.reachable[row] = self._builder.begin(row, world)
        if self._mappers is not None:
            # A separate stream, so that the mapper's draws do not change any other noise.
            self._mappers.reset(row, np.random.default_rng((key, MAPPER_STREAM)))
        else:
            self._state.beliefs[row] = 0
            self._state.ways_home[row, TRAVEL] = 0
        self._worlds[row], self.world_names[row] = world, world.name
        home = self.home_of(world, start)
        begin_stats(row, home, stats)
        self._state.starts[row] = home
        stats.before[row], stats.path_lengths[row] = start[:2], 0.0

    def act(self, numbers: Numbers) -> None:
        """Make one control step of all robots with these actions."""
        self.drive(self.actions.commands(numbers))

    def drive(self, commands: Float64[np.ndarray, "robots 2"]) -> None:
        """Make one control step of all robots with speeds (m/s) and turn rates (rad/s)."""
        simulator = self._simulator
        simulator.clear_contacts()
        simulator.drive(simulator.robot.targets_for(commands), SUBSTEPS)
        steps = self._stats.steps
        steps += 1
        self.observations = np.empty_like(self.observations)
        if self._struck is not None:
            for row in self._everyone.tolist():
                if self._struck.has_begun(row):
                    self._strike(row, self._struck)

    def _strike(self, row: int, worlds: FaultyWorlds) -> None:
        """Let the faults of the world strike a robot that are due."""
        steps, driven = int(self.steps[row]), float(self.path_lengths[row])
        if steps == 1:
            worlds.set_out(row, driven)
        pose, home = self._simulator.states[row, :3].copy(), self.starts[row, :2]
        struck = worlds.strike(row, steps * CONTROL_STEP, driven, pose, home)
        if struck is None:
            return
        boxes = len(worlds.base(row).movables.boxes)
        self._simulator.relocate(row, struck.world, struck.pose, boxes)
        self._worlds[row] = struck.world
        self._builder.change_world(row, struck.world)
        if struck.pose is not None:  # Nobody drives there.
            self._stats.before[row] = struck.pose[:2]
        self._on_strike(row, struck.way)

    def _on_strike(self, row: int, way: Segments | None) -> None:
        """Take in that a fault struck a robot's world: it is elsewhere, or its way home is another.

        Args:
            row: The robot.
            way: What is in its way from now on; None if that is as before.
        """

    def observe(self, rows: Int64[np.ndarray, "some"] | None = None) -> None:
        """Let all robots, or those in `rows`, sense, map and observe; compute their rewards."""
        chosen = self._everyone if rows is None else rows
        self._simulator.locate(chosen)
        self._threads.share(chosen, self._observe, MIN_ROWS_PER_THREAD)

    def _observe(self, rows: Int64[np.ndarray, "some"], _: int) -> None:
        self._simulator.sense(rows)
        state, arrived = self._state, 1
        if self._faulty is None:
            self._hear(rows, self.readings)
        else:
            taken = self._simulator.readings(self.times)
            counts, contacts = self._simulator.readings_taken, self.collided
            for having, readings in self._faulty.arrivals(
                rows, taken, counts, self.path_lengths, contacts
            ):
                self._hear(having, readings)
            arrived = self._faulty.arrived[rows]
        if self._mappers is not None and self._needs_way_home:
            self._mappers.find_ways(rows)
        self._builder.observe(rows, state, self.observations, arrived)
        self._compute_rewards(rows)

    def _hear(self, rows: Int64[np.ndarray, "some"], readings: Readings) -> None:
        """Let some robots take in the readings that have arrived."""
        state = self._state
        if self._mappers is None:
            integrate_odometry(rows, state.motions, state.beliefs, state.ways_home[:, TRAVEL])
        else:
            self._mappers.update(rows, readings)

    def _compute_rewards(self, rows: Int64[np.ndarray, "some"]) -> None:
        """Update the statistics of some robots, and compute their rewards."""
        update_all_stats(rows, self._cell_area, self._state, self._builder.progress, self._stats)

    @property
    def ended(self) -> Bool[np.ndarray, "robots"]:
        """Which robots' episodes have ended by themselves."""
        return self._never

    @property
    def facts(self) -> dict[str, np.ndarray]:
        """True values for `info`, one row per robot."""
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
            **({"localised": ~self._state.is_lost} if self._in_saved_map else {}),
            **self._fault_facts,
        }

    @property
    def _fault_facts(self) -> dict[str, np.ndarray]:
        """What strikes the robots, where something can: never part of an observation."""
        if not self._faults:
            return {}
        names = np.full(len(self._everyone), "", object)
        counts = np.zeros(len(self._everyone), np.int64)
        for row in self._everyone.tolist():
            if self._worlds[row] is None:
                continue
            active: tuple[str, ...] = ()
            for faulty in (self._faulty, self._struck):
                if faulty is not None:
                    active += faulty.active(row)
                    counts[row] += faulty.struck(row)
            names[row] = "+".join(active)
        return {"fault": names, "faults_struck": counts}

    @property
    def readings(self) -> Readings:
        """The latest readings of the robots; overwritten by the next `observe`."""
        stamps = self.times if self._faulty is None else self._faulty.stamps
        return self._simulator.readings(stamps)

    def close(self) -> None:
        """Stop the threads."""
        self._threads.close()

    @property
    def times(self) -> Float64[np.ndarray, "robots"]:
        """Simulated time since the start of each robot's episode (s)."""
        return self.steps * CONTROL_STEP

    @property
    def collided(self) -> Bool[np.ndarray, "robots"]:
        """Whether each touched something in the last step."""
        return self._simulator.collided

    @property
    def coverages(self) -> Float64[np.ndarray, "robots"]:
        """Share of the reachable ground that each robot has covered."""
        return self._stats.coverages

    @property
    def ranges(self) -> Float64[np.ndarray, "robots beams"]:
        """Latest ranges of the beams of `ground_laser` (m); infinite for no return."""
        return self._state.ranges

    @property
    def true_ranges(self) -> Float64[np.ndarray, "robots beams"]:
        """Latest distances of what the beams of `ground_laser` meet (m); infinite for nothing."""
        return self._state.true_ranges

    @property
    def rooms_entered(self) -> Int64[np.ndarray, "robots"]:
        """Number of rooms that each robot has entered."""
        return self._builder.progress.rooms_entered

    @property
    def updates(self) -> Int64[np.ndarray, "robots"]:
        """Number of views that each mapper has added to its map."""
        return self._nothing if self._mappers is None else self._mappers.updates

    @property
    def surface_counts(self) -> Int64[np.ndarray, "robots"]:
        """Number of surfaces in each robot's map."""
        return self._nothing if self._mappers is None else self._mappers.segment_counts

    @property
    def lost(self) -> Bool[np.ndarray, "robots"]:
        """Whether each robot believes to be lost; never without a mapper that can tell."""
        return self._state.is_lost

    @property
    def map_versions(self) -> Int64[np.ndarray, "robots"]:
        """Number of changes of each map."""
        return self._nothing if self._mappers is None else self._mappers.map_versions

    def matched_reading(self, row: int) -> int:
        """Return the earlier reading that a robot's mapper matches to its place; -1 for none."""
        if self._matcher is None:
            return -1
        self._matcher.match_readings(np.array([row]))
        return int(self._matcher.matched_readings[row])

    def snapshot(self, row: int) -> MapSnapshot:
        """Return a robot's map."""
        return EMPTY_MAP if self._mappers is None else self._mappers.snapshot(row)

    def activity(self, row: int) -> Activity | None:
        """Return the activity of a robot's attractor network; None if its mapper has none."""
        return None if self._mappers is None else self._mappers.activity(row)

    def dynamic_obstacles(self, row: int) -> Segments:
        """Return the outlines of the moving obstacles around a robot now (world frame)."""
        obstacles = self._simulator.obstacles(row)
        if self._struck is None:
            return obstacles
        return np.concatenate((obstacles, self._struck.moved_walls(row)))

    def given_world(self, row: int) -> World:
        """Return the world of a robot as it was before any fault struck."""
        return self.world(row) if self._struck is None else self._struck.base(row)

    @property
    def obstacle_outlines(self) -> tuple[Segments, Int64[np.ndarray, "robots 2"]]:
        """The outlines of all moving obstacles now, and each robot's first row and end row of them.

        The next step overwrites them.
        """
        return self._simulator.outlines

    def room(self, row: int) -> str:
        """Return the name of the room that a robot is truly in; empty between rooms."""
        room: int = self._builder.progress.room.item(row)
        return self.world(row).rooms[room].name if room >= 0 else ""

    @property
    def rooms(self) -> np.ndarray:
        """Names of the rooms that the robots are truly in (robots,); empty between rooms."""
        return self._builder.rooms

    def episode_snapshot(self, row: int) -> EpisodeSnapshot:
        """Return the state of a robot at rest, and all that it knows."""
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
        """Give a robot another one's state and knowledge in the same world, at step 0.

        `key` seeds the noise from now on. By default it is the snapshot's key; the robot then
        continues as the other one would have, except that its occupancy grid is empty.
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
        """Tell a robot's mapper that the robot is to return home from now on."""
        if self._mappers is not None:
            self._mappers.begin_return(row)

    @property
    def at_rest(self) -> bool:
        """Whether no wheel of any robot turns."""
        return not self._simulator.wheels.any()

    def state(self, row: int) -> RobotState:
        """Return all that the future of a robot's episode depends on (copies)."""
        mappers, nobody = self._mappers, np.array(-1)
        kept: Arrays = mappers.kept_way(row) if isinstance(mappers, KeptWays) else {}
        return RobotState(
            simulator=self._simulator.state(row),
            mapper=None if mappers is None else mappers.state(row),
            arrays={
                **copied_rows("stats", self._stats, row),
                **copied_rows("beliefs", self._state, row, _KEPT_OF_BELIEFS),
                **self._builder.state(row),
                **({} if self._faulty is None else self._faulty.state(row)),
                **({} if self._struck is None else self._struck.state(row)),
                **self._task_state(row),
                "matched": nobody if mappers is None else np.array(mappers.matched_readings[row]),
                **{f"way.{name}": array for name, array in kept.items()},
                "observation": self.observations[row].copy(),
            },
        )

    def set_state(self, row: int, world: World, state: RobotState) -> None:
        """Put a robot into a state that robots of this task with the same equipment returned.

        Args:
            row: The robot.
            world: World of the state, before any fault struck.
            state: The state; it is not changed.

        Raises:
            InputError: As for `BatchSimulator.set_state`.
        """
        assert state.simulator is not None, "a robot that drives has a body"
        key = int(state.simulator.sensors["keys"])
        given = world
        if self._struck is not None:
            world = self._struck.set_state(row, given, key, state.arrays)
        self._simulator.set_state(row, world, state.simulator)
        self._worlds[row], self.world_names[row] = world, world.name
        if self._faulty is not None:
            self._faulty.set_state(row, key, state.arrays)
        self._builder.begin(row, given)
        self._builder.change_world(row, world)
        if self._mappers is not None and state.mapper is not None:
            self._mappers.restore(row, state.mapper)
            if isinstance(self._mappers, KeptWays):
                kept = {name: array for name, array in state.arrays.items() if name[:4] == "way."}
                self._mappers.restore_way(row, {name[4:]: array for name, array in kept.items()})
            self._mappers.matched_readings[row] = state.arrays["matched"]
        self._builder.set_state(row, state.arrays)
        for table, arrays in (("stats", self._stats), ("beliefs", self._state)):
            put_rows(table, arrays, row, state.arrays)
        self._state.starts[row] = state.arrays["stats.starts"]
        self._set_task_state(row, given, state.arrays)
        self.detach_observations()
        self.observations[row] = state.arrays["observation"]

    def _task_state(self, row: int) -> Arrays:
        """Return the rows of the task's own arrays that a robot's future depends on (copies)."""
        return {}

    def _set_task_state(self, row: int, world: World, arrays: Arrays) -> None:
        """Put a robot into what `_task_state` returned; all else has been set."""

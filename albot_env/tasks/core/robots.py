"""The expedition: robots that drive and map, each on its own, all in the same compiled loops.

An environment is an expedition of one, a batch one of many: what a robot finds is
the same to the last bit. What its steps are worth, a task says that builds on this one.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from jaxtyping import Bool, Float32, Float64, Int64

from albot_core.errors import InputError
from albot_core.geometry.types import Pose, Segments
from albot_core.mappers.mapper import TRAVEL, WayHome
from albot_core.maps.layers import EMPTY_MAP, MapSnapshot
from albot_core.sensing.reading import Readings
from albot_env.sim import PIONEER_3DX
from albot_env.sim.batch_simulator import BatchSimulator, RobotSnapshot, draw_key
from albot_env.sim.simulator import CONTROL_STEP, SUBSTEPS
from albot_env.sim.thread_pool import MIN_ROWS_PER_THREAD, ThreadPool
from albot_env.tasks.core.actions import ActionConfig, Numbers
from albot_env.tasks.core.journeys import Journeys
from albot_env.tasks.core.observation import ObservationConfig
from albot_env.tasks.core.observation_builder import Survey, Surveyed
from albot_env.tasks.core.settings import Equipment
from albot_env.tasks.core.state import Senses, new_standing, reckon, set_out, trail
from albot_maps import World

_MAPPER_STREAM = 1
"""Which of a robot's random streams its mapper draws from."""


class Expedition:
    """Robots that drive, sense, map and look around, to no end.

    Args:
        robots: How many.
        equipment: What they set out with.
        actions: What actions ask for.
        observations: How they observe.

    Raises:
        InputError: There is no such mapper; or what is left of a time is to be observed where none
            is given, or nothing at all.
    """

    task: ClassVar[str] = "Expedition"
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
            expected = f"parts that {self.task} has: no time is given to be back in"
            raise InputError("ObservationConfig.parts", expected, "time_left")
        sensors = equipment.sensors
        self.actions = actions
        """What actions ask for."""
        self._nothing: Int64[np.ndarray, "robots"] = np.zeros(robots, np.int64)
        self._unmatched: Int64[np.ndarray, "robots"] = np.full(robots, -1)
        self._never = np.zeros(robots, np.bool_)
        self._mappers = equipment.mappers(robots)
        self._crew = ThreadPool(equipment.threads)
        self.geometry = sensors.laser.geometry
        """Where the lasers' beams point."""
        self.sonar = None if sensors.sonar is None else sensors.sonar.geometry
        """Where the sonars point; None without."""
        self.observing = observations = observations.fitted(self.geometry, self.sonar)
        """How they observe with these sensors."""
        if not observations.shapes:
            expected = "a part that robots with these sensors have"
            raise InputError("ObservationConfig.parts", expected, ", ".join(observations.parts))
        self._fleet = BatchSimulator(
            robots,
            robot=PIONEER_3DX,
            sensors=sensors,
            threads=self._crew,
            movables=equipment.movables,
        )
        self._survey = Survey(robots, observations, self.geometry)
        self._standing = new_standing(robots, len(self.terms_of_reward))
        self._cell_area = observations.coverage.cell**2
        self._everyone: Int64[np.ndarray, "robots"] = np.arange(robots)
        self._worlds: list[World | None] = [None] * robots
        self.world_names = np.full(robots, None, object)
        """The name of each robot's world."""
        mappers = self._mappers
        beliefs = np.zeros((robots, 3)) if mappers is None else mappers.poses
        self._senses = Senses(
            poses=self._fleet.poses,
            beliefs=beliefs,
            home_places=np.zeros((robots, 3)) if mappers is None else mappers.homes,
            ways_home=np.full((robots, 7), np.nan) if mappers is None else mappers.ways_home,
            places=np.zeros((robots, 2), np.bool_) if mappers is None else mappers.places,
            homes=np.zeros((robots, 3)),
            motions=self._fleet.motions,
            ranges=self._fleet.ranges,
            echoes=self._fleet.echoes,
        )
        length = observations.flat_space.shape[0]
        self.observations: Float32[np.ndarray, "robots length"] = np.zeros(
            (robots, length), np.float32
        )
        """What each observes, in one row; after each `drive` another array."""

    def check_start(self, world: World, start: Pose) -> None:
        """Refuse a start that is none.

        Raises:
            InputError: It is not finite, too near to something, or nowhere that a robot can
                come to from the world's starts.
        """
        self._fleet.check_start(world, start)

    def begin(self, row: int, world: World, start: Pose, rng: np.random.Generator) -> None:
        """Let a robot set out anew with an empty map; look around before all else.

        The start must be one (see `check_start`).
        """
        self._set_out(row, world, start, draw_key(rng))

    def _set_out(self, row: int, world: World, start: Pose, key: int) -> None:
        """Let a robot set out with an empty map; `key` decides all its noise."""
        self._fleet.place(row, world, start, key)
        standing = self._standing
        standing.reachable[row] = self._survey.begin(row, world)
        if self._mappers is not None:
            # A stream of its own: how often a mapper draws changes no other noise.
            self._mappers.reset(row, np.random.default_rng((key, _MAPPER_STREAM)))
        else:
            self._senses.beliefs[row] = 0
            self._senses.ways_home[row, TRAVEL] = 0
        self._worlds[row], self.world_names[row] = world, world.name
        set_out(row, start, standing)
        standing.before[row], standing.path_lengths[row] = start[:2], 0.0

    def rest(self, row: int) -> Rest:
        """How a robot stands that has come to rest, and all that it knows."""
        return Rest(
            start=self.starts[row].copy(),
            path_length=float(self.path_lengths[row]),
            halt=self._fleet.snapshot(row),
            surveyed=self._survey.keep(row),
            belief=self.beliefs[row].copy(),
            way_home=self._senses.ways_home[row].copy(),
            memory={} if self._mappers is None else self._mappers.state(row),
        )

    def resume(self, row: int, world: World, rest: Rest, key: int | None = None) -> None:
        """Let a robot stand and know as another one did in this world; its steps count anew.

        `key` decides the noise from now on; by default it is the one it had, and what comes next
        is what would have come, but that it begins an empty sketch of the ground.
        """
        halt = rest.halt if key is None else rest.halt._replace(key=key)
        self._set_out(row, world, rest.start, halt.key)
        self._fleet.restore(row, world, halt)
        self._survey.resume(row, rest.surveyed)
        if self._mappers is None:
            self._senses.beliefs[row] = rest.belief
            self._senses.ways_home[row] = rest.way_home
        else:
            self._mappers.restore(row, rest.memory)
        standing = self._standing
        standing.before[row] = rest.halt.pose[:2]
        standing.path_lengths[row] = rest.path_length

    @property
    def at_rest(self) -> bool:
        """Whether no wheel turns."""
        return not self._fleet.wheels.any()

    def act(self, numbers: Numbers) -> None:
        """One control step of all robots with these actions."""
        self.drive(self.actions.commands(numbers))

    def drive(self, commands: Float64[np.ndarray, "robots 2"]) -> None:
        """One control step of all robots with speeds (m/s) and turn rates (rad/s)."""
        fleet = self._fleet
        fleet.clear_contacts()
        fleet.drive(fleet.robot.targets_for(commands), SUBSTEPS)
        steps = self._standing.steps
        steps += 1
        self.observations = np.empty_like(self.observations)

    def turn_page(self) -> None:
        """Write observations elsewhere from now on: those handed out stay as they are."""
        self.observations = self.observations.copy()

    def look(self, rows: Int64[np.ndarray, "some"] | None = None) -> None:
        """Let all robots, or some, sense, map, look around and reckon what the step was worth."""
        chosen = self._everyone if rows is None else rows
        self._fleet.locate(chosen)
        self._crew.share(chosen, self._look, MIN_ROWS_PER_THREAD)

    def _look(self, rows: Int64[np.ndarray, "some"], _: int) -> None:
        self._fleet.sense(rows)
        senses = self._senses
        if self._mappers is None:
            reckon(rows, senses.motions, senses.beliefs, senses.ways_home[:, TRAVEL])
        else:
            self._mappers.update(rows, self.readings)
            if self.observing.shows_way_home:
                self._mappers.find_ways(rows)
        self._survey.look(rows, senses, self.observations)
        self._appraise(rows)

    def _appraise(self, rows: Int64[np.ndarray, "some"]) -> None:
        """Reckon how some stand after a look, and what their step was worth."""
        trail(rows, self._cell_area, self._senses, self._survey.findings, self._standing)

    @property
    def ended(self) -> Bool[np.ndarray, "robots"]:
        """Whose episode is over by what it did."""
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
        """What the robots sensed last. It is written over at the next look."""
        return self._fleet.readings(self.times)

    def close(self) -> None:
        """Let the threads go."""
        self._crew.close()

    @property
    def poses(self) -> Float64[np.ndarray, "robots 3"]:
        """Where the robots truly are, in the world frame."""
        return self._senses.poses

    @property
    def beliefs(self) -> Float64[np.ndarray, "robots 3"]:
        """Where they believe to be, in their maps' frames."""
        return self._senses.beliefs

    @property
    def homes(self) -> Float64[np.ndarray, "robots 3"]:
        """Where they believe home to be, in their own frames."""
        return self._senses.homes

    @property
    def times(self) -> Float64[np.ndarray, "robots"]:
        """Simulated time since each set out (s)."""
        return self.steps * CONTROL_STEP

    @property
    def collided(self) -> Bool[np.ndarray, "robots"]:
        """Whether each touched something in the last step."""
        return self._fleet.collided

    @property
    def steps(self) -> Int64[np.ndarray, "robots"]:
        """How many control steps each has taken."""
        return self._standing.steps

    @property
    def starts(self) -> Float64[np.ndarray, "robots 3"]:
        """Where each set out (world frame): the origin of its map's frame."""
        return self._standing.starts

    @property
    def path_lengths(self) -> Float64[np.ndarray, "robots"]:
        """How far each has truly driven (m)."""
        return self._standing.path_lengths

    @property
    def rewards(self) -> Float64[np.ndarray, "robots"]:
        """What the last step was worth to each: the sum of the terms."""
        return self._standing.rewards

    @property
    def terms(self) -> dict[str, Float64[np.ndarray, "robots"]]:
        """What the last step was worth, by the reward's terms."""
        return dict(zip(self.terms_of_reward, self._standing.terms.T, strict=True))

    def terms_of(self, row: int) -> dict[str, float]:
        """What the last step was worth to a robot, by the reward's terms."""
        return dict(zip(self.terms_of_reward, self._standing.terms[row].tolist(), strict=True))

    @property
    def position_errors(self) -> Float64[np.ndarray, "robots"]:
        """Distance from each true position to the believed one (m)."""
        return self._standing.position_errors

    @property
    def coverages(self) -> Float64[np.ndarray, "robots"]:
        """Share of the ground that can be reached which each has covered."""
        return self._standing.coverages

    @property
    def rooms_entered(self) -> Int64[np.ndarray, "robots"]:
        """How many rooms each has been in."""
        return self._survey.findings.rooms_entered

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

    @property
    def matched_readings(self) -> Int64[np.ndarray, "robots"]:
        """The earlier reading that each believes was taken where it is now; -1 for none."""
        return self._unmatched if self._mappers is None else self._mappers.matched_readings

    def snapshot(self, row: int) -> MapSnapshot:
        """A robot's map."""
        return EMPTY_MAP if self._mappers is None else self._mappers.snapshot(row)

    def things(self, row: int) -> Segments:
        """The outlines of what moves around a robot, where it is now (world frame)."""
        return self._fleet.obstacles(row)

    def world(self, row: int) -> World:
        """The world that a robot is in."""
        world = self._worlds[row]
        assert world is not None, "a robot is nowhere before it begins"
        return world

    def room(self, row: int) -> str:
        """Name of the room that a robot is truly in; empty between rooms."""
        room: int = self._survey.findings.room.item(row)
        return self.world(row).rooms[room].name if room >= 0 else ""

    @property
    def rooms(self) -> np.ndarray:
        """Names of the rooms that the robots are truly in (robots,); empty between rooms."""
        return self._survey.rooms


@dataclass(frozen=True, kw_only=True, eq=False)
class Rest:
    """How a robot stands that has come to rest on an expedition, and all that it knows."""

    start: Pose
    """Where it set out (world frame)."""
    path_length: float
    """How far it has driven since (m)."""
    halt: RobotSnapshot
    """How it stands."""
    surveyed: Surveyed
    """What it has covered and entered."""
    belief: Pose
    """Where it believes to be, in its map's frame."""
    way_home: WayHome
    """The way home that it believes in."""
    memory: dict[str, np.ndarray]
    """Its mapper's state."""

"""The expedition: robots that explore, each on its own, all in one compiled step.

An environment is an expedition of one, a batch one of many: what a robot finds is
the same to the last bit.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float32, Float64, Int64

from albot_core.errors import InputError
from albot_core.geometry.types import Pose
from albot_core.mapper import Mapper
from albot_core.perception.reading import LaserScan, Reading
from albot_core.registry import make_mapper
from albot_env.sim import LMS_200, ODOMETERS, PIONEER_3DX
from albot_env.sim.fleet import Fleet, draw_key
from albot_env.sim.simulator import CONTROL_STEP, SUBSTEPS
from albot_env.tasks.ground import reachable_area
from albot_env.tasks.kernels import find_errors, reckon
from albot_env.tasks.observation import ObservationConfig
from albot_env.tasks.reward import ExploreWeights
from albot_env.tasks.survey import Survey
from albot_env.tasks.survey_kernel import Findings, Senses
from albot_maps import World

NO_MAPPER = "none"
"""Name of the mapper that is none: the belief is the odometer's, and nothing is remembered."""


class Expedition:
    """Robots that drive, sense, map and look around.

    Args:
        worlds: The world of each robot.
        mapper: Name of the mapper inside, or `none`.
        odometer: Name of the odometer's preset.
        observations: How they observe.
        weights: What the reward's terms are worth.

    Raises:
        InputError: There is no such mapper or odometer.
    """

    def __init__(
        self,
        worlds: Sequence[World],
        mapper: str,
        odometer: str,
        observations: ObservationConfig,
        weights: ExploreWeights,
    ) -> None:
        if odometer not in ODOMETERS:
            raise InputError("odometer", f"one of {', '.join(ODOMETERS)}", odometer)
        count = len(worlds)
        self.mappers: tuple[Mapper, ...] = ()
        """The mappers, one a robot; empty where there are none."""
        if mapper != NO_MAPPER:
            self.mappers = tuple(make_mapper(mapper) for _ in range(count))
        self.worlds = tuple(worlds)
        self._weights = weights
        laser = LMS_200
        self.geometry = laser.geometry
        """Where the lasers' beams point."""
        self._fleet = Fleet(worlds, robot=PIONEER_3DX, laser=laser, odometer=ODOMETERS[odometer])
        self._senses = Senses(
            poses=self._fleet.poses,
            beliefs=np.zeros((count, 3)),
            homes=np.zeros((count, 3)),
            motions=self._fleet.motions,
            ranges=self._fleet.ranges,
        )
        self._findings = Findings(
            ground=np.zeros(count, np.int64),
            new_ground=np.zeros(count, np.int64),
            room=np.full(count, -1),
            new_room=np.zeros(count, np.bool_),
            observations=np.zeros((count, observations.flat_space.shape[0]), np.float32),
        )
        self._cell_area = observations.coverage.cell**2
        self._everyone: Int64[np.ndarray, "robots"] = np.arange(count)
        self._surveys: list[Survey] = []
        self._survey_of: dict[int, Survey] = {}
        self._reachable: Float64[np.ndarray, "robots"] = np.ones(count)
        self._fresh: Bool[np.ndarray, "robots"] = np.ones(count, np.bool_)
        self._settle(observations)
        self.starts: Float64[np.ndarray, "robots 3"] = np.zeros((count, 3))
        """Where each robot set out (world frame): the origin of its map's frame."""
        self.steps: Int64[np.ndarray, "robots"] = np.zeros(count, np.int64)
        """How many control steps each has taken."""
        self.path_lengths: Float64[np.ndarray, "robots"] = np.zeros(count)
        """How far each has truly driven (m)."""
        self.updates: Int64[np.ndarray, "robots"] = np.zeros(count, np.int64)
        """How often each mapper has added a view to its map."""
        self.surfaces: Int64[np.ndarray, "robots"] = np.zeros(count, np.int64)
        """How many surfaces each remembers."""
        self.terms: dict[str, Float64[np.ndarray, "robots"]] = {}
        """What the last step was worth, by the reward's terms."""

    def _settle(self, observations: ObservationConfig) -> None:
        """A survey for every world; which world it is goes by the object."""
        groups: dict[int, list[int]] = {}
        for row, world in enumerate(self.worlds):
            groups.setdefault(id(world), []).append(row)
        for rows in groups.values():
            world = self.worlds[rows[0]]
            survey = Survey(world, np.array(rows), observations, self.geometry)
            self._surveys.append(survey)
            self._reachable[rows] = reachable_area(world)
            self._survey_of |= dict.fromkeys(rows, survey)

    def begin(self, row: int, start: Pose, rng: np.random.Generator) -> None:
        """Let a robot set out anew with an empty map; look around before all else.

        Raises:
            InputError: The start is none.
        """
        self._fleet.check_start(row, start)
        self._fleet.place(row, start, draw_key(rng))
        self._survey_of[row].clear(row)
        if self.mappers:
            self.mappers[row].reset()
        self.starts[row] = start
        tallies = (self._findings.ground, self.steps, self.path_lengths, self.updates)
        for tally in (*tallies, self._senses.beliefs, self._senses.homes, self.surfaces):
            tally[row] = 0
        self._fresh[row] = True

    def drive(self, commands: Float64[np.ndarray, "robots 2"]) -> None:
        """One control step of all robots with speeds (m/s) and turn rates (rad/s)."""
        fleet = self._fleet
        before = fleet.poses[:, :2].copy()
        fleet.clear_contacts()
        fleet.drive(fleet.robot.targets_for(commands), SUBSTEPS)
        way = fleet.poses[:, :2] - before
        self.path_lengths += np.hypot(way[:, 0], way[:, 1])
        self.steps += 1
        self._fresh[:] = False

    def look(self, rows: Int64[np.ndarray, "some"] | None = None) -> None:
        """Let all robots, or some, sense, map, look around and reckon what the step was worth."""
        chosen = self._everyone if rows is None else rows
        self._fleet.sense(rows)
        if self.mappers:
            for row in chosen.tolist():
                self._map(row)
        else:
            reckon(chosen, self._senses.motions, self._senses.beliefs, self._senses.homes)
        for survey in self._surveys:
            survey.look(rows, self._senses, self._findings)
        self.terms = self._weights.terms(
            new_ground=self._findings.new_ground * self._cell_area,
            new_room=self._findings.new_room,
            collided=self._fleet.collided,
            elapsed=CONTROL_STEP,
        )
        for term in self.terms.values():  # Setting out earns nothing.
            term[self._fresh] = 0.0

    def _map(self, row: int) -> None:
        mapper = self.mappers[row]
        if mapper.update(self.reading(row)) or self._fresh[row]:
            self.updates[row] = mapper.updates
            self.surfaces[row] = len(mapper.surfaces)
        self._senses.beliefs[row] = mapper.pose
        self._senses.homes[row] = mapper.home

    def reading(self, row: int) -> Reading:
        """What a robot sensed last."""
        senses = self._senses
        return Reading(
            stamp=float(self.times[row]),
            motion=senses.motions[row].copy(),
            laser=LaserScan(ranges=senses.ranges[row].copy(), geometry=self.geometry),
        )

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
    def observations(self) -> Float32[np.ndarray, "robots length"]:
        """What each observes, in one row. It is written over at the next look."""
        return self._findings.observations

    @property
    def rewards(self) -> Float64[np.ndarray, "robots"]:
        """What the last step was worth to each: the sum of the terms."""
        total = np.zeros(len(self.worlds))
        for term in self.terms.values():
            total += term
        return total

    @property
    def position_errors(self) -> Float64[np.ndarray, "robots"]:
        """Distance from each true position to the believed one (m)."""
        errors = np.empty(len(self.worlds))
        find_errors(self.starts, self.poses, self.beliefs, errors)
        return errors

    @property
    def coverages(self) -> Float64[np.ndarray, "robots"]:
        """Share of the ground that can be reached which each has covered."""
        area = self._findings.ground * self._cell_area
        return np.asarray(np.minimum(1.0, area / self._reachable))

    @property
    def rooms_entered(self) -> Int64[np.ndarray, "robots"]:
        """How many rooms each has been in."""
        entered = np.empty(len(self.worlds), np.int64)
        for survey in self._surveys:
            entered[survey.rows] = survey.rooms_entered
        return entered

    def room(self, row: int) -> str:
        """Name of the room that a robot is truly in; empty between rooms."""
        room = int(self._findings.room[row])
        return self.worlds[row].rooms[room].name if room >= 0 else ""

"""Place recognition: robots on guided tours that judge which places they have seen before."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np
from jaxtyping import Bool, Float64, Int64

from albot_core.errors import InputError
from albot_core.geometry.types import Pose
from albot_core.kernels.arguments import KernelArguments
from albot_core.maps.activity import Activity
from albot_core.maps.layers import MapSnapshot
from albot_core.ranges import SHARE, check_fields
from albot_core.sensing.reading import Readings
from albot_env.sim.batch_simulator import check_start
from albot_env.tasks.core.actions import Numbers
from albot_env.tasks.core.episode_state import RobotState
from albot_env.tasks.core.row_arrays import copied_rows, put_rows
from albot_env.tasks.core.settings import Equipment, chosen_config
from albot_env.tasks.core.state import BatchState, begin_stats
from albot_env.tasks.core.task import Task
from albot_env.tasks.place_recognition.reward import (
    AnswerStats,
    PlaceRecognitionTerms,
    PlaceRecognitionWeights,
    TourTable,
    judge_answers,
)
from albot_env.tasks.place_recognition.spaces import (
    FEATURES,
    AnswerActionConfig,
    ArrivalsObservationConfig,
    arrivals_observation,
)
from albot_env.tasks.place_recognition.tours import Tour, TourConfig, Tours, TourStop
from albot_maps import World


@dataclass(frozen=True, kw_only=True)
class PlaceRecognitionConfig:
    """Parameters of tours, rewards and success."""

    tour: TourConfig = field(default_factory=TourConfig)
    """Length and destinations of tours."""
    weights: PlaceRecognitionWeights = field(default_factory=PlaceRecognitionWeights)
    """Weights of the reward's terms."""
    recall: float = 0.85
    """Share of the revisited places that must be recognised, with no false match, for success."""

    def __post_init__(self) -> None:
        check_fields(self, SHARE, "recall")


class PlaceRecognitionTask(Task):
    """Robots that are led from place to place and judge which places they have seen before.

    Args:
        robots: Number of robots.
        equipment: Equipment of the robots. Dynamic obstacles are left out.
        config: Parameters of tours, rewards and success.
        journeys: Number of tours per start; 0 for a new one each time.

    Raises:
        InputError: `journeys` is negative, or the mapper is unknown.
    """

    environment: ClassVar[str] = "Albot/PlaceRecognition-v0"
    terms_of_reward: ClassVar[tuple[str, ...]] = PlaceRecognitionTerms._fields

    def __init__(
        self,
        robots: int,
        equipment: Equipment,
        *,
        config: PlaceRecognitionConfig | None = None,
        journeys: int = 0,
    ) -> None:
        config = chosen_config(config, PlaceRecognitionConfig, self.environment)
        if equipment.reveal:
            raise InputError(self.environment, "a task in which the agent drives", "reveal=True")
        if equipment.saved_map is not None:
            expected = "a task in which the agent drives"
            raise InputError(self.environment, expected, "saved_map")
        self._tours = Tours(self.environment, equipment, config.tour, journeys)
        most = config.tour.most
        self._sensors = sensors = equipment.sensors
        self._has_faults = bool(equipment.faults)
        sonar = sensors.sonar
        beams = sensors.ground_laser.geometry.beams
        sonars = 0 if sonar is None else len(sonar.geometry.bearings)
        super().__init__(
            robots,
            actions=AnswerActionConfig(most=most),
            observations=ArrivalsObservationConfig(most=most).fitted(*sensors.geometries, None),
            state=BatchState(
                poses=np.zeros((robots, 3)),
                beliefs=np.zeros((robots, 3)),
                homes_in_map=np.zeros((robots, 3)),
                ways_home=np.full((robots, 7), np.nan),
                is_recognised=np.zeros(robots, np.bool_),
                is_lost=np.zeros(robots, np.bool_),
                homes_in_robot=np.zeros((robots, 3)),
                motions=np.zeros((robots, 3)),
                true_ranges=np.full((robots, beams), np.inf),
                ranges=np.full((robots, beams), np.inf),
                echoes=np.full((robots, sonars), np.inf),
                compasses=np.zeros(robots),
                time_left=np.full(robots, np.inf),
                starts=np.zeros((robots, 3)),
                true_homes=np.zeros((robots, 3)),
            ),
        )
        self.journeys = self._tours
        self._radius = equipment.robot.radius
        self._current_tours: list[Tour | None] = [None] * robots
        length = self.observations.shape[1]
        self._tour_table = TourTable(
            counts=np.ones(robots, np.int64),
            observations=np.zeros((robots, most + 1, length), np.float32),
            same=np.zeros((robots, most + 1, most + 1), np.bool_),
            rooms=np.full((robots, most + 1), -1),
            poses=np.zeros((robots, most + 1, 3)),
            beliefs=np.zeros((robots, most + 1, 3)),
            errors=np.zeros((robots, most + 1)),
            path_lengths=np.zeros((robots, most + 1)),
            times=np.zeros((robots, most + 1)),
            collided=np.zeros((robots, most + 1), np.bool_),
            ranges=np.zeros((robots, most + 1, beams)),
            echoes=np.zeros((robots, most + 1, sonars)),
            compasses=np.zeros((robots, most + 1)),
        )
        self._answers = AnswerStats(
            answers=np.zeros(robots, np.int64),
            right_answers=np.zeros(robots, np.int64),
            arrivals=np.zeros(robots, np.int64),
            rooms=np.full(robots, -1),
            tallies=np.zeros((robots, len(self.terms_of_reward)), np.int64),
            revisits=np.zeros(robots, np.int64),
            precision=np.ones(robots),
            recall=np.ones(robots),
            success=np.zeros(robots, np.bool_),
            ended=np.zeros(robots, np.bool_),
            collided=np.zeros(robots, np.bool_),
            times=np.zeros(robots),
        )
        weights = config.weights.values, config.recall
        nothing = arrivals_observation(np.empty((0, len(FEATURES)), np.float32), most)
        tables = self._tour_table, self._state, self._stats, self._answers
        self._arguments = KernelArguments((*weights, nothing, *tables))

    def check_start(self, world: World, start: Pose) -> None:
        """Raise InputError unless a robot can start there and the world has a tour.

        Raises:
            InputError: As for all robots; or the world does not have two rooms to stop in.
        """
        check_start(world, start, self._radius, lambda: world.free_space.clearance(start[:2]))
        self._tours.check(world)

    def begin(self, row: int, world: World, start: Pose, rng: np.random.Generator) -> None:
        """Start a tour for a robot."""
        self._join(row, world, self._tours.draw(world, start, rng))
        begin_stats(row, start, self._stats)

    def _join(self, row: int, world: World, tour: Tour) -> None:
        """Let a robot take part in a tour."""
        self._worlds[row], self.world_names[row] = world, world.name
        self._current_tours[row] = tour
        count, table = len(tour.stops), self._tour_table
        table.counts[row] = count
        table.same[row, :count, :count] = tour.same
        for name, column in tour.columns.items():
            getattr(table, name)[row, :count] = column

    def state(self, row: int) -> RobotState:
        """Return all that the future of a robot's episode depends on (copies)."""
        tour = self._current_tours[row]
        assert tour is not None, "a robot is nowhere before it begins"
        return RobotState(
            arrays={
                **copied_rows("stats", self._stats, row),
                **copied_rows("state", self._state, row),
                **copied_rows("answers", self._answers, row),
                "observation": self.observations[row].copy(),
            },
            journey=tour,
        )

    def set_state(self, row: int, world: World, state: RobotState) -> None:
        """Put a robot into a state that robots of this task with the same equipment returned."""
        tour = state.journey
        self._join(row, world, tour if tour.world is world else replace(tour, world=world))
        tables = ("stats", self._stats), ("state", self._state), ("answers", self._answers)
        for table, arrays in tables:
            put_rows(table, arrays, row, state.arrays)
        self.detach_observations()
        self.observations[row] = state.arrays["observation"]

    def most_steps(self, row: int) -> int:
        """Return the number of answers to a robot's tour: one for each stop after the first."""
        return int(self._tour_table.counts[row]) - 1

    def action_masks(self) -> Bool[np.ndarray, "robots answers"]:
        """Return which answers each robot can give: a new place, or one of its earlier arrivals."""
        counts = np.where(self._answers.ended, 1, self._answers.arrivals)
        return np.arange(self.actions.choice_space.n) < counts[:, np.newaxis]

    def act(self, numbers: Numbers) -> None:
        """Store the answers, and move all robots to their next stops."""
        self._answers.answers[:] = numbers[:, 0]
        steps = self._stats.steps
        steps += 1
        self.observations = np.empty_like(self.observations)

    def observe(self, rows: Int64[np.ndarray, "some"] | None = None) -> None:
        """Judge the answers of all robots, or of some, and fill in their next observations."""
        chosen = self._everyone if rows is None else rows
        judge_answers(chosen, self._arguments, self.observations)

    def close(self) -> None:
        """Do nothing: no thread runs between tours."""

    @property
    def ended(self) -> Bool[np.ndarray, "robots"]:
        """Which robots' tours are over."""
        return self._answers.ended

    @property
    def collided(self) -> Bool[np.ndarray, "robots"]:
        """Whether each robot touched something since the previous arrival."""
        return self._answers.collided

    @property
    def times(self) -> Float64[np.ndarray, "robots"]:
        """Simulated time since the start (s)."""
        return self._answers.times

    @property
    def readings(self) -> Readings:
        """The last reading of each robot's present arrival; no scene is told."""
        state, (laser, sonar) = self._state, self._sensors.geometries
        return Readings(
            stamps=self.times,
            motions=state.motions,
            laser=laser,
            ranges=None if laser is None else state.ranges,
            sonar=sonar,
            echoes=None if sonar is None else state.echoes,
            scenes=None if self._sensors.scenes is None else np.full(len(state.poses), -1),
            compasses=None if self._sensors.compass is None else state.compasses,
        )

    @property
    def facts(self) -> dict[str, np.ndarray]:
        """The true values for `info`, one row per robot."""
        answers = self._answers
        return {
            "pose": self.poses,
            "start": self.starts,
            "belief": self.beliefs,
            "position_error": self.position_errors,
            "collided": self.collided,
            "path_length": self.path_lengths,
            "time": self.times,
            "is_success": answers.success,
            "arrivals": answers.arrivals,
            "right_answer": answers.right_answers,
            "revisits": answers.revisits,
            **dict(zip(self.terms_of_reward, answers.tallies.T, strict=True)),
            "precision": answers.precision,
            "recall": answers.recall,
            **(self._fault_facts if self._has_faults else {}),
        }

    @property
    def _fault_facts(self) -> dict[str, np.ndarray]:
        """What has struck the robots since their last arrivals."""
        stops = [self._at(row) if tour else None for row, tour in enumerate(self._current_tours)]
        return {
            "fault": np.array(["" if stop is None else stop.fault for stop in stops], object),
            "faults_struck": np.array([0 if stop is None else stop.struck for stop in stops]),
        }

    def snapshot(self, row: int) -> MapSnapshot:
        """Return a robot's map at its current arrival."""
        return self._at(row).snapshot

    def activity(self, row: int) -> Activity | None:
        """Return the activity of a robot's attractor network at its current arrival."""
        return self._at(row).activity

    @property
    def lost(self) -> Bool[np.ndarray, "robots"]:
        """False: an arrival is where the guide has led the robot."""
        return np.zeros(len(self.map_versions), np.bool_)

    @property
    def map_versions(self) -> Int64[np.ndarray, "robots"]:
        """The same as `updates`."""
        return self._answers.arrivals

    @property
    def updates(self) -> Int64[np.ndarray, "robots"]:
        """Number of updates of each robot's place database: one per arrival."""
        return self._answers.arrivals

    def room(self, row: int) -> str:
        """Return the name of the room that a robot is truly in; empty between rooms."""
        room = self._at(row).room
        return self.world(row).rooms[room].name if room >= 0 else ""

    @property
    def rooms(self) -> np.ndarray:
        """Names of the rooms that the robots are truly in (robots,); empty between rooms."""
        return np.array(
            [self.room(row) if tour else "" for row, tour in enumerate(self._current_tours)], object
        )

    def _at(self, row: int) -> TourStop:
        """Return a robot's current stop of its tour."""
        tour = self._current_tours[row]
        assert tour is not None, "a robot is nowhere before it begins"
        return tour.stops[int(self._answers.arrivals[row]) - 1]

"""Homing by the map: robots that find their way home without hints, perhaps after a change."""

from __future__ import annotations

from collections import OrderedDict
from dataclasses import dataclass, field, replace
from threading import Lock
from typing import ClassVar, NamedTuple

import numpy as np
from jaxtyping import Float64

from albot_core.errors import InputError
from albot_core.geometry.types import Pose
from albot_env.sim.batch_simulator import draw_key
from albot_env.tasks.core.episode_state import RobotState
from albot_env.tasks.core.observation import ObservationConfig, chosen_observations
from albot_env.tasks.core.row_arrays import Arrays
from albot_env.tasks.core.settings import Equipment, chosen_config
from albot_env.tasks.homing.outward_journey import OutwardJourney
from albot_env.tasks.homing.task import HomingConfig, HomingTask
from albot_env.tasks.homing_by_map.changes import (
    LONGER,
    ChangesConfig,
    carried_pose,
    openable_doors,
    shut_on_way_home,
    with_furniture_moved,
    with_walls,
)
from albot_env.tasks.homing_by_map.doorways import (
    Doorway,
    length_through,
    possible_doorways,
    with_doorway,
    with_more_doors,
)
from albot_maps import World
from albot_maps.geodesic import DistanceField

_GIVEN, _MORE_DOORS = -2, -1
"""Worlds that are changed: the one that was given, and that with more doors."""
_KEPT = 512
"""Number of plans of changes that are kept: with fewer than a training has worlds and starts, the
changed worlds are new each time, and so are the journeys in them."""
_TRIES = 3
"""Number of journeys that are made until a change is possible."""


@dataclass(frozen=True, kw_only=True)
class HomingByMapConfig(HomingConfig):
    """Parameters of actions, observations, rewards, outward journeys and changes."""

    claims: bool = True
    """Whether actions have a fourth number, which claims that the place is known (see `claims`)."""
    observations: ObservationConfig | None = None  # type: ignore[assignment]
    """Parts and scales of observations; None for `parts_by_map`, all that the mapper can give."""
    hints: bool = False
    """Whether what a planner has worked out may be observed (`HINTS`)."""
    changes: ChangesConfig = field(default_factory=ChangesConfig)
    """Shares of episodes before which something was changed."""


class _Episode(NamedTuple):
    """Where an episode begins: at the end of a journey, in the world after the change."""

    journey: OutwardJourney
    """The journey, with the changed world and the way home in it."""
    base: int = _GIVEN
    """What the world was changed from: `_GIVEN`, `_MORE_DOORS`, or the number of the doorway that
    was cut into it."""
    changed: bool = False
    """Whether something was changed."""


class _Plan(NamedTuple):
    """What can be changed in a world."""

    given: World
    """The world."""
    given_field: DistanceField
    """Geodesic distances home in it."""
    more_doors: World
    """The world with more doors, so that there are ways round."""
    more_field: DistanceField
    """Geodesic distances home in that."""
    shut: tuple[World, ...]
    """The world with one of its doors shut without which some ways home are longer."""
    doorways: tuple[Doorway, ...]
    """The doorways that could be cut into the world."""


_PLANS: OrderedDict[tuple[int, bytes], _Plan] = OrderedDict()
"""The plans of this process by the world's id and the start; a plan holds its world. Robots that
are compared, one after another in the same episode, share the changed worlds and so the ways."""
_PLANS_LOCK = Lock()


def _carried(journey: OutwardJourney, rng: np.random.Generator) -> _Episode:
    """Carry the robot elsewhere at the end of a journey."""
    end = journey.end
    pose = carried_pose(journey.world, journey.field, end.body.pose[:2], rng)
    if pose is None:
        return _Episode(journey)
    end = replace(end, body=end.body._replace(pose=pose))
    return _Episode(replace(journey, end=end), changed=True)


class HomingByMapTask(HomingTask):
    """Robots that have explored and drive home by their maps.

    Args:
        robots: Number of robots.
        equipment: Equipment of the robots.
        config: Parameters of actions, observations, rewards, outward journeys and changes.
        journeys: Number of outward journeys per start; 0 for a new one each time.

    Raises:
        InputError: `journeys` is negative, the mapper is unknown, or hints are to be observed
            though `config.hints` is false.
    """

    environment: ClassVar[str] = "Albot/HomingByMap-v0"

    def __init__(
        self,
        robots: int,
        equipment: Equipment,
        *,
        config: HomingByMapConfig | None = None,
        journeys: int = 0,
    ) -> None:
        config = chosen_config(config, HomingByMapConfig, self.environment)
        seen = chosen_observations(config, equipment.spec)
        config = replace(config, observations=seen)
        super().__init__(robots, equipment, config=config, journeys=journeys)
        self._changes = config.changes
        self._given: list[World | None] = [None] * robots
        self._kinds = np.full(robots, "none", object)
        self._bases = np.full(robots, _GIVEN)

    def begin(self, row: int, world: World, start: Pose, rng: np.random.Generator) -> None:
        """Start a robot's episode at the end of an outward journey, after a change."""
        kind = self._changes.draw(rng)
        episode = None
        if kind == "door_opened":
            episode = self._with_door_opened(world, start, rng)
        elif kind == "door_shut":
            episode = self._with_door_shut(world, start, rng)
        if episode is None:
            journey = self._outward_journeys.draw(world, start, rng)
            episode = _Episode(journey)
            if kind == "carried":
                episode = _carried(journey, rng)
            elif kind == "furniture_moved":
                episode = self._with_furniture_moved(journey, start, rng)
            kind = kind if kind in ("carried", "furniture_moved") and episode.changed else "none"
        self._given[row], self._kinds[row] = world, kind
        self._bases[row] = episode.base
        self._set_out_from(row, episode.journey, draw_key(rng) if self._shared else None)

    def _with_door_opened(
        self, world: World, start: Pose, rng: np.random.Generator
    ) -> _Episode | None:
        """Open a door after a journey through which the way home is shorter.

        It is one of the world's own that was shut on the journey, or a wall was there.
        """
        plan = self._plan(world, start)
        for number in rng.permutation(len(plan.shut))[:_TRIES].tolist():
            journey = self._outward_journeys.draw(plan.shut[number], start, rng)
            length = plan.given_field.distance(journey.end.body.pose[:2])
            if journey.field.distance(journey.end.body.pose[:2]) >= LONGER * length:
                opened = replace(journey, world=world, field=plan.given_field)
                return _Episode(opened, changed=True)
        for _ in range(_TRIES if plan.doorways else 0):
            journey = self._outward_journeys.draw(world, start, rng)
            position = journey.end.body.pose[:2]
            robot = self._field(world, position)
            lengths = [length_through(each, journey.field, robot) for each in plan.doorways]
            number = int(np.argmin(lengths))
            cut = None
            if journey.field.distance(position) >= LONGER * lengths[number]:
                cut = with_doorway(world, plan.doorways[number])
            if cut is not None:
                journey = replace(journey, world=cut, field=self._field(cut, start))
                return _Episode(journey, base=number, changed=True)
        return None

    def _with_door_shut(
        self, world: World, start: Pose, rng: np.random.Generator
    ) -> _Episode | None:
        """Shut a door on the way home after a journey, if there is another way."""
        plan = self._plan(world, start)
        for _ in range(_TRIES):
            journey = self._outward_journeys.draw(plan.more_doors, start, rng)
            position = journey.end.body.pose[:2]
            shut = shut_on_way_home(plan.more_doors, plan.more_field, position, start[:2])
            if shut is not None:
                journey = replace(journey, world=shut.world, field=shut.field)
                return _Episode(journey, base=_MORE_DOORS, changed=True)
        return None

    def _with_furniture_moved(
        self, journey: OutwardJourney, start: Pose, rng: np.random.Generator
    ) -> _Episode:
        position = journey.end.body.pose[:2]
        moved = with_furniture_moved(journey.world, position, rng)
        if moved is None:
            return _Episode(journey)
        journey = replace(journey, world=moved, field=self._field(moved, start))
        return _Episode(journey, changed=True)

    def _plan(self, world: World, start: Pose) -> _Plan:
        """Return what can be changed in a world; the most recent plans are kept."""
        key = id(world), start.tobytes()
        with _PLANS_LOCK:
            if key in _PLANS:
                _PLANS.move_to_end(key)
                return _PLANS[key]
        more, field = with_more_doors(world), self._field(world, start)
        plan = _Plan(
            given=world,
            given_field=field,
            more_doors=more,
            more_field=self._field(more, start),
            shut=tuple(openable_doors(world, field)),
            doorways=possible_doorways(world),
        )
        with _PLANS_LOCK:
            _PLANS[key] = plan
            while len(_PLANS) > _KEPT:
                _PLANS.popitem(last=False)
        return plan

    @staticmethod
    def _field(world: World, goal: Float64[np.ndarray, "numbers"]) -> DistanceField:
        """Return the geodesic distances to a pose or a position."""
        return DistanceField(world.walls, world.robot_radius, goal[:2])

    @property
    def facts(self) -> dict[str, np.ndarray]:
        """The true values for `info`, one row per robot."""
        return super().facts | {"change": self._kinds}

    def given_world(self, row: int) -> World:
        """Return the world of a robot as it was given, before the change."""
        world = self._given[row]
        assert world is not None, "a robot is nowhere before it begins"
        return world

    def _task_state(self, row: int) -> Arrays:
        changed = self.world(row)
        kind = np.frombuffer(str(self._kinds[row]).encode(), np.uint8)
        return {
            **super()._task_state(row),
            "change.kind": kind.copy(),
            "change.base": np.array(self._bases[row]),
            "change.walls": changed.walls,
            "change.glass": changed.glass,
        }

    def set_state(self, row: int, world: World, state: RobotState) -> None:
        """Put a robot into a state; `world` is the one without the change."""
        walls, glass = state.arrays["change.walls"], state.arrays["change.glass"]
        number, base = int(state.arrays["change.base"]), world
        if number != _GIVEN:
            plan = self._plan(world, state.arrays["stats.starts"])
            base = plan.more_doors
            if 0 <= number < len(plan.doorways):
                base = with_doorway(world, plan.doorways[number]) or world
        changed = base if np.array_equal(walls, base.walls) else with_walls(base, walls, glass)
        if changed is None:
            raise InputError("state", "a change after which each room can be reached", "another")
        super().set_state(row, changed, state)
        self._given[row], self._bases[row] = world, number
        self._kinds[row] = state.arrays["change.kind"].tobytes().decode()

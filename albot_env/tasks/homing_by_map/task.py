"""Homing by the map: robots that find their way home without hints, perhaps after a change."""

from __future__ import annotations

from collections import OrderedDict
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

import numpy as np

from albot_core.errors import InputError
from albot_core.geometry.types import Pose
from albot_env.sim.batch_simulator import draw_key
from albot_env.tasks.core.episode_state import RobotState
from albot_env.tasks.core.observation import HINTS, ObservationConfig, parts_by_map
from albot_env.tasks.core.row_arrays import Arrays
from albot_env.tasks.core.settings import Equipment, chosen_config
from albot_env.tasks.homing.outward_journey import OutwardJourney
from albot_env.tasks.homing.task import HomingConfig, HomingTask
from albot_env.tasks.homing_by_map.changes import (
    LONGER,
    ChangedWorld,
    ChangesConfig,
    carried_pose,
    openable_doors,
    shut_on_way_home,
    with_furniture_moved,
    with_walls,
)
from albot_maps import World
from albot_maps.geodesic import DistanceField

_KEPT = 64
"""Number of worlds with a door shut that are kept."""


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
        config = replace(config, observations=without_hints(config, equipment))
        super().__init__(robots, equipment, config=config, journeys=journeys)
        self._changes = config.changes
        self._given: list[World | None] = [None] * robots
        self._kinds = np.full(robots, "none", object)
        self._shut: OrderedDict[tuple[int, bytes], tuple[World, list[World]]] = OrderedDict()

    def begin(self, row: int, world: World, start: Pose, rng: np.random.Generator) -> None:
        """Start a robot's episode at the end of an outward journey, after a change."""
        kind = self._changes.draw(rng)
        journey = None
        if kind == "door_opened":
            journey = self._journey_past_shut_door(world, start, rng)
        if journey is None:
            kind = "none" if kind == "door_opened" else kind
            journey = self._outward_journeys.draw(world, start, rng)
        pose = journey.end.body.pose
        changed = ChangedWorld(world, journey.field)
        if kind == "door_opened":
            changed = ChangedWorld(world, self._field(world, start))
        elif kind == "door_shut":
            shut = shut_on_way_home(world, journey.field, pose[:2], start[:2])
            kind, changed = ("none", changed) if shut is None else (kind, shut)
        elif kind == "furniture_moved":
            moved = with_furniture_moved(world, pose[:2], rng)
            if moved is None:
                kind = "none"
            else:
                changed = ChangedWorld(moved, self._field(moved, start))
        elif kind == "carried":
            elsewhere = carried_pose(world, journey.field, pose[:2], rng)
            kind, pose = ("none", pose) if elsewhere is None else (kind, elsewhere)
        end = journey.end
        if kind == "carried":
            end = replace(end, body=end.body._replace(pose=pose))
        self._given[row], self._kinds[row] = world, kind
        key = draw_key(rng) if self._shared else None
        self._set_out_from(
            row, replace(journey, world=changed.world, end=end, field=changed.field), key
        )

    def _journey_past_shut_door(
        self, world: World, start: Pose, rng: np.random.Generator
    ) -> OutwardJourney | None:
        """Make a journey while a door is shut, without which the way home is longer at its end."""
        key = id(world), start.tobytes()
        if key not in self._shut:
            self._shut[key] = world, list(openable_doors(world, start[:2]))
            if len(self._shut) > _KEPT:
                self._shut.popitem(last=False)
        self._shut.move_to_end(key)
        kept = self._shut[key][1]
        if not kept:
            return None
        journey = self._outward_journeys.draw(kept[int(rng.integers(len(kept)))], start, rng)
        position = journey.end.body.pose[:2]
        direct = self._field(world, start).distance(position)
        return journey if journey.field.distance(position) >= LONGER * direct else None

    @staticmethod
    def _field(world: World, start: Pose) -> DistanceField:
        return DistanceField(world.walls, world.robot_radius, start[:2])

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
            "change.walls": changed.walls,
            "change.glass": changed.glass,
        }

    def set_state(self, row: int, world: World, state: RobotState) -> None:
        """Put a robot into a state; `world` is the one without the change."""
        walls, glass = state.arrays["change.walls"], state.arrays["change.glass"]
        changed = world
        if walls.shape != world.walls.shape or (walls != world.walls).any():
            rebuilt = with_walls(world, walls, glass)
            if rebuilt is None:
                expected = "a changed world in which each room can be reached"
                raise InputError("state", expected, "another one")
            changed = rebuilt
        super().set_state(row, changed, state)
        self._given[row] = world
        self._kinds[row] = state.arrays["change.kind"].tobytes().decode()


def without_hints(config: Any, equipment: Equipment, *others: str) -> ObservationConfig:
    """Return the observation config of a task that may bar hints.

    Args:
        config: A config with `observations` (None for all that the mapper can give) and `hints`.
        equipment: The robots' equipment.
        others: Further parts that are observed by default.

    Raises:
        InputError: Hints are to be observed though `config.hints` is false.
    """
    observations: ObservationConfig | None = config.observations
    if observations is None:
        hints = HINTS if config.hints else ()
        return ObservationConfig(parts=parts_by_map(equipment.spec, *hints, *others))
    barred = [part for part in observations.parts if part in HINTS]
    if barred and not config.hints:
        name = type(config).__name__
        expected = "parts that are no hints, or hints=True"
        raise InputError(f"{name}.observations", expected, barred[0], place="parts")
    return observations

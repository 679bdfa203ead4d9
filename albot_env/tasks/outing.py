"""Outward journeys: how robots that are to find home got to where they are.

A robot that is to go home has first explored, by the gap explorer of `albot_core.exploration`,
and so filled its map. A journey is a function of its world, start and number alone (and
of what the robot set out with), whoever asks for it and when; so it may be kept and
given to any robot, or made again, without making any difference.
"""

from __future__ import annotations

import math
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass, replace
from threading import Lock
from typing import Any, Generic, TypeVar

import numpy as np

from albot_core.errors import InputError
from albot_core.exploration.gap_explorer import GapExplorer, GapExplorerConfig
from albot_core.exploration.senses import Senses
from albot_core.geometry.types import Pose
from albot_env.tasks.action import ActionConfig
from albot_env.tasks.equipment import Equipment
from albot_env.tasks.expedition import Expedition
from albot_env.tasks.observation import ObservationConfig
from albot_env.tasks.rest import Rest
from albot_maps import ROBOT_RADIUS, World
from albot_maps.geodesic import DistanceField

KEPT = 1024
"""Journeys that are kept in a process, whoever made them; the one that was longest not asked
for is made again."""


@dataclass(frozen=True, kw_only=True)
class OutingConfig:
    """How long outward journeys are."""

    shortest: float = 30.0
    """The length of a journey is drawn from this (m)…"""
    longest: float = 100.0
    """…to this, each as likely."""
    away: float = 5.0
    """It goes on where the way home from its end would be shorter (m)."""

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not 0 <= value < math.inf:
                raise InputError(f"OutingConfig.{name}", "a length (m)", str(value))
        if self.shortest > self.longest:
            expected = f"at least shortest, {self.shortest:g}"
            raise InputError("OutingConfig.longest", expected, f"{self.longest:g}")


@dataclass(frozen=True, kw_only=True, eq=False)
class Outing:
    """An outward journey that is over."""

    world: World
    """Where it was."""
    rest: Rest
    """The robot at its end."""
    field: DistanceField
    """How far it is home from everywhere."""
    cut_short: bool
    """Whether the robot got stuck before it came as far as it was to."""


Kept = TypeVar("Kept")


class Shelf(Generic[Kept]):
    """The journeys that are kept. Each holds its world, whose id so is nobody else's."""

    def __init__(self) -> None:
        self._kept: OrderedDict[tuple[Any, ...], Kept] = OrderedDict()
        self._lock = Lock()

    def fetch(self, key: tuple[Any, ...], make: Callable[[], Kept]) -> Kept:
        """The journey with this key, which is made where it is not kept."""
        with self._lock:
            kept = self._kept.get(key)
        journey = make() if kept is None else kept
        with self._lock:
            self._kept[key] = journey
            self._kept.move_to_end(key)
            if len(self._kept) > KEPT:
                self._kept.popitem(last=False)
        return journey

    def clear(self) -> None:
        """Keep none any more."""
        with self._lock:
            self._kept.clear()


SHELF: Shelf[Outing] = Shelf()


class Outings:
    """Makes outward journeys, and keeps them.

    Args:
        equipment: What the robots set out with.
        observations: How they look at the ground that they cover.
        config: How long journeys are.
        journeys: How many different ones there are from a start; 0 for a new one each time.
    """

    _STEPS_PER_METRE = 40
    """Steps after which the robot is stuck, for each metre of a journey…"""
    _STEPS = 400
    """…and besides."""

    def __init__(
        self,
        equipment: Equipment,
        observations: ObservationConfig,
        config: OutingConfig,
        journeys: int,
    ) -> None:
        self._config = config
        self._journeys = journeys
        seen = observations.coverage, observations.laser_range
        self._kind = replace(equipment, threads=1), *seen, config
        self._scout = Expedition(
            1,
            replace(equipment, threads=1),
            actions=ActionConfig(),
            observations=observations,
        )
        self._explorer = GapExplorer(GapExplorerConfig(near=observations.coverage.radius))

    def draw(self, world: World, start: Pose, rng: np.random.Generator) -> Outing:
        """A journey from a start, drawn at random."""
        if not self._journeys:
            return self._travel(world, start, int(rng.integers(2**63)))
        number = int(rng.integers(self._journeys))
        key = (self._kind, id(world), start.tobytes(), number)
        return SHELF.fetch(key, lambda: self._travel(world, start, number))

    def close(self) -> None:
        """Let the scout go."""
        self._scout.close()

    def _travel(self, world: World, start: Pose, number: int) -> Outing:
        """Make the journey of a number."""
        rng = np.random.default_rng((number, *start.view(np.uint64).tolist()))
        wanted = float(rng.uniform(self._config.shortest, self._config.longest))
        field = DistanceField(world.walls, ROBOT_RADIUS, start[:2])
        scout, explorer = self._scout, self._explorer
        scout.begin(0, world, start, rng)
        explorer.reset(rng)
        scout.look()
        arrived, left = False, self._STEPS + int(self._STEPS_PER_METRE * wanted)
        while left and not arrived:
            scout.drive(explorer.command(self._senses())[np.newaxis])
            scout.look()
            away = field.distance(scout.poses[0, :2]) >= self._config.away
            arrived, left = bool(away and scout.path_lengths[0] >= wanted), left - 1
        while not scout.at_rest:
            scout.drive(np.zeros((1, 2)))
            scout.look()
        if math.isinf(field.distance(scout.poses[0, :2])):
            field = DistanceField(world.walls, ROBOT_RADIUS, start[:2], tight=True)
        return Outing(world=world, rest=scout.rest(0), field=field, cut_short=not arrived)

    def _senses(self) -> Senses:
        """What the scout knows now."""
        scout = self._scout
        reading = scout.readings[0]
        return Senses(
            ranges=np.minimum(reading.laser.ranges, scout.observing.laser_range),
            laser=scout.geometry,
            pose=scout.beliefs[0].copy(),
            motion=reading.motion.copy(),
        )

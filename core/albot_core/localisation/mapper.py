"""A mapper that knows a saved map, and localises the robot in it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Protocol, runtime_checkable

import numpy as np

from albot_core.errors import InputError
from albot_core.geometry.types import Points, Pose
from albot_core.localisation.config import LocaliserConfig
from albot_core.localisation.known_map import CELL as GROUND_CELL
from albot_core.localisation.known_map import UNKNOWN, WALL, KnownMap, viewpoints_of
from albot_core.localisation.localiser import LOCALISED, STATES, Hypothesis, Localiser
from albot_core.mappers.mapper import Estimate, Mapper, MapperSpec, WayHome
from albot_core.mappers.slam.way_home import Ground, RouteKeeper, WayHomeConfig
from albot_core.maps.layers import MapSnapshot
from albot_core.sensing.reading import LaserScan, Reading

_OWN = "localisation."
"""Prefix of the arrays of a state that are not the saved mapper's."""


@runtime_checkable
class Resumable(Protocol):
    """A mapper that goes on mapping from any pose on its map."""

    def resume(self, pose: Pose, scan: LaserScan) -> None:
        """Continue at a pose on the map; the next reading's motion begins there.

        Args:
            pose: The robot's pose on the map.
            scan: The scan that was taken there.
        """


@runtime_checkable
class Visited(Protocol):
    """A mapper that remembers where the robot has been, but has no layer that says so."""

    @property
    def visited(self) -> Points:
        """Points where the robot has been (m, map frame)."""


def known_map_of(mapper: Mapper, config: LocaliserConfig, source: object) -> KnownMap:
    """Return a mapper's map, as localisation uses it.

    Args:
        mapper: The mapper.
        config: Resolution of the map.
        source: Name of the map in errors.

    Raises:
        InputError: The map has no walls, or is larger than any building.
    """
    snapshot = mapper.snapshot()
    viewpoints = viewpoints_of(snapshot)
    if isinstance(mapper, Visited):
        viewpoints = np.concatenate((viewpoints, mapper.visited))
    return KnownMap(snapshot, config, viewpoints, source)


class MapUser:
    """A mapper in a map that is known from before: it localises itself, and knows a way home.

    The map's frame and home are the saved map's: home is where the robot began to make it. The map
    is frozen; or, to extend it, the saved mapper goes on from the pose that was found. Readings
    before that are not added to it.

    Args:
        saved: The mapper that made the map. It belongs to this one from now on.
        config: Parameters of localisation.
        extend: Whether the map is extended once the robot is localised.
        known: The map, if it has been made from the saved mapper before.
        source: Name of the map in errors.

    Raises:
        InputError: The map has no walls, or its mapper cannot extend it.
    """

    def __init__(
        self,
        saved: Mapper,
        config: LocaliserConfig | None = None,
        *,
        extend: bool = False,
        known: KnownMap | None = None,
        source: object = "the saved map",
    ) -> None:
        if extend and not isinstance(saved, Resumable):
            expected = "the map of a mapper that goes on mapping from any pose"
            raise InputError(source, expected, f"one of {saved.spec.name}", place="extend")
        if known is None:
            known = known_map_of(saved, config or LocaliserConfig(), source)
        self.saved = saved
        """The mapper whose map it is, with all that was added since."""
        self.extends = extend
        """Whether the map is extended once the robot is localised."""
        self.localiser = Localiser(known, config or LocaliserConfig())
        """Where the robot is on the saved map."""
        way_home = getattr(saved.config, "way_home", None)
        radius = getattr(way_home, "robot_radius", WayHomeConfig.robot_radius)
        self._route = RouteKeeper(replace(WayHomeConfig(), robot_radius=radius))
        self._home = saved.estimate.home.copy()
        self._beginning = saved.state() if extend else {}
        self._estimate = saved.estimate
        self._is_extending = False

    @property
    def spec(self) -> MapperSpec:
        """The saved mapper's spec."""
        return self.saved.spec

    @property
    def config(self) -> Any:
        """The saved mapper's parameters."""
        return self.saved.config

    @property
    def estimate(self) -> Estimate:
        """The pose on the map; the robot counts as lost until it is localised."""
        if self._is_extending:
            return self.saved.estimate
        localiser = self.localiser
        return replace(
            self._estimate,
            pose=localiser.pose.copy(),
            home=self._home.copy(),
            localised=localiser.standing == LOCALISED,
            place=None,
            matched_reading=None,
        )

    @property
    def standing(self) -> str:
        """`undecided`, `localised` or `lost`."""
        if self._is_extending:
            return "localised" if self.saved.estimate.localised else "lost"
        return STATES[self.localiser.standing]

    @property
    def hypotheses(self) -> tuple[Hypothesis, ...]:
        """The possible poses on the saved map, the likeliest first."""
        return self.localiser.hypotheses

    def reset(self, rng: np.random.Generator) -> None:
        """Forget where the robot is, and all that was added to the map. Draws no random number."""
        if self._is_extending:
            self.saved.restore(self._beginning)
        self._is_extending = False
        self.localiser.reset()
        self._route.forget()

    def update(self, reading: Reading) -> bool:
        """Process a reading; return whether it was added to the map.

        Raises:
            InputError: The reading lacks a laser scan.
        """
        if self._is_extending:
            return self.saved.update(reading)
        laser = reading.required_laser(f"localisation on a map of {self.spec.name}")
        self.localiser.update(laser, reading.motion)
        if self.extends and self.localiser.standing == LOCALISED:
            assert isinstance(self.saved, Resumable)
            self.saved.resume(self.localiser.pose.copy(), laser)
            self._is_extending = True
            return True
        return False

    @property
    def way_home(self) -> WayHome:
        """The shortest way home over the free ground of the map, from the pose believed."""
        pose = self.estimate.pose

        def ground() -> Ground:
            known = self.localiser.known.ground
            belief = np.where(known.kinds == WALL, 1.0, -1.0).astype(np.float32)
            belief[known.kinds == UNKNOWN] = 0.0
            return Ground(belief, known.corner, GROUND_CELL, np.array((self._home[:2], pose[:2])))

        here = tuple(np.floor(pose[:2] / 0.5).astype(int).tolist())
        return self._route.way_home(here, pose, ground)

    def snapshot(self) -> MapSnapshot:
        """Return the saved map, with all that was added to it."""
        return self.saved.snapshot() if self._is_extending else self.localiser.known.snapshot

    def state(self) -> dict[str, np.ndarray]:
        """Return everything that was remembered since the map was loaded, as arrays by name."""
        state = {_OWN + name: array for name, array in self.localiser.state().items()}
        state[_OWN + "extending"] = np.array(self._is_extending)
        return state | (self.saved.state() if self._is_extending else {})

    def restore(self, state: Mapping[str, np.ndarray]) -> None:
        """Restore what `state` returned, on the same map.

        Raises:
            InputError: The arrays are not a valid state.
        """
        own = {name[len(_OWN) :]: a for name, a in state.items() if name.startswith(_OWN)}
        if "extending" not in own:
            raise InputError(_OWN + "extending", "whether the map is extended", "none")
        is_extending = bool(own.pop("extending"))
        if is_extending and not self.extends:
            raise InputError(_OWN + "extending", "0, because the map is frozen", "1")
        self.localiser.restore(own)
        if is_extending:
            self.saved.restore({n: a for n, a in state.items() if not n.startswith(_OWN)})
        elif self._is_extending:
            self.saved.restore(self._beginning)
        self._is_extending = is_extending
        self._route.forget()

"""A small topological mapper: places half a metre wide, and no line of any surface.

The guide "add a mapper" in docs/mappers.md is this file, told step by step.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from albot_core.geometry.poses import compose, relative
from albot_core.mappers.mapper import Estimate, MapperSpec
from albot_core.mappers.registry import register_mapper
from albot_core.mappers.schema import Field, Pack, Schema
from albot_core.mappers.stored import StoredMapper
from albot_core.maps.layers import MapSnapshot, PlaceEdge, PlaceGraph, PlaceNode
from albot_core.ranges import FROM_ONE, POSITIVE, check_fields
from albot_core.sensing.reading import Reading


@dataclass(frozen=True, kw_only=True)
class TopologicalConfig:
    """Thresholds of the topological mapper."""

    width: float = 0.5
    """Width of a place (m)."""
    apart: int = 30
    """A place is recognised when its last visit ended so many readings ago."""

    def __post_init__(self) -> None:
        check_fields(self, POSITIVE, "width")
        check_fields(self, FROM_ONE, "apart")


class TopologicalMapper(StoredMapper):
    """Places where the odometer says that they are, each known again by its position.

    Args:
        config: Parameters of the mapper.
        name: The name under which the mapper is known.
    """

    def __init__(self, config: TopologicalConfig | None = None, name: str = "topological") -> None:
        super().__init__(config or TopologicalConfig(), name)

    def reset(self, rng: np.random.Generator) -> None:
        """Forget everything; the next reading is the first. It draws no random number."""
        self._pose = np.zeros(3)
        self._reading = -1
        self._current = -1
        self._matched = -1
        self._version = 0
        self._poses = np.empty((0, 3))
        self._first = np.empty(0, np.int64)
        self._last = np.empty(0, np.int64)
        self._links = np.empty((0, 2), np.int64)
        self._history = np.empty(0, np.int64)

    @property
    def estimate(self) -> Estimate:
        """Where the odometer says that the robot is, and the place that is there."""
        return Estimate(
            pose=self._pose.copy(),
            home=np.zeros(3),
            place=None if self._current < 0 else self._current,
            matched_reading=None if self._matched < 0 else self._matched,
            updates=self._version,
            map_version=self._version,
        )

    def update(self, reading: Reading) -> bool:
        """Take in a reading; true where it made a new place or a new link."""
        if self._reading >= 0:
            self._pose = compose(self._pose, reading.motion)
        self._reading += 1
        before, version = self._current, self._version
        away = np.hypot(*(self._poses - self._pose)[:, :2].T)
        if len(away) and away.min() < self.config.width / 2:
            self._current = int(np.argmin(away))
        elif not len(away) or away[before] >= self.config.width:
            self._add_place()
        if self._current != before:
            rested = self._reading - self._last[self._current]
            self._matched = int(self._first[self._current]) if rested > self.config.apart else -1
            self._link(before)
        self._last[self._current] = self._reading
        self._history = np.append(self._history, self._current)
        return self._version > version

    def snapshot(self) -> MapSnapshot:
        """The places and the ways between them."""
        nodes = tuple(
            PlaceNode(id=k, label=f"P{k + 1}", pose=pose.copy(), middle=pose[:2].copy())
            for k, pose in enumerate(self._poses)
        )
        edges = tuple(
            PlaceEdge(
                source=one, target=other, motion=relative(self._poses[one], self._poses[other])
            )
            for one, other in self._links.tolist()
        )
        current = None if self._current < 0 else self._current
        home = 0 if len(nodes) else None
        return MapSnapshot(
            layers=(PlaceGraph(nodes=nodes, edges=edges, current=current, home=home),)
        )

    @property
    def events(self) -> tuple[str, ...]:
        """When it recognised its place last."""
        return () if self._matched < 0 else (f"this is P{self._current + 1}",)

    def place_at(self, reading: int) -> int:
        """Id of the place where a reading was taken."""
        return int(self._history[reading])

    SCHEMA = Schema(
        Field("pose", "3"),
        Pack(
            "counts",
            int,
            Field("reading", least=-1),
            Field("current", least=-1, below="places"),
            Field("matched", least=-1, most="reading"),
            Field("version", least=0),
        ),
        Field("poses", "places 3"),
        Field("first", "places", int, least=0, most="reading"),
        Field("last", "places", int, least=0, most="reading"),
        Field("links", "links 2", int, least=0, below="places"),
        Field("history", "reading+1", int, least=0, below="places"),
    )

    def _add_place(self) -> None:
        self._current = len(self._poses)
        self._poses = np.concatenate((self._poses, self._pose[None]))
        self._first = np.append(self._first, self._reading)
        self._last = np.append(self._last, self._reading)
        self._version += 1

    def _link(self, before: int) -> None:
        link = np.array((before, self._current))
        if before >= 0 and not (self._links == link).all(axis=1).any():
            self._links = np.concatenate((self._links, link[None]))
            self._version += 1


register_mapper(
    MapperSpec(
        name="topological",
        summary="Places half a metre wide where the odometer says that they are.",
        paper="the guide in docs/mappers.md",
        sensors=frozenset(),
        layers=("place_graph",),
        factory=f"{__name__}:TopologicalMapper",
        config=f"{__name__}:TopologicalConfig",
    )
)

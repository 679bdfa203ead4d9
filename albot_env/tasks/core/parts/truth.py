"""The parts that reveal the truth, for twins of tasks in which nothing need be mapped."""

from __future__ import annotations

import numpy as np

from albot_core.geometry.types import Segments
from albot_core.mappers.mapper import MapperSpec
from albot_core.maps.layers import (
    EMPTY_MAP,
    MapSnapshot,
    PlaceEdge,
    PlaceGraph,
    PlaceNode,
    SegmentsLayer,
)
from albot_env.tasks.core.parts.beliefs import HOME
from albot_env.tasks.core.parts.map_patch import MAP_PATCH
from albot_env.tasks.core.parts.part import Need, ObservationPart
from albot_maps import World

TRUE_HOME = ObservationPart(
    name="true_home",
    numbers="3",
    meaning="only in revealed twins: true direction of home (cosine, sine) and its distance",
    shape=HOME.shape,
    needs=frozenset((Need.TRUTH,)),
    decode=HOME.decode,
)
TRUE_PATCH = ObservationPart(
    name="true_patch",
    numbers="2 × 6 × 32 × 32",
    meaning=(
        "only in revealed twins: `map_patch` of the true map at the true pose: all walls that "
        "light does not pass, ground truly covered, the true trail, the world's exits, home and "
        "the middles of its rooms"
    ),
    shape=MAP_PATCH.shape,
    needs=frozenset((Need.TRUTH,)),
    decode=MAP_PATCH.decode,
)
REVEALED = (TRUE_HOME.name, TRUE_PATCH.name)
"""The parts that only revealed twins have."""


class TrueMaps:
    """The worlds of robots as a `MapSource`, in the world's frame.

    Args:
        robots: Number of robots.
    """

    spec = MapperSpec(
        name="truth",
        summary="The world itself.",
        paper="",
        sensors=frozenset(),
        layers=(SegmentsLayer.kind, PlaceGraph.kind),
        factory="",
        config="",
        has_exits=True,
    )

    def __init__(self, robots: int) -> None:
        self.map_versions = np.zeros(robots, np.int64)
        self._worlds: list[World | None] = [None] * robots
        self._snapshots: list[MapSnapshot] = [EMPTY_MAP] * robots

    def begin(self, row: int, world: World) -> None:
        """Put a robot into a world. Robots in the same world share its map."""
        if self._worlds[row] is not world:
            others = (k for k, other in enumerate(self._worlds) if other is world)
            shared = next(others, None)
            made = _snapshot_of(world) if shared is None else self._snapshots[shared]
            self._worlds[row], self._snapshots[row] = world, made
            self.map_versions[row] += 1

    def snapshot(self, row: int) -> MapSnapshot:
        """Return the map of a robot's world."""
        return self._snapshots[row]


def _snapshot_of(world: World) -> MapSnapshot:
    """Return a world as a map: its opaque walls, its rooms and its exits."""
    frame, number = np.zeros(3), {room.name: k for k, room in enumerate(world.rooms)}
    nodes = tuple(
        PlaceNode(id=k, label=room.name, pose=frame, middle=room.boundary.mean(axis=0))
        for k, room in enumerate(world.rooms)
    )
    edges = tuple(
        PlaceEdge(
            source=number[each.rooms[0]],
            target=number[each.rooms[1]],
            motion=frame,
            doorway=each.segment,
        )
        for each in world.exits
    )
    walls: Segments = world.opaque
    layers = SegmentsLayer(segments=walls), PlaceGraph(nodes=nodes, edges=edges)
    return MapSnapshot(layers=layers)

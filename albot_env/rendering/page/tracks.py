"""Tracks: what one mapper believes over the time of a page, as arrays."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from albot_core.geometry.poses import compose
from albot_core.geometry.types import Pose, Poses
from albot_core.maps.activity import Activity
from albot_core.maps.layers import MapSnapshot
from albot_env.rendering.layers import layer_shapes
from albot_env.rendering.page.tables import (
    Arrays,
    FrameTable,
    GridTable,
    LifetimeTable,
    millimetres,
)
from albot_env.rendering.shapes import Shape

MOST_POINTS = 1000
"""Largest number of points of a line in a map, which is new at each version."""
_WIDTHS = {"segments": 4, "dots": 2, "marks": 3}
"""Numbers in a row of each kind of shape whose rows last."""


@dataclass(kw_only=True, eq=False)
class _Channel:
    """The shapes of one label in the map."""

    kind: str
    style: str
    label: str
    table: LifetimeTable | FrameTable | GridTable
    names: dict[str, int] = field(default_factory=dict)
    """Labels of marks, and the number by which a row tells each."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Track:
    """What one mapper believed."""

    facts: dict[str, Any]
    """What JSON can hold."""
    arrays: Arrays
    poses: Poses
    """Believed pose at each moment, in the frame in which all is drawn."""


class TrackWriter:
    """Takes down what a mapper believes, moment by moment.

    Args:
        mapper: Name of the mapper.
        start: Pose of the map's frame (world frame).
        map_interval: Least time between two versions of the map (s).
    """

    def __init__(self, mapper: str, start: Pose, *, map_interval: float = 0.0) -> None:
        self._mapper, self._start, self._interval = mapper, start, map_interval
        self._beliefs: list[Pose] = []
        self._homes: list[Pose] = []
        self._steps: list[int] = []
        self._last = -np.inf
        self._waiting: tuple[int, MapSnapshot] | None = None
        self._channels: dict[tuple[str, str, str], _Channel] = {}
        self._plane: Activity | None = None
        self._packets: list[Pose] = []
        self._active_steps: list[int] = []
        self._cells = FrameTable(3, np.int32)

    def add(
        self,
        time: float,
        belief: Pose,
        home: Pose,
        snapshot: MapSnapshot | None,
        activity: Activity | None = None,
    ) -> None:
        """Add the next moment.

        Args:
            time: Its time (s).
            belief: Believed pose (map frame).
            home: Believed pose of home (robot frame).
            snapshot: The map; None if it is as before.
            activity: The activity of the mapper's network; None if as before, or without one.
        """
        step = len(self._beliefs)
        self._beliefs.append(belief)
        self._homes.append(home)
        if snapshot is not None:
            self._waiting = step, snapshot
        if self._waiting is not None and time >= self._last + self._interval:
            self._add_map(step, self._waiting[1])
            self._last, self._waiting = time, None
        if activity is not None:
            self._add_activity(step, activity)

    def _add_map(self, step: int, snapshot: MapSnapshot) -> None:
        version = len(self._steps)
        self._steps.append(step)
        drawn: set[tuple[str, str, str]] = set()
        for layer in snapshot.layers:
            for shape in layer_shapes(layer, self._start):
                drawn.add(self._draw(version, shape))
        for key in self._channels.keys() - drawn:  # What the map had before, and has no longer.
            channel = self._channels[key]
            if not isinstance(channel.table, GridTable):
                channel.table.update(version, np.empty((0, 1), np.int32))

    def _draw(self, version: int, shape: Shape) -> tuple[str, str, str]:
        key = shape.kind, shape.style, shape.label
        channel = self._channels.get(key)
        if channel is None:
            table = _table(shape.kind)
            channel = _Channel(kind=shape.kind, style=shape.style, label=shape.label, table=table)
            self._channels[key] = channel
        table = channel.table
        if isinstance(table, GridTable):
            table.update(version, shape.placed_grid)
        elif isinstance(table, FrameTable):
            stride = -(-len(shape.data) // MOST_POINTS) or 1
            # The last point stays, where the robot is.
            table.update(version, millimetres(shape.data[::-1][::stride][::-1]))
        else:
            rows = millimetres(shape.data)
            if shape.kind == "marks":
                names = [channel.names.setdefault(name, len(channel.names)) for name in shape.names]
                rows = np.column_stack((rows, np.array(names, np.int32)))
            table.update(version, rows)
        return key

    def _add_activity(self, step: int, activity: Activity) -> None:
        rows, columns = np.nonzero(activity.values)
        strengths = np.sqrt(activity.values[rows, columns] / activity.values.max(initial=1e-9))
        self._plane = activity
        self._cells.update(
            len(self._active_steps), np.column_stack((columns, rows, np.rint(255 * strengths)))
        )
        self._active_steps.append(step)
        self._packets.append(activity.packet)

    def track(self) -> Track:
        """Return all that was taken down, with the last map."""
        if self._waiting is not None:
            self._add_map(len(self._beliefs) - 1, self._waiting[1])
            self._waiting = None
        beliefs = np.reshape(self._beliefs, (-1, 3)).astype(np.float64)
        believed = compose(self._start, beliefs)
        arrays = {
            "beliefs": pose_numbers(believed),
            "homes": pose_numbers(compose(believed, np.reshape(self._homes, (-1, 3)))),
            "map_steps": np.array(self._steps, np.int32),
        }
        channels: list[dict[str, Any]] = []
        for number, channel in enumerate(self._channels.values()):
            arrays |= {f"{number}.{name}": each for name, each in channel.table.arrays.items()}
            drawn = {"kind": channel.kind, "style": channel.style, "label": channel.label}
            channels.append({**drawn, "names": list(channel.names)})
        facts: dict[str, Any] = {"mapper": self._mapper, "channels": channels, "activity": None}
        if self._plane is not None:
            rows, columns = self._plane.values.shape
            facts["activity"] = {"rows": rows, "columns": columns, "cell": self._plane.cell}
            arrays |= {f"activity.{name}": each for name, each in self._cells.arrays.items()}
            arrays["activity.steps"] = np.array(self._active_steps, np.int32)
            arrays["activity.packets"] = pose_numbers(np.reshape(self._packets, (-1, 3)))
        return Track(facts=facts, arrays=arrays, poses=believed)


def _table(kind: str) -> LifetimeTable | FrameTable | GridTable:
    """Return an empty table for shapes of a kind."""
    if kind == "grid":
        return GridTable()
    return LifetimeTable(_WIDTHS[kind]) if kind in _WIDTHS else FrameTable(2)


def pose_numbers(poses: np.ndarray) -> np.ndarray:
    """Return poses as whole numbers: millimetres and tenths of milliradians."""
    return np.column_stack((millimetres(poses[:, :2]), millimetres(poses[:, 2:] * 10.0)))

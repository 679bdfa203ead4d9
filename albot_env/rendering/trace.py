"""The trace: the history of an episode, from which a frame can be made at any moment."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float64

from albot_core.maps.activity import Activity
from albot_core.maps.layers import EMPTY_MAP
from albot_env.recording.episode import EpisodeHeader, Moment
from albot_env.rendering.frame import Frame


class Trace:
    """Follows an episode, running or recorded, and makes frames of its present moment.

    Args:
        header: The constant data of the episode.
        first: The state after the reset.
    """

    def __init__(self, header: EpisodeHeader, first: Moment) -> None:
        self._header = header
        # A guided tour has driven to its first stop; that is no way out.
        self._way_out_length = first.path_length if len(header.way_out) else 0.0
        self._path, self._believed, self._packets = _Positions(), _Positions(), _Positions()
        self._snapshot = EMPTY_MAP
        self._activity: Activity | None = None
        self._terms: dict[str, float] = {}
        self.add(first)

    def add(self, moment: Moment) -> None:
        """Advance to the next moment of the episode."""
        self._moment = moment
        self._path.append(moment.pose[:2])
        self._believed.append(moment.belief[:2])
        for name, value in moment.terms.items():
            self._terms[name] = self._terms.get(name, 0.0) + value
        if moment.snapshot is not None:
            self._snapshot = moment.snapshot
        if moment.activity is not None:
            self._activity = moment.activity
            self._packets.append(moment.activity.packet[:2])

    @property
    def frame(self) -> Frame:
        """Return the frame of the latest moment."""
        moment, header = self._moment, self._header
        laser, localised = moment.reading.laser, moment.facts.get("localised")
        return Frame(
            environment=header.environment,
            agent=header.agent,
            world=header.world,
            mapper=header.mapper,
            robot_radius=header.robot_radius,
            steps=len(self._path.points) - 1,
            time=moment.reading.stamp,
            path_length=moment.path_length,
            way_out_length=self._way_out_length,
            way_out=header.way_out,
            updates=moment.updates,
            walls=header.walls,
            dynamic_obstacles=moment.dynamic_obstacles,
            start=header.start,
            pose=moment.pose,
            path=self._path.points,
            hits=np.empty((0, 2)) if laser is None else laser.points,
            snapshot=self._snapshot,
            belief=moment.belief,
            believed_path=self._believed.points,
            home=moment.home,
            localised=localised if isinstance(localised, bool) else None,
            activity=self._activity,
            packets=self._packets.points,
            terms=dict(self._terms),
            answer=None if moment.action is None else round(float(moment.action[0])),
        )


class _Positions:
    """Positions that are appended one by one; earlier ones never change."""

    def __init__(self) -> None:
        self._array, self._count = np.empty((64, 2)), 0

    def append(self, position: Float64[np.ndarray, "2"]) -> None:
        """Append a position (m); the array grows by doubling."""
        if self._count == len(self._array):
            self._array = np.concatenate((self._array, np.empty_like(self._array)))
        self._array[self._count] = position
        self._count += 1

    @property
    def points(self) -> Float64[np.ndarray, "points 2"]:
        """All positions so far, without a copy: later ones are not seen in it."""
        points = self._array[: self._count]
        points.flags.writeable = False
        return points

"""The trace: the history of an episode, from which a frame can be made at any moment."""

from __future__ import annotations

import numpy as np

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
        self._path: list[tuple[float, float]] = []
        self._believed: list[tuple[float, float]] = []
        self._snapshot = EMPTY_MAP
        self._activity: Activity | None = None
        self._packets: list[tuple[float, float]] = []
        self._terms: dict[str, float] = {}
        self.add(first)

    def add(self, moment: Moment) -> None:
        """Advance to the next moment of the episode."""
        self._moment = moment
        self._path.append((moment.pose[0], moment.pose[1]))
        self._believed.append((moment.belief[0], moment.belief[1]))
        for name, value in moment.terms.items():
            self._terms[name] = self._terms.get(name, 0.0) + value
        if moment.snapshot is not None:
            self._snapshot = moment.snapshot
        if moment.activity is not None:
            self._activity = moment.activity
            self._packets.append((moment.activity.packet[0], moment.activity.packet[1]))

    @property
    def frame(self) -> Frame:
        """Return the frame of the latest moment."""
        moment, header = self._moment, self._header
        laser = moment.reading.laser
        return Frame(
            environment=header.environment,
            agent=header.agent,
            world=header.world,
            mapper=header.mapper,
            robot_radius=header.robot_radius,
            steps=len(self._path) - 1,
            time=moment.reading.stamp,
            path_length=moment.path_length,
            way_out_length=self._way_out_length,
            way_out=header.way_out,
            updates=moment.updates,
            walls=header.walls,
            dynamic_obstacles=moment.dynamic_obstacles,
            start=header.start,
            pose=moment.pose,
            path=np.array(self._path),
            hits=np.empty((0, 2)) if laser is None else laser.points,
            snapshot=self._snapshot,
            belief=moment.belief,
            believed_path=np.array(self._believed),
            home=moment.home,
            activity=self._activity,
            packets=np.reshape(self._packets, (-1, 2)).astype(np.float64),
            terms=dict(self._terms),
            answer=None if moment.action is None else round(float(moment.action[0])),
        )

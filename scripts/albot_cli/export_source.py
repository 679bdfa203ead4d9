"""What `albot export` reads: an episode, a mapper's map, or a log, and what each of them holds."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from albot_core.errors import InputError, MissingFileError
from albot_core.evaluation.trajectory import Trajectory
from albot_core.export.geojson import OCCUPIED
from albot_core.export.points import PointCloud, laser_points
from albot_core.geometry.types import Pose
from albot_core.logs.log import Log
from albot_core.logs.reader import read_log
from albot_core.logs.ros_bag import BagTopics
from albot_core.mappers.map_file import load_map
from albot_core.mappers.mapper import CorrectedTrajectory
from albot_core.maps.layers import (
    EMPTY_MAP,
    MapSnapshot,
    OccupancyGridLayer,
    ParticlesLayer,
    PlaceGraph,
    SegmentsLayer,
    TrajectoryLayer,
)
from albot_core.ros.bag import is_bag
from albot_env.recording.episode import Moment
from albot_env.recording.log import log_of_moments
from albot_env.recording.reader import EpisodeReader

TRUE, CORRECTED, BELIEVED = "true", "corrected", "believed"
"""Kinds of poses: in the simulator; as corrected afterwards; as they were believed on the way, or
as the odometer says."""
POSES = (TRUE, CORRECTED, BELIEVED)
"""All kinds, the best first."""
_LAYERS = {
    SegmentsLayer: "line segments",
    OccupancyGridLayer: "an occupancy grid",
    ParticlesLayer: "particles",
    TrajectoryLayer: "a path",
    PlaceGraph: "a place graph",
}
"""What the layers of a map are called in errors."""
_EPISODE, _ARCHIVE = b"\x89MCAP", b"PK\x03\x04"
"""First bytes of episodes and maps."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Source:
    """A file, and what it holds."""

    path: Path
    """The file."""
    kind: str
    """`episode`, `map` or `log`."""
    trajectories: Mapping[str, Trajectory] = field(default_factory=dict)
    """The robot's poses, by kind."""
    log: Log | None = None
    """The sensor data; None in a map."""
    snapshot: MapSnapshot = EMPTY_MAP
    """The map; in an episode the last one."""
    notes: tuple[str, ...] = ()
    """What is to be said of a log."""
    unread: str = ""
    """What was not read of a torn episode or of a damaged log, and why; empty if all was."""

    def trajectory(self, pose: str | None) -> Trajectory:
        """Return the poses of a kind; None for the best that there is.

        Raises:
            InputError: The file has none of this kind.
        """
        known = [kind for kind in POSES if kind in self.trajectories]
        if not known or pose not in (None, *known):
            expected = f"a kind of poses that {self.path.name} has: {' or '.join(known) or 'none'}"
            raise InputError("--pose", expected, str(pose))
        return self.trajectories[pose or known[0]]

    @property
    def grid(self) -> OccupancyGridLayer | None:
        """The map's occupancy grid; None without one that has cells."""
        grid = self.snapshot.layer(OccupancyGridLayer)
        return grid if grid is not None and grid.occupancy.size else None

    @property
    def has_laser(self) -> bool:
        """Whether there are laser scans."""
        return self.log is not None and self.log.ranges is not None

    def points(self, pose: str | None) -> PointCloud:
        """Return the points that the laser hit, in the frame of the poses; a map's occupied cells.

        Raises:
            InputError: The file has no poses of this kind, or no points.
        """
        if self.log is not None:
            return laser_points(self.log, self.trajectory(pose).poses)
        if self.grid is None:
            raise InputError(self.path, "laser scans or an occupancy grid", "neither")
        self.check_own_frame(pose)
        return PointCloud(points=self.grid.centres(OCCUPIED))

    def check_own_frame(self, pose: str | None) -> None:
        """Raise InputError if poses are asked for, on which a map does not depend."""
        if pose is not None:
            raise InputError("--pose", f"none for the map in {self.path}, which has a frame", pose)

    @property
    def content(self) -> str:
        """What it is and holds, for an error."""
        holds = [f"{' and '.join(self.trajectories)} poses"] if self.trajectories else []
        holds += ["laser scans"] if self.has_laser else []
        holds += [_LAYERS[type(layer)] for layer in self.snapshot.layers]
        article = "an" if self.kind == "episode" else "a"
        return f"{article} {self.kind} with {', '.join(holds) or 'nothing in it'}"


def read_source(path: Path, *, keep_going: bool = False, topics: BagTopics | None = None) -> Source:
    """Read an episode, a map or a log; the file's content determines which it is.

    Args:
        path: The file, or the folder of a ROS bag.
        keep_going: Whether to leave out the damaged lines of a log.
        topics: The topics of a ROS bag that are read.

    Raises:
        InputError: The file cannot be read, or is damaged or none of these; or topics of what is
            no bag are asked for.
    """
    if not is_bag(path):
        readers = {_EPISODE: _episode, _ARCHIVE: _map}
        beginning = first_bytes(path)
        for known, read in readers.items():
            if beginning.startswith(known):
                source = read(path)
                if topics is not None:
                    expected = "a ROS bag, as topics are given"
                    raise InputError(path, expected, source.content)
                return source
    log = read_log(path, keep_going, topics)
    trajectories = {BELIEVED: log.odometry_trajectory}
    if log.reference_trajectory is not None:
        trajectories[CORRECTED] = log.reference_trajectory
    unread = "" if log.unread is None else log.unread.reason
    return Source(
        path=path, kind="log", trajectories=trajectories, log=log, notes=log.notes, unread=unread
    )


def first_bytes(path: Path) -> bytes:
    """Return a file's first bytes.

    Raises:
        InputError: It cannot be read.
    """
    try:
        with path.open("rb") as stream:
            return stream.read(len(_EPISODE))
    except FileNotFoundError:
        raise MissingFileError(path) from None
    except (OSError, ValueError) as error:
        found = "a folder" if isinstance(error, IsADirectoryError) else str(error)
        raise InputError(path, "an episode, a map or a log", found) from None


def is_episode(path: Path) -> bool:
    """Return whether a file begins as an episode does.

    Raises:
        InputError: It cannot be read.
    """
    return first_bytes(path).startswith(_EPISODE) and not is_bag(path)


def _episode(path: Path) -> Source:
    reader = EpisodeReader(path)
    beliefs: list[Pose] = []
    snapshots = [EMPTY_MAP]

    def watched() -> Iterator[Moment]:
        for moment in reader.moments():
            beliefs.append(moment.belief)
            if moment.snapshot is not None:
                snapshots[0] = moment.snapshot
            yield moment

    log = log_of_moments(path.name, reader.header, watched())
    assert log.reference is not None
    trajectories = {
        TRUE: Trajectory(stamps=log.stamps, poses=log.reference),
        BELIEVED: Trajectory(stamps=log.stamps, poses=np.stack(beliefs)),
    }
    return Source(
        path=path,
        kind="episode",
        trajectories=trajectories,
        log=log,
        snapshot=snapshots[0],
        unread=torn_note(reader),
    )


def torn_note(reader: EpisodeReader) -> str:
    """Return the note on an episode that was never closed, once it was read; "" for a whole one."""
    return "never closed, ends early; exported up to its last complete chunk" if reader.torn else ""


def _map(path: Path) -> Source:
    mapper = load_map(path)
    snapshot = mapper.snapshot()
    poses = None
    if isinstance(mapper, CorrectedTrajectory):
        poses = mapper.corrected_poses()
    elif (layer := snapshot.layer(TrajectoryLayer)) is not None:
        poses = layer.poses
    trajectories = {}
    if poses is not None and len(poses):  # A map keeps no time: a pose's stamp is its number.
        trajectories[CORRECTED] = Trajectory(stamps=np.arange(len(poses), dtype=float), poses=poses)
    return Source(path=path, kind="map", trajectories=trajectories, snapshot=snapshot)

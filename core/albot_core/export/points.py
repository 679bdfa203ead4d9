"""Points as PLY, which CloudCompare, MeshLab and Open3D read, and as CSV."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float64

from albot_core.errors import InputError
from albot_core.files import atomic_write
from albot_core.geometry.poses import transform_points
from albot_core.geometry.types import Points
from albot_core.logs.log import Log
from albot_core.sensing.reading import LaserScan


@dataclass(frozen=True, kw_only=True, eq=False)
class PointCloud:
    """Points in one frame."""

    points: Points
    """The points, (n, 2) (m)."""
    stamps: Float64[np.ndarray, "n"] | None = None
    """When each was seen (s); None if unknown."""


def laser_points(log: Log, poses: Float64[np.ndarray, "scans 3"]) -> PointCloud:
    """Return all points that the laser of a log hit, in the frame of `poses`.

    Args:
        log: The log.
        poses: The robot's pose at every scan.

    Raises:
        InputError: The log has no laser.
    """
    if log.geometry is None or log.ranges is None:
        raise InputError(log.name, "a laser", "none")
    hits, stamps = [np.empty((0, 2))], [np.empty(0)]
    for ranges, pose, stamp in zip(log.ranges, poses, log.stamps, strict=True):
        seen = transform_points(pose, LaserScan(ranges=ranges, geometry=log.geometry).points)
        hits.append(seen)
        stamps.append(np.full(len(seen), stamp))
    return PointCloud(points=np.concatenate(hits), stamps=np.concatenate(stamps))


def write_ply(cloud: PointCloud, path: Path) -> None:
    """Write points as a binary PLY file, atomically: `x`, `y`, `z` (0) and `time` as doubles.

    https://paulbourke.net/dataformats/ply/
    """
    names = ("x", "y", "z", *(() if cloud.stamps is None else ("time",)))
    table = np.zeros((len(cloud.points), len(names)), "<f8")
    table[:, :2] = cloud.points
    if cloud.stamps is not None:
        table[:, 3] = cloud.stamps
    head = ["ply", "format binary_little_endian 1.0", f"element vertex {len(table)}"]
    head += [*(f"property double {name}" for name in names), "end_header", ""]
    with atomic_write(path) as stream:
        stream.write("\n".join(head).encode("ascii"))
        stream.write(table.tobytes())


def write_points_csv(cloud: PointCloud, path: Path) -> None:
    """Write points as CSV, atomically: a line `time,x,y`, or `x,y` where no time is known.

    The numbers read back exactly.
    """
    with atomic_write(path) as stream:
        stream.write(b"x,y\n" if cloud.stamps is None else b"time,x,y\n")
        for line in _csv_lines(cloud):
            stream.write(line.encode("ascii"))


def _csv_lines(cloud: PointCloud) -> Iterator[str]:
    columns = [] if cloud.stamps is None else [cloud.stamps]
    for row in zip(*columns, *cloud.points.T, strict=True):
        yield ",".join(repr(float(number)) for number in row) + "\n"

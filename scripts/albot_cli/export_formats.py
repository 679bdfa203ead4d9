"""The formats of `albot export` that take one file each: what each needs, and who writes it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

from albot_cli.export_source import Source
from albot_core.errors import InputError
from albot_core.export.carmen import write_carmen
from albot_core.export.g2o import write_g2o
from albot_core.export.geojson import write_geojson
from albot_core.export.graphml import write_graphml
from albot_core.export.kitti import write_kitti
from albot_core.export.map_server import write_map_server
from albot_core.export.points import write_ply, write_points_csv
from albot_core.export.tum import write_tum
from albot_core.maps.layers import MapSnapshot, TrajectoryLayer
from albot_core.ros.messages import check_rosbags


@dataclass(frozen=True, kw_only=True)
class Format:
    """A format of files."""

    suffix: str
    """Suffix of its files."""
    needs: str
    """What a source must have for it, for errors."""
    fits: Callable[[Source], bool]
    """Whether a source has it."""
    write: Callable[[Source, str | None, Path], None]
    """Writes a source, with the poses of a kind (None for the best), to a file; atomically."""
    takes_pose: bool = False
    """Whether it depends on the kind of poses."""
    beside: tuple[str, ...] = ()
    """Suffixes of the files that it writes besides."""
    is_folder: bool = False
    """Whether it is a folder, which must be new or empty."""
    check: Callable[[Path], None] = lambda _: None
    """Raises InputError if the library that it needs is missing."""


def _write_geojson(source: Source, pose: str | None, path: Path) -> None:
    """Write the map; of a log, which has none, the path."""
    snapshot = source.snapshot
    if not snapshot.layers:
        snapshot = MapSnapshot(layers=(TrajectoryLayer(poses=source.trajectory(pose).poses),))
    else:
        source.check_own_frame(pose)
    write_geojson(snapshot, path)


def _write_carmen(source: Source, _: str | None, path: Path) -> None:
    assert source.log is not None
    write_carmen(source.log, path)


def _write_grid(source: Source, _: str | None, path: Path) -> None:
    assert source.grid is not None
    write_map_server(source.grid, path)


def _write_rerun(source: Source, _: str | None, path: Path) -> None:
    from albot_env.export import rerun_recording
    from albot_env.recording.reader import EpisodeReader

    if source.kind == "episode":
        rerun_recording.write_episode_rerun(EpisodeReader(source.path), path)
    elif source.log is not None:
        rerun_recording.write_log_rerun(source.log, path)
    else:
        rerun_recording.write_map_rerun(source.snapshot, source.path.name, path)


def _check_rerun(path: Path) -> None:
    from albot_env.export.rerun_scene import check_rerun

    check_rerun(path)


def _write_ros2(source: Source, _: str | None, path: Path) -> None:
    from albot_core.export.ros2_bag import write_ros2_bag

    assert source.log is not None
    write_ros2_bag(source.log, path)


_POINTS = Format(
    suffix=".ply",
    needs="laser scans or an occupancy grid",
    fits=lambda source: source.has_laser or source.grid is not None,
    write=lambda source, pose, path: write_ply(source.points(pose), path),
    takes_pose=True,
)
_POSES = Format(
    suffix=".tum",
    needs="poses",
    fits=lambda source: bool(source.trajectories),
    write=lambda source, pose, path: write_tum(source.trajectory(pose), path),
    takes_pose=True,
)
_PLACES = Format(
    suffix=".graphml",
    needs="a place graph with places",
    fits=lambda source: bool(source.snapshot.place_graph.nodes),
    write=lambda source, _, path: write_graphml(source.snapshot.place_graph, path),
)
FORMATS: dict[str, Format] = {
    "tum": _POSES,
    "kitti": replace(
        _POSES,
        suffix=".kitti",
        write=lambda source, pose, path: write_kitti(source.trajectory(pose), path),
    ),
    "geojson": Format(
        suffix=".geojson",
        needs="a map or poses",
        fits=lambda source: bool(source.snapshot.layers or source.trajectories),
        write=_write_geojson,
        takes_pose=True,
    ),
    "graphml": _PLACES,
    "g2o": replace(
        _PLACES,
        suffix=".g2o",
        write=lambda source, _, path: write_g2o(source.snapshot.place_graph, path),
    ),
    "carmen": Format(
        suffix=".log",
        needs="laser scans",
        fits=lambda source: source.has_laser,
        write=_write_carmen,
    ),
    "map_server": Format(
        suffix=".yaml",
        needs="an occupancy grid",
        fits=lambda source: source.grid is not None,
        write=_write_grid,
        beside=(".pgm",),
    ),
    "ply": _POINTS,
    "csv": replace(
        _POINTS,
        suffix=".csv",
        write=lambda source, pose, path: write_points_csv(source.points(pose), path),
    ),
    "ros2": Format(
        suffix="_bag",
        needs="laser scans",
        fits=lambda source: source.has_laser,
        write=_write_ros2,
        is_folder=True,
        check=check_rosbags,
    ),
    "rerun": Format(
        suffix=".rrd",
        needs="an episode, a log or a map",
        fits=lambda _: True,
        write=_write_rerun,
        check=_check_rerun,
    ),
}
"""The formats by name."""
MINARI = "minari"
"""The format that takes many episodes at once."""


def check_fits(source: Source, name: str) -> None:
    """Raise InputError if a source cannot become a format; it names those that it can become."""
    if FORMATS[name].fits(source):
        return
    fitting = [other for other, known in FORMATS.items() if known.fits(source)]
    fitting += [MINARI] if source.kind == "episode" else []
    found = f"{source.content}, which can become {', '.join(fitting)}"
    raise InputError(source.path, f"{FORMATS[name].needs}, for {name}", found)

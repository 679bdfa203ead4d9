"""Rerun recordings (.rrd) of episodes, logs and maps, which `rerun FILE` shows on one time line.

https://rerun.io. The entities, in metres, z up:

- `world/walls`, `world/way_out`, `world/path`: what does not change; `world/things`: what moves.
- `world/robot`: the robot's pose; `world/robot/scan`: the points that its laser hit.
- `world/map`: the frame of the map, and in it `robot` (as believed) and an entity for each layer,
  such as `world/map/segments`.
- `place_graph`: places and links as a graph to be laid out.
- `curves/position_error`, `curves/reward`, `curves/terms/NAME`.

The time lines are `time` (s since the beginning, or as in the log) and `step`.
"""

from __future__ import annotations

from functools import singledispatch
from pathlib import Path

import numpy as np

from albot_core.export.geojson import OCCUPIED
from albot_core.geometry.poses import compose
from albot_core.logs.log import Log
from albot_core.maps.layers import (
    Layer,
    MapSnapshot,
    OccupancyGridLayer,
    ParticlesLayer,
    PlaceGraph,
    SegmentsLayer,
    TrajectoryLayer,
)
from albot_core.sensing.reading import LaserScan
from albot_env.export.rerun_scene import DOT, RerunScene, rerun_recording
from albot_env.recording.episode import EpisodeHeader, Moment
from albot_env.recording.reader import EpisodeReader

_WALLS, _TRUTH, _BELIEF, _HITS = (128, 134, 148), (60, 120, 216), (230, 145, 56), (220, 60, 60)
_LINKS = (145, 128, 214)


def write_episode_rerun(reader: EpisodeReader, path: Path) -> None:
    """Write an episode, atomically; of one that was never closed, the intact part.

    Raises:
        InputError: Rerun is not installed; the episode is damaged; or the file cannot be written.
    """
    header = reader.header
    with rerun_recording(path, header.environment) as scene:
        scene.lines("world/walls", header.walls, _WALLS, static=True)
        scene.strip("world/way_out", header.way_out, _WALLS, static=True)
        scene.frame("world/map", header.start, static=True)
        path_driven = []
        curves = _Curves()
        for step, moment in enumerate(reader.moments()):
            scene.at(step, moment.reading.stamp)
            _show_moment(scene, moment)
            curves.add(step, header, moment)
            path_driven.append(moment.pose[:2])
        scene.strip("world/path", np.reshape(path_driven, (-1, 2)), _TRUTH, static=True)
        scene.curves(curves.rows)


def write_log_rerun(log: Log, path: Path) -> None:
    """Write a log, atomically: the robot by the log's corrected poses, or by its odometer.

    Raises:
        InputError: Rerun is not installed, or the file cannot be written.
    """
    poses = log.odometry if log.reference is None else log.reference
    with rerun_recording(path, log.name) as scene:
        scene.strip("world/path", poses[:, :2], _TRUTH, static=True)
        for scan, (stamp, pose) in enumerate(zip(log.stamps.tolist(), poses, strict=True)):
            scene.at(scan, stamp)
            scene.robot("world/robot", pose, _TRUTH)
            if log.ranges is not None and log.geometry is not None:
                seen = LaserScan(ranges=log.ranges[scan], geometry=log.geometry)
                scene.points("world/robot/scan", seen.points, _HITS)


def write_map_rerun(snapshot: MapSnapshot, name: str, path: Path) -> None:
    """Write a map, atomically.

    Raises:
        InputError: Rerun is not installed, or the file cannot be written.
    """
    with rerun_recording(path, name) as scene:
        scene.at(0, 0.0)
        _show_map(scene, snapshot)


def _show_moment(scene: RerunScene, moment: Moment) -> None:
    scene.robot("world/robot", moment.pose, _TRUTH)
    scene.robot("world/map/robot", moment.belief, _BELIEF)
    if moment.reading.laser is not None:
        scene.points("world/robot/scan", moment.reading.laser.points, _HITS)
    scene.lines("world/things", moment.dynamic_obstacles, _LINKS)
    if moment.snapshot is not None:
        _show_map(scene, moment.snapshot)


def _show_map(scene: RerunScene, snapshot: MapSnapshot) -> None:
    for layer in snapshot.layers:
        _show_layer(layer, scene, f"world/map/{layer.kind}")


@singledispatch
def _show_layer(layer: Layer, scene: RerunScene, entity: str) -> None:
    """Show a layer in the map's frame."""
    raise NotImplementedError(type(layer).__name__)


@_show_layer.register
def _show_segments(layer: SegmentsLayer, scene: RerunScene, entity: str) -> None:
    scene.lines(entity, layer.segments, _BELIEF)


@_show_layer.register
def _show_grid(layer: OccupancyGridLayer, scene: RerunScene, entity: str) -> None:
    scene.points(entity, layer.centres(OCCUPIED), _BELIEF, radius=layer.resolution / 2)


@_show_layer.register
def _show_particles(layer: ParticlesLayer, scene: RerunScene, entity: str) -> None:
    scene.points(entity, layer.poses[:, :2], _LINKS)


@_show_layer.register
def _show_trajectory(layer: TrajectoryLayer, scene: RerunScene, entity: str) -> None:
    scene.strip(entity, layer.poses[:, :2], _BELIEF)


@_show_layer.register
def _show_places(layer: PlaceGraph, scene: RerunScene, entity: str) -> None:
    middles = np.reshape([node.middle for node in layer.nodes], (-1, 2)).astype(np.float64)
    labels = [node.label for node in layer.nodes]
    scene.points(f"{entity}/places", middles, _LINKS, radius=4 * DOT, labels=labels)
    ends = [(*layer.node(a).middle, *layer.node(b).middle) for a, b in layer.links]
    scene.lines(f"{entity}/links", np.reshape(ends, (-1, 4)).astype(np.float64), _LINKS)
    scene.lines(f"{entity}/doorways", layer.doorways(), _HITS)
    scene.graph("place_graph", layer)


class _Curves:
    """Numbers over the steps of an episode, by name."""

    def __init__(self) -> None:
        self.rows: dict[str, list[tuple[int, float, float]]] = {}

    def add(self, step: int, header: EpisodeHeader, moment: Moment) -> None:
        """Add the numbers of a moment."""
        believed = compose(header.start, moment.belief)
        error = float(np.hypot(*(believed - moment.pose)[:2]))
        numbers = {"position_error": error, "reward": moment.reward}
        numbers |= {f"terms/{name}": value for name, value in moment.terms.items()}
        for name, number in numbers.items():
            self.rows.setdefault(name, []).append((step, moment.reading.stamp, number))

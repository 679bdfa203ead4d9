"""Readers of episodes and of the files of mappers, with whole files of their kinds."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import numpy as np
import yaml

from albot_cli.export_source import read_source
from albot_cli.mappers import read_mapper_config, read_robots_config
from albot_core.export.geojson import write_geojson
from albot_core.mappers.map_file import load_map, save_map
from albot_core.mappers.mapper import Mapper, PlaceMemory, RouteHome
from albot_core.mappers.registry import installed_mappers, make_mapper, mapper_config, mapper_spec
from albot_core.maps.activity import Activity
from albot_core.maps.layers import (
    MapSnapshot,
    OccupancyGridLayer,
    ParticlesLayer,
    PlaceEdge,
    PlaceGraph,
    PlaceNode,
    SegmentsLayer,
    TrajectoryLayer,
)
from albot_core.plain_data import to_plain
from albot_core.sensing.reading import LaserGeometry, Reading, SonarGeometry, SonarScan
from albot_env.recording.episode import EpisodeHeader, Moment
from albot_env.recording.log import read_episode_log, read_log_or_episode
from albot_env.recording.reader import EpisodeReader
from albot_env.recording.writer import EpisodeWriter
from albot_env.rendering.terminal import draw_text
from albot_env.rendering.trace import Trace
from tests.core.scenes import ROOM, scan_from
from tests.fuzzing.reader import Reader, one_file

# Episodes.


def _layers() -> MapSnapshot:
    """A map with a layer of each kind."""
    nodes = tuple(
        PlaceNode(
            id=k, label=f"P{k}", pose=np.array((k, 0.0, 0.1)), middle=np.zeros(2), segments=ROOM
        )
        for k in range(2)
    )
    door = np.array((1.0, 0.0, 1.0, 1.0))
    edges = (
        PlaceEdge(source=0, target=1, motion=np.zeros(3), doorway=door, reverse=1),
        PlaceEdge(source=1, target=0, motion=np.zeros(3), reverse=0),
    )
    cells = np.array(((0.0, 1.0, np.nan), (0.5, 0.2, 0.0)), np.float32)
    return MapSnapshot(
        layers=(
            SegmentsLayer(segments=ROOM),
            OccupancyGridLayer(origin=np.zeros(3), resolution=0.5, occupancy=cells),
            PlaceGraph(nodes=nodes, edges=edges, current=1, home=0),
            ParticlesLayer(poses=np.zeros((2, 3)), weights=np.array((0.25, 0.75))),
            TrajectoryLayer(poses=np.eye(3)),
        )
    )


def _readings(count: int) -> list[Reading]:
    """What a robot with all sensors senses that drives through a room."""
    laser, sonar = LaserGeometry(beams=61, spacing=np.pi / 60), SonarGeometry()
    return [
        Reading(
            stamp=0.1 * k,
            motion=np.array((0.3, 0.0, 0.15)),
            laser=scan_from(np.array((0.25 * k, 0.1 * k, 0.15 * k)), ROOM, laser),
            sonar=SonarScan(ranges=np.full(8, 2.0), geometry=sonar),
            scene=k % 3,
            compass=0.15 * k,
        )
        for k in range(count)
    ]


def _activity() -> Activity:
    values = np.zeros((4, 5), np.float32)
    values[1, 1:4] = 0.25, 0.5, 0.25
    return Activity(cell=0.25, values=values, packet=np.array((0.6, 0.4, 0.1)))


def _write_episode(folder: Path) -> None:
    sensed = _readings(3)
    assert sensed[0].laser and sensed[0].sonar
    header = EpisodeHeader(
        environment="Albot/Explore-v0",
        world="room",
        walls=ROOM,
        start=np.zeros(3),
        mapper="all",
        agent="chance",
        odometer="ideal",
        robot_radius=0.25,
        seed=3,
        spec={"id": "Albot/Explore-v0", "kwargs": {"world": "room"}},
        laser=sensed[0].laser.geometry,
        sonar=sensed[0].sonar.geometry,
    )
    writer = EpisodeWriter(folder / "episode.mcap")
    writer.begin(header)
    for k, reading in enumerate(sensed):
        moment = Moment(
            action=np.array((0.5, 0.1, -1.0)) if k else None,
            reward=0.5 * k,
            terms={"coverage": 0.5 * k},
            reading=reading,
            pose=np.array((0.3 * k, 0.0, 0.1)),
            collided=k == 1,
            room="room",
            path_length=0.3 * k,
            belief=np.array((0.3 * k, 0.1, 0.1)),
            home=np.array((-0.3 * k, 0.0, 0.1)),
            updates=k,
            matched_reading=0 if k else None,
            facts={"coverage": 0.1 * k, "is_success": False, "change": "none", "gap": None},
            snapshot=None if k == 1 else _layers(),
            activity=None if k == 1 else _activity(),
            dynamic_obstacles=ROOM[:2],
        )
        writer.add(moment)
    writer.close()


def _play(path: Path) -> None:
    reader = EpisodeReader(path)
    trace = None
    for moment in reader.moments():
        if trace is None:
            trace = Trace(reader.header, moment)
        else:
            trace.add(moment)
        assert trace.frame.heading
        draw_text(trace.frame, 60, 20)


def _map(path: Path) -> None:
    """Lead a mapper through a recorded episode."""
    mapper = make_mapper("odometry")
    read_source(path)
    for reading in read_log_or_episode(path).readings:
        mapper.update(reading)


def episode_readers() -> Iterator[Reader]:
    """Readers of recorded episodes."""
    yield Reader(
        name="episode",
        functions=(EpisodeReader,),
        write=_write_episode,
        read=lambda folder: _play(folder / "episode.mcap"),
        examples=40,
    )
    yield Reader(
        name="episode as a log",
        functions=(read_episode_log, read_log_or_episode, read_source),
        write=_write_episode,
        read=lambda folder: _map(folder / "episode.mcap"),
    )


# Mappers.


def _write_map(folder: Path, name: str) -> None:
    mapper = make_mapper(name)
    for reading in _readings(12):
        mapper.update(reading)
    save_map(mapper, folder / "map.albot")


def _go_on(path: Path) -> None:
    """Let the mapper in a file go on as it would have."""
    mapper = load_map(path)
    _ask(mapper)
    for reading in _readings(4):
        mapper.update(reading)
    _ask(mapper)


def _ask(mapper: Mapper) -> None:
    """Ask a mapper all that it can be asked."""
    assert mapper.estimate.pose.shape == (3,)
    write_geojson(mapper.snapshot(), Path(os.devnull))
    if isinstance(mapper, RouteHome):
        assert len(mapper.way_home) == 7
    if isinstance(mapper, PlaceMemory):
        assert all(map(str, mapper.events))
        mapper.place_at(0)
    mapper.state()


def mapper_readers() -> Iterator[Reader]:
    """Readers of each mapper's file and of its thresholds."""
    # Not those that other tests have registered.
    ours = (
        name for name in installed_mappers() if mapper_spec(name).factory.startswith("albot_core.")
    )
    for name in ours:
        yield Reader(
            name=f"map of {name}",
            functions=(load_map,),
            write=partial(_write_map, name=name),
            read=lambda folder: _go_on(folder / "map.albot"),
            # What reads the file is the same for all; a whole state takes SLAM systems long.
            examples=40 if name == "albot1" else 15,
        )
        plain = json.loads(json.dumps(to_plain(mapper_config(mapper_spec(name)))))
        config = yaml.safe_dump(plain, sort_keys=False)
        read = partial(_read_mapper_config, name)
        functions = (read_mapper_config, read_robots_config)
        yield one_file(f"config of {name}", "a.yaml", config, read, *functions)


def _read_mapper_config(name: str, path: Path) -> None:
    mapper = make_mapper(name, config=read_robots_config(name, path))
    for reading in _readings(2):
        mapper.update(reading)

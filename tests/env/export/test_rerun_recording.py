"""Rerun recordings, read back by Rerun's own reader."""

from __future__ import annotations

from collections.abc import Callable
from importlib import util
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from albot_core.errors import InputError
from albot_core.geometry.poses import compose
from albot_core.logs.log import Log
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
from albot_core.sensing.reading import LaserGeometry
from albot_env.export.rerun_recording import (
    write_episode_rerun,
    write_log_rerun,
    write_map_rerun,
)
from albot_env.recording.reader import EpisodeReader
from tests.env.export.conftest import Recorded

pytest.importorskip("rerun", reason="rerun is not installed: pip install '.[rerun]'")

from rerun.chunk import RrdReader

EXPLORE = "Albot/Explore-v0"


def _rows(path: Path) -> dict[str, dict[str, list[Any]]]:
    """What a recording holds: values by entity and column, in the order of the rows."""
    found: dict[str, dict[str, list[Any]]] = {}
    for chunk in RrdReader(path).stream():
        columns = found.setdefault(chunk.entity_path, {})
        for name, values in chunk.to_record_batch().to_pydict().items():
            columns.setdefault(name, []).extend(values)
    return found


def test_an_episode_on_one_line_of_time(record: Callable[..., Recorded], tmp_path: Path) -> None:
    path, was = record(EXPLORE, mapper="albot1", max_episode_steps=15)
    write_episode_rerun(EpisodeReader(path), tmp_path / "a.rrd")
    reader = EpisodeReader(path)
    moments = list(reader.moments())
    found = _rows(tmp_path / "a.rrd")
    robot = found["/world/robot"]
    assert robot["step"] == list(range(16))
    there = np.array(robot["Transform3D:translation"])[:, 0]
    np.testing.assert_allclose(there[:, :2], [moment.pose[:2] for moment in moments], atol=1e-5)
    curves = found["/curves/reward"]
    assert [value for (value,) in curves["Scalars:scalars"][1:]] == was["rewards"]
    seconds = [time.total_seconds() for time in curves["time"]]
    np.testing.assert_allclose(seconds, [moment.reading.stamp for moment in moments], atol=1e-6)
    errors = [
        np.hypot(*(compose(reader.header.start, each.belief) - each.pose)[:2]) for each in moments
    ]
    assert [value for (value,) in found["/curves/position_error"]["Scalars:scalars"]] == errors
    for name, value in moments[-1].terms.items():
        assert found[f"/curves/terms/{name}"]["Scalars:scalars"][-1] == [value]
    laser = moments[3].reading.laser
    assert laser is not None
    seen = np.array(found["/world/robot/scan"]["Points3D:positions"][3])
    np.testing.assert_allclose(seen[:, :2], laser.points, atol=1e-5)
    walls = np.array(found["/world/walls"]["LineStrips3D:strips"][0])
    np.testing.assert_allclose(walls[:, :, :2].reshape(-1, 4), reader.header.walls, atol=1e-5)
    maps = [moment.snapshot for moment in moments if moment.snapshot is not None]
    shown = found["/world/map/segments"]["LineStrips3D:strips"]
    assert [len(strips) for strips in shown] == [len(each.segments) for each in maps]
    assert "log_time" not in robot


def test_a_log(tmp_path: Path) -> None:
    geometry = LaserGeometry(beams=2, first_bearing=0.0, spacing=1.0, max_range=9.0)
    log = Log(
        name="a.log",
        geometry=geometry,
        stamps=np.array((100.5, 101.5)),
        ranges=np.array(((1.0, np.inf), (np.inf, np.inf))),
        odometry=np.array(((0, 0, 0), (1, 2, 0.5)), float),
    )
    write_log_rerun(log, tmp_path / "a.rrd")
    found = _rows(tmp_path / "a.rrd")
    assert found["/world/robot"]["Transform3D:translation"] == [[[0, 0, 0]], [[1, 2, 0]]]
    assert found["/world/robot/scan"]["Points3D:positions"] == [[[1, 0, 0]], []]
    assert [time.total_seconds() for time in found["/world/robot"]["time"]] == [100.5, 101.5]


def test_all_layers_of_a_map(tmp_path: Path) -> None:
    occupancy = np.array(((0.9, 0.1), (np.nan, 0.7)), np.float32)
    nodes = tuple(
        PlaceNode(id=number, label=f"P{number}", pose=np.array((number, 0.0, 0.0)),
                  middle=np.array((number, 0.5)))
        for number in (1, 4)
    )  # fmt: skip
    doorway = np.array((0.5, -0.5, 0.5, 0.5))
    edge = PlaceEdge(source=1, target=4, motion=np.array((3.0, 0, 0)), doorway=doorway)
    snapshot = MapSnapshot(
        layers=(
            SegmentsLayer(segments=np.array(((0, 0, 1, 0), (1, 0, 1, 2)), float)),
            OccupancyGridLayer(origin=np.zeros(3), resolution=0.5, occupancy=occupancy),
            ParticlesLayer(poses=np.ones((3, 3)), weights=np.full(3, 1 / 3)),
            TrajectoryLayer(poses=np.zeros((4, 3))),
            PlaceGraph(nodes=nodes, edges=(edge,), current=1, home=1),
        )
    )
    write_map_rerun(snapshot, "a", tmp_path / "a.rrd")
    found = _rows(tmp_path / "a.rrd")
    assert len(found["/world/map/segments"]["LineStrips3D:strips"][0]) == 2
    cells = found["/world/map/occupancy_grid"]["Points3D:positions"][0]
    assert cells == [[0.25, 0.25, 0], [0.75, 0.75, 0]]
    assert len(found["/world/map/particles"]["Points3D:positions"][0]) == 3
    assert len(found["/world/map/trajectory"]["LineStrips3D:strips"][0][0]) == 4
    places = found["/world/map/place_graph/places"]
    assert places["Points3D:positions"][0] == [[1, 0.5, 0], [4, 0.5, 0]]
    assert places["Points3D:labels"][0] == ["P1", "P4"]
    links = found["/world/map/place_graph/links"]["LineStrips3D:strips"][0]
    assert links == [[[1, 0.5, 0], [4, 0.5, 0]]]
    graph = found["/place_graph"]
    assert graph["GraphNodes:node_ids"][0] == ["1", "4"]
    assert graph["GraphEdges:edges"][0] == [{"first": "1", "second": "4"}]


def test_a_missing_library_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    known = util.find_spec
    monkeypatch.setattr(
        "albot_env.export.rerun_scene.find_spec",
        lambda name: None if name == "rerun" else known(name),
    )
    with pytest.raises(InputError, match=r"pip install 'albot-env\[rerun\]'"):
        write_map_rerun(MapSnapshot(), "a", tmp_path / "a.rrd")
    assert [*tmp_path.iterdir()] == []

"""What every system of metric SLAM does alike: the way home, its grid, wrong readings."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
import yaml
from PIL import Image

from albot_core.errors import InputError
from albot_core.export.map_server import write_map_server
from albot_core.geometry.poses import compose, relative
from albot_core.mappers import map_file
from albot_core.mappers.map_file import load_map
from albot_core.mappers.mapper import POINT, TRAVEL, Mapper, RouteHome, require
from albot_core.mappers.registry import installed_mappers, make_mapper
from albot_core.maps.layers import OccupancyGridLayer
from albot_core.sensing.reading import LaserScan, Reading
from tests.core.mappers.slam.rooms import LASER, reading_from
from tests.core.mappers.slam.test_scan_matching import drive, lap

CONFIGS = {
    "scan-matching": {},
    "graph-slam": {},
    "gmapping": {"particles": 5},
    "grid-slam": {"particles": 5},
    "fastslam": {"particles": 20},
    "dp-slam": {"particles": 20, "beams": 60},
    "karto": {},
}
NAMES = [name for name in CONFIGS if name in installed_mappers()]
NOTHING = LaserScan(ranges=np.full(LASER.beams, np.inf), geometry=LASER)


def made(name: str) -> Mapper:
    return make_mapper(name, config=CONFIGS[name], rng=np.random.default_rng(3))


def led(name: str, poses: np.ndarray) -> Mapper:
    mapper = made(name)
    drive(mapper, poses, np.random.default_rng(0), 0.0, 0.0)
    return mapper


def off(mapper: Mapper, poses: np.ndarray) -> float:
    """How far from the last pose the mapper takes the robot to be (m)."""
    return float(np.hypot(*(mapper.estimate.pose - relative(poses[0], poses[-1]))[:2]))


def around_the_stub() -> np.ndarray:
    """Poses from one side of the wall that hangs from above to the other, 2 m from the first."""
    begin = np.array((0.0, 3.2, -np.pi / 2))
    poses = [begin + np.array((0, -d, 0)) for d in np.linspace(0, 2.2, 10)]
    poses += [poses[-1] + (0, 0, 0.4 * k) for k in range(1, 5)]
    poses += [poses[-1] + (d, 0, 0) for d in np.linspace(0.1, 2.0, 8)]
    poses += [poses[-1] + (0, 0, 0.4 * k) for k in range(1, 5)]
    poses += [poses[-1] + (0, d, 0) for d in np.linspace(0.1, 2.2, 10)]
    return np.array(poses)


@pytest.mark.parametrize("name", NAMES)
def test_the_way_home_leads_around_a_wall(name):
    poses = around_the_stub()
    mapper = led(name, poses)
    assert off(mapper, poses) < 0.2
    way = require(mapper, RouteHome).way_home
    # Straight ahead it is 2 m, through the wall.
    assert 3.0 < way[TRAVEL] < 5.5
    point = compose(poses[0], np.array((*way[POINT], 0.0)))
    assert point[1] < 2.4
    fresh = require(made(name), RouteHome).way_home
    assert fresh[TRAVEL] == 0.0
    assert np.isnan(fresh[:6]).all()


@pytest.mark.parametrize("name", NAMES)
def test_its_grid_is_written_for_map_server(name, tmp_path):
    poses = lap()[:12]
    layer = led(name, poses).snapshot().layer(OccupancyGridLayer)
    write_map_server(layer, tmp_path / "grid.yaml")
    described = yaml.safe_load((tmp_path / "grid.yaml").read_text())
    gray = np.asarray(Image.open(tmp_path / described["image"]))
    assert gray.shape == layer.occupancy.shape
    # Where the robot stood last it is free: the picture's rows begin at the greatest y.
    x, y, _ = relative(poses[0], poses[-1])
    cell = (np.array((x, y)) - described["origin"][:2]) / described["resolution"]
    column, row = cell.astype(int)
    assert gray[::-1][row, column] == 254
    assert (gray == 0).sum() > 50


def drive_on(mapper: Mapper, poses: np.ndarray) -> None:
    """Lead a mapper from the first pose, where it is, to the others."""
    for before, pose in pairwise(poses):
        mapper.update(reading_from(pose, relative(before, pose)))


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("ranges", [np.inf, 0.0, LASER.max_range])
def test_scans_of_no_returns_leave_the_odometer(name, ranges):
    mapper = made(name)
    nothing = LaserScan(ranges=np.full(LASER.beams, ranges), geometry=LASER)
    for k in range(6):
        motion = np.array((0.5 if k else 0.0, 0.0, 0.1 if k else 0.0))
        mapper.update(Reading(stamp=float(k), motion=motion, laser=nothing))
    x, y, heading = mapper.estimate.pose
    assert np.hypot(x - 2.45, y - 0.5) < 0.9
    assert heading == pytest.approx(0.5, abs=0.5)
    occupancy = mapper.snapshot().layer(OccupancyGridLayer).occupancy
    assert not (occupancy > 0.5).any()


@pytest.mark.parametrize("name", NAMES)
def test_one_scan_of_no_returns_among_others_is_survived(name):
    poses = lap()[:16]
    mapper = led(name, poses[:8])
    mapper.update(Reading(stamp=0.0, motion=relative(poses[7], poses[8]), laser=NOTHING))
    drive_on(mapper, poses[8:])
    assert off(mapper, poses) < 0.2
    assert mapper.estimate.localised


@pytest.mark.parametrize("name", NAMES)
def test_scans_alone_are_enough_where_the_robot_moves_little(name):
    poses = lap(step=0.04, turn=0.04)[:40]
    # DP-SLAM looks at a scan once the odometer says that the robot has moved, or at each.
    config = {"step": 0.0, "turn": 0.0, "particles": 50} if name == "dp-slam" else CONFIGS[name]
    mapper = make_mapper(name, config=config, rng=np.random.default_rng(3))
    for pose in poses:
        mapper.update(reading_from(pose, np.zeros(3)))
    assert off(mapper, poses) < (0.25 if name == "dp-slam" else 0.1)


@pytest.mark.parametrize("name", NAMES)
def test_a_map_file_of_another_system_is_refused(name, tmp_path):
    other = "scan-matching" if name != "scan-matching" else "gmapping"
    state = led(name, lap()[:3]).state()
    header = {"mapper": other, "config": "{}\n"}
    map_file._FILE.write(tmp_path / "map.albot", header, state)
    with pytest.raises(InputError, match=r"map\.albot, .*\.npy: expected (the array|only)"):
        load_map(tmp_path / "map.albot")

"""A grid written for ROS's map_server, read back by pillow and YAML."""

from __future__ import annotations

import numpy as np
import pytest
import yaml
from PIL import Image

from albot_core.errors import InputError
from albot_core.export.map_server import write_map_server
from albot_core.maps.layers import OccupancyGridLayer


def layer(occupancy: np.ndarray) -> OccupancyGridLayer:
    return OccupancyGridLayer(
        origin=np.array((-1.0, 2.0, 0.5)), resolution=0.05, occupancy=occupancy.astype(np.float32)
    )


def test_cells_stand_where_ros_looks_for_them(tmp_path):
    grid = np.array(((0.9, 0.1, np.nan), (0.6, 0.4, 0.97)))
    write_map_server(layer(grid), tmp_path / "a.yaml")
    found = yaml.safe_load((tmp_path / "a.yaml").read_text())
    assert found["image"] == "a.pgm"
    assert found["resolution"] == 0.05
    assert found["origin"] == [-1.0, 2.0, 0.5]
    gray = np.asarray(Image.open(tmp_path / found["image"]), float)
    shares = (255 - gray) / 255
    # The picture's last row is the grid's first.
    occupied, free = shares > found["occupied_thresh"], shares < found["free_thresh"]
    assert occupied.tolist() == [[False, False, True], [True, False, False]]
    assert free.tolist() == [[False, True, False], [False, True, False]]


def test_what_is_no_grid_or_no_name_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"ends in \.yaml"):
        write_map_server(layer(np.zeros((2, 2))), tmp_path / "a.yml")
    with pytest.raises(InputError, match="a grid with cells"):
        write_map_server(layer(np.zeros((0, 0))), tmp_path / "a.yaml")
    assert not list(tmp_path.iterdir())

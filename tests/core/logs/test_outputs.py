from __future__ import annotations

import json
import warnings

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from PIL import Image

from albot_core.drawing.figure import save_figure
from albot_core.drawing.palette import BELIEVED, TRUTH, WALL, rgb
from albot_core.errors import InputError
from albot_core.evaluation.trajectory import Trajectory
from albot_core.export.geojson import write_geojson
from albot_core.export.picture import Panel, map_figure
from albot_core.export.tum import write_tum
from albot_core.geometry.poses import wrap_angle
from albot_core.logs.reader import read_reference
from albot_core.maps.activity import Activity
from albot_core.maps.layers import EMPTY_MAP, MapSnapshot, SegmentsLayer

FINITE = st.floats(-1e6, 1e6, allow_subnormal=False)


@settings(deadline=None)
@given(st.integers(1, 8).flatmap(lambda n: hnp.arrays(np.float64, (n, 4), elements=FINITE)))
def test_a_trajectory_comes_back(tmp_path_factory, table):
    path = tmp_path_factory.mktemp("tum") / "run.tum"
    stamps = np.sort(table[:, 0])
    write_tum(Trajectory(stamps=stamps, poses=table[:, 1:]), path)
    back = read_reference(path)
    np.testing.assert_array_equal(back.stamps, stamps)
    np.testing.assert_array_equal(back.poses[:, :2], table[:, 1:3])
    np.testing.assert_allclose(wrap_angle(back.poses[:, 2] - table[:, 3]), 0, atol=1e-8)


def test_a_quarter_turn_to_the_left_as_tum(tmp_path):
    path = tmp_path / "run.tum"
    pose = np.array([[1.0, -2.0, np.pi / 2]])
    write_tum(Trajectory(stamps=np.array([3.5]), poses=pose), path)
    header, line = path.read_text().splitlines()
    assert header.startswith("#")
    numbers = [float(word) for word in line.split()]
    assert numbers[:6] == [3.5, 1, -2, 0, 0, 0]
    assert numbers[6:] == pytest.approx([np.sqrt(0.5), np.sqrt(0.5)])


def test_a_reference_in_any_order_and_with_comments(tmp_path):
    path = tmp_path / "truth.tum"
    path.write_text("# a comment\n\n2 20 0 0 0 0 0 1\n1 10 0 0 0 0 1 0\n")
    truth = read_reference(path)
    assert truth.stamps.tolist() == [1, 2]
    assert truth.poses[:, 0].tolist() == [10, 20]
    assert np.abs(truth.poses[0, 2]) == pytest.approx(np.pi)


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("3 0 0 0 0 0 0", "line 2: expected eight finite numbers.*7 fields"),
        ("3 0 nan 0 0 0 0 1", r"line 2: expected a field within ±1e\+12, found nan"),
        ("3 0 zero 0 0 0 0 1", "line 2: .*'zero'"),
        ("3 0 0 0 0 0 0 0.5", "line 2: expected a quaternion of length 1"),
    ],
)
def test_a_damaged_trajectory_is_named(line, message, tmp_path):
    path = tmp_path / "truth.tum"
    path.write_text(f"1 0 0 0 0 0 0 1\n{line}\n")
    with pytest.raises(InputError, match=message):
        read_reference(path)


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("truth.txt", "1 0 0 0\n", "line 1: expected eight finite numbers, stamp x y .* 4 fields"),
        ("truth.tum", "time x y\n", "line 1: expected eight finite numbers, stamp x y .* 3 fields"),
        (
            "truth.txt",
            "Dear diary\n",
            r"expected a TUM trajectory \(stamp x y .*found 'Dear diary'",
        ),
        ("truth.txt", "", "expected a TUM trajectory .*found an empty file"),
    ],
)
def test_what_is_no_reference_is_told_what_one_is(name, text, message, tmp_path):
    (tmp_path / name).write_text(text)
    with pytest.raises(InputError, match=message):
        read_reference(tmp_path / name)


def test_references_from_logs(write, log_text, drive):
    corrected = read_reference(write(log_text("corrected")))
    np.testing.assert_allclose(corrected.poses, drive("corrected").corrected, atol=1e-9)
    as_json = read_reference(write(log_text("json")))
    np.testing.assert_allclose(as_json.poses, drive("json").odometry, atol=1e-9)


@pytest.mark.parametrize("kind", ["carmen", "wean", "duke"])
def test_raw_odometry_is_no_reference(kind, write, log_text):
    with pytest.raises(InputError, match="corrected poses, found only odometry"):
        read_reference(write(log_text(kind)))


def test_surfaces_as_geojson(tmp_path):
    path = tmp_path / "map.geojson"
    write_geojson(
        MapSnapshot(
            layers=(SegmentsLayer(segments=np.array([[0, 0, 1, 2.00004], [-0.00001, 3, 4, 5]])),)
        ),
        path,
    )
    map_ = json.loads(path.read_text())
    assert map_["type"] == "FeatureCollection"
    assert "metres" in map_["frame"]
    assert [feature["properties"]["id"] for feature in map_["features"]] == [0, 1]
    assert {feature["type"] for feature in map_["features"]} == {"Feature"}
    lines = [feature["geometry"] for feature in map_["features"]]
    assert {line["type"] for line in lines} == {"LineString"}
    assert [line["coordinates"] for line in lines] == [[[0, 0], [1, 2]], [[0, 3], [4, 5]]]
    assert "-0.0" not in path.read_text()


def test_no_surfaces_as_geojson(tmp_path):
    path = tmp_path / "map.geojson"
    write_geojson(EMPTY_MAP, path)
    assert json.loads(path.read_text())["features"] == []


@pytest.mark.parametrize("wide", [True, False])
def test_a_picture_shows_surfaces_and_paths(wide, tmp_path):
    path = tmp_path / "map.png"
    turn = slice(None) if wide else slice(None, None, -1)
    surfaces = np.array([[0.0, 3, 20, 3], [0, -3, 20, -3]]).reshape(-1, 2, 2)[..., turn]
    walls = np.ascontiguousarray(surfaces).reshape(-1, 4)
    believed = np.zeros((50, 3))
    believed[:, 0 if wide else 1] = np.linspace(0, 20, 50)
    save_figure(
        map_figure(
            Panel(
                title="a corridor",
                snapshot=MapSnapshot(layers=(SegmentsLayer(segments=walls),)),
                believed=believed,
                reference=believed + 1.0,
            )
        ),
        path,
    )
    with Image.open(path) as picture:
        image = np.asarray(picture.convert("RGB")).astype(int)
    for colour in (WALL, BELIEVED, TRUTH):
        rows, columns = np.nonzero(np.abs(image - rgb(colour)).max(axis=-1) < 70)
        assert len(rows) > 300
        assert (np.ptp(columns) > np.ptp(rows)) == wide
    assert (image.shape[1] > image.shape[0]) == wide


def test_a_picture_shows_the_path_in_a_network_beside_the_map(tmp_path):
    values = np.zeros((20, 20), np.float32)
    values[15:18, 2:5] = 1.0
    activity = Activity(cell=1.0, values=values, packet=np.zeros(3))
    still = np.array(((6.0, 3.0), (6.0, 3.0)))
    images = []
    for path in (still, np.array(((6.0, 3.0), (14.0, 3.0)))):
        save_figure(
            map_figure(
                Panel(title="", snapshot=EMPTY_MAP, believed=np.zeros((1, 3))),
                network=(activity, path),
            ),
            tmp_path / "map.png",
        )
        with Image.open(tmp_path / "map.png") as image:
            images.append(np.asarray(image.convert("RGB")).astype(int))
    rows, columns = np.nonzero((images[0] != images[1]).any(axis=-1))
    width = images[0].shape[1]
    assert columns.max() < 0.4 * width  # On the left, a line of 8 m of 20 m.
    assert np.ptp(rows) < 5
    orange = (images[0][..., 0] > 100) & (images[0][..., 2] < 80) & (images[0][..., 1] < 100)
    up, along = np.nonzero(orange[:, : int(0.4 * width)])
    assert up.mean() < rows.mean()
    assert along.mean() < columns.mean()
    side = np.ptp(columns) / 8
    assert np.ptp(along) / side == pytest.approx(3, abs=0.2)


def test_a_picture_of_nothing(tmp_path):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        save_figure(
            map_figure(Panel(title="nothing", snapshot=EMPTY_MAP, believed=np.zeros((1, 3)))),
            tmp_path / "map.png",
        )
    with Image.open(tmp_path / "map.png") as image:
        assert image.size[0] > 500

from __future__ import annotations

import io
import json
import zipfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from albot_core.errors import InputError
from albot_core.mappers.map_file import FORMAT, VERSION, load_map, save_map
from albot_core.mappers.mapper import Mapper
from albot_core.mappers.registry import installed_mappers, make_mapper
from albot_core.sensing.reading import LaserGeometry, LaserScan, Reading, SonarGeometry, SonarScan

LASER, SONAR = LaserGeometry(), SonarGeometry()


def readings(count: int, seed: int = 0) -> list[Reading]:
    rng = np.random.default_rng(seed)
    walls = np.repeat(rng.uniform(1, 9, (count, 20)), 10, axis=1)[:, : LASER.beams]
    return [
        Reading(
            stamp=float(k),
            motion=rng.normal((0.3, 0, 0), (0.1, 0.02, 0.2)),
            laser=LaserScan(ranges=walls[k], geometry=LASER),
            sonar=SonarScan(ranges=walls[k, : len(SONAR.bearings)], geometry=SONAR),
            compass=0.2 * np.sin(k),
        )
        for k in range(count)
    ]


def led(name: str, count: int = 20) -> Mapper:
    mapper = make_mapper(name)
    for reading in readings(count):
        mapper.update(reading)
    return mapper


def test_the_file_is_plain_numpy_and_json(tmp_path):
    path = tmp_path / "a.albot"
    mapper = led("odometry")
    save_map(mapper, path)
    with zipfile.ZipFile(path) as archive:
        header = json.loads(archive.read("header.json"))
        # No clock in the file.
        assert {member.date_time for member in archive.infolist()} == {(1980, 1, 1, 0, 0, 0)}
    expected = {"format": "albot-map", "version": 11, "mapper": "odometry", "config": "{}\n"}
    assert header == expected
    with np.load(path, allow_pickle=False) as arrays:
        np.testing.assert_array_equal(arrays["surfaces"], mapper.snapshot().segments)


@pytest.fixture(params=installed_mappers())
def name(request):
    return request.param


@pytest.mark.parametrize("count", [0, 1, 20])
def test_a_map_comes_back_exactly(name, count, tmp_path):
    mapper = led(name, count)
    save_map(mapper, tmp_path / "a.albot")
    back = load_map(tmp_path / "a.albot")
    assert back.spec.name == mapper.spec.name
    state = mapper.state()
    assert back.state().keys() == state.keys()
    for key, array in back.state().items():
        assert array.dtype == state[key].dtype
        np.testing.assert_array_equal(array, state[key])
    np.testing.assert_array_equal(back.estimate.pose, mapper.estimate.pose)
    np.testing.assert_array_equal(back.snapshot().segments, mapper.snapshot().segments)


def test_a_run_goes_on_as_if_never_stopped(name, tmp_path):
    all_readings = readings(40)
    straight = make_mapper(name)
    for reading in all_readings[:25]:
        straight.update(reading)
    save_map(straight, tmp_path / "a.albot")
    resumed = load_map(tmp_path / "a.albot")
    for reading in all_readings[25:]:
        assert straight.update(reading) == resumed.update(reading)
    save_map(straight, tmp_path / "b.albot")
    save_map(resumed, tmp_path / "c.albot")
    assert (tmp_path / "b.albot").read_bytes() == (tmp_path / "c.albot").read_bytes()


def test_the_same_map_is_the_same_bytes(name, tmp_path):
    save_map(led(name), tmp_path / "a.albot")
    save_map(led(name), tmp_path / "b.albot")
    assert (tmp_path / "a.albot").read_bytes() == (tmp_path / "b.albot").read_bytes()


def test_saving_replaces_and_leaves_nothing_beside(tmp_path):
    path = tmp_path / "a.albot"
    path.write_bytes(b"old")
    save_map(led("odometry"), path)
    assert load_map(path).estimate.map_version > 0
    assert list(tmp_path.iterdir()) == [path]


def rewrite(path: Path, **members: bytes | None) -> Path:
    """The map file with members replaced (`header`, or an array's name), or left out."""
    with zipfile.ZipFile(path) as archive:
        content = {name: archive.read(name) for name in archive.namelist()}
    for name, new in members.items():
        member = "header.json" if name == "header" else f"{name}.npy"
        content.pop(member, None)
        if new is not None:
            content[member] = new
    with zipfile.ZipFile(path, "w") as archive:
        for member, data in content.items():
            archive.writestr(member, data)
    return path


def header(**fields: object) -> bytes:
    return json.dumps(
        {"format": FORMAT, "version": VERSION, "mapper": "odometry", "config": ""} | fields
    ).encode()


def npy(array: np.ndarray, *, pickled: bool = False) -> bytes:
    stream = io.BytesIO()
    np.lib.format.write_array(stream, array, allow_pickle=pickled)
    return stream.getvalue()


@pytest.mark.parametrize(
    ("members", "message"),
    [
        ({"header": None}, "header.json: expected a header of format albot-map"),
        ({"header": b"{"}, "header.json: expected valid JSON"),
        ({"header": b"[]"}, "header.json: expected a header"),
        ({"header": b"\xff\xfe"}, "header.json: expected valid JSON"),
        ({"header": header(format="other")}, "header.json: expected a header"),
        ({"header": header(version=1)}, "expected version 11 of the format, found 1"),
        (
            {"header": header(mapper="gone")},
            r"expected a mapper, one of .*found 'gone' \(one from outside is known once its module",
        ),
        ({"header": header(mapper=["odometry"])}, "expected a mapper"),
        ({"header": header(mapper="albot1")}, "npy: expected"),
        ({"header": header(config=None)}, "expected the mapper's config as YAML, found None"),
        (
            {"header": header(config="step: far")},
            "config, step: expected a number, found far|line 1",
        ),
        ({"pose": None}, "pose.npy: expected the array pose, found none"),
        ({"extra": npy(np.zeros(3))}, "extra.npy: expected only laid_at, pose"),
        ({"pose": npy(np.zeros(3, np.float32))}, "1 dimensions of float64, found 1 of float32"),
        ({"pose": npy(np.zeros((3, 1)))}, "1 dimensions of float64, found 2 of float64"),
        ({"pose": npy(np.zeros(3))[:-1]}, "pose.npy: expected 24 bytes in rows, found 23"),
        ({"pose": npy(np.zeros(3)) + b"0"}, "pose.npy: expected 24 bytes in rows, found 25"),
        ({"pose": b"junk"}, "pose.npy: expected an array"),
        ({"pose": npy(np.array(["a", None]), pickled=True)}, "an array of numbers, found object"),
        ({"pose": npy(np.array(["a"]))}, "an array of numbers"),
    ],
)
def test_a_file_that_is_no_map_of_ours_is_refused(members, message, tmp_path):
    path = tmp_path / "a.albot"
    save_map(led("odometry"), path)
    with pytest.raises(InputError, match=message) as caught:
        load_map(rewrite(path, **members))
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)


ODOMETRY, ALBOT1 = "odometry", "albot1"


@pytest.mark.parametrize(
    ("mapper", "array", "change", "message"),
    [
        (ODOMETRY, "pose", lambda pose: pose[:2], r"pose\.npy: expected shape \(3,\), \(3\), f"),
        (ODOMETRY, "pose", lambda pose: pose * np.nan, r"pose\.npy: expected finite numbers"),
        (
            ODOMETRY,
            "updates",
            lambda count: count - 99,
            r"updates\.npy: expected whole numbers from 0, f",
        ),
        (ODOMETRY, "surfaces", lambda rows: rows[:, :3], r"surfaces\.npy: expected shape"),
        (ODOMETRY, "surfaces", lambda rows: rows * 1e17, r"surfaces\.npy: expected numbers within"),
        (ODOMETRY, "surfaces", lambda rows: rows * 1e7, "line segments of 1000 m at most, found"),
        (
            ALBOT1,
            "memory.surfaces",
            lambda rows: rows * 1e17,
            "numbers within ±1e\\+12",
        ),
        (ALBOT1, "memory.surfaces", lambda rows: rows * 1e7, "line segments of 1000 m at most"),
        (ALBOT1, "memory.marks", lambda marks: marks[:-1], r"marks\.npy: expected shape"),
        (ALBOT1, "memory.met", lambda rows: rows[:, :1], r"memory\.met\.npy: expected shape"),
        (ALBOT1, "memory.counts", lambda counts: counts + 2**60, r"counts\.npy: expected numbers"),
        (ALBOT1, "view.surfaces", lambda rows: rows * 1e7, "line segments of 1000 m at most"),
        (ALBOT1, "view.slots", lambda slots: slots + 9999, "view.slots.npy: expected slots of"),
        (
            ALBOT1,
            "exits.gate",
            lambda gate: gate[:3],
            r"exits\.gate\.npy: expected shape \(5,\), \(5\), f",
        ),
        (ALBOT1, "places.frames", lambda rows: rows[:, :2], r"frames\.npy: expected shape"),
        (ALBOT1, "places.trail_links", lambda rows: rows * (1, 1, 1e-9), "lengths from 0.001 to"),
        (ALBOT1, "places.trail_links", lambda rows: rows + 0.5, "expected pairs of"),
        (
            ALBOT1,
            "readings",
            lambda count: count - 999,
            r"readings\.npy: expected whole numbers from 0, f",
        ),
    ],
)
def test_arrays_that_no_mapper_made_are_refused(mapper, array, change, message, tmp_path):
    path = tmp_path / "a.albot"
    kept = led(mapper)
    save_map(kept, path)
    changed = np.asarray(change(kept.state()[array]), kept.state()[array].dtype)
    with pytest.raises(InputError, match=message) as caught:
        load_map(rewrite(path, **{array: npy(changed)}))
    assert str(caught.value).startswith(f"{path}, {array}.npy: expected")


@pytest.mark.parametrize(
    "shape", [b"(99999999999999999999,)", b"(-3,)", b"(3,", b"('a',)", b"(" * 500, b"open('x')"]
)
def test_an_array_with_a_strange_header_is_refused(shape, tmp_path):
    path = tmp_path / "a.albot"
    save_map(led("odometry"), path)
    with pytest.raises(InputError, match=r"pose\.npy: expected") as caught:
        load_map(rewrite(path, pose=npy(np.zeros(3)).replace(b"(3,)", shape)))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("content", [b"", b"no zip", b"PK\x03\x04", b"PK\x05\x06" + bytes(18)])
def test_what_is_no_zip_is_refused(content, tmp_path):
    path = tmp_path / "a.albot"
    path.write_bytes(content)
    with pytest.raises(InputError):
        load_map(path)
    with pytest.raises(InputError, match="file not found"):
        load_map(tmp_path / "none.albot")


@settings(
    deadline=None, max_examples=150, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(data=st.data())
def test_a_torn_or_changed_file_is_refused_or_loads_the_same(data, tmp_path):
    path = tmp_path / "a.albot"
    mapper = led("odometry", 2)
    save_map(mapper, path)
    content = bytearray(path.read_bytes())
    if data.draw(st.booleans()):
        content = content[: data.draw(st.integers(0, len(content) - 1))]
    else:
        place = data.draw(st.integers(0, len(content) - 1))
        content[place] ^= data.draw(st.integers(1, 255))
    path.write_bytes(bytes(content))
    try:
        back = load_map(path)
    except InputError as error:
        assert "\n" not in str(error)
        return
    np.testing.assert_array_equal(back.snapshot().segments, mapper.snapshot().segments)
    np.testing.assert_array_equal(back.estimate.pose, mapper.estimate.pose)

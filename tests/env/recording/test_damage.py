"""Files that are cut off, damaged or something else."""

from __future__ import annotations

import io
import json
from pathlib import Path

import pytest
from mcap.reader import make_reader
from mcap.writer import Writer

from albot_core.errors import InputError
from albot_env.recording import reader
from albot_env.recording.episode import Moment
from albot_env.recording.reader import EpisodeReader
from albot_env.recording.schemas import EPISODE_HEADER, STEP


def _stamps(path: Path) -> list[float]:
    return [moment.reading.stamp for moment in EpisodeReader(path).moments()]


def test_a_file_cut_anywhere_gives_its_beginning_or_a_clear_error(
    episode: Path, tmp_path: Path
) -> None:
    whole, stamps = episode.read_bytes(), _stamps(episode)
    played = set()
    for k in range(1, 60):
        torn = tmp_path / "torn.mcap"
        torn.write_bytes(whole[: len(whole) * k // 60])
        try:
            found = _stamps(torn)
        except InputError as error:
            assert str(error).startswith(f"{torn}")
            assert "\n" not in str(error)
            continue
        assert found == stamps[: len(found)]
        played.add(len(found))
    assert len(played) > 2
    assert max(played) == len(stamps)


@pytest.mark.parametrize("tail", [b"\0" * 4096, b"\6" + b"\0" * 99, bytes(range(1, 256))])
def test_what_follows_the_last_whole_chunk_is_left_out(
    episode: Path, tmp_path: Path, tail: bytes
) -> None:
    """A computer that goes down may leave blocks of zeros, or of something else."""
    with episode.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    chunk = summary.chunk_indexes[2]
    whole = episode.read_bytes()[: chunk.chunk_start_offset + chunk.chunk_length]
    torn = tmp_path / "torn.mcap"
    torn.write_bytes(whole + tail)
    reader = EpisodeReader(torn)
    assert len(list(reader.moments())) == 20
    assert reader.torn


def test_a_file_that_ends_before_its_header_says_so(episode: Path, tmp_path: Path) -> None:
    torn = tmp_path / "torn.mcap"
    torn.write_bytes(episode.read_bytes()[:100])
    with pytest.raises(InputError, match="its header first, found a file that ends before it"):
        EpisodeReader(torn)


@pytest.mark.parametrize("content", [b"", b"MCAP", b"hello\n"])
def test_a_file_that_is_too_short_ends(content: bytes, tmp_path: Path) -> None:
    (tmp_path / "short.mcap").write_bytes(content)
    with pytest.raises(InputError, match="an episode in MCAP format, found its end"):
        EpisodeReader(tmp_path / "short.mcap")


@pytest.mark.parametrize("share", [0.3, 0.6])
def test_a_flipped_byte_is_found(episode: Path, share: float) -> None:
    data = bytearray(episode.read_bytes())
    with episode.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    chunk = summary.chunk_indexes[0]
    data[chunk.chunk_start_offset + int(share * chunk.chunk_length)] ^= 0xFF
    episode.write_bytes(data)
    with pytest.raises(InputError, match="expected an episode in MCAP format"):
        _stamps(episode)


@pytest.mark.parametrize(
    "content", [b"", b"hello", b"x" * 5000, b"\x89MCAP0\r\n", bytes(range(256)) * 40]
)
def test_a_foreign_file_is_refused(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "foreign.mcap"
    path.write_bytes(content)
    with pytest.raises(InputError, match=r"foreign\.mcap"):
        EpisodeReader(path)


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("none.mcap", "none.mcap: file not found"),
        (".", "expected an episode file that can be read"),
    ],
)
def test_no_file_is_refused(tmp_path: Path, name: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        EpisodeReader(tmp_path / name)


def _write(path: Path, messages: list[tuple[str, bytes]]) -> None:
    stream = io.BytesIO()
    writer = Writer(stream)
    writer.start()
    for topic, data in messages:
        schema = writer.register_schema("any", "jsonschema", b"{}")
        channel = writer.register_channel(topic, "json", schema)
        writer.add_message(channel, 0, data, 0)
    writer.finish()
    path.write_bytes(stream.getvalue())


def _sonar(**changes: object) -> dict[str, object]:
    sonar = {"bearings": [0.0], "places": [[0.0, 0.0]], "cone": 0.5}
    return {**sonar, "min_range": 0.1, "max_range": 4.0, **changes}


def _header(**changes: object) -> bytes:
    header = {
        "format": 7,
        "environment": "Albot/Explore-v0",
        "world": "w",
        "walls": [[0, 0, 1, 0]],
        "start": [0, 0, 0],
        "mapper": "odometry",
        "odometer": "ideal",
        "robot_radius": 0.25,
        "agent": "a",
        "seed": 1,
        "spec": None,
        "laser": {
            "beams": 3,
            "first_bearing": -1.5,
            "spacing": 1.5,
            "max_range": 30.0,
            "mount": [0, 0, 0],
        },
        "sonar": None,
        "way_out": [[0, 0], [1, 0]],
    }
    assert set(header) == set(EPISODE_HEADER["required"])
    return json.dumps({**header, **changes}).encode()


@pytest.mark.parametrize("error", [MemoryError, OverflowError])
def test_a_length_that_cannot_be_true_is_damage(
    episode: Path, monkeypatch: pytest.MonkeyPatch, error: type[Exception]
) -> None:
    """The library takes lengths at their word."""

    def broken_up(chunk: object, validate_crc: bool) -> None:
        raise error

    monkeypatch.setattr(reader, "breakup_chunk", broken_up)
    with pytest.raises(InputError, match="found a length that cannot be true"):
        EpisodeReader(episode)


def test_another_mcap_file_is_refused(tmp_path: Path) -> None:
    _write(tmp_path / "a.mcap", [("/camera", b"{}")])
    with pytest.raises(InputError, match="an MCAP file without one"):
        EpisodeReader(tmp_path / "a.mcap")


@pytest.mark.parametrize(
    ("changes", "place"),
    [
        ({"format": 2}, "header/format"),
        ({"walls": [[0, 0, 1]]}, "header/walls/0"),
        ({"start": None}, "header/start"),
        ({"seed": "one"}, "header/seed"),
        ({"spec": "Albot/Explore-v0"}, "header/spec"),
        ({"sonar": {"bearings": [0]}}, "header/sonar"),
        ({"sonar": _sonar(cone=7.0)}, "header.sonar.cone"),
        ({"sonar": _sonar(places=[])}, "header.sonar.places"),
    ],
)
def test_a_wrong_header_says_where(tmp_path: Path, changes: dict, place: str) -> None:
    _write(tmp_path / "a.mcap", [("/albot/header", _header(**changes))])
    with pytest.raises(InputError, match=f"{place}: expected"):
        EpisodeReader(tmp_path / "a.mcap")


def test_an_episode_of_another_version_is_told(tmp_path: Path) -> None:
    _write(tmp_path / "a.mcap", [("/albot/header", _header(format=8))])
    with pytest.raises(InputError, match="header/format: expected 7, found 8, of another version"):
        EpisodeReader(tmp_path / "a.mcap")


STEP_SENT = {
    "stamp": 0.0, "action": None, "reward": 0.0, "terms": {"coverage": 1.0}, "motion": [0, 0, 0],
    "echoes": None, "scene": None, "compass": None, "pose": [0, 0, 0], "collided": False,
    "room": "west", "path_length": 0.0, "belief": [0, 0, 0], "home": [0, 0, 0], "updates": 0,
    "matched_reading": None, "facts": {"coverage": 0.5},
}  # fmt: skip
NODE = {"id": 0, "label": "P1", "pose": [0, 0, 0], "middle": [0, 0], "segments": []}
EDGE = {"source": 0, "target": 0, "motion": [0, 0, 0], "doorway": None, "reverse": None}
GRID = {"origin": [0, 0, 0], "resolution": 0.5, "rows": 1, "columns": 2, "occupancy": "AP8="}
GRAPH = {"nodes": [NODE], "edges": [EDGE], "current": 0, "home": None}


def _moments(path: Path, **changed: object) -> list[Moment]:
    """The moments of an episode of one step, of which some messages are others."""
    sent = {
        "/scan": {"ranges": [1, 2, 3]},
        "/albot/things": {"segments": [[0, 0, 1, 1]]},
        "/albot/map": {"occupancy_grid": GRID, "place_graph": GRAPH},
        "/albot/step": STEP_SENT,
    } | changed
    messages = [(topic, json.dumps(content).encode()) for topic, content in sent.items()]
    _write(path, [("/albot/header", _header()), *messages])
    return list(EpisodeReader(path).moments())


def test_the_messages_that_are_damaged_below_are_whole(tmp_path: Path) -> None:
    (moment,) = _moments(tmp_path / "a.mcap")
    assert moment.snapshot is not None
    assert len(moment.snapshot.place_graph.nodes) == 1


@pytest.mark.parametrize(
    ("topic", "content", "message"),
    [
        ("/scan", [], "expected a mapping with ranges, found"),
        ("/scan", {}, "ranges: expected a value, found none"),
        ("/scan", {"ranges": {}}, "ranges: expected n numbers within"),
        ("/scan", {"ranges": [1, None, 3]}, "ranges: expected n numbers within"),
        ("/scan", {"ranges": [1, 2]}, "ranges: expected 3 ranges, one per beam"),
        ("/scan", {"ranges": [1, 2, -3]}, "ranges: expected distances"),
        ("/scan", {"ranges": [1, 2, 10**39]}, "ranges: expected n numbers within"),
        ("/albot/things", {"segments": [[1, 2, 3]]}, "segments: expected n x 4 numbers"),
        ("/albot/step", STEP_SENT | {"terms": []}, "terms: expected a mapping"),
        ("/albot/step", STEP_SENT | {"terms": {"a": "b"}}, "terms.a: expected a number"),
        ("/albot/step", STEP_SENT | {"pose": [0, 0]}, "pose: expected 3 numbers"),
        ("/albot/step", STEP_SENT | {"pose": [0, 0, 1e300]}, "pose: expected 3 numbers"),
        ("/albot/step", STEP_SENT | {"action": 3}, "action: expected n numbers"),
        ("/albot/step", STEP_SENT | {"updates": -1}, "updates: expected a whole number from 0"),
        ("/albot/step", STEP_SENT | {"updates": 1.5}, "updates: expected a whole number"),
        ("/albot/step", STEP_SENT | {"matched_reading": "x"}, "matched_reading: expected a whole"),
        ("/albot/step", STEP_SENT | {"facts": []}, "facts: expected a mapping"),
        ("/albot/step", STEP_SENT | {"facts": {"a": [1]}}, "facts.a: expected a number, a text"),
        ("/albot/step", STEP_SENT | {"echoes": [1]}, "echoes: expected echoes of the sonars"),
        ("/albot/map", [], "expected a mapping with"),
        ("/albot/map", {"segmnts": {}}, "found segmnts .did you mean segments"),
        ("/albot/map", {"segments": {"segments": 3}}, "segments.segments: expected n x 4"),
        ("/albot/map", {"trajectory": {"poses": [[0, 0]]}}, "trajectory.poses: expected n x 3"),
        (
            "/albot/map",
            {"particles": {"poses": [[0, 0, 0]], "weights": []}},
            "particles.weights: expected 1 numbers",
        ),
        ("/albot/map", {"occupancy_grid": GRID | {"rows": 2}}, "expected 2 x 2 bytes in base 64"),
        ("/albot/map", {"occupancy_grid": GRID | {"rows": -1}}, "expected -1 x 2 bytes"),
        ("/albot/map", {"occupancy_grid": GRID | {"rows": 2**62}}, "bytes in base 64"),
        ("/albot/map", {"occupancy_grid": GRID | {"occupancy": "A"}}, "bytes in base 64"),
        ("/albot/map", {"occupancy_grid": GRID | {"resolution": 0}}, "resolution: expected a pos"),
        ("/albot/map", {"place_graph": GRAPH | {"nodes": {}}}, "place_graph.nodes: expected a li"),
        ("/albot/map", {"place_graph": GRAPH | {"nodes": [NODE, NODE]}}, "ids of their own"),
        ("/albot/map", {"place_graph": GRAPH | {"nodes": [3]}}, r"nodes\[0\]: expected a mapping"),
        ("/albot/map", {"place_graph": GRAPH | {"current": 7}}, "current: expected the id of a pl"),
        (
            "/albot/map",
            {"place_graph": GRAPH | {"edges": [EDGE | {"target": 7}]}},
            r"edges\[0\]\.target: expected the number of one that is there, found 7",
        ),
        (
            "/albot/map",
            {"place_graph": GRAPH | {"edges": [EDGE | {"reverse": 1}]}},
            r"edges\[0\]\.reverse: expected the number",
        ),
        (
            "/albot/map",
            {"place_graph": GRAPH | {"edges": [EDGE | {"doorway": [1]}]}},
            r"edges\[0\]\.doorway: expected 4 numbers",
        ),
    ],
)
def test_a_message_of_another_shape_says_where(
    tmp_path: Path, topic: str, content: object, message: str
) -> None:
    with pytest.raises(InputError, match=message) as caught:
        _moments(tmp_path / "a.mcap", **{topic: content})
    assert str(caught.value).startswith(f"{tmp_path / 'a.mcap'}, {topic} at 0 s")


@pytest.mark.parametrize("data", [b"{", b"[]", b'{"pose": 1}', b"\xff\xfe"])
def test_a_wrong_step_says_when(tmp_path: Path, data: bytes) -> None:
    scan = b'{"ranges": [1, 2, 3]}'
    messages = [("/albot/header", _header()), ("/scan", scan), ("/albot/step", data)]
    _write(tmp_path / "a.mcap", messages)
    assert "pose" in STEP["required"]
    with pytest.raises(InputError, match=r"step at 0 s|Step at 0 s"):
        list(EpisodeReader(tmp_path / "a.mcap").moments())

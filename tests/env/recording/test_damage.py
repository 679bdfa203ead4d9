"""Files that are cut off, damaged or something else."""

from __future__ import annotations

import io
import json
from pathlib import Path

import pytest
from mcap.reader import make_reader
from mcap.writer import Writer

from albot_core.errors import InputError
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


@pytest.mark.parametrize("name", ["none.mcap", "."])
def test_no_file_is_refused(tmp_path: Path, name: str) -> None:
    with pytest.raises(InputError, match="expected an episode file that can be read"):
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
        "format": 3,
        "environment": "Albot/Explore-v0",
        "world": "w",
        "walls": [[0, 0, 1, 0]],
        "start": [0, 0, 0],
        "mapper": "odometry",
        "odometer": "ideal",
        "agent": "a",
        "seed": 1,
        "laser": {
            "beams": 3,
            "first_bearing": -1.5,
            "spacing": 1.5,
            "max_range": 30.0,
            "mount": [0, 0, 0],
        },
        "sonar": None,
    }
    assert set(header) == set(EPISODE_HEADER["required"])
    return json.dumps({**header, **changes}).encode()


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
        ({"sonar": {"bearings": [0]}}, "header/sonar"),
        ({"sonar": _sonar(cone=7.0)}, "header, SonarGeometry.cone"),
        ({"sonar": _sonar(places=[])}, "header, SonarGeometry.places"),
    ],
)
def test_a_wrong_header_says_where(tmp_path: Path, changes: dict, place: str) -> None:
    _write(tmp_path / "a.mcap", [("/albot/header", _header(**changes))])
    with pytest.raises(InputError, match=f"{place}: expected"):
        EpisodeReader(tmp_path / "a.mcap")


@pytest.mark.parametrize("data", [b"{", b"[]", b'{"pose": 1}', b"\xff\xfe"])
def test_a_wrong_step_says_when(tmp_path: Path, data: bytes) -> None:
    scan = b'{"ranges": [1, 2, 3]}'
    messages = [("/albot/header", _header()), ("/scan", scan), ("/albot/step", data)]
    _write(tmp_path / "a.mcap", messages)
    assert "pose" in STEP["required"]
    with pytest.raises(InputError, match=r"step at 0 s|Step at 0 s"):
        list(EpisodeReader(tmp_path / "a.mcap").moments())

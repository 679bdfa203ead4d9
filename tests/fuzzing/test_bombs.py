"""Small files that unpack to more than any memory holds are refused before they are unpacked."""

from __future__ import annotations

import gzip
import io
import json
import lzma
import struct
import subprocess
import sys
import zipfile
import zlib
from pathlib import Path

import pytest
from mcap.writer import Writer

_MIB = 1 << 20
_READ = """
import json, re, resource, sys
from pathlib import Path
from albot_core.errors import InputError
from albot_core.logs.reader import read_log
from albot_core.mappers.map_file import load_map
from albot_maps import load_world
from albot_maps.formats.picture import read_shades
from albot_env.recording.reader import EpisodeReader
data = int(re.search(r"VmData:\\s+(\\d+)", Path("/proc/self/status").read_text())[1]) * 1024
resource.setrlimit(resource.RLIMIT_DATA, (data + 500_000_000,) * 2)
readers = {"log": read_log, "map": load_map, "world": load_world, "episode": EpisodeReader}
errors = {}
for path in sorted(Path(sys.argv[1]).iterdir()):
    if (name := path.name.split(".")[0]) in readers:
        try:
            readers[name](path)
        except InputError as error:
            errors[path.name] = f"{error.place}: {error.expected}, {error.found}"
print(json.dumps(errors))
"""
"""Reads all files of a folder within 500 MB, and prints what is said of each."""


def _png(side: int, first: bytes, second: bytes) -> bytes:
    """A grey picture of so many pixels a side, of two rows in turn."""
    packer = zlib.compressobj()
    rows = b"".join(packer.compress(b"\0" + (second if row % 2 else first)) for row in range(side))
    header = struct.pack(">IIBBBBB", side, side, 8, 0, 0, 0, 0)
    chunks = ((b"IHDR", header), (b"IDAT", rows + packer.flush()), (b"IEND", b""))
    parts = (
        struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
        for kind, data in chunks
    )
    return b"\x89PNG\r\n\x1a\n" + b"".join(parts)


def _episode() -> bytes:
    """An episode of one chunk of 200 MB of zeros."""
    stream = io.BytesIO()
    writer = Writer(stream, chunk_size=1 << 30)
    writer.start()
    schema = writer.register_schema("any", "jsonschema", b"{}")
    channel = writer.register_channel("/albot/header", "json", schema)
    writer.add_message(channel, 0, bytes(70 * _MIB), 0)
    writer.finish()
    return stream.getvalue()


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="limits memory as Linux does")
def test_what_unpacks_to_too_much_is_refused_within_500_mb(tmp_path: Path) -> None:
    for name, size in (("log.log", 130), ("world.json", 20), ("world.xml", 20)):
        (tmp_path / f"{name}.gz").write_bytes(gzip.compress(b" " * (size * _MIB)))
    (tmp_path / "world.yaml.xz").write_bytes(lzma.compress(b" " * (5 * _MIB), preset=0))
    with zipfile.ZipFile(tmp_path / "map.albot", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("surfaces.npy", bytes(300 * _MIB))
    described = "resolution: 0.05\norigin: [0, 0, 0]\nnegate: 0\noccupied_thresh: 0.65\n"
    for name, picture in (
        ("large", _png(13_000, bytes(13_000), bytes(13_000))),
        ("board", _png(4096, b"\0\xff" * 2048, b"\xff\0" * 2048)),
    ):
        (tmp_path / f"{name}.png").write_bytes(picture)
        text = f"image: {name}.png\n{described}free_thresh: 0.196\n"
        (tmp_path / f"world.{name}.yaml").write_text(text)
    (tmp_path / "episode.mcap").write_bytes(_episode())
    sizes = [path.stat().st_size for path in tmp_path.iterdir()]
    assert max(sizes) < 400_000
    ran = subprocess.run([sys.executable, "-c", _READ, tmp_path], capture_output=True, text=True)
    assert ran.returncode == 0, ran.stderr
    errors = json.loads(ran.stdout)
    assert errors.pop("episode.mcap").endswith("a chunk that unpacks to more than 67,108,864 bytes")
    assert errors == {
        "log.log.gz": ": 134,217,728 bytes at most, more, decompressed",
        "map.albot": ": members of 268,435,456 bytes in total at most, "
        "1 members of 314,572,800 bytes",
        "world.board.yaml": ": 500,000 runs of dark cells at most, 8,388,608",
        "world.json.gz": ": 16,777,216 bytes at most, more, decompressed",
        "world.large.yaml": ": 16,777,216 cells at most, 13,000 x 13,000",
        "world.xml.gz": ": 16,777,216 bytes at most, more, decompressed",
        "world.yaml.xz": ": 4,194,304 bytes at most, more, decompressed",
    }

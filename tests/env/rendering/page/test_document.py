"""The HTML file of a page, read back as a browser reads it."""

from __future__ import annotations

import base64
import gzip
import json
import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hn

from albot_core.errors import InputError
from albot_env.recording import show
from albot_env.recording.reader import EpisodeReader
from albot_env.rendering.page import episode_page, write_page
from albot_env.rendering.page.document import ACROSS, document

LARGEST = 100_000
"""Size of the player without data (bytes)."""
TYPES = {"i4": np.int32, "u1": np.uint8, "u2": np.uint16, "f4": np.float32, "f8": np.float64}
ARRAYS = st.one_of(
    *(
        hn.arrays(dtype, hn.array_shapes(min_dims=1, max_dims=2, min_side=0, max_side=5))
        for dtype in TYPES.values()
    )
)


def read(page: bytes) -> tuple[dict, dict[str, np.ndarray]]:
    """The facts and arrays of a page, by another way than the player's."""
    found = re.search(rb'<script id="data" type="[^"]+">([^<]*)</script>', page)
    assert found
    content = gzip.decompress(base64.b64decode(found[1]))
    length = int.from_bytes(content[:4], "little")
    facts = json.loads(content[4 : 4 + length])
    blob = content[-(-(4 + length) // 8) * 8 :]
    arrays = {}
    for name, entry in facts["arrays"].items():
        dtype = np.dtype(TYPES[entry["type"]])
        count = int(np.prod(entry["shape"]))
        planes = np.frombuffer(blob, np.uint8, count * dtype.itemsize, entry["at"])
        values = np.ascontiguousarray(planes.reshape(dtype.itemsize, count).T).view(dtype)
        values = values.reshape(entry["shape"])
        if dtype.kind in "iu" and count:
            values = values.cumsum(axis=-1 if entry["across"] else 0, dtype=dtype)
        arrays[name] = values
    return facts, arrays


@given(ARRAYS, st.sampled_from(["poses", ACROSS]))
def test_arrays_are_read_as_they_were_written(array: np.ndarray, name: str) -> None:
    _, arrays = read(document("a", {}, {"before": np.arange(3, dtype=np.uint8), name: array}))
    assert arrays["before"].tolist() == [0, 1, 2]
    assert arrays[name].dtype == array.dtype
    assert np.array_equal(arrays[name], array, equal_nan=array.dtype.kind == "f")


def test_names_cannot_end_what_they_stand_in() -> None:
    hostile = '</title></script><script>alert("x")</script>'
    page = document(hostile, {"heading": {"world": hostile}}, {})
    assert hostile.encode() not in page
    assert b"&lt;/title&gt;" in page
    assert read(page)[0]["heading"]["world"] == hostile


def test_the_player_is_small_and_asks_nobody() -> None:
    page = document("a", {}, {})
    assert len(page) < LARGEST
    assert b"default-src 'none'" in page
    text = re.sub(r"/\*!.*?\*/", "", page.decode(), flags=re.DOTALL)
    assert not re.findall(r'(?:src|href)="', text)


def test_a_page_holds_the_moments_of_its_episode(episode: Path) -> None:
    page = episode_page(episode)
    assert page == episode_page(episode)
    facts, arrays = read(page)
    moments = list(EpisodeReader(episode).moments())
    assert arrays["times"].tolist() == [moment.reading.stamp for moment in moments]
    poses = np.array([moment.pose for moment in moments])
    assert np.abs(arrays["poses"][:, :2] / 1e3 - poses[:, :2]).max() <= 0.0005 + 1e-9
    scan = moments[7].reading.laser
    assert scan is not None
    told = np.where(arrays["scans"][7] == 0, np.inf, arrays["scans"][7] / 100)
    near = np.isfinite(scan.ranges)
    assert np.abs(told[near] - scan.ranges[near]).max() <= 0.005 + 1e-6
    assert (np.isinf(told) == ~near).all()
    sums = dict(zip(facts["terms"], (arrays[f"term.{k}"][-1] for k in range(99)), strict=False))
    for name, total in sums.items():
        assert total == pytest.approx(sum(moment.terms[name] for moment in moments), abs=1e-5)
    (track,) = facts["tracks"]
    surfaces = [channel["label"] for channel in track["channels"]].index("surfaces")
    births, deaths = (arrays[f"track.0.{surfaces}.{name}"] for name in ("births", "deaths"))
    last = [moment.snapshot for moment in moments if moment.snapshot is not None][-1]
    version = len(arrays["track.0.map_steps"]) - 1
    alive = (births <= version) & ((deaths < 0) | (deaths > version))
    assert alive.sum() == len(np.unique(np.rint(1000 * last.segments), axis=0))


def test_a_notebook_shows_the_page_in_a_frame(episode: Path) -> None:
    shown = show(str(episode))
    text = shown._repr_html_()
    assert text.startswith('<iframe sandbox="allow-scripts"')
    assert text.count("<") == 2  # The page inside is escaped.
    assert str(episode) in repr(shown)


def test_what_is_no_episode_leaves_no_page(tmp_path: Path) -> None:
    (tmp_path / "a.mcap").write_bytes(b"nothing")
    with pytest.raises(InputError, match=r"a\.mcap"):
        write_page(tmp_path / "a.mcap", tmp_path / "a.html")
    assert not (tmp_path / "a.html").exists()

"""The activity of an attractor network, from the mapper to the file and to the screen."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest
from mcap.reader import make_reader
from PIL import Image

from albot_core.drawing.figure import save_figure
from albot_core.errors import InputError
from albot_core.maps.activity import Activity
from albot_core.plain_data import Location
from albot_env.recording.activity import activity_from_message, activity_messages
from albot_env.recording.episode import Moment
from albot_env.recording.reader import EpisodeReader
from albot_env.recording.writer import EpisodeWriter
from albot_env.rendering import canvas, picture
from albot_env.rendering.frame import Frame
from albot_env.rendering.scene import lay_out
from albot_env.rendering.terminal import draw_text
from albot_env.rendering.trace import Trace
from albot_env.tasks.explore.env import ExploreEnv
from albot_maps import World
from tests.env.conftest import drive
from tests.env.rendering.test_rendering import made_frame


def made_activity() -> Activity:
    """20 × 10 cells of 0.5 m: one place fully active, one by a quarter."""
    values = np.zeros((10, 20), np.float32)
    values[2, 4], values[7, 15] = 0.8, 0.2
    return Activity(cell=0.5, values=values, packet=np.array((2.25, 1.25, np.pi / 2)))


@pytest.fixture
def frame() -> Frame:
    """A robot in a square room whose mapper has a network; the packet went round its east end."""
    packets = np.array(((8.0, 1.0), (9.8, 1.0), (0.2, 1.0), (2.25, 1.25)))
    return replace(made_frame(), activity=made_activity(), packets=packets)


def test_the_network_has_a_panel_in_its_own_frame(frame: Frame) -> None:
    scene = lay_out(frame)
    assert scene.activity is not None
    assert scene.panels == (scene.truth, scene.map, scene.activity)
    assert scene.bounds == lay_out(made_frame()).bounds == scene.map.bounds
    x0, y0, x1, y1 = scene.activity.bounds
    assert x0 < 0 < 10 < x1
    assert y0 < 0 < 5 < y1
    shapes = {shape.label: shape for shape in scene.activity.shapes}
    # Middles and sides of the cells; the weaker is drawn with the root of its share.
    wanted = np.array(((2.25, 1.25, 0.5, 1.0), (7.75, 3.75, 0.5, 0.5)))
    assert shapes["activity"].data == pytest.approx(wanted)
    assert shapes["activity"].points == pytest.approx(wanted[:, :2])
    assert shapes["packet"].data == pytest.approx((2.25, 1.25, np.pi / 2))
    # The step from one end to the other is not drawn across.
    path = np.array(((8.0, 1.0, 9.8, 1.0), (0.2, 1.0, 2.25, 1.25)))
    assert shapes["packet's path"].data == pytest.approx(path)


def test_without_a_network_there_are_two_panels() -> None:
    assert len(lay_out(made_frame()).panels) == 2


def _changed(one: np.ndarray, other: np.ndarray) -> tuple[slice, slice]:
    """The rectangle in which two pictures differ."""
    rows, columns = np.nonzero((one != other).any(axis=-1))
    return slice(rows.min(), rows.max() + 1), slice(columns.min(), columns.max() + 1)


def _moved(frame: Frame) -> Frame:
    """The weak activity lies elsewhere: 5 m to the west."""
    activity = made_activity()
    values = np.roll(activity.values, -10, axis=1)
    values[2], values[2, 4] = 0.0, 0.8
    return replace(frame, activity=replace(activity, values=values))


def test_the_window_and_the_picture_show_where_it_is_active(frame: Frame, tmp_path: Path) -> None:
    drawn = []
    for name, each in (("a", frame), ("b", _moved(frame))):
        path = tmp_path / f"{name}.png"
        save_figure(picture.episode_figure(each), path)
        with Image.open(path) as image:
            drawn.append(np.asarray(image.convert("RGB")).astype(int))
    painted = [canvas.paint_array(lay_out(each)).astype(int) for each in (frame, _moved(frame))]
    panel, full = np.array(canvas.PANEL), np.array(canvas.PALETTE["activity"])
    for one, other in (drawn, painted):
        rows, columns = _changed(one, other)
        assert columns.start > 0.76 * one.shape[1]  # In the third panel, …
        cell = rows.stop - rows.start
        # …two cells of 0.5 m, 5 m apart.
        assert (columns.stop - columns.start) / cell == pytest.approx(11, rel=0.1)
    rows, columns = _changed(*painted)
    shade = painted[0][(rows.start + rows.stop) // 2, columns.stop - 3]
    assert shade == pytest.approx((panel + full) / 2, abs=1)


def test_the_terminal_shows_it_where_there_is_room(frame: Frame) -> None:
    wide, narrow = draw_text(frame, 140, 30).plain, draw_text(frame, 80, 23).plain
    assert "the network's activity" in wide
    assert "activity" not in narrow
    assert max(map(len, wide.splitlines())) <= 140
    assert draw_text(_moved(frame), 140, 30).plain != wide
    two = draw_text(made_frame(), 80, 23).plain
    assert narrow == two


class _Recorder(EpisodeWriter):
    """Writes the moments, and keeps them."""

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self.moments: list[Moment] = []

    def add(self, moment: Moment) -> None:
        self.moments.append(moment)
        super().add(moment)


def test_an_episode_holds_it_to_the_last_bit(two_rooms: World, tmp_path: Path) -> None:
    env, path = ExploreEnv(two_rooms, mapper="ratslam"), tmp_path / "a.mcap"
    env.recorder = recorder = _Recorder(path)
    drive(env, 40)
    live = env.frame
    env.close()
    with path.open("rb") as stream:
        for schema, channel, message in make_reader(stream).iter_messages():
            assert schema is not None
            jsonschema.validate(json.loads(message.data), json.loads(schema.data))
            assert channel.topic != "/activity" or b'"frame_id":"network"' in message.data
    reader = EpisodeReader(path)
    read = list(reader.moments())
    trace = Trace(reader.header, read[0])
    for one in read[1:]:
        trace.add(one)
    for one, other in zip(read, recorder.moments, strict=True):
        assert (one.activity is None) == (other.activity is None)
        if one.activity is not None and other.activity is not None:
            _assert_same(one.activity, other.activity)
    count = sum(moment.activity is not None for moment in read)
    assert 3 < count < len(read)  # Only where it has changed.
    assert live.activity is not None
    assert trace.frame.activity is not None
    _assert_same(trace.frame.activity, live.activity)
    assert len(live.packets) == count
    assert np.array_equal(trace.frame.packets, live.packets)
    played, shown = lay_out(trace.frame), lay_out(live)
    assert np.array_equal(canvas.paint_array(played), canvas.paint_array(shown))


def _assert_same(one: Activity, other: Activity) -> None:
    assert one.cell == other.cell
    assert np.array_equal(one.values, other.values)
    assert np.array_equal(one.packet, other.packet)


def _change(**changes: Any) -> Callable[[dict[str, Any]], dict[str, Any]]:
    return lambda content: content | changes


@pytest.mark.parametrize(
    ("changes", "place"),
    [
        (_change(rows=0), "rows"),
        (_change(columns=1 << 40), "columns"),
        (_change(cell=0.0), "cell"),
        (_change(cell="wide"), "cell"),
        (_change(active=[44, 200]), "active"),
        (_change(active=[44, -1]), "active"),
        (_change(values=[0.8]), "values"),
        (_change(values=[0.8, -0.2]), "values"),
        (_change(values=[0.8, 1e300]), "values"),
        (_change(packet=[1.0, 2.0]), "packet"),
        (_change(colour="red"), "colour"),
    ],
)
def test_a_damaged_message_is_refused_at_its_place(
    changes: Callable[[dict[str, Any]], dict[str, Any]], place: str
) -> None:
    where = Location("a.mcap")
    content = dict(activity_messages(made_activity(), 0.0))["/albot/activity"]
    _assert_same(activity_from_message(content, where), made_activity())
    with pytest.raises(InputError, match=rf"a\.mcap, {place}") as error:
        activity_from_message(changes(content), where)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("cell", np.nan),
        ("values", np.zeros((0, 3), np.float32)),
        ("values", np.full((2, 3), np.inf, np.float32)),
        ("values", np.full((2, 3), -1, np.float32)),
    ],
)
def test_what_is_no_activity_is_refused(field: str, value: object) -> None:
    with pytest.raises(InputError, match=rf"Activity\.{field}: expected"):
        replace(made_activity(), **{field: value})

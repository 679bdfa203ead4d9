"""The player in a real browser: what it reads, shows, and does on keys and clicks."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from albot_core.maps.layers import MapSnapshot, OccupancyGridLayer, TrajectoryLayer
from albot_core.sensing.reading import Reading
from albot_env.recording.reader import EpisodeReader
from albot_env.recording.writer import EpisodeWriter
from albot_env.rendering.page import write_page
from albot_env.rendering.page.comparison_page import comparison_page
from albot_env.rendering.page.document import document
from albot_env.rendering.page.episode_page import EpisodeTracker
from albot_env.rendering.page.tracks import TrackWriter
from albot_env.tasks.explore.env import ExploreEnv
from albot_maps import World
from tests.env.conftest import drive


class Opened:
    """A page in the browser, and what it complained about or asked for."""

    def __init__(self, browser: Any, path: Path, moment: str = "") -> None:
        self.problems: list[str] = []
        self.page = browser.new_page(viewport={"width": 1200, "height": 900})
        self.page.on("console", lambda message: self.problems.append(message.text))
        self.page.on("pageerror", lambda error: self.problems.append(str(error)))
        url = path.as_uri()
        self.page.on(
            "request",
            lambda asked: None if asked.url.startswith(url) else self.problems.append(asked.url),
        )
        self.page.goto(url + moment)
        self.page.wait_for_selector("html[data-ready]")

    def __call__(self, script: str) -> Any:
        """What a script returns, after the page has drawn what it was asked to."""
        return self.page.evaluate(
            f"new Promise((done) => requestAnimationFrame(() => done({script})))"
        )

    def until(self, script: str, seconds: float = 10.0) -> None:
        """Wait until a script is true. The page's own policy forbids it to wait for a text."""
        end = time.monotonic() + seconds
        while not self.page.evaluate(script):
            assert time.monotonic() < end, script
            self.page.wait_for_timeout(20)

    def press(self, *keys: str) -> int:
        """The step after some keys."""
        for key in keys:
            self.page.keyboard.press(key)
        return self("player.step")


@pytest.fixture(scope="module")
def recorded(two_rooms: World, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An episode of forty steps with albot1, and its page beside it."""
    path = tmp_path_factory.mktemp("page") / "episode.mcap"
    env = ExploreEnv(two_rooms, mapper="albot1")
    env.recorder = EpisodeWriter(path)
    drive(env, 40)
    env.close()
    write_page(path, path.with_suffix(".html"))
    return path


@pytest.fixture
def opened(browser: Any, recorded: Path) -> Iterator[Opened]:
    """The page of the recorded episode."""
    opened = Opened(browser, recorded.with_suffix(".html"))
    yield opened
    assert opened.problems == []
    opened.page.close()


def test_the_player_reads_what_was_recorded(opened: Opened, recorded: Path) -> None:
    moments = list(EpisodeReader(recorded).moments())
    assert opened("player.episode.steps") == len(moments) == 41
    for step in (0, 7, 40):
        x, y, heading = opened(f"player.episode.pose({step})")
        assert np.allclose((x / 1e3, y / 1e3, heading), moments[step].pose, atol=1e-3)
        laser = moments[step].reading.laser
        assert laser is not None
        hits = np.reshape(opened(f"player.episode.hits({step})"), (-1, 2)) / 1e3
        cos, sin = np.cos(moments[step].pose[2]), np.sin(moments[step].pose[2])
        points = laser.points @ np.array(((cos, sin), (-sin, cos))) + moments[step].pose[:2]
        assert np.abs(hits - points).max() < 0.02
    versions = np.cumsum([moment.snapshot is not None for moment in moments]) - 1
    surfaces = "player.episode.tracks[0].channels.find((c) => c.label === 'surfaces').table"
    snapshot = None
    for step, moment in enumerate(moments):
        snapshot = moment.snapshot or snapshot
        assert snapshot is not None
        assert opened(f"player.episode.tracks[0].version({step})") == versions[step]
        count = len(np.unique(np.rint(1000 * snapshot.segments), axis=0))
        assert opened(f"{surfaces}.count({versions[step]})") == count


def test_keys_step_and_seek(opened: Opened) -> None:
    assert opened.press("n", "n", "n") == 3
    assert opened.press("b") == 2
    assert opened.press("End") == 40
    assert opened.press("ArrowLeft") == 0
    assert opened.press("ArrowRight") == 40
    assert opened.press("Home") == 0
    assert opened("player.speed") == 10
    opened.press("+", "+", "-")
    assert opened("player.speed") == 20


def test_it_plays_to_the_end_and_stops(opened: Opened) -> None:
    opened.press(" ")
    opened.until("player.step === 40 && !player.playing")
    assert opened.page.get_by_role("button", name="play", exact=True).count() == 1
    opened.page.get_by_role("button", name="to the beginning").click()
    assert opened("player.step") == 0


def test_a_link_leads_to_a_moment(opened: Opened, browser: Any, recorded: Path) -> None:
    linked = Opened(browser, recorded.with_suffix(".html"), "#t=1.3")
    assert linked("player.step") == 13
    linked.page.evaluate("location.hash = '#t=2.5'")
    linked.until("player.step === 25")
    linked.press("n")
    linked.until("location.hash === '#t=2.6'")
    assert linked.problems == []
    linked.page.close()


def test_events_are_listed_and_lead_to_their_moment(
    browser: Any, recorded: Path, tmp_path: Path
) -> None:
    reader = EpisodeReader(recorded)
    tracker = EpisodeTracker(reader.header)
    for step, moment in enumerate(reader.moments()):
        room = "east" if 10 <= step < 30 else "west"
        tracker.add(replace(moment, room=room, updates=1 + step // 5))
    (tmp_path / "a.html").write_bytes(tracker.page("a"))
    opened = Opened(browser, tmp_path / "a.html")
    rooms = opened.page.locator(".events button", has_text="entered")
    assert rooms.all_inner_texts() == ["0:01.0\nentered east", "0:03.0\nentered west"]
    rooms.last.click()
    assert opened("player.step") == 30
    # Updates are many: they are on the line of time, and in the list on request.
    before = opened.page.locator(".events li").count()
    opened.page.get_by_label("map updates").check()
    assert opened.page.locator(".events li").count() > before
    opened.page.get_by_label("map updates").uncheck()
    for kind in ("contact", "places"):
        if opened.page.get_by_label(kind).count():
            opened.page.get_by_label(kind).uncheck()
    opened.press("Home")
    assert [opened.press("e"), opened.press("e"), opened.press("E")] == [10, 30, 10]
    opened.page.close()


def _inked(opened: Opened, number: int) -> int:
    """How many pixels of a panel are painted."""
    return opened(
        "(() => { const copy = document.createElement('canvas');"
        f"const from = player.panels[{number}].canvas;"
        "[copy.width, copy.height] = [from.width, from.height];"
        "const context = copy.getContext('2d', { willReadFrequently: true });"
        "context.drawImage(from, 0, 0);"
        "return context.getImageData(0, 0, copy.width, copy.height).data"
        ".reduce((sum, value, k) => sum + (k % 4 === 3 && value > 0), 0); })()"
    )


def test_layers_can_be_hidden(opened: Opened) -> None:
    opened.press("End")
    before = _inked(opened, 0)
    opened.page.locator(".panel").first.get_by_label("walls").uncheck()
    without = _inked(opened, 0)
    assert 0 < without < 0.8 * before
    opened.page.locator(".panel").first.get_by_label("walls").check()
    assert _inked(opened, 0) == before


def test_what_is_under_the_pointer_is_told(opened: Opened) -> None:
    opened.press("End")
    place = opened(
        "(() => { const { canvas, camera } = player.panels[0];"
        "const box = canvas.getBoundingClientRect();"
        "return [box.left + box.width / 2 + (5000 - camera.x) * camera.scale,"
        "box.top + box.height / 2 - (700 - camera.y) * camera.scale]; })()"
    )
    opened.page.mouse.move(*place)  # On the wall between the rooms.
    note = opened.page.locator(".note").first
    assert note.inner_text().splitlines()[0] == "wall, 1.50 m"
    x, y = note.inner_text().splitlines()[1].removesuffix(" m").split(", ")
    assert (float(x), float(y)) == pytest.approx((5.0, 0.7), abs=0.05)


def test_the_wheel_zooms_about_the_pointer_and_all_can_be_shown_again(opened: Opened) -> None:
    box = opened.page.locator(".panel canvas").first.bounding_box()
    opened.page.mouse.move(box["x"] + 50, box["y"] + 50)
    fitted = opened("[player.camera.x, player.camera.y, player.camera.scale]")
    point = "[player.camera.x + (50 - {w} / 2) / player.camera.scale, player.camera.scale]"
    x, scale = opened(point.format(w=box["width"]))
    opened.page.mouse.wheel(0, -300)
    opened.until(f"player.camera.scale > {scale} * 1.5")
    assert opened(point.format(w=box["width"]))[0] == pytest.approx(x, abs=20)
    opened.press("0")
    assert opened("[player.camera.x, player.camera.y, player.camera.scale]") == fitted


def test_light_dark_and_help(opened: Opened) -> None:
    first = opened("getComputedStyle(document.body).backgroundColor")
    opened.press("d")
    assert opened("getComputedStyle(document.body).backgroundColor") != first
    opened.press("?")
    assert opened.page.locator("#overlay").is_visible()
    opened.page.get_by_role("button", name="close").click()
    assert opened.page.locator("#overlay").is_hidden()


def test_screen_readers_are_told_names_values_and_events(opened: Opened) -> None:
    opened.press("n", "n")
    slider = opened.page.get_by_role("slider", name="step of the episode")
    assert slider.get_attribute("aria-valuetext") == "step 2, 0:00.2"
    unnamed = opened(
        "[...document.querySelectorAll('button, select, input, canvas')].filter((each) =>"
        "!(each.textContent || each.getAttribute('aria-label') || each.ariaHidden || "
        "each.closest('label'))).length"
    )
    assert unnamed == 0
    opened.until("document.getElementById('live').textContent.startsWith('0:00.2')")


def test_curves_seek_by_a_click(opened: Opened) -> None:
    over = opened.page.locator(".u-over").first
    box = over.bounding_box()
    over.click(position={"x": box["width"] / 2, "y": box["height"] / 2})
    assert opened("player.step") == pytest.approx(20, abs=1)


def test_hostile_names_are_text(browser: Any, recorded: Path, tmp_path: Path) -> None:
    reader = EpisodeReader(recorded)
    hostile = "<img src=x onerror='window.hit=1'></script><script>window.hit=1</script>"
    tracker = EpisodeTracker(replace(reader.header, world=hostile, agent=hostile, mapper=hostile))
    for moment in reader.moments():
        tracker.add(replace(moment, room=hostile))
    (tmp_path / "hostile.html").write_bytes(tracker.page(hostile))
    opened = Opened(browser, tmp_path / "hostile.html")
    assert opened.problems == []
    assert opened("window.hit") is None
    assert hostile in opened.page.locator("#heading").inner_text()
    opened.page.close()


def test_the_list_follows_the_episode(browser: Any, recorded: Path, tmp_path: Path) -> None:
    reader = EpisodeReader(recorded)
    tracker = EpisodeTracker(reader.header)
    for step, moment in enumerate(reader.moments()):
        tracker.add(replace(moment, room=f"room {step}"))
    (tmp_path / "a.html").write_bytes(tracker.page("a"))
    opened = Opened(browser, tmp_path / "a.html")
    for key in ("End", "ArrowLeft"):
        opened.press(key)
        opened("player.seek(player.step || 1)")  # Before the first event none is current.
        inside = opened(
            "(() => { const place = (name) => document.querySelector(name).getBoundingClientRect();"
            "const [list, item] = [place('.events'), place('.events [aria-current]')];"
            "return [item.top - list.top, list.bottom - item.bottom]; })()"
        )
        assert min(inside) > -1
    opened.page.close()


def test_curves_leave_out_what_is_no_number(browser: Any, recorded: Path, tmp_path: Path) -> None:
    reader = EpisodeReader(recorded)
    tracker = EpisodeTracker(reader.header)
    for step, moment in enumerate(reader.moments()):
        odd = {3: np.nan, 7: 1e300}.get(step, float(step))
        facts = {**moment.facts, "odd": odd, "rare": step if step % 3 == 0 else None}
        tracker.add(replace(moment, facts=facts))
    (tmp_path / "a.html").write_bytes(tracker.page("a"))
    opened = Opened(browser, tmp_path / "a.html")
    odd = opened("player.episode.curves.find(({ name }) => name === 'odd').values")
    assert [odd[k] for k in (2, 3, 6, 7)] == [2, None, 6, None]
    opened.page.get_by_role("combobox").select_option(label="odd")
    assert opened("player.charts[player.charts.length - 1].plot.scales.y.max") == pytest.approx(
        40, rel=0.2
    )
    assert opened.problems == []
    opened.page.close()


def test_the_slider_leaves_the_browser_its_keys(opened: Opened) -> None:
    opened.page.get_by_role("slider").focus()
    assert opened.press("ArrowRight") == 40
    prevented = (
        "['F5', 'ArrowUp', 'r'].map((key) => !document.querySelector('.timeline input')"
        ".dispatchEvent(new KeyboardEvent('keydown', { key, ctrlKey: key === 'r', "
        "bubbles: true, cancelable: true })))"
    )
    assert opened(prevented) == [False, False, False]


def test_keys_zoom_and_pan_and_work_the_legends_of_curves(opened: Opened) -> None:
    scale, x = opened("[player.camera.scale, player.camera.x]")
    opened.press("]")
    assert opened("player.camera.scale") == pytest.approx(1.3 * scale)
    opened.press("[", "Shift+ArrowRight")
    assert opened("player.camera.x") == pytest.approx(x + 60 / scale)
    label = opened.page.locator(".u-series th[role=button]").first
    label.focus()
    opened.press("Enter")
    assert opened("player.charts[0].plot.series[1].show") is False


def test_two_fingers_zoom_about_each_other(opened: Opened) -> None:
    scale = opened("player.camera.scale")
    opened(
        "(() => { const canvas = player.panels[0].canvas; canvas.setPointerCapture = () => 0;"
        "const box = canvas.getBoundingClientRect();"
        "const send = (type, pointerId, x) => canvas.dispatchEvent(new PointerEvent(type, {"
        "pointerId, clientX: box.left + x, clientY: box.top + 50, buttons: 1 }));"
        "send('pointerdown', 1, 50); send('pointerdown', 2, 150); send('pointermove', 1, 0); })()"
    )
    assert opened("player.camera.scale") == pytest.approx(1.5 * scale)


def _grid(value: float) -> MapSnapshot:
    occupancy = np.full((4, 6), np.nan, np.float32)
    occupancy[1, 2:5] = value
    layer = OccupancyGridLayer(origin=np.array((-1.0, -1, 0)), resolution=0.5, occupancy=occupancy)
    return MapSnapshot(layers=(layer, TrajectoryLayer(poses=np.zeros((3, 3)))))


def test_mappers_are_compared_over_one_line_of_time(browser: Any, tmp_path: Path) -> None:
    readings = [Reading(stamp=0.5 * k, motion=np.zeros(3)) for k in range(6)]
    tracks = []
    for number, name in enumerate(("one", "two")):
        writer = TrackWriter(name, np.zeros(3))
        for k, reading in enumerate(readings):
            pose = np.array((0.2 * k, number, 0.0))
            writer.add(reading.stamp, pose, -pose, _grid(k / 5) if k % 2 == 0 else None)
        tracks.append(writer.track())
    assert [len(track.arrays["map_steps"]) for track in tracks] == [3, 3]
    errors = {"one": np.linspace(0, 1, 6), "two": np.full(6, np.nan)}
    page = comparison_page("a", {"drive": "b"}, readings=readings, tracks=tracks, errors=errors)
    (tmp_path / "a.html").write_bytes(page)
    opened = Opened(browser, tmp_path / "a.html")
    assert opened.page.locator(".panel h2").all_inner_texts() == [
        "what the robot believes (one)",
        "what the robot believes (two)",
    ]
    for step in (5, 0, 3, 2):
        opened(f"player.seek({step})")
        cells = opened("Object.values(player.panels[1].track.channels[0].table.now.cells)")
        assert cells[6 + 2] == round(254 * (step // 2 * 2) / 5)
        assert cells[0] == 255
    assert opened.problems == []
    opened.page.close()


def test_data_of_another_format_is_told(browser: Any, tmp_path: Path) -> None:
    page = document("a", {}, {}).replace(b"const FORMAT = 1;", b"const FORMAT = 2;")
    (tmp_path / "a.html").write_bytes(page)
    tab = browser.new_page()
    tab.goto((tmp_path / "a.html").as_uri())
    tab.get_by_role("alert").get_by_text("data of format 1").wait_for()
    tab.close()


def test_the_last_map_is_kept_whatever_the_interval() -> None:
    writer = TrackWriter("one", np.zeros(3), map_interval=1.0)
    for k in range(4):
        writer.add(0.3 * k, np.zeros(3), np.zeros(3), _grid(k / 3))
    arrays = writer.track().arrays
    assert arrays["map_steps"].tolist() == [0, 3]
    assert arrays["0.values"].max() == 254


def test_a_page_without_a_map_goes_on(browser: Any, tmp_path: Path) -> None:
    readings = [Reading(stamp=0.5 * k, motion=np.zeros(3)) for k in range(3)]
    page = comparison_page("a", {"drive": "b"}, readings=readings, tracks=[], errors={})
    (tmp_path / "a.html").write_bytes(page)
    opened = Opened(browser, tmp_path / "a.html")
    opened.press("f", "End")
    assert opened.page.locator("#clock").inner_text() == "0:01.0 / 0:01.0"
    assert opened.problems == []
    opened.page.close()

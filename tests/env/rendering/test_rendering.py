"""The frame, its layout, and the four ways to draw it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pygame
import pytest
from gymnasium.wrappers import HumanRendering
from hypothesis import given, settings
from hypothesis import strategies as st
from matplotlib.patches import Circle
from PIL import Image
from rich.console import Console

from albot_core.drawing.figure import save_figure
from albot_core.drawing.palette import LIGHT, rgb
from albot_core.errors import InputError
from albot_core.maps.layers import (
    EMPTY_MAP,
    MapSnapshot,
    PlaceEdge,
    PlaceGraph,
    PlaceNode,
    SegmentsLayer,
)
from albot_env.rendering import canvas
from albot_env.rendering.canvas import (
    ACCENT,
    BACKGROUND,
    LINE_HEIGHT,
    MARGIN,
    PALETTE,
    PANEL,
    legend_places,
    paint,
    paint_array,
)
from albot_env.rendering.frame import Frame
from albot_env.rendering.layers import layer_shapes, layer_summary
from albot_env.rendering.picture import episode_figure
from albot_env.rendering.scene import Scene, lay_out
from albot_env.rendering.terminal import BrailleCanvas, TerminalView, draw_text
from albot_env.rendering.viewer import Footer, NullViewer, Viewer
from albot_env.rendering.window import Window
from tests.env.conftest import MakeEnv


@pytest.fixture
def frame() -> Frame:
    """See `made_frame`."""
    return made_frame()


def made_frame() -> Frame:
    """A square room of 10 m; the robot has gone 4 m east from its south-west, facing north.

    Its map frame is turned by a quarter against the world's. The map is perfect.
    """
    walls = np.array(((0, 0, 10, 0), (10, 0, 10, 10), (10, 10, 0, 10), (0, 10, 0, 0)), float)
    surfaces = np.array(((-2.0, 2.0, -2.0, -8.0), (8.0, -8.0, 8.0, 2.0)))
    return Frame(
        environment="Albot/Homing-v0",
        agent="homing",
        world="room",
        mapper="albot1",
        robot_radius=0.25,
        steps=832,
        time=83.25,
        path_length=4.0,
        updates=7,
        walls=walls,
        dynamic_obstacles=np.empty((0, 4)),
        start=np.array((2.0, 2.0, np.pi / 2)),
        pose=np.array((6.0, 2.0, np.pi / 2)),
        path=np.linspace((2.0, 2.0), (6.0, 2.0), 11),
        hits=np.array(((8.0, 0.0), (0.0, 6.0))),
        snapshot=MapSnapshot(layers=(SegmentsLayer(segments=surfaces),)),
        belief=np.array((0.0, -4.0, 0.0)),
        believed_path=np.linspace((0.0, 0.0), (0.0, -4.0), 11),
        home=np.array((0.0, 4.0, 0.0)),
    )


def test_a_perfect_map_lies_on_the_truth(frame: Frame) -> None:
    scene = lay_out(frame)
    truth = {shape.style: shape.data for shape in scene.truth.shapes}
    mapped = {shape.style: shape.data for shape in scene.map.shapes}
    assert mapped["robot"] == pytest.approx(truth["robot"])
    assert mapped["home"] == pytest.approx(truth["home"])
    assert mapped["believed"] == pytest.approx(truth["path"])
    assert mapped["surface"][0] == pytest.approx((0, 0, 10, 0))
    assert truth["laser"] == pytest.approx(np.array(((6, 10), (0, 2))))
    assert scene.bounds == pytest.approx((-0.8, -0.8, 10.8, 10.8))
    assert frame.position_error == pytest.approx(0, abs=1e-12)


def test_the_error_is_the_distance_from_the_truth(frame: Frame) -> None:
    believed = replace(frame, belief=np.array((0.3, -3.6, 1.0)))
    assert believed.position_error == pytest.approx(0.5)
    assert believed.figures == "1:23.2 · 4.0 m driven · 7 updates · 2 surfaces · 0.50 m off"


@given(st.lists(st.floats(-50, 50), min_size=6, max_size=6))
@settings(deadline=None)
def test_the_error_does_not_depend_on_where_the_map_lies(numbers: list[float]) -> None:
    start, belief = np.array(numbers[:3]), np.array(numbers[3:])
    origin = np.zeros(3)
    truth = np.array((1.0, 2.0, 0.5))
    cos, sin = np.cos(start[2]), np.sin(start[2])
    moved = np.array((
        start[0] + cos * truth[0] - sin * truth[1],
        start[1] + sin * truth[0] + cos * truth[1],
        start[2] + truth[2],
    ))  # fmt: skip
    here = replace(made_frame(), start=origin, pose=truth, belief=belief)
    there = replace(here, start=start, pose=moved)
    assert there.position_error == pytest.approx(here.position_error, abs=1e-9)


def test_the_canvas_shows_each_thing_in_its_colour(frame: Frame) -> None:
    image = paint_array(lay_out(frame), (1000, 520))
    assert image.shape == (520, 1000, 3)
    left, right = image[:, :500].reshape(-1, 3), image[:, 500:].reshape(-1, 3)
    colours = {style: np.array(colour) for style, colour in PALETTE.items()}
    for style in ("wall", "laser", "home", "robot"):
        assert (left == colours[style]).all(axis=1).any(), style
    for style in ("surface", "home", "robot"):
        assert (right == colours[style]).all(axis=1).any(), style
    assert (left == colours["path"]).all(axis=1).any()
    assert not (right == colours["path"]).all(axis=1).any()
    assert tuple(image[0, 0]) == BACKGROUND
    assert (left == np.array(PANEL)).all(axis=1).mean() > 0.5


@pytest.fixture
def mapped(frame: Frame) -> Frame:
    """The same, its map with two places that an exit in the middle of the room joins."""
    middle = np.array((3.0, -3.0))  # (5, 5) in the world: the map is turned by a quarter.
    nodes = tuple(
        PlaceNode(id=k, label=f"P{k + 1}", pose=np.zeros(3), middle=middle) for k in range(2)
    )
    doorway = np.tile(middle, 2) + np.array((-1.0, 0.0, 1.0, 0.0))
    edges = tuple(
        PlaceEdge(source=k, target=1 - k, motion=np.zeros(3), doorway=line)
        for k, line in enumerate((doorway, doorway[[2, 3, 0, 1]]))
    )
    layers = (*frame.snapshot.layers, PlaceGraph(nodes=nodes, edges=edges))
    return replace(frame, snapshot=MapSnapshot(layers=layers))


def test_places_that_share_an_exit_lie_on_its_two_sides(mapped: Frame) -> None:
    shapes = {shape.style: shape for shape in lay_out(mapped).map.shapes}
    assert shapes["doorway"].data[0] == pytest.approx((5, 4, 5, 6))
    assert shapes["place"].names == ("P1", "P2")
    # The source is to the left of who goes along the line: north here, so in the west.
    assert shapes["place"].data == pytest.approx(np.array(((4.2, 5.0), (5.8, 5.0))))
    assert shapes["link"].data[0] == pytest.approx((4.2, 5.0, 5.8, 5.0))


@pytest.mark.parametrize(("count", "message"), [(1, "1 place"), (2, "2 places")])
def test_the_status_line_counts_places(count: int, message: str) -> None:
    node = PlaceNode(id=0, label="P1", pose=np.zeros(3), middle=np.zeros(2))
    assert layer_summary(PlaceGraph(nodes=(node,) * count)) == message


@pytest.mark.parametrize(("spacing", "kind"), [(0.5, "dots"), (1.5, "marks")])
def test_many_places_close_together_have_no_labels(spacing: float, kind: str) -> None:
    nodes = tuple(
        PlaceNode(id=k, label=f"P{k}", pose=np.zeros(3), middle=np.array((spacing * k, 0.0)))
        for k in range(11)
    )
    (places,) = layer_shapes(PlaceGraph(nodes=nodes), np.zeros(3))
    assert (places.kind, len(places.data)) == (kind, 11)
    assert bool(places.names) == (kind == "marks")


def test_places_exits_and_links_are_seen_where_they_are(mapped: Frame) -> None:
    scene = lay_out(mapped)
    half = paint_array(scene, (1000, 520))[:, 500:]
    # The legend below the drawing has the same colours.
    drawing = half[: _legend_top(scene, 520, panel=1)]
    seen = {style: _where(drawing, style) for style in ("surface", "place", "doorway", "link")}
    walls = seen["surface"].max(axis=0) - seen["surface"].min(axis=0)
    metre = walls.max() / 10  # The longest walls of the room are 10 m long.
    centre = (seen["surface"].max(axis=0) + seen["surface"].min(axis=0)) / 2
    assert seen["doorway"].mean(axis=0) == pytest.approx(centre, abs=0.3 * metre)
    assert np.ptp(seen["doorway"], axis=0)[0] == pytest.approx(2 * metre, rel=0.1)
    for side in (-0.8, 0.8):
        away = np.hypot(*(seen["place"] - centre - (0, side * metre)).T)
        assert (away < 4).sum() > 40
    assert len(seen["link"]) > 0


@pytest.mark.parametrize("size", [(1200, 640), (700, 420)])
def test_the_legend_shows_everything_that_is_drawn(mapped: Frame, size: tuple[int, int]) -> None:
    scene = lay_out(mapped)
    image = paint_array(scene, size)
    for k, panel in enumerate(scene.panels):
        half = image[:, k * size[0] // 2 : (k + 1) * size[0] // 2]
        legend = half[_legend_top(scene, size[1], panel=k, width=size[0]) :]
        for shape in panel.shapes:
            swatch = _where(legend, shape.style)
            assert len(swatch) >= 20, shape.label
            if shape.kind in ("segments", "line"):  # Drawn as a line, not as a blot.
                assert np.ptp(swatch[:, 0]) < 4, shape.label
            elif shape.kind not in ("grid", "cells"):
                assert np.ptp(swatch[:, 0]) > 4, shape.label
    assert [shape.label for shape in scene.map.shapes] == [
        "surfaces", "links", "exits", "places", "path", "home", "robot",
    ]  # fmt: skip


def _legend_top(scene: Scene, height: int, *, panel: int, width: int = 1000) -> int:
    """The first row of a panel's legend in a picture without a footer."""
    bottom = height - MARGIN - LINE_HEIGHT * len(scene.captions) - MARGIN // 2
    area = pygame.Rect(0, 0, (width - 3 * MARGIN) // 2, bottom)
    return legend_places(scene.panels[panel], area)[0][1].top


def _where(image: np.ndarray, style: str) -> np.ndarray:
    """Row and column of each pixel in the colour of a style."""
    return np.argwhere((image == np.array(PALETTE[style])).all(axis=-1))


def test_a_footer_is_below_the_picture(frame: Frame) -> None:
    footers = [Footer(status="playing", keys="q close", share=share) for share in (0.25, 0.75)]
    bars = []
    for footer in footers:
        canvas = pygame.Surface((800, 480), depth=32)
        paint(lay_out(frame), canvas, footer)
        image = pygame.surfarray.array3d(canvas).swapaxes(0, 1)
        rows = (image == np.array(ACCENT)).all(axis=-1).sum(axis=1)
        bars.append(rows.max())
    assert bars == pytest.approx([0.25 * 776, 0.75 * 776], abs=2)


def test_a_robot_that_is_led_has_stops_and_no_path(frame: Frame, tmp_path: Path) -> None:
    stops = np.array(((2.0, 8.0), (8.0, 8.0), (8.0, 2.0), (8.0, 2.0)))
    led = replace(frame, path=stops, believed_path=stops, steps=3, answer=2, terms={"missed": -1.0})
    shape = next(shape for shape in lay_out(led).truth.shapes if shape.style == "path")
    # Home is the first; the last answer leads nowhere else.
    assert (shape.kind, shape.label, shape.names) == ("marks", "stops", ("2", "3", "4"))
    assert led.rewards == "stop 4: as stop 2 · reward -1.00 · missed -1.00"
    assert replace(led, answer=0).rewards.startswith("stop 4: new · ")
    assert not frame.is_led
    save_figure(episode_figure(led), tmp_path / "a.png")
    assert "● stops" in draw_text(led, 80, 23).plain


def test_the_frame_says_who_does_what_where_and_what_it_brought(frame: Frame) -> None:
    paid = replace(frame, terms={"success": 10.0, "time": -0.404, "collision": 0.0})
    assert paid.heading == "Albot/Homing-v0 · agent homing · world room · mapper albot1"
    assert paid.rewards == "reward 9.60 · success 10.00 · time -0.40"
    assert replace(frame, agent="").heading == "Albot/Homing-v0 · world room · mapper albot1"


def test_painting_needs_no_display(frame: Frame, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "SDL_VIDEODRIVER"):
        monkeypatch.delenv(name, raising=False)
    first = paint_array(lay_out(frame))
    assert np.array_equal(first, paint_array(lay_out(frame)))


def test_the_picture_is_whole_and_the_same_again(frame: Frame, tmp_path: Path) -> None:
    save_figure(episode_figure(frame), tmp_path / "a.png")
    save_figure(episode_figure(frame), tmp_path / "b.png")
    assert (tmp_path / "b.png").read_bytes() == (tmp_path / "a.png").read_bytes()
    with Image.open(tmp_path / "b.png") as image:
        assert image.format == "PNG"
        assert image.width > 1200
        pixels = np.asarray(image.convert("RGB"))
    half = pixels.shape[1] // 2
    orange = (np.abs(pixels.astype(int) - rgb(LIGHT["believed"])) < 20).all(axis=2)
    blue = (np.abs(pixels.astype(int) - rgb(LIGHT["path"])) < 20).all(axis=2)
    assert orange[:, half:].sum() > 50
    assert blue[:, :half].sum() > 50
    assert blue[:, half:].sum() == 0
    assert list(tmp_path.iterdir()) != []


def test_the_picture_says_what_it_shows(frame: Frame) -> None:
    scene = lay_out(frame)
    title = "\n".join((scene.heading, *scene.captions))
    assert episode_figure(frame).get_suptitle() == title
    assert scene.captions


def test_a_picture_that_cannot_be_written_leaves_nothing(frame: Frame, tmp_path: Path) -> None:
    (tmp_path / "taken.png").mkdir()
    with pytest.raises(InputError, match=r"taken\.png: expected a file to write"):
        save_figure(episode_figure(frame), tmp_path / "taken.png")
    assert [path.name for path in tmp_path.iterdir()] == ["taken.png"]


def test_an_empty_map_can_be_drawn(frame: Frame, tmp_path: Path) -> None:
    empty = replace(
        frame,
        snapshot=EMPTY_MAP,
        hits=np.empty((0, 2)),
        path=frame.path[:1],
        believed_path=frame.believed_path[:1],
    )
    paint_array(lay_out(empty))
    save_figure(episode_figure(empty), tmp_path / "a.png")
    assert "room" in draw_text(empty, 60, 20).plain


@given(st.integers(0, 3), st.integers(0, 3), st.floats(0.01, 0.99), st.floats(0.01, 0.99))
@settings(deadline=None)
def test_a_dot_is_where_unicode_says(column: int, row: int, dx: float, dy: float) -> None:
    """Eight dots numbered 1-2-3-7 down the left and 4-5-6-8 down the right of a cell."""
    canvas = BrailleCanvas(2, 1, (0.0, 0.0, 4.0, 4.0))
    canvas.dots(np.array(((column + dx, 4 - row - dy),)), "white")
    number = ((1, 4), (2, 5), (3, 6), (7, 8))[row][column % 2]
    expected = [" ", " "]
    expected[column // 2] = chr(0x2800 + (1 << (number - 1)))
    assert canvas.line(0).plain == "".join(expected)


@pytest.mark.parametrize(("columns", "lines"), [(80, 24), (120, 50), (40, 10), (200, 30)])
def test_the_text_fits_the_terminal(frame: Frame, columns: int, lines: int) -> None:
    rows = draw_text(frame, columns, lines).plain.split("\n")
    assert len(rows) <= lines
    assert max(map(len, rows)) <= columns
    assert any("⌂" in row for row in rows)
    if lines >= 24:
        assert "⌂ home" in draw_text(frame, columns, lines).plain
        assert rows[0].startswith("Albot/Homing-v0 · agent homing")
    drawn = "".join(rows)
    assert sum(0x2800 < ord(c) < 0x2900 for c in drawn) > 20
    assert "↑" in drawn


def test_the_terminal_shows_frames_and_footer(frame: Frame) -> None:
    console = Console(width=90, height=30, force_terminal=True, record=True)
    view = TerminalView(console)
    assert isinstance(view, Viewer)
    assert view.show(frame, Footer(status="below", keys="q close", share=0.5))
    view.close()
    shown = console.export_text()
    assert "truth" in shown
    assert "below" in shown


def test_nobody_sees_the_null_viewer(frame: Frame) -> None:
    viewer = NullViewer()
    assert isinstance(viewer, Viewer)
    assert viewer.show(frame)
    viewer.close()


def test_the_window_opens_shows_and_is_closed(
    frame: Frame, monkeypatch: pytest.MonkeyPatch
) -> None:
    pygame = pytest.importorskip("pygame")
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    window = Window("test", rate=1000.0)
    assert window.show(frame)
    shown = pygame.surfarray.array3d(pygame.display.get_surface())
    assert len(np.unique(shown @ (1 << 16, 1 << 8, 1))) > 10
    pygame.event.post(pygame.event.Event(pygame.KEYDOWN, key=pygame.K_ESCAPE))
    assert not window.show(frame)
    assert not window.show(frame)
    window.close()


def test_pictures_and_windows_go_on_after_others_have_ended_pygame(
    frame: Frame, make_env: MakeEnv, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As gymnasium's `HumanRendering` does when it is closed."""
    for name in ("SDL_VIDEODRIVER", "SDL_AUDIODRIVER"):
        monkeypatch.setenv(name, "dummy")
    before = paint_array(lay_out(frame))
    window = Window("test", rate=1000.0)
    assert window.show(frame)
    watched = HumanRendering(make_env(render_mode="rgb_array"))
    for seed in (1, 2):
        watched.reset(seed=seed)
    watched.close()
    np.testing.assert_array_equal(paint_array(lay_out(frame)), before)
    assert window.show(frame)
    window.close()
    assert not window.show(frame)


def test_a_display_that_does_not_open_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SDL_VIDEODRIVER", "nonesuch")
    with pytest.raises(InputError, match="expected a display that opens"):
        Window("test")


@pytest.mark.parametrize("radius", [0.5, 1.0, 1.5])
def test_the_robot_is_drawn_with_its_radius(frame: Frame, radius: float) -> None:
    seen = replace(frame, robot_radius=radius, hits=np.empty((0, 2)), pose=np.array((5.0, 5.0, 0)))
    pixels = paint_array(lay_out(seen))
    half = pixels[:, : pixels.shape[1] // 2]
    walls = np.flatnonzero((half == canvas.PALETTE["wall"]).all(axis=2).sum(axis=1) > 200)
    rows = np.flatnonzero((half == canvas.PALETTE["robot"]).all(axis=2).any(axis=1))
    rows = rows[rows < walls[-1]]  # Below is the legend.
    share = (rows[-1] - rows[0]) / (walls[-1] - walls[0])
    assert share == pytest.approx(2 * radius / 10, abs=0.01)
    edges = [
        patch
        for axes in episode_figure(seen).axes
        for patch in axes.patches
        if isinstance(patch, Circle) and patch.center == (5.0, 5.0)
    ]
    assert [edge.radius for edge in edges] == [radius]

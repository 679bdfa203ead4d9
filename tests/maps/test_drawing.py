"""The floor plan shows what is there: floor, walls, what is shut off, and in scale."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.colors import to_hex
from matplotlib.figure import Figure

from albot_core.drawing.palette import CORRECTED, HOME, WALL, rgb
from albot_maps import World, load_world
from albot_maps.drawing import draw_world


@pytest.fixture(scope="module")
def colour_at():
    """The colour (0 to 255) of the drawn office-ring at a point of the world (m)."""
    figure = Figure(figsize=(9, 9))
    canvas = FigureCanvasAgg(figure)
    axes = figure.add_axes((0, 0, 1, 1))
    draw_world(load_world("office-ring"), axes)
    canvas.draw()
    pixels = np.asarray(canvas.buffer_rgba())[..., :3].astype(int)

    def look(x: float, y: float) -> np.ndarray:
        column, row = axes.transData.transform((x, y))
        return pixels[len(pixels) - 1 - int(row), int(column)]

    return look


def test_glass_is_light_blue():
    world = load_world("office-ring")
    axes = Figure().add_subplot()
    draw_world(replace(world, glass=np.arange(len(world.walls)) < 3), axes)
    drawn = {
        to_hex(lines.get_colors()[0]): len(lines.get_segments())
        for lines in axes.collections
        if isinstance(lines, LineCollection)
    }
    assert drawn[CORRECTED] == 3
    assert drawn[WALL] == len(world.walls) - 3


def test_walls_are_dark_floors_tinted_and_solids_grey(colour_at):
    assert colour_at(0, 9).sum() < 300
    assert np.ptp(colour_at(7, 11)) > 5
    assert (colour_at(7, 11) > 215).all()
    for inside_furniture_or_core in ((4.2, 7.0), (12, 15)):
        assert np.ptp(colour_at(*inside_furniture_or_core)) <= 5
        assert colour_at(*inside_furniture_or_core).mean() < 225


@pytest.mark.parametrize(("x", "y"), [(5, -0.9), (-0.9, 4), (10.9, 4), (5, 8.9), (5, 4)])
@pytest.mark.parametrize("size", [1, 60])
def test_every_start_is_in_the_picture(x, y, size):
    corners = size * np.array([[0, 0], [10, 0], [10, 8], [0, 8]], float)
    walls = np.concatenate((corners, np.roll(corners, -1, axis=0)), axis=1)
    inside = 0 < x < 10 and 0 < y < 8
    start = size * np.array([x, y]) if inside else np.clip((x, y), -0.9, corners[2] + 0.9)
    world = World(name="hall", walls=walls, starts=np.array([[*start, 0.0]]))
    figure = Figure(figsize=(6, 6), dpi=100)
    canvas = FigureCanvasAgg(figure)
    axes = figure.add_axes((0, 0, 1, 1))
    draw_world(world, axes)
    canvas.draw()
    pixels = np.asarray(canvas.buffer_rgba())[..., :3].astype(int)
    mark = np.abs(pixels - rgb(HOME)).max(axis=-1) < 20
    column, row = axes.transData.transform(start)
    assert 3 < column < 597
    assert 3 < row < 597
    assert np.count_nonzero(mark) > 12


def test_rooms_differ_and_the_start_is_marked(colour_at):
    assert not np.array_equal(colour_at(7, 11), colour_at(1.3, 20))
    assert tuple(colour_at(11.2, 6.6)) == rgb(HOME)

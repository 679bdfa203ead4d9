"""Labels lie on nothing: neither on each other, nor on marks, nor over walls if there is room."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.transforms import Bbox

from albot_core.drawing.labels import Label, place_labels


def new_axes() -> Axes:
    figure = Figure(figsize=(5, 5), dpi=100)
    axes = figure.add_axes((0, 0, 1, 1))
    axes.set(xlim=(0, 10), ylim=(0, 10))
    return axes


def boxes(axes: Axes) -> list[Bbox]:
    """The letters' boxes (pixels)."""
    return [text.get_window_extent() for text in axes.texts]


@given(
    places=st.lists(st.tuples(*2 * [st.floats(2, 8)]), min_size=1, max_size=12),
)
@settings(deadline=None, max_examples=25)
def test_labels_do_not_cover_each_other_or_any_mark(places: list[tuple[float, float]]) -> None:
    axes = new_axes()
    labels = [Label(text=f"P{k}", at=at, radius=3.0) for k, at in enumerate(places)]
    place_labels(axes, labels)
    assert [text.get_text() for text in axes.texts] == [label.text for label in labels]
    found = boxes(axes)
    for one, other in itertools.combinations(found, 2):
        assert not one.overlaps(other.padded(-1.0))
    for at, box in itertools.product(places, found):
        assert not box.contains(*axes.transData.transform(at))


def test_two_labels_of_one_place_stand_beside_each_other() -> None:
    axes = new_axes()
    place_labels(axes, [Label(text=name, at=(5.0, 5.0), radius=3.0) for name in ("P1", "P2")])
    one, other = boxes(axes)
    assert not one.overlaps(other)


def test_a_label_avoids_lines_and_the_edge() -> None:
    axes = new_axes()
    wall = np.array([[5.4, 0.0, 5.4, 10.0]])
    place_labels(axes, [Label(text="home", at=(5.2, 5.0)), Label(text="corner", at=(9.9, 9.9))],
                 segments=wall)  # fmt: skip
    home, corner = boxes(axes)
    assert home.x1 < axes.transData.transform((5.4, 5))[0]
    assert axes.bbox.x1 >= corner.x1
    assert axes.bbox.y1 >= corner.y1


def test_the_same_labels_get_the_same_places() -> None:
    found = []
    for _ in range(2):
        axes = new_axes()
        place_labels(axes, [Label(text=str(k), at=(5.0, 5 + 0.01 * k)) for k in range(9)])
        found.append([box.extents.tolist() for box in boxes(axes)])
    assert found[0] == found[1]


@pytest.mark.parametrize(
    ("outline", "turned", "lines"),
    [((0, 0, 9, 2), 0, 1), ((0, 0, 1, 9), 90, 1), ((0, 0, 2.6, 2.6), 0, 2)],
)
def test_the_name_of_a_room_lies_within_its_walls(
    outline: tuple[float, ...], turned: int, lines: int
) -> None:
    axes = new_axes()
    room = shapely.box(*outline)
    place_labels(axes, [Label(text="SHARED OFFICE", at=(0.0, 0.0), size=12.0, within=room)])
    (text,) = axes.texts
    assert text.get_rotation() == turned
    assert text.get_text().count("\n") == lines - 1
    corners = axes.transData.inverted().transform(boxes(axes)[0].corners())
    assert room.buffer(0.05).contains(shapely.MultiPoint(corners))


def test_a_name_that_does_not_fit_is_left_out() -> None:
    axes = new_axes()
    closet = shapely.box(0, 0, 0.2, 0.2)
    place_labels(axes, [Label(text="CLOSET", at=(0.1, 0.1), within=closet)])
    assert not axes.texts

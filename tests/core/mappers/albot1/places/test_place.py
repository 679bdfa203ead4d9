"""A place by itself: its frame and its box."""

from __future__ import annotations

import numpy as np

from albot_core.geometry.poses import inverse, transform_points
from albot_core.mappers.albot1.places.place import LearnedPlace


def test_a_place_surrounds_what_is_in_its_box_however_its_frame_lies():
    frame = np.array((3.0, -2.0, 0.7))
    surfaces = np.array(((-1.0, -2.0, 4.0, -2.0), (4.0, -2.0, 4.0, 1.5)))
    place = LearnedPlace(id=0, frame=frame, surfaces=surfaces)
    points = frame[:2] + np.random.default_rng(1).uniform(-7, 7, (500, 2))
    x, y = transform_points(inverse(frame), points).T
    inside = (x >= -1) & (x <= 4) & (y >= -2) & (y <= 1.5)
    assert [place.surrounds(*point) for point in points.tolist()] == inside.tolist()
    assert 30 < inside.sum() < 200
    place.surfaces = surfaces[:0]
    assert not place.surrounds(3.0, -2.0)

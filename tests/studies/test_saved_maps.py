"""The study of saved maps: what counts as right, and that broken methods are seen to be worse."""

from __future__ import annotations

import numpy as np
import pytest

from albot_core.geometry.poses import compose
from albot_core.localisation.config import LocaliserConfig
from albot_core.localisation.known_map import KnownMap
from albot_studies.saved_maps import (
    Outcome,
    SavedMap,
    counts,
    follow,
    measure_world,
    rows_table,
)
from tests.core.localisation.buildings import BUILDING, TOUR, led, readings, snapshot

WORLD = "random:office:613?rooms=4"


class Believer:
    """A method that believes these poses, one after another."""

    def __init__(self, *believed: np.ndarray | None) -> None:
        self._left = list(believed)
        self.believed: np.ndarray | None = None

    def update(self, scan: object, motion: object) -> None:
        self.believed = self._left.pop(0)


def test_what_is_right_and_what_is_wrong():
    reading, pose = readings(TOUR)[0]
    drive = [(reading, pose, float(way)) for way in range(3)]
    near, far = pose + np.array((0.4, 0.0, 2.0)), pose + np.array((0.0, 0.6, 0.0))

    def became(*believed):
        return tuple(follow(Believer(*believed), drive, lambda true: true).values())

    assert became(None, None, None) == (False, False, False, None)
    assert became(None, near, near) == (True, False, False, 1.0)
    assert became(far, None, near) == (True, False, True, 0.0)
    assert became(None, None, far) == (False, True, True, 2.0)


def test_a_map_that_lies_aside_is_no_error_of_localisation():
    true = np.array(list(led(TOUR)))
    aside = np.array((3.0, -1.0, 0.4))
    known = KnownMap(snapshot(BUILDING, TOUR), LocaliserConfig())
    saved = SavedMap(known=known, true=true, believed=compose(aside, true))
    pose = np.array((6.0, 5.3, 1.0))
    assert saved.place_of(pose) == pytest.approx(compose(aside, pose))


def test_robots_in_a_small_office_are_right_and_baselines_are_worse():
    methods = ("hypotheses", "hasty", "first match", "particles", "elsewhere")
    other = SavedMap(
        known=KnownMap(snapshot(BUILDING, TOUR), LocaliserConfig()),
        true=np.zeros((1, 3)),
        believed=np.zeros((1, 3)),
    )
    outcomes, _ = measure_world(WORLD, 613, 2, ["scan-matching"], methods, other)
    rows = {row["method"]: row for row in counts(outcomes)}
    assert set(rows) == set(methods)
    assert rows["hypotheses"]["right"] == 2 and rows["hypotheses"]["ever_wrong"] == 0
    assert rows["elsewhere"]["right"] == 0 and rows["elsewhere"]["ever_wrong"] == 0
    assert rows["first match"]["median_after_m"] == 0.0 < rows["hypotheses"]["median_after_m"]


def test_rows_count_outcomes():
    one = {"world": "w", "mapper": "m", "method": "hypotheses", "after": 3.0}
    outcomes = [
        Outcome(**one, right=True, wrong=False, ever_wrong=False),
        Outcome(**one, right=False, wrong=True, ever_wrong=True),
    ]
    (row,) = counts(outcomes)
    assert (row["starts"], row["right"], row["wrong"], row["ever_wrong"]) == (2, 1, 1, 1)
    assert "50.0%" in rows_table([row])

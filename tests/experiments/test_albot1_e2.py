"""Experiment 2: angles and distances as geometry says, and home is known."""

from __future__ import annotations

import numpy as np
import pytest

from albot_experiments import albot1_e2 as e2


def pointing(home: list[float], believed: list[float]) -> e2.Pointing:
    return e2.Pointing(
        stop=e2.STOPS[0], truth=np.zeros(3), home=np.array(home), believed=np.array(believed)
    )


def test_errors_in_closed_form():
    aside = pointing([0.0, 10.0, 0.0], [-10.0, 0.0, 0.0])
    assert aside.angle_error == pytest.approx(np.pi / 2)
    assert aside.distance_error == pytest.approx(0.0)
    far = pointing([3.0, 4.0, 0.0], [6.0, 8.0, 1.0])
    assert far.angle_error == pytest.approx(0.0)
    assert far.distance_error == pytest.approx(5.0)
    # Across the cut at half a turn.
    assert pointing([-1.0, 0.01, 0.0], [-1.0, -0.01, 0.0]).angle_error < 0.03


def test_the_papers_figures_are_those_of_its_table():
    assert e2.PAPER["angle_error_deg"] == {"median": 5.7, "worst": 6.5}
    assert e2.PAPER["distance_error_m"]["worst"] == 3.2


def test_home_is_known_from_every_stop():
    report = e2.run(range(1))
    assert report.holds
    assert report.measured["angle_error_deg"]["worst"] < 7.0
    assert 12 < report.measured["albot1"]["home_m"] < 30
    ours, odometer = (report.measured[name] for name in ("albot1", "odometry"))
    assert ours["distance_error_m"]["worst"] < odometer["distance_error_m"]["worst"]

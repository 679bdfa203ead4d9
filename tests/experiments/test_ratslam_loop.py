"""RatSLAM's loop: the measures in closed form, and a short run."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from albot_core.mappers.ratslam.config import RatSlamConfig
from albot_core.sensing.reading import Reading
from albot_experiments import ratslam_loop
from albot_experiments.ratslam_runs import Run, follow


def straight(count: int = 200) -> Run:
    """A robot that sees a new scene every metre of a straight way."""
    truth = np.column_stack((0.1 * np.arange(count), np.zeros((count, 2))))
    step = np.array((0.1, 0.0, 0.0))
    readings = [Reading(stamp=0.1 * k, motion=step, scene=k // 10) for k in range(count)]
    return follow(readings, truth, RatSlamConfig.scenes())


def test_measures_of_a_straight_way():
    run = straight()
    assert run.error == pytest.approx(0.0, abs=1e-9)
    assert run.path_error == pytest.approx(0.0, abs=1e-9)
    assert run.counts[-1] == run.growth(199) + 1 > 18
    assert run.longest_elsewhere == 0
    assert run.relocalisations == 0
    assert run.represented == (0, 0)
    assert (run.grown, run.weakened) == (0, 0)  # No view is seen twice.


def test_a_robot_taken_for_elsewhere_is_seen_to_be():
    run = straight()
    run.truth[144:148] += (0.0, 5.0, 0.0)  # Within one experience, which was made before.
    run.truth[165] += (0.0, 5.0, 0.0)
    np.testing.assert_array_equal(np.flatnonzero(run.is_elsewhere), (144, 145, 146, 147, 165))
    assert run.longest_elsewhere == 4


def test_a_loop_with_a_whole_turn_too_much_a_lap_is_mapped(monkeypatch):
    monkeypatch.setattr(ratslam_loop, "MINUTES", 6)
    corrected, uncorrected = ratslam_loop.loop("bias-6", 0)
    assert corrected.error < 0.5
    assert uncorrected.error > 5 * corrected.error
    assert corrected.relocalisations >= 1
    assert corrected.grown > 0
    assert corrected.weakened == 0
    settled = dataclasses.replace(corrected, counts=np.full_like(corrected.counts, 30))
    assert ratslam_loop.is_consistent(settled, uncorrected)
    for fault in ({"weakened": 1}, {"grown": 0}):
        assert not ratslam_loop.is_consistent(dataclasses.replace(settled, **fault), uncorrected)
    figure = ratslam_loop._picture(dict.fromkeys(ratslam_loop.BIASES, (corrected, uncorrected)))
    assert len(figure.axes) == 9

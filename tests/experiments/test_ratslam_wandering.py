"""Robots that wander over the paper's floors: where they go, what counts as a revisit."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from albot_core.sensing.reading import Reading
from albot_experiments import ratslam_floor, ratslam_office
from albot_experiments.ratslam_runs import CORRECTED, Run, follow
from albot_experiments.ratslam_wandering import wandering
from albot_maps import load_world


def there_and_back() -> Run:
    """A robot that goes 20 m on, turns, and comes back."""
    on = np.column_stack((0.1 * np.arange(200) + 0.05, np.full(200, 0.25), np.zeros(200)))
    turn = np.column_stack((np.full((9, 2), on[-1, :2]), np.linspace(0, np.pi, 10)[1:]))
    back = on[::-1] + np.array((0.0, 0.0, np.pi))
    truth = np.concatenate((on, turn, back[1:]))
    readings = []
    for k, pose in enumerate(truth):
        step = pose - truth[max(k - 1, 0)]
        motion = np.array((np.hypot(*step[:2]), 0.0, step[2]))
        scene = 2 * int(pose[0]) + (pose[2] > np.pi / 2)
        readings.append(Reading(stamp=0.1 * k, motion=motion, scene=int(scene)))
    return follow(readings, truth, CORRECTED)


def test_squares_that_were_left_for_long_are_revisited():
    run = there_and_back()
    # Of the 40 squares of the way those 10 s away and more: 5 m on and 5 m back, less the turn.
    assert len(run.revisits) == 40 - 10
    assert run.revisits.max() < 0.2
    assert run.revisits_within_a_metre == 1.0


def test_a_map_that_lays_the_way_back_elsewhere_is_seen():
    run = there_and_back()
    poses = run.mapper.experiences.poses
    back = np.abs(poses[:, 2]) > np.pi / 2
    poses[back, 1] += 3.0
    assert run.revisits_within_a_metre < 0.5


def test_the_verdict_goes_by_seeds_not_by_medians():
    """Of 20 seeds 17 must keep within every bound; good and bad bounds may fall on others."""
    good, wide = there_and_back(), there_and_back()
    poses = wide.mapper.experiences.poses
    poses[np.abs(poses[:, 2]) > np.pi / 2, 1] += 3.0
    enough = [good] * 17 + [wide] * 3
    short = [good] * 16 + [wide] * 4
    for runs, holds in ((enough, True), (short, False)):
        report = ratslam_office.report(range(20), runs)
        assert report.holds == report.measured["multiple_overlap"] == holds
        assert report.measured["within_a_metre"] == 1.0
        assert report.measured["seeds_within_every_bound"] == runs.count(good)
        assert ratslam_floor.report(range(20), runs).holds == holds


@pytest.mark.parametrize(("world", "tour"), [("office-floor", "floor"), ("open-plan", "routes")])
def test_a_robot_wanders_on_after_the_tour(world: str, tour: str):
    floor = load_world(world)
    stops = floor.tours[tour]
    long = np.hypot(*np.diff(stops, axis=0).T).sum() + 50
    way = wandering(floor, tour, long, np.random.default_rng(0))
    np.testing.assert_array_equal(way[: len(stops)], stops)
    assert long <= np.hypot(*np.diff(way, axis=0).T).sum() < long + 60
    other = wandering(floor, tour, long, np.random.default_rng(1))
    assert not np.array_equal(way[-1], other[-1])


@pytest.mark.parametrize("module", [ratslam_floor, ratslam_office])
def test_a_short_run_makes_a_report(module, monkeypatch: pytest.MonkeyPatch):
    name = "FLOOR" if module is ratslam_floor else "OFFICE"
    monkeypatch.setattr(module, name, dataclasses.replace(getattr(module, name), minutes=1))
    report = module.run(range(0, 1))
    assert report.id == module.ID
    assert set(report.paper) <= set(report.measured)
    assert report.measured["seeds"] == 1
    assert len(report.pictures["maps"].axes) == 2
    assert report.measured["error_m"]["worst"] < 2.0

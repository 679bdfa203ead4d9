"""Experiment 3: its odometers are what it says, and it repeats itself."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from albot_cli.group import albot
from albot_core.errors import InputError
from albot_core.geometry.poses import compose
from albot_experiments import albot1_e3 as e3
from albot_experiments.tours import TourRecord, guided_tour
from albot_maps import load_world


def guided(floor: e3.Floor, seed: int) -> TourRecord:
    world = load_world(floor.world)
    rng = np.random.default_rng(seed)
    return guided_tour(world, world.tours[floor.tour], rng, steps=floor.steps, laser=floor.laser)


OFFICE = e3.FLOORS["office"].world


@pytest.fixture(scope="module")
def journey() -> TourRecord:
    return guided(e3.FLOORS["office"], 3)


@pytest.mark.parametrize("floor", e3.FLOORS)
def test_the_journeys_are_the_theses(floor: str) -> None:
    journey = guided(e3.FLOORS[floor], 3)
    assert len(journey.readings) == e3.PAPER["views"]
    assert 90 < journey.path_length < 105


def test_the_drift_sets_the_corner_just_so_far_apart(journey: TourRecord) -> None:
    corner = e3.common_corner(load_world(OFFICE), journey)
    drifted = e3.drifting(journey, corner, 4.6)
    assert e3.map_tour("odometry", drifted, corner).error == pytest.approx(4.6, abs=1e-6)
    assert e3.map_tour("odometry", journey, corner).error != pytest.approx(4.6, abs=0.05)


def test_an_impossible_drift_is_refused(journey: TourRecord) -> None:
    corner = e3.common_corner(load_world(OFFICE), journey)
    with pytest.raises(InputError, match="a drift that ends 500"):
        e3.drifting(journey, corner, 500.0)


def test_the_disturbance_stands_between_views(journey: TourRecord) -> None:
    moved = e3.moved_by(journey, e3.DISTURBANCE)
    for before, after in zip(journey.readings[1:], moved.readings[1:], strict=True):
        assert np.allclose(after.motion - before.motion, e3.DISTURBANCE)
    assert np.array_equal(journey.readings[0].motion, moved.readings[0].motion)


def test_the_map_bears_what_the_odometer_does_not(journey: TourRecord) -> None:
    corner = e3.common_corner(load_world(OFFICE), journey)
    disturbed = e3.moved_by(e3.drifting(journey, corner, 4.6), e3.DISTURBANCE)
    odometry = e3.map_tour("odometry", disturbed, corner)
    albot1 = e3.map_tour("albot1", disturbed, corner)
    assert odometry.error > 10
    assert albot1.error < 2
    # Integration of the motions is what the odometry mapper does.
    pose = np.zeros(3)
    for reading in disturbed.readings[1:]:
        pose = compose(pose, reading.motion)
    assert np.allclose(odometry.poses[-1], pose)


def test_on_the_way_the_map_is_off_by_less_than_half_a_metre() -> None:
    off = []
    for seed in (3, 4, 5):
        journey = guided(e3.FLOORS["office"], seed)
        corner = e3.common_corner(load_world(OFFICE), journey)
        disturbed = e3.moved_by(e3.drifting(journey, corner, 4.6), e3.DISTURBANCE)
        off.append(e3.map_tour("albot1", disturbed, corner).on_the_way)
    assert np.median(off) < 0.5


def test_each_idea_betters_the_corridor_loop() -> None:
    errors: dict[str, list[float]] = {name: [] for name in ("albot1-thesis", "albot1-tracked")}
    for seed in (3, 4, 5):
        journey = guided(e3.FLOORS["corridor"], seed)
        corner = e3.common_corner(load_world("corridor-loop"), journey)
        drifting = e3.drifting(journey, corner, 4.6)
        for name, of in errors.items():
            run = e3.map_tour(name, drifting, corner)
            assert run.lost <= 3  # Doors are landmarks nearly everywhere.
            of.append(run.error)
    assert np.median(errors["albot1-tracked"]) < 0.5 * np.median(errors["albot1-thesis"])
    assert np.median(errors["albot1-thesis"]) < 0.7 * 4.6


def test_the_command_reports_in_json_and_writes_a_folder(tmp_path: Path) -> None:
    runner = CliRunner()
    args = ["experiment", "run", "albot1-e3", "--seeds", "1", "--json", "--out", str(tmp_path)]
    outcome = runner.invoke(albot, args, catch_exceptions=False)
    report = json.loads(outcome.stdout)
    assert report["id"] == "albot1-e3"
    assert report["paper"]["albot1_error_m"] == 0.4
    assert report["measured"]["seeds"] == 1
    assert isinstance(report["holds"], bool)
    assert {path.name for path in tmp_path.iterdir()} == {"result.json", "report.md", "maps.png"}
    assert json.loads((tmp_path / "result.json").read_text())["measured"] == report["measured"]


def test_the_list_names_it() -> None:
    outcome = CliRunner().invoke(albot, ["experiment", "list", "--json"], catch_exceptions=False)
    assert "albot1-e3" in [row["id"] for row in json.loads(outcome.stdout)["experiments"]]


@pytest.mark.parametrize(
    ("args", "message"),
    [
        (["albot1-e33"], "did you mean albot1-e3"),
        (["albot1-e3", "--seeds", "9..1"], "a range A..B with B at least A, found 9..1"),
    ],
)
def test_bad_input_is_one_line(args: list[str], message: str) -> None:
    outcome = CliRunner().invoke(albot, ["experiment", "run", *args])
    assert isinstance(outcome.exception, InputError)
    assert message in str(outcome.exception)
    assert "\n" not in str(outcome.exception)

"""Experiment 1: the ring keeps its shape, and in its bare corridor no landmark is found."""

from __future__ import annotations

import numpy as np
import pytest

from albot_core.errors import InputError
from albot_experiments import albot1_e1 as e1
from albot_experiments.tours import TourRecord, guided_tour
from albot_maps import World, load_world

RING = e1.ROUTES[0]


@pytest.fixture(scope="module")
def world() -> World:
    return load_world(RING.world)


@pytest.fixture(scope="module")
def journey(world: World) -> TourRecord:
    """Home, along the bare corridor, and some way into the next room."""
    return guided_tour(world, RING.waypoints(world)[:7], np.random.default_rng(3))


def test_there_are_six_routes_over_two_floors_or_more():
    assert len({route.name for route in e1.ROUTES}) == e1.PAPER["routes"]
    assert len({route.world for route in e1.ROUTES}) >= 2


def test_the_thesis_falls_back_to_path_integration_in_the_corridor(world, journey):
    trip = e1.map_trip("albot1-thesis", RING, world, journey)
    assert trip.lost[trip.in_corridor].sum() >= 3
    assert trip.lost[~trip.in_corridor].sum() <= 1
    assert trip.by_odometer[trip.lost].all()
    assert not trip.by_odometer[1:].all()
    off = trip.turn_errors()[trip.lost]
    assert np.allclose(off, trip.odometer_turn_errors()[trip.lost])


def test_ours_finds_no_landmark_there_but_keeps_its_heading(world, journey):
    trip = e1.map_trip("albot1", RING, world, journey)
    assert trip.lost[trip.in_corridor].sum() >= 2
    assert not trip.lost[~trip.in_corridor].any()
    assert (
        trip.turn_errors()[trip.lost].mean() < 0.3 * trip.odometer_turn_errors()[trip.lost].mean()
    )
    assert e1.is_kept([trip.shape])


def test_the_report_holds_the_routes_it_ran(monkeypatch):
    short = e1.Route(name="square", world="square-loop", tour="loop")
    monkeypatch.setattr(e1, "ROUTES", (short,))
    monkeypatch.setattr(e1, "CORRIDOR", "north")
    report = e1.run(range(2))
    assert report.measured["routes"] == 1
    assert report.measured["shape_kept"]
    assert report.verdicts.keys() == {"albot1-thesis", "albot1-tracked", "albot1"}
    square = report.measured["square, albot1"]
    assert square["path_m"] == pytest.approx(18.0, abs=0.2)
    assert square["path_error_m"]["median"] <= square["path_error_m"]["worst"]
    assert square["wall_precision"]["worst"] <= square["wall_precision"]["median"]
    # A loop with four corners is no corridor that leaves the robot without landmarks.
    assert not report.holds


def test_no_seeds_are_refused():
    with pytest.raises(InputError, match="at least one, found none"):
        e1.run(range(0))

"""Sensors are chosen by name, and a wrong name is answered with the right ones."""

from __future__ import annotations

import re

import numpy as np
import pytest

from albot_core.errors import InputError
from albot_env.sim.compass import COMPASSES
from albot_env.sim.laser import LASERS, RayCaster
from albot_env.sim.odometer import ODOMETERS
from albot_env.sim.scenes import SCENES
from albot_env.sim.sensors import Sensors, choose_sensors
from albot_env.sim.sonar import SONARS
from tests.conftest import ROOT

PLACE = re.compile(r"^\| [^|`]*\| `([^`]+)` \| `([^`]+)` \|", re.MULTILINE)


def test_the_guide_names_places_that_there_are() -> None:
    places = PLACE.findall((ROOT / "docs/guides/sensor.md").read_text(encoding="utf-8"))
    assert len(places) == 9
    for file, name in places:
        code = (ROOT / file).read_text(encoding="utf-8")
        assert re.search(rf"^((class|def) {name}\b|{name}\b.* =)", code, re.MULTILINE), name


def test_the_default_robot_has_laser_odometer_and_sonars() -> None:
    sensors = choose_sensors()
    assert sensors == Sensors(sonar=SONARS["pioneer"])
    assert choose_sensors(sonar="none") == Sensors()


@pytest.mark.parametrize(
    ("kind", "presets"),
    [
        ("laser", LASERS),
        ("odometer", ODOMETERS),
        ("sonar", SONARS),
        ("scenes", SCENES),
        ("compass", COMPASSES),
    ],
)
def test_every_preset_can_be_chosen(kind: str, presets) -> None:
    for name, config in presets.items():
        assert getattr(choose_sensors(**{kind: name}), kind) is config


def test_an_unknown_name_is_answered_with_those_there_are() -> None:
    with pytest.raises(InputError) as error:
        choose_sensors(sonar="pionere", source="play.yaml")
    assert str(error.value) == (
        "play.yaml, sonar: expected one of none, ideal, pioneer, poor, "
        "found 'pionere' (did you mean pioneer?)"
    )
    with pytest.raises(InputError, match=r"laser: expected one of none, ideal.*found 'x'$"):
        choose_sensors(laser="x")


def test_the_panoramic_laser_looks_all_round_once() -> None:
    geometry = LASERS["panoramic"].geometry
    assert np.diff(geometry.bearings) == pytest.approx(np.radians(1.0))
    assert np.ptp(geometry.bearings) == pytest.approx(np.radians(359.0))
    walls = np.array([[x, -9.0, x, 9.0] for x in (2.0, -3.0)])
    ranges = RayCaster(walls, geometry, indexed=False).scan(np.zeros(3))
    assert ranges[[0, 90, 180]] == pytest.approx((3.0, np.inf, 2.0))


@pytest.mark.parametrize("name", [name for name in LASERS if name != "panoramic"])
def test_every_laser_looks_a_half_turn_ahead_and_as_far_as_it_says(name: str) -> None:
    geometry = LASERS[name].geometry
    assert geometry.bearings[[0, -1]] == pytest.approx((-np.pi / 2, np.pi / 2))
    reach = {"long": 80.0, "short": 8.0}.get(name, 30.0)
    for distance, seen in ((0.99 * reach, True), (1.01 * reach, False)):
        wall = np.array([[distance, -9.0, distance, 9.0]])
        ranges = RayCaster(wall, geometry, indexed=False).scan(np.zeros(3))
        assert np.isfinite(ranges[geometry.beams // 2]) == seen


def test_what_the_robot_carries_is_told() -> None:
    assert choose_sensors().available == {"laser", "sonar"}
    assert choose_sensors(laser="none", sonar="none").available == set()
    assert choose_sensors(sonar="none", scenes="ambiguous").available == {"laser", "scene"}
    assert choose_sensors(sonar="none", compass="ideal").available == {"laser", "compass"}

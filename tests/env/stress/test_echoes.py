"""What sonars may say: two bounds, which the simulator's own sonars never leave."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from albot_core.sensing.reading import SonarGeometry, SonarScan
from albot_env.sim import SONARS
from albot_env.sim.plane_geometry import transform_of
from albot_env.sim.sonar_echoes import make_sonar_buffers
from albot_env.sim.sonar_kernels import measure_echoes
from albot_env.stress.checks import Limits, check_sonar

BOX = np.array([[0.0, 0, 4, 0], [4, 0, 4, 3], [4, 3, 0, 3], [0, 3, 0, 0]])
AHEAD = SonarGeometry(bearings=(0.0,), places=((0.0, 0.0),))
POSE = np.array((1.0, 1.5, 0.0))
EXACT = Limits(echo_noise=0.0, echo_share=0.0)


def said(*ranges: float, geometry: SonarGeometry = AHEAD) -> SonarScan:
    return SonarScan(ranges=np.array(ranges), geometry=geometry)


def test_an_echo_of_the_wall_ahead():
    assert check_sonar(BOX, POSE, said(3.0), EXACT) == []
    assert check_sonar(BOX, POSE, said(np.inf), EXACT) == []


def test_an_echo_of_nothing():
    [wrong] = check_sonar(BOX, POSE, said(2.9), EXACT)
    assert wrong == "sonar 0 hears 2.900 m, nothing is before 3.000 m"


def test_a_thing_makes_an_echo_shorter():
    thing = np.array([[2.0, 1.0, 2.0, 2.0]])
    assert check_sonar(np.concatenate((BOX, thing)), POSE, said(1.0), EXACT) == []
    [wrong] = check_sonar(np.concatenate((BOX, thing)), POSE, said(2.0), EXACT)
    assert wrong.startswith("sonar 0 hears 2.000 m, through a surface at 1.0")


def test_a_gap_that_is_narrow_is_heard_through():
    gap = np.array([[2.0, 0.0, 2.0, 1.499], [2.0, 1.503, 2.0, 3.0]])
    assert check_sonar(np.concatenate((BOX, gap)), POSE, said(3.0), EXACT) == []


def test_an_echo_from_beyond_the_sonars_reach():
    wide = BOX * 1.5
    assert check_sonar(wide, POSE, said(4.5), EXACT) != []


def test_noise_is_no_violation_and_more_is():
    limits = Limits()
    error = float(limits.echo_error(np.array((3.0,)))[0])
    assert error == pytest.approx(3.7 * np.hypot(0.005, 0.03))
    assert check_sonar(BOX, POSE, said(3.0 - 0.99 * error), limits) == []
    assert check_sonar(BOX, POSE, said(3.0 - 1.01 * error), limits) != []


def test_a_neighbours_echo_may_be_half_their_distance_nearer():
    pair = SonarGeometry(bearings=(0.0, 0.0), places=((0.0, 0.0), (0.2, 0.0)))
    assert check_sonar(BOX, POSE, said(2.9, 2.8, geometry=pair), EXACT) == []
    assert check_sonar(BOX, POSE, said(2.69, 2.8, geometry=pair), EXACT) != []


def test_a_place_that_is_none_is_not_looked_at():
    assert check_sonar(BOX, np.array((np.nan, 0, 0)), said(1.0), EXACT) == []


@settings(deadline=None)  # The first call compiles.
@given(st.integers(0, 2**32 - 1))
def test_the_simulators_sonars_stay_within(seed: int):
    """Among walls and things by chance, with noise, misses, and cross-talk all the time."""
    rng = np.random.default_rng(seed)
    surfaces = rng.uniform(-4, 4, (12, 4))
    pose = np.append(rng.uniform(-1, 1, 2), rng.uniform(-4, 4))
    config = dataclasses.replace(SONARS["pioneer"], crosstalk=float(rng.integers(2)))
    echoes = np.empty(8)
    nearby = np.arange(8, dtype=np.int32)
    robot = transform_of(pose), config.constants, np.uint64(seed), 0
    measure_echoes(surfaces[:8], nearby, surfaces[8:], *robot, make_sonar_buffers(12, 8), echoes)
    scan = SonarScan(ranges=echoes, geometry=config.geometry)
    assert check_sonar(surfaces, pose, scan, Limits()) == []

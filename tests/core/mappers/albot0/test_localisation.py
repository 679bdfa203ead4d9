"""The cues and Democratic Integration, worked out by hand."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from albot_core.errors import InputError
from albot_core.mappers.albot0.localisation import (
    CUES,
    DemocraticIntegration,
    LocalisationConfig,
    Stop,
    distance_map,
    extent_map,
    is_sure,
    most_confident,
    orientation_map,
    register_cue,
)
from albot_core.mappers.albot0.regions import Regions

CONFIG = LocalisationConfig()


def chain(*ways: tuple[float, float]) -> Regions:
    """Regions that lead from one point to the next, each by its length (m) and direction (°)."""
    points = [np.zeros(2)]
    for length, degrees in ways:
        angle = math.radians(degrees)
        points.append(points[-1] + length * np.array((math.cos(angle), math.sin(angle))))
    lines = np.array([(*a, *b) for a, b in pairwise(points)]).reshape(-1, 4)
    return Regions(splits=np.arange(len(ways) + 1), steps=lines)


def at(home: Regions) -> Stop:
    """A stop on the way home."""
    return Stop(out=OUT, home=home, beside=np.zeros(3))


OUT = chain((10.0, 0.0), (4.0, 90.0), (6.0, 60.0))
"""From home: 10 m east, 4 m north, 6 m to 60°. On the way home they end at 20, 10 and 6 m."""


def test_the_distance_cue_by_hand():
    confidences = distance_map(at(chain((4.0, 0.0), (5.0, 80.0))), CONFIG)
    exact = np.exp(-0.5 * ((np.array((20, 10, 6)) - 9) / 0.45) ** 2)
    np.testing.assert_allclose(confidences, exact / exact.max())
    assert most_confident(confidences) == 1


def test_the_extent_cue_is_sure_of_the_asr_that_the_distance_lies_in():
    confidences = extent_map(at(chain((7.0, 0.0))), CONFIG)
    assert most_confident(confidences) == 1
    assert most_confident(distance_map(at(chain((7.0, 0.0))), CONFIG)) == 2
    # 1 m beyond the end of the last one, with σ = 0.35 m.
    np.testing.assert_allclose(confidences[2], math.exp(-0.5 * (1 / 0.35) ** 2))
    assert extent_map(at(chain((500.0, 0.0))), CONFIG).argmax() == 0


@pytest.mark.parametrize("cue", ["distance", "extent"])
@pytest.mark.parametrize("travelled", [0.0, 1e-300, 1e-3, 1e5])
def test_the_best_asr_has_confidence_1_however_far_it_is(cue, travelled):
    confidences = CUES[cue](at(chain((travelled, 0.0))), CONFIG)
    assert confidences.max() == 1.0
    assert (confidences >= 0).all()
    assert most_confident(confidences) == (2 if travelled < 1 else 0)


def test_the_orientation_cue_takes_turns_in_reverse_order_with_the_opposite_sign():
    """Out: 90° left into the second ASR, 30° right into the third. Home: 30° left, 90° right."""
    home = chain((6.0, 180.0), (4.0, 210.0))
    np.testing.assert_allclose(
        orientation_map(at(home), CONFIG), 0.5 * np.array((1 - 120 / 180, 1.0, 0.5))
    )
    home = chain((6.0, 180.0), (4.0, 210.0), (10.0, 120.0))
    np.testing.assert_allclose(
        orientation_map(at(home), CONFIG), 0.5 * np.array((1.0, 1 - 120 / 180, 0.5))
    )


def test_before_the_second_asr_of_the_way_home_the_orientation_cue_says_nothing():
    np.testing.assert_allclose(orientation_map(at(chain((1.0, 0.0))), CONFIG), 0.25)
    np.testing.assert_allclose(orientation_map(at(chain()), CONFIG), 0.25)


@pytest.mark.parametrize("home", [chain(), chain((0.0, 0.0)), chain((5.0, 0.0), (0.0, 0.0))])
def test_regions_of_no_length_have_confidences(home):
    out = chain((10.0, 0.0), (0.0, 0.0), (6.0, 60.0), (0.0, 0.0))
    stop = Stop(out=out, home=home, beside=np.ones(4))
    for cue in CUES.values():
        confidences = cue(stop, CONFIG)
        assert confidences.shape == (4,)
        assert ((confidences >= 0) & (confidences <= 1)).all()


def test_democratic_integration_by_hand_over_two_steps():
    fusion = DemocraticIntegration.of(2)
    fused = fusion.fuse(np.array(((1.0, 0.5, 0.5), (0.2, 0.4, 0.2))))
    np.testing.assert_allclose(fused, (0.6, 0.45, 0.35))
    # At the first ASR the maps have 1/2 and 1/4 of their sums: qualities 2/3 and 1/3.
    np.testing.assert_allclose(fusion.weights, (2 / 3, 1 / 3))
    fused = fusion.fuse(np.array(((0.0, 0.5, 0.5), (0.3, 0.9, 0.3))))
    np.testing.assert_allclose(fused, (0.1, 1.9 / 3, 1.3 / 3))
    # Shares 1/2 and 3/5: qualities 5/11 and 6/11, of which half is taken over.
    expected = np.array((2 / 3, 1 / 3)) + (np.array((5, 6)) / 11 - (2 / 3, 1 / 3)) / 2
    np.testing.assert_allclose(fusion.weights, expected)


@given(
    st.lists(arrays.arrays(np.float64, (2, 4), elements=st.floats(0, 1)), min_size=1, max_size=8)
)
def test_weights_sum_to_1_whatever_the_maps(maps):
    fusion = DemocraticIntegration.of(2)
    for each in maps:
        fused = fusion.fuse(each)
        assert ((fused >= 0) & (fused <= 1 + 1e-9)).all()
        assert fusion.weights.sum() == pytest.approx(1.0)
        assert (fusion.weights >= 0).all()


def test_where_all_confidences_are_0_the_robot_is_not_sure():
    fusion = DemocraticIntegration.of(2)
    fused = fusion.fuse(np.zeros((2, 3)))
    np.testing.assert_array_equal(fused, 0.0)
    np.testing.assert_allclose(fusion.weights, 0.5)
    assert not is_sure(fused, CONFIG)


def test_a_border_is_where_two_are_equal():
    assert not is_sure(np.array((0.1, 0.7, 0.68)), CONFIG)
    assert is_sure(np.array((0.1, 0.7, 0.4)), CONFIG)
    assert is_sure(np.array((0.0,)), CONFIG)
    assert most_confident(np.array((0.5, 0.7, 0.7))) == 2


def test_a_cue_of_ones_own_is_chosen_by_its_name():
    with pytest.raises(InputError, match="did you mean extent"):
        LocalisationConfig(cues=("extend",))
    with pytest.raises(InputError, match="a name that no other cue has"):
        register_cue("distance", extent_map)
    register_cue("distance", distance_map)
    register_cue("even", lambda stop, config: np.ones(stop.out.count))
    try:
        assert LocalisationConfig(cues=("distance", "even")).cues[1] == "even"
    finally:
        del CUES["even"]


@pytest.mark.parametrize(
    "config", [{"cues": ()}, {"cues": ("extent", "extent")}, {"spread": 0.0}, {"border": 1.5}]
)
def test_thresholds_are_checked(config):
    with pytest.raises(InputError, match=r"LocalisationConfig\."):
        LocalisationConfig(**config)


def test_an_empty_list_of_cues_is_told_what_it_lacks():
    with pytest.raises(InputError, match=r"expected one or more of .*extent.*, found none"):
        LocalisationConfig(cues=())

"""Verification of a re-localisation: a false one leaves no transition, a true one does."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from albot_core.mappers.ratslam.config import RatSlamConfig
from albot_core.mappers.ratslam.mapper import RatSlam
from albot_core.mappers.ratslam.verification import Transition, Verification
from albot_core.sensing.reading import Reading

STEP = 0.1


def drive(mapper: RatSlam, scenes: list[int]) -> None:
    """Straight on, a scene every 0.1 m."""
    motion = np.array((STEP, 0.0, 0.0))
    for k, scene in enumerate(scenes):
        mapper.update(Reading(stamp=STEP * k, motion=motion, scene=scene))


def mapper_that_asks_for(confirmations: int) -> RatSlam:
    config = RatSlamConfig.scenes()
    zones = dataclasses.replace(config.experiences, confirmations=confirmations)
    # A single view is enough to be re-localised.
    views = dataclasses.replace(config.views, injection=0.1, fatigue=0.9)
    config = dataclasses.replace(config, experiences=zones, views=views)
    return RatSlam(config, "ratslam-scenes")


def misled(confirmations: int) -> RatSlam:
    """A robot that goes 30 m, then for 2 m sees what it saw after 5 m, then goes on."""
    mapper = mapper_that_asks_for(confirmations)
    way = [k // 10 for k in range(400)]
    way[300:320] = [5] * 20
    drive(mapper, way)
    return mapper


def farthest_transition(mapper: RatSlam) -> float:
    """How far the farthest ends of a transition are apart on the true way (m)."""
    experiences, links = mapper.experiences.experiences, mapper.experiences.links
    made_at = STEP * experiences.rows("reading")
    ends = made_at[links.rows("source")] - made_at[links.rows("target")]
    return float(np.abs(ends).max())


def test_a_false_relocalisation_leaves_no_transition():
    mapper = misled(confirmations=2)
    assert mapper.events
    assert farthest_transition(mapper) < 4.0
    made_at = STEP * mapper.experiences.experiences.rows("reading")
    np.testing.assert_allclose(mapper.experiences.poses[:, 0], made_at, atol=0.5)


def test_a_false_relocalisation_that_is_dropped_leaves_no_pose():
    """Its poses were elsewhere at the time; in hindsight they lie on the way."""
    mapper = misled(confirmations=3)
    places = np.array([mapper.place_at(k) for k in range(400)])
    made_at = STEP * mapper.experiences.experiences.rows("reading")
    way = STEP * np.arange(400)
    assert np.abs(made_at[places] - way).max() > 20.0
    np.testing.assert_allclose(mapper.corrected_poses()[:, 0], way, atol=0.5)


def test_without_verification_it_bends_the_map():
    mapper = misled(confirmations=1)
    assert farthest_transition(mapper) > 20.0


def test_a_true_relocalisation_joins_both_ends():
    mapper = mapper_that_asks_for(2)
    drive(mapper, [k // 10 for k in range(300)] + [5 + k // 10 for k in range(80)])
    assert mapper.events
    assert farthest_transition(mapper) > 20.0
    assert mapper.place_at(379) == mapper.place_at(129)


def test_known_experiences_confirm_once_each():
    verification = Verification()
    verification.begin(7, (1.0, 0.0, 0.0), 0.5, 3.0, 9, known=8)
    pending = [
        Transition(7, 2, (0.5, 0.1, 0.2), 1.0, 1.0, 4),
        Transition(2, 8, (1.0, 0, 0), 2.0, 0.5, 5),
    ]
    for transition in pending:
        verification.add_pending(transition)
    verification.add_pending(Transition(8, 2, (0.0, 0.0, 0.0), 1.0, 0.0, 1))
    assert verification.confirmations == 1
    verification.add_pending(Transition(2, 3, (0.0, 0.0, 0.0), 1.0, 0.0, 1))
    assert verification.confirmations == 2
    other = Verification()
    other._set_state(verification.state())
    assert other.confirmations == 2
    assert other.accept()[0] == pending[0]
    assert (other.anchor, other.confirmations) == (-1, 0)


def test_path_integration_goes_on_from_the_anchor():
    verification = Verification()
    verification.begin(0, (1.0, 0.0, np.pi / 2), 0.5, 0.0, 1, known=1)
    verification.integrate((2.0, 1.0, 0.5))
    assert verification.from_anchor == pytest.approx((0.0, 2.0, np.pi / 2 + 0.5))
    here = Transition(0, 1, (9.0, 9.0, 9.0), 2.0, 1.5, 3)
    assert verification.process(here, 2.0, 3, 2, is_new=True) == [
        Transition(0, 1, pytest.approx((0.0, 2.0, np.pi / 2 + 0.5)), 2.0, 0.5, 2)
    ]
    assert (verification.anchor, verification.from_anchor) == (1, (0.0, 0.0, 0.0))

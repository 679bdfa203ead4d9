"""RatSLAM to the letter: what each switch changes, and that no input makes it lose its numbers."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from albot_core.mappers.ratslam.config import RatSlamConfig
from albot_core.mappers.ratslam.mapper import RatSlam
from albot_core.mappers.registry import make_mapper
from albot_core.sensing.reading import Reading
from tests.core.mappers.ratslam.lap import lead, true_laps

CONFIG = RatSlamConfig.paper()


def led(scenes, step: float = 0.1, turn: float = 0.0, config: RatSlamConfig = CONFIG) -> RatSlam:
    """A mapper after readings of these scenes, as far apart as `step` and `turn`."""
    mapper = RatSlam(config, "ratslam-paper")
    for k, scene in enumerate(scenes):
        motion = np.array((step, 0.0, turn)) if k else np.zeros(3)
        mapper.update(Reading(stamp=0.1 * k, motion=motion, scene=scene))
    return mapper


def is_finite(mapper: RatSlam) -> bool:
    """Whether all numbers of the map, and of what is believed, are finite."""
    arrays = mapper.experiences.poses, mapper.estimate.pose, mapper.corrected_poses()
    return all(np.isfinite(array).all() for array in arrays) and np.isfinite(mapper.packet).all()


@pytest.mark.parametrize(
    "scene_of",
    [
        lambda k: None,
        lambda k: 7,
        lambda k: k,
        lambda k: k % 2,
        lambda k: None if k // 20 % 2 else k // 4 % 6,
    ],
    ids=["lost", "one", "all-new", "two-in-turn", "lost-for-a-while"],
)
@pytest.mark.parametrize(("step", "turn"), [(0.0, 0.0), (0.1, 0.0), (0.1, 0.1), (0.0, 0.2)])
def test_no_input_makes_it_lose_its_numbers(scene_of, step, turn):
    mapper = led([scene_of(k) for k in range(400)], step, turn)
    assert is_finite(mapper)
    assert np.abs(mapper.corrected_poses()[:, :2]).max() < 400 * 0.1 + 1.0


def test_junctions_do_not_diverge():
    """Twelve scenes all over the floor make experiences with many transitions."""
    rng = np.random.default_rng(0)
    scenes = rng.integers(0, 12, 1000).tolist()
    mapper = led(scenes, 0.1, 0.05)
    links = mapper.experiences.links
    ends = np.concatenate((links.rows("source"), links.rows("target")))
    assert np.bincount(ends).max() >= 4
    assert is_finite(mapper)
    literal = dataclasses.replace(CONFIG.correction, form="all_at_once", passes=1)
    with np.errstate(all="ignore"):
        diverged = led(scenes, 0.1, 0.05, dataclasses.replace(CONFIG, correction=literal))
    assert not np.abs(diverged.experiences.poses).max() < 1e3


def test_laps_are_known_again():
    laps = 4
    truth, mapper = true_laps(laps), make_mapper("ratslam-paper")
    assert isinstance(mapper, RatSlam)
    lead(mapper, truth[: len(truth) // laps], 0.0)
    known = mapper.experiences.count
    mapper = make_mapper("ratslam-paper")
    assert isinstance(mapper, RatSlam)
    lead(mapper, truth, 0.0)
    assert mapper.experiences.count < 2 * known
    assert mapper.estimate.matched_reading is not None


def test_a_scene_counts_at_once():
    assert led([3]).views == 1
    assert led([3], config=RatSlamConfig.scenes()).views == 0


def test_a_view_is_linked_while_it_is_seen():
    """Ours links it where it comes into sight alone."""
    seen = [5] * 30
    letter = led(seen)
    once = dataclasses.replace(CONFIG.views, links_in_sight=False)
    cells = [
        len(mapper._links.injection(0, 1.0)[0])
        for mapper in (letter, led(seen, config=dataclasses.replace(CONFIG, views=once)))
    ]
    assert cells[0] > 2 * cells[1] > 0


def test_a_view_does_not_tire():
    links = led([5] * 30)._links
    assert links.activate(0, 100) == links.activate(0, 101) == 1.0


def test_transitions_begin_and_end_at_experiences():
    """A robot that enters a zone at its edge is taken to be at the experience."""
    there = [0] * 12 + [1] * 12
    back = list(reversed(there))
    mapper = RatSlam(CONFIG, "ratslam-paper")
    for k, scene in enumerate(there + back):
        step = 0.1 if k < len(there) else -0.1
        motion = np.array((step, 0.0, 0.0)) if k else np.zeros(3)
        mapper.update(Reading(stamp=0.1 * k, motion=motion, scene=scene))
        if mapper._position.place == 0 and k >= len(there):
            break
    np.testing.assert_allclose(mapper._position.here, np.zeros(3), atol=1e-12)


def test_one_zone_is_enough():
    """By eq. (9) a scene seen far away, with the same heading, activates its experience."""
    seen = [0] * 15 + [1] * 60 + [0] * 15
    both = dataclasses.replace(CONFIG.experiences, position_or_heading=False)
    assert led(seen).experiences.count == 2
    assert led(seen, config=dataclasses.replace(CONFIG, experiences=both)).experiences.count > 2

"""Local views: what is seen, and where its links lead."""

from __future__ import annotations

import numpy as np
import pytest

from albot_core.mappers.ratslam.config import LocalViewConfig, PoseCellConfig
from albot_core.mappers.ratslam.local_views import NO_VIEW, Links, Scenes
from albot_core.mappers.ratslam.pose_cells import Packet, PoseCells

CONFIG = LocalViewConfig()


def look(scenes: Scenes, shown: list[int | None]) -> list[int]:
    view, views = NO_VIEW, []
    for scene in shown:
        view = scenes.look(scene, view)
        views.append(view)
    return views


def test_a_scene_is_believed_when_it_is_seen_again():
    assert look(Scenes(CONFIG), [70, 70, 5, 70, 5, 5, 70, None, 70, 70]) == [
        NO_VIEW, 0, 0, 0, 0, 1, 1, 1, 1, 0,
    ]  # fmt: skip


def test_a_scene_that_is_not_seen_any_more_is_forgotten():
    config = LocalViewConfig(forget_after=3)
    assert look(Scenes(config), [7, 7, None, None, None, None]) == [-1, 0, 0, 0, -1, -1]
    assert look(Scenes(config), [7, 7, 1, 2, 3, 4]) == [-1, 0, 0, 0, -1, -1]
    assert look(Scenes(config), [None] * 5) == [NO_VIEW] * 5


def test_links_follow_the_maximum_rule_and_wait():
    links = Links(CONFIG)
    cells = np.array((4, 9))
    assert links.activate(0, 1) == 1.0
    links.remember(0, cells, np.array((0.2, 0.6)), 1.0)
    links.learn(1.0 + CONFIG.learning_delay - 0.1)
    assert not links.has_links(0)
    links.learn(1.0 + CONFIG.learning_delay + 0.1)
    links.remember(0, cells, np.array((0.5, 0.3)), 2.0)
    links.learn(100.0)
    found, amounts = links.injection(0, 1.0)
    order = np.argsort(found)
    np.testing.assert_array_equal(found[order], (4, 9))
    # Together they are the injection: the less of each would be 2 to 3.
    np.testing.assert_allclose(amounts[order], CONFIG.injection * np.array((5, 6)) / 11)
    np.testing.assert_array_equal(links.linked(3), (True, False, False))


def test_a_view_near_its_links_strengthens_these_and_makes_no_other():
    """A packet of one cell is linked; a wider one strengthens it, and a tired view does not."""
    cells, links = PoseCells(PoseCellConfig()), Links(CONFIG)
    cells.seed(Packet(20.0, 30.0, 4.0, 1.0))
    links.activate(0, 1)
    strengths = []
    for k, active in enumerate((0.3, 0.9, 0.2)):
        links.associate(0, active, (0.0, 0.0, 0.0), cells, 10.0 * k)
        links.learn(10.0 * k + CONFIG.learning_delay + 0.1)
        strengths.append(links.strengths.tolist())
        cells.seed(Packet(20.2, 30.0, 4.0, 1.0))
    assert strengths == [[0.3], pytest.approx([0.9 * 0.8]), pytest.approx([0.9 * 0.8])]
    cells.seed(Packet(25.0, 30.0, 4.0, 1.0))  # Not near.
    links.associate(0, 0.1, (0.0, 0.0, 0.0), cells, 40.0)
    links.learn(60.0)
    assert links.strengths.tolist() == pytest.approx([0.9 * 0.8, 0.1])


def test_what_waits_when_the_robot_is_relocalised_is_not_learned():
    links = Links(CONFIG)
    links.activate(0, 1)
    links.remember(0, np.array((4,)), np.array((0.2,)), 1.0)
    links.forget_waiting()
    links.learn(100.0)
    assert links.injection(0, 1.0)[0].size == 0


def test_a_view_tires_and_recovers():
    links = Links(CONFIG)
    seen = [links.activate(0, k) for k in range(1, 60)]
    np.testing.assert_allclose(seen[:2], (1.0, CONFIG.fatigue))
    assert np.all(np.diff(seen) < 0)
    assert seen[-1] < 0.01
    assert links.activate(0, 1000) == 1.0


def test_a_view_knows_whether_it_leads_near():
    links, shape = Links(CONFIG), (20, 20, 36)
    links.activate(0, 1)
    links.remember(0, np.array((19,)), np.array((1.0,)), 0.0)
    links.learn(100.0)
    assert links.leads_near(0, 1, shape)
    assert links.leads_near(0, 35 * 400 + 19, shape)
    assert not links.leads_near(0, 5, shape)
    assert not links.leads_near(1, 19, shape)

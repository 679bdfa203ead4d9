"""Local views: what is seen, and where its links lead."""

from __future__ import annotations

import numpy as np

from albot_core.mappers.ratslam.config import LocalViewConfig
from albot_core.mappers.ratslam.local_views import NO_VIEW, Links, Scenes

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

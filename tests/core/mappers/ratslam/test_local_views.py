"""Local views: what is seen, and where its links lead."""

from __future__ import annotations

import numpy as np
import pytest

from albot_core.mappers.ratslam.config import LocalViewConfig
from albot_core.mappers.ratslam.local_views import NO_VIEW, Links, Scenes, Templates, compare
from albot_core.sensing.reading import LaserGeometry, LaserScan

CONFIG = LocalViewConfig()
LASER = LaserGeometry()


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
    config = LocalViewConfig(forget=3)
    assert look(Scenes(config), [7, 7, None, None, None, None]) == [-1, 0, 0, 0, -1, -1]
    assert look(Scenes(config), [7, 7, 1, 2, 3, 4]) == [-1, 0, 0, 0, -1, -1]
    assert look(Scenes(config), [None] * 5) == [NO_VIEW] * 5


def room(turn: float = 0.0, width: float = 6.0) -> LaserScan:
    """A scan in a room of 10 m by `width`, from a robot in its middle that is turned."""
    angles = LASER.bearings + turn
    with np.errstate(divide="ignore"):
        ranges = np.minimum(5 / np.abs(np.cos(angles)), width / 2 / np.abs(np.sin(angles)))
    return LaserScan(ranges=ranges, geometry=LASER)


def test_a_scan_is_known_again_turned_a_little():
    templates = Templates(CONFIG)
    assert templates.look(room(), NO_VIEW) == (0, 0.0)
    for turn in np.radians((-12, -5, 3, 8, 15)):
        view, seen = templates.look(room(float(turn)), NO_VIEW)
        assert view == 0
        assert seen == pytest.approx(turn, abs=np.radians(2))
    assert templates.look(room(width=3.0), 0)[0] == 1
    assert templates.look(room(), 1)[0] == 0


def test_a_view_stays_while_it_matches():
    templates = Templates(LocalViewConfig(difference=0.1))
    templates.look(room(width=6.0), NO_VIEW)
    templates._table.append(profile=templates._table["profile"][0] + 0.05)
    assert templates.look(room(width=6.0), 1)[0] == 1
    assert templates.look(room(width=6.0), NO_VIEW)[0] == 0


def test_the_difference_is_the_least_over_the_turns():
    rng = np.random.default_rng(0)
    for _ in range(50):
        one, other = rng.uniform(size=(2, 36))
        brute = {}
        for turn in range(-4, 5):
            first, last = max(0, -turn), min(36, 36 - turn)
            brute[turn] = np.abs(one[first:last] - other[first + turn : last + turn]).mean()
        least, turn = compare(one, other, 4, np.inf)
        best = min(brute, key=lambda key: brute[key])
        assert least == pytest.approx(brute[best])
        assert abs(turn - best) <= 0.5
        assert compare(one, other, 4, 0.9 * least)[0] == np.inf


def test_links_follow_the_maximum_rule_and_wait():
    links = Links(CONFIG)
    cells = np.array((4, 9))
    assert links.activate(0, 1) == 1.0
    links.remember(0, cells, np.array((0.2, 0.6)), 1.0)
    links.learn(1.0 + CONFIG.learning_delay - 0.1)
    assert not links.has_links(0)
    links.learn(1.0 + CONFIG.learning_delay + 0.1)
    links.remember(0, cells, np.array((0.4, 0.3)), 2.0)
    links.learn(100.0)
    found, amounts = links.injection(0, 1.0, 0, 100, 1000)
    order = np.argsort(found)
    np.testing.assert_array_equal(found[order], (4, 9))
    np.testing.assert_allclose(amounts[order], CONFIG.injection * np.array((0.4, 0.6)))
    turned, _ = links.injection(0, 1.0, -1, 100, 1000)
    assert set(turned) == {904, 909}


def test_what_waits_when_the_robot_is_relocalised_is_not_learned():
    links = Links(CONFIG)
    links.activate(0, 1)
    links.remember(0, np.array((4,)), np.array((0.2,)), 1.0)
    links.forget_waiting()
    links.learn(100.0)
    assert links.injection(0, 1.0, 0, 100, 1000)[0].size == 0


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

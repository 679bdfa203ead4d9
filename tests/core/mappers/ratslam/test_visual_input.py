"""What views inject, and where."""

from __future__ import annotations

import numpy as np
import pytest

from albot_core.mappers.ratslam.config import RatSlamConfig
from albot_core.mappers.ratslam.local_views import Links
from albot_core.mappers.ratslam.panoramas import ViewMatch
from albot_core.mappers.ratslam.pose_cells import PoseCells
from albot_core.mappers.ratslam.position import Position
from albot_core.mappers.ratslam.visual_input import LaserInput, SceneInput
from albot_core.sensing.reading import Reading

CONFIG = RatSlamConfig()
HERE = (0.0, 0.0, 0.0)


def injected(monkeypatch: pytest.MonkeyPatch, *matches: ViewMatch) -> list[float]:
    """What each view injects; views 0 and 1 lie 10 m apart, the robot is in the first."""
    cells, links, position = PoseCells(CONFIG.pose_cells), Links(CONFIG.views), Position(CONFIG)
    for view, x in enumerate((0.0, 10.0)):
        position.enter(position.add(view, cells.packet), HERE, is_new=True)
        links.remember(view, np.array((1000 * (view + 1),)), np.ones(1), 0.0)
        position.iteration += 1
        position.integrate((10.0 - x, 0.0, 0.0), 1.0)
    position.place, position.here, position.since = 0, HERE, HERE
    position.way = 10.0
    links.learn(CONFIG.views.learning_delay + 1.0)
    visual = LaserInput(CONFIG, cells, links, position, "ratslam")
    monkeypatch.setattr(visual, "_compare", lambda: matches)
    return [float(amount) for amount in visual.inject()[1]]


def test_one_view_alone_injects_nearly_all(monkeypatch: pytest.MonkeyPatch) -> None:
    """Even one that matches poorly, where the robot is expected."""
    poor = 0.5
    match = (poor - CONFIG.panoramas.min_score) / (1 - CONFIG.panoramas.min_score)
    share = match / (match + CONFIG.panoramas.new_place_weight)
    found = injected(monkeypatch, ViewMatch(0, HERE, poor))
    assert share > 0.85
    assert found == pytest.approx([share * CONFIG.views.injection])


def test_a_view_that_the_odometer_rules_out_injects_hardly_any(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    found = injected(monkeypatch, ViewMatch(1, HERE, 1.0))
    assert found[0] < 1e-6 * CONFIG.views.injection


@pytest.mark.parametrize(("disagree", "part"), [(0.0, 0.0), (0.05, 0.5), (0.1, 1.0), (0.5, 1.0)])
def test_the_robot_is_the_surer_the_better_its_scans_were_aligned(disagree, part) -> None:
    """After 20 m a match 1 m away from the believed position; `drift` holds for a doubtful way."""
    cells, links, position = PoseCells(CONFIG.pose_cells), Links(CONFIG.views), Position(CONFIG)
    visual, config = LaserInput(CONFIG, cells, links, position, "ratslam"), CONFIG.panoramas
    position.enter(position.add(0, cells.packet), HERE, is_new=True)
    position.way, position.doubt = position.way + 20.0, position.doubt + 20.0 * disagree
    spread = config.spread + part * config.drift * 20.0
    plausible = visual._plausible(ViewMatch(0, (1.0, 0.0, 0.0), 1.0))
    assert plausible == pytest.approx(np.exp(-0.5 / spread**2))


def test_two_views_share_by_how_well_they_match(monkeypatch: pytest.MonkeyPatch) -> None:
    """The second one says that the robot is 10 m behind its origin: where it is believed."""
    found = injected(monkeypatch, ViewMatch(0, HERE, 1.0), ViewMatch(1, (-10.0, 0.0, 0.0), 0.7))
    total = 1.5 + CONFIG.panoramas.new_place_weight
    injection = CONFIG.views.injection
    assert found == pytest.approx([injection / total, 0.5 * injection / total])


def test_a_scene_injects_where_the_robot_has_come_since_it_came_into_sight() -> None:
    """Its link leads to one cell; the robot drives on along x', a cell per iteration."""
    config = RatSlamConfig.scenes()
    cells, links, position = PoseCells(config.pose_cells), Links(config.views), Position(config)
    visual = SceneInput(config, cells, links, position)
    cell = int(cells.cells[0])
    links.remember(0, np.array((cell,)), np.ones(1), 0.0)
    links.learn(config.views.learning_delay + 1.0)
    reading = Reading(stamp=0.0, motion=np.zeros(3), scene=7)
    injected = []
    for _ in range(3):
        visual.look(reading)
        visual.look(reading)
        position.since = (0.25, 0.0, 0.0)
        injected.append(visual.inject()[0])
        position.iteration += 1
    here = cells.moved(np.array((cell,)), (0.0, 0.0, 0.0))
    for k, places in enumerate(injected):
        np.testing.assert_array_equal(places, here + np.array((k, 0, 0)))
    other = SceneInput(config, cells, links, position)
    other._set_state(visual.state())
    for each in (other, visual):
        each.look(reading)
        np.testing.assert_array_equal(each.inject()[0], here + np.array((3, 0, 0)))

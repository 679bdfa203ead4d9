"""Scenes that are known from elsewhere: tentative until they are seen at the next visit, too."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from albot_core.mappers.ratslam.config import ExperienceConfig, PoseCellConfig, RatSlamConfig
from albot_core.mappers.ratslam.mapper import RatSlam
from albot_core.mappers.ratslam.pose_cells import Packet
from albot_core.mappers.ratslam.tentative import Tentative

from .lap import SPEED, STEP, readings, true_laps

CELLS = PoseCellConfig()
HERE = Packet(10.0, 127.5, 35.8, 1.0)
AWAY = Packet(40.0, 0.0, 0.0, 1.0)


def tentative(visits: int = 2) -> Tentative:
    return Tentative(ExperienceConfig(visits=visits), CELLS)


def visit(views: Tentative, view: int | None) -> None:
    """Come by, see a view or none, and leave."""
    views.move(HERE)
    if view is not None:
        views.see(view, HERE)
        views.see(view, HERE)
    views.move(HERE)
    views.move(AWAY)


def test_a_view_is_confirmed_at_the_next_visit_not_in_the_same() -> None:
    views = tentative()
    views.see(3, HERE)
    views.see(3, HERE)
    assert not views.is_confirmed(3, HERE)
    views.move(AWAY)
    visit(views, 3)
    assert views.is_confirmed(3, HERE)
    near = Packet(10.0 + 4.0, 0.2, 0.3, 1.0)  # 1 m and 5° away, across the edges.
    assert views.is_confirmed(3, near)
    assert not views.is_confirmed(4, HERE)
    for far in (Packet(15.0, 127.5, 35.8, 1.0), Packet(10.0, 127.5, 31.0, 1.0)):
        assert not views.is_confirmed(3, far)


def test_a_visit_that_does_not_see_it_starts_it_anew() -> None:
    views = tentative()
    visit(views, 3)
    visit(views, None)
    visit(views, 3)
    assert not views.is_confirmed(3, HERE)
    visit(views, 3)
    assert views.is_confirmed(3, HERE)


def test_the_rim_of_its_zone_is_no_visit() -> None:
    views = tentative()
    visit(views, 3)
    views.move(Packet(10.0 + 4.0, 127.5, 35.8, 1.0))
    views.move(AWAY)
    visit(views, 3)
    assert views.is_confirmed(3, HERE)


def test_as_many_visits_as_asked_for() -> None:
    assert tentative(1).is_confirmed(7, HERE)
    views = tentative(3)
    for _ in range(2):
        visit(views, 3)
    assert not views.is_confirmed(3, HERE)
    visit(views, 3)
    assert views.is_confirmed(3, HERE)


def test_rows_are_used_again_and_the_state_is_whole() -> None:
    views = tentative()
    for view in range(50):
        visit(views, view)
        visit(views, None)
    assert views.state()["tentative.view"].shape == (1,)
    views.see(8, HERE)
    other = tentative()
    other._set_state(views.state())
    for each in (views, other):
        each.move(AWAY)
        visit(each, 8)
        assert each.is_confirmed(8, HERE)


def familiar(visits: int) -> RatSlam:
    """A robot on seven laps that for 0.5 to 1 m now and then sees a scene of the first lap."""
    config = RatSlamConfig.scenes()
    zones = dataclasses.replace(config.experiences, visits=visits)
    mapper = RatSlam(dataclasses.replace(config, experiences=zones), "ratslam-scenes")
    rng = np.random.default_rng(3)
    stream = list(readings(true_laps(7), np.radians(3.0), rng))
    lap = len(stream) // 7
    for start in range(lap, len(stream) - 20, 80):
        false = stream[int(rng.integers(lap))].scene
        for k in range(start, start + int(rng.uniform(0.5, 1.0) / SPEED / STEP)):
            stream[k] = dataclasses.replace(stream[k], scene=false)
    for reading in stream:
        mapper.update(reading)
    return mapper


@pytest.mark.parametrize(("visits", "least", "most"), [(1, 12, 40), (2, 0, 3)])
def test_familiar_false_scenes_make_no_experiences(visits: int, least: int, most: int) -> None:
    mapper = familiar(visits)
    lap = len(true_laps(1))
    later = mapper.experiences.experiences.rows("reading") > 3 * lap
    assert least <= later.sum() <= most

"""Scenes: their numbers in closed form, noise and mistakes by their frequencies."""

from __future__ import annotations

import math
from collections import Counter

import numpy as np
import pytest
from scipy.stats import norm

from albot_core.errors import InputError
from albot_env.sim.batch_simulator import draw_key
from albot_env.sim.scenes import (
    CAMERA_STATE,
    SCENE_DRAWS,
    SCENES,
    SceneConfig,
    SceneConstants,
    recognise_scene,
    scene_at,
    start_camera,
)
from albot_env.sim.sensing import CAMERA_COUNTER
from albot_env.sim.sensors import choose_sensors
from albot_env.sim.simulator import Simulator
from albot_maps import load_world

BOUNDS = (-1.0, 2.0, 4.0, 5.5)
KEY = np.uint64(11)


def looks(scenes: SceneConstants, count: int, pose: tuple[float, float, float]) -> np.ndarray:
    camera = started_camera()
    return np.array(
        [recognise_scene(*pose, scenes, KEY, k * SCENE_DRAWS, k, camera) for k in range(count)]
    )


def started_camera() -> np.ndarray:
    camera = np.zeros(CAMERA_STATE, np.int64)
    start_camera(camera)
    return camera


def all_views(scenes: SceneConstants) -> list[int]:
    """The number of every view, from the middle of its place and sector."""
    return [
        scene_at(
            scenes.left + scenes.cell * (column + 0.5),
            scenes.bottom + scenes.cell * (row + 0.5),
            2 * math.pi * (sector + 0.5) / scenes.sectors,
            scenes,
        )
        for row in range(scenes.rows)
        for column in range(scenes.columns)
        for sector in range(scenes.sectors)
    ]


def test_views_are_numbered_row_by_row_from_the_lower_left() -> None:
    scenes = SceneConfig(cell=0.5, sectors=4).constants(BOUNDS)
    assert (scenes.columns, scenes.rows, scenes.scenes) == (10, 7, 280)
    assert all_views(scenes) == list(range(280))
    assert scene_at(-0.9, 2.1, -0.1, scenes) == 3
    assert scene_at(-0.9, 2.1, 2 * math.pi + 0.1, scenes) == 0
    assert scene_at(0.1, 3.1, 0.1, scenes) == (2 * 10 + 2) * 4
    assert scene_at(99.0, 99.0, 0.1, scenes) == 276


@pytest.mark.parametrize("sharing", [2, 3, 7])
def test_each_number_is_shared_by_as_many_views_as_asked_for(sharing: int) -> None:
    scenes = SceneConfig(sharing=sharing).constants((0.0, 0.0, 9.0, 7.0))
    views = all_views(scenes)
    shares = Counter(views)
    assert set(shares) == set(range(math.ceil(len(views) / sharing)))
    assert sharing - 1 <= min(shares.values()) <= max(shares.values()) == sharing
    for number in range(0, scenes.scenes, 5):
        places = [k // scenes.sectors for k, view in enumerate(views) if view == number]
        assert len(set(places)) == len(places)  # never two views of one place


@pytest.mark.parametrize("sharing", [2, 5])
def test_no_two_parts_of_the_world_look_alike(sharing: int) -> None:
    """The views that share a number with those along a way do not lie along another."""
    scenes = SceneConfig(sharing=sharing).constants((0.0, 0.0, 43.0, 13.0))
    views = all_views(scenes)
    others: dict[int, list[int]] = {}
    for view, number in enumerate(views):
        others.setdefault(number, []).append(view)
    for step in (scenes.sectors, scenes.columns * scenes.sectors):
        alike = 0
        for view, number in enumerate(views[: len(views) - step]):
            ahead = set(others[views[view + step]]) - {view + step}
            near = {other + way for other in others[number] for way in (step, -step)}
            alike += bool(ahead & (near - {view + step}))
        assert alike < 0.02 * len(views)


def test_the_numbers_are_the_world_s_not_the_run_s() -> None:
    scenes = SCENES["ideal"].constants(BOUNDS)
    for pose in ((0.3, 2.2, 0.5), (3.3, 4.9, -2.0)):
        seen = {
            recognise_scene(*pose, scenes, np.uint64(key), 6 * key, 0, started_camera())
            for key in range(50)
        }
        assert seen == {scene_at(*pose, scenes)}


def test_a_place_is_mistaken_for_its_neighbour_as_often_as_the_noise_makes_it() -> None:
    """A robot 0.2 m before the next place, with 0.15 m of noise; heading likewise."""
    config = SceneConfig(sectors=4, position_noise=0.15, heading_noise=0.2)
    scenes = config.constants((0.0, 0.0, 10.0, 10.0))
    heading = math.pi / 2 - 0.1
    seen = Counter(looks(scenes, 6000, (4.8, 4.5, heading)).tolist())
    east, turned = norm.sf(0.2 / 0.15), norm.sf(0.1 / 0.2)
    here = (4 * 10 + 4) * 4
    for dx, dt in ((0, 0), (1, 0), (0, 1), (1, 1)):
        share = (east if dx else 1 - east) * (turned if dt else 1 - turned)
        assert seen[here + 4 * dx + dt] / 6000 == pytest.approx(share, abs=0.02)


def test_scenes_are_missed_and_falsely_seen_at_the_rates_asked_for() -> None:
    config = SceneConfig(missed_rate=0.1, false_rate=0.2)
    scenes = config.constants((0.0, 0.0, 5.0, 5.0))
    pose = (2.5, 2.5, 0.4)
    seen = looks(scenes, 8000, pose)
    true = scene_at(*pose, scenes)
    assert (seen == -1).mean() == pytest.approx(0.1, abs=0.015)
    false = seen[(seen != -1) & (seen != true)]
    assert len(false) / 8000 == pytest.approx(0.9 * 0.2 * (1 - 1 / 200), abs=0.015)
    counts = np.bincount(false, minlength=200)
    assert counts[true] == 0 and len(counts) == 200
    # Each of the others as likely: chi-squared with 198 degrees of freedom, ± 4 sigma.
    others = np.delete(counts, true)
    chi = ((others - others.mean()) ** 2 / others.mean()).sum()
    assert abs(chi - 198) < 4 * math.sqrt(2 * 198)


def test_mistakes_come_at_random_times() -> None:
    scenes = SceneConfig(false_rate=0.2).constants((0.0, 0.0, 20.0, 20.0))
    wrong = looks(scenes, 5000, (2.5, 2.5, 0.4)) != scene_at(2.5, 2.5, 0.4, scenes)
    assert abs(np.corrcoef(wrong[1:], wrong[:-1])[0, 1]) < 0.06


def runs_of(flags: np.ndarray) -> np.ndarray:
    """The lengths of the runs of True."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], flags, [False])).astype(int)))
    return edges[1::2] - edges[::2]


def test_false_scenes_last_as_long_as_asked_for_at_the_same_share() -> None:
    config = SceneConfig(false_rate=0.1, false_shortest=1.0, false_longest=3.0)
    scenes = config.constants((0.0, 0.0, 40.0, 40.0))
    pose = (2.5, 2.5, 0.4)
    seen = looks(scenes, 60_000, pose)
    is_false = seen != scene_at(*pose, scenes)
    # Some 300 durations of 20 readings in the mean: the share has a deviation of 0.006.
    assert is_false.mean() == pytest.approx(0.1, abs=0.02)
    edges = np.flatnonzero(np.diff(seen, prepend=-2, append=-2))
    durations = np.diff(edges)[is_false[edges[:-1]]]
    assert durations.min() == 10 and durations.max() == 30
    assert durations.mean() == pytest.approx(20.0, abs=1.5)
    assert (runs_of(is_false) >= 10).all()


def test_a_false_scene_may_be_missed_and_still_lasts() -> None:
    config = SceneConfig(missed_rate=0.3, false_rate=0.5, false_shortest=2.0, false_longest=2.0)
    scenes = config.constants((0.0, 0.0, 40.0, 40.0))
    seen = looks(scenes, 6000, (2.5, 2.5, 0.4))
    assert (seen == -1).mean() == pytest.approx(0.3, abs=0.03)
    true = scene_at(2.5, 2.5, 0.4, scenes)
    numbers = seen[(seen != -1) & (seen != true)]
    assert np.median(runs_of(np.diff(numbers, prepend=-2) == 0)) > 5


def test_familiar_scenes_are_those_passed_evenly_over_the_past() -> None:
    """A robot passes scene after scene; what it falsely recognises lies behind it."""
    config = SceneConfig(sectors=1, false_rate=0.3, familiar=True)
    scenes = config.constants((0.0, 0.0, 2000.0, 1.0))
    camera, count = started_camera(), 20_000
    true = np.arange(count) // 10
    seen = np.array(
        [
            recognise_scene(x + 0.5, 0.5, 0.0, scenes, KEY, k * SCENE_DRAWS, k, camera)
            for k, x in enumerate(true)
        ]
    )
    is_false = seen != true
    assert is_false.mean() == pytest.approx(0.3, abs=0.02)
    assert (seen[is_false] < true[is_false]).all()
    ages = (seen[is_false] / true[is_false])[true[is_false] > 100]
    assert np.histogram(ages, 4, (0, 1))[0] == pytest.approx([len(ages) / 4] * 4, rel=0.12)


def test_nothing_is_familiar_at_the_first_look() -> None:
    scenes = SceneConfig(false_rate=1.0, familiar=True).constants(BOUNDS)
    pose, camera = (0.3, 2.2, 0.5), started_camera()
    first = recognise_scene(*pose, scenes, KEY, 0, 0, camera)
    assert first == scene_at(*pose, scenes)


@pytest.mark.parametrize("name", SCENES)
def test_presets_number_the_paper_s_floor(name: str) -> None:
    scenes = SCENES[name].constants((0.0, 0.0, 43.0, 13.0))
    seen = looks(scenes, 300, (20.0, 6.0, 1.0))
    assert ((seen >= -1) & (seen < scenes.scenes)).all()


@pytest.mark.parametrize(
    ("field", "value"),
    [("cell", 0.0), ("sectors", 0), ("sharing", 0), ("false_rate", 1.1), ("heading_noise", -1.0)],
)
def test_impossible_scenes_are_refused(field: str, value: float) -> None:
    with pytest.raises(InputError, match=f"SceneConfig.{field}: expected"):
        SceneConfig(**{field: value})


def test_false_scenes_do_not_end_before_they_may() -> None:
    with pytest.raises(InputError, match=r"SceneConfig.false_longest: expected at least"):
        SceneConfig(false_shortest=2.0, false_longest=1.0)


def test_each_look_of_a_robot_draws_numbers_of_its_own() -> None:
    """Those of one look after another would make the mistakes of a look follow from the last's."""
    world = load_world("square-loop")
    sensors = choose_sensors(laser="none", sonar="none", scenes="ambiguous")
    simulator = Simulator(world, sensors=sensors)
    reading = simulator.reset(np.random.default_rng(4))
    constants = SCENES["ambiguous"].constants(world.bounds)
    key = np.uint64(draw_key(np.random.default_rng(4)))
    camera = started_camera()
    seen, expected = [], []
    for number in range(40):
        seen.append(-1 if reading.scene is None else reading.scene)
        counter = CAMERA_COUNTER + number * SCENE_DRAWS
        pose = simulator.pose
        expected.append(recognise_scene(*pose, constants, key, counter, number, camera))
        reading = simulator.step(0.0, 0.5)
    assert seen == expected

"""Probes: robots are led as the scene says, changes happen, and choices are told rightly."""

from __future__ import annotations

import itertools
import math
import re
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from albot_core.errors import InputError
from albot_env.tasks.core.observation import ObservationConfig
from albot_env.tasks.core.parts.truth import TRUE_HOME
from albot_env.tasks.probe.scenes import NO_CHOICE, Scene
from albot_env.tasks.probe.task import PROBES, ProbeConfig
from albot_maps import World, load_world
from albot_maps.geodesic import DistanceField

DETOUR, SUNBURST = "Albot/Probe-Detour-v0", "Albot/Probe-Sunburst-v0"
RECTANGLE, TRIANGLE = "Albot/Probe-Rectangle-v0", "Albot/Probe-TriangleCompletion-v0"
POOL = "Albot/Probe-HiddenGoal-v0"
SCENES = {name: task.scene for name, task in PROBES.items()}
WITH_CHOICES = [name for name, scene in SCENES.items() if scene.choices]
AHEAD = np.array([1.0, 0.1, -1.0], np.float32)


def worlds_of(scene: Scene) -> dict[str, World]:
    """The worlds in which the robot is to come home, by trial."""
    return {name: load_world(trial.world or scene.world) for name, trial in scene.trials.items()}


@pytest.mark.parametrize("name", PROBES)
def test_a_scene_fits_its_worlds(name: str) -> None:
    """The same home, the same bounds, tours that exist, and right answers that can be given."""
    scene = SCENES[name]
    given = load_world(scene.world)
    assert gymnasium.spec(name).kwargs["world"] == scene.world
    assert [trial.tour for trial in scene.trials.values()] == (
        list(given.tours) if name == TRIANGLE else ["out"] * len(scene.trials)
    )
    for trial, world in worlds_of(scene).items():
        assert np.array_equal(world.starts, given.starts)
        assert world.bounds == given.bounds
        assert [room.name for room in world.rooms] == [room.name for room in given.rooms]
        assert set(scene.trials[trial].right) <= scene.choices.keys()
        for point in scene.choices.values():
            assert world.reaches(np.array(point)), point


@pytest.mark.parametrize("name", [DETOUR, SUNBURST])
def test_the_right_choice_is_on_the_shortest_way_home(name: str) -> None:
    """The way that the changed world's file calls the answer is as short as any, and shorter by a
    quarter than before the change through nothing but the right choice."""
    scene = SCENES[name]
    ((trial, world),) = worlds_of(scene).items()
    home = world.starts[0, :2]
    begin = load_world(scene.world).tours["out"][-1]
    field = DistanceField(world.walls, world.robot_radius, home)
    way = np.concatenate((begin[np.newaxis], field.path(begin)))
    points = np.concatenate([np.linspace(a, b, 200) for a, b in itertools.pairwise(way)])
    passed = [choice for point in points if (choice := scene.chosen(point)) != NO_CHOICE]
    assert set(passed) == set(scene.trials[trial].right)
    answer = world.tours["answer"]
    told = np.hypot(*np.diff(answer, axis=0).T).sum() + np.hypot(*(answer[-1] - begin))
    assert field.distance(begin) == pytest.approx(told, rel=0.15)


def test_the_other_way_round_the_barrier_is_much_longer() -> None:
    scene = SCENES[DETOUR]
    world = load_world("probe-detour-shut")
    home, begin = world.starts[0, :2], load_world(scene.world).tours["out"][-1]
    lengths = {}
    for choice, point in scene.choices.items():
        field = DistanceField(world.walls, world.robot_radius, np.array(point))
        lengths[choice] = field.distance(begin) + field.distance(home)
    assert lengths["long way"] > 1.4 * lengths["short way"]


def test_a_tour_that_a_robot_cannot_follow_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    """Here it has no time for it."""
    monkeypatch.setattr("albot_env.tasks.probe.task._patience", lambda leg: 3)
    env = gymnasium.make(DETOUR, mapper="none")
    with pytest.raises(InputError, match=r"probe-detour: expected a tour that the robot can foll"):
        env.reset(seed=1)
    env.close()


@pytest.mark.parametrize("name", PROBES)
def test_the_robot_is_led_along_the_tour_and_carried(name: str) -> None:
    scene = SCENES[name]
    given = load_world(scene.world)
    for trial, its in list(scene.trials.items())[::5] or scene.trials.items():
        env = gymnasium.make(name, mapper="none", config=ProbeConfig(trial=trial))
        _, info = env.reset(seed=3)
        tour = given.tours[its.tour]
        assert info["trial"] == trial
        assert info["choice"] == NO_CHOICE
        assert info["outward_length"] == pytest.approx(
            np.hypot(*np.diff(tour, axis=0).T).sum(), rel=0.08, abs=0.3
        )
        assert not info["outward_cut_short"]
        end = tour[-1] if its.at is None else its.at
        assert np.hypot(*(info["pose"][:2] - end)) < (0.35 if its.at is None else 1e-9)
        if its.heading is not None:
            assert info["pose"][2] == its.heading
        assert info["world"] == (its.world or scene.world)
        assert np.array_equal(info["start"], given.starts[0])
        env.close()


def test_triangles_close_as_their_names_say() -> None:
    """By the law of cosines; the robot stops within 0.15 m of each corner."""
    for trial in list(SCENES[TRIANGLE].trials)[::4]:
        env = gymnasium.make(TRIANGLE, mapper="none", config=ProbeConfig(trial=trial))
        _, info = env.reset(seed=1)
        first, turn, second = map(int, re.findall(r"\d+", trial))
        inside = math.radians(180 - turn)
        third = math.sqrt(first**2 + second**2 - 2 * first * second * math.cos(inside))
        assert info["distance_home"] == pytest.approx(third, abs=0.4)
        turned = math.degrees(info["pose"][2])
        assert turned == pytest.approx(turn if "left" in trial else -turn, abs=8)
        ranges = env.unwrapped._robot.true_ranges  # type: ignore[attr-defined]
        assert np.isinf(ranges).all()  # No wall within reach: path integration alone.
        env.close()


def test_carried_robots_are_turned_by_chance_only_where_the_scene_says_so() -> None:
    headings = {}
    for name in (RECTANGLE, POOL):
        trial = next(iter(SCENES[name].trials))
        env = gymnasium.make(name, mapper="none", config=ProbeConfig(trial=trial))
        headings[name] = {float(env.reset(seed=seed)[1]["pose"][2]) for seed in range(4)}
        env.close()
    assert len(headings[RECTANGLE]) == 4
    assert len(headings[POOL]) == 1


@pytest.mark.parametrize("name", WITH_CHOICES)
def test_a_position_is_the_choice_whose_point_it_is_at(name: str) -> None:
    scene = SCENES[name]
    for choice, point in scene.choices.items():
        for angle in np.linspace(0, 2 * math.pi, 9):
            near = np.array(point) + 0.7 * np.array((math.cos(angle), math.sin(angle)))
            assert scene.chosen(near) == choice
    assert scene.chosen(np.array((-30.0, 0.0))) == NO_CHOICE


def test_the_first_choice_counts_or_the_place_at_the_end(monkeypatch: pytest.MonkeyPatch) -> None:
    for name, kept in ((DETOUR, True), (RECTANGLE, False)):
        env = gymnasium.make(name, mapper="none")
        env.reset(seed=1)
        scene, task = SCENES[name], env.unwrapped._robot  # type: ignore[attr-defined]
        points = list(scene.choices.items())
        told = []
        for _, point in (*points[:2], ("nowhere", (-30.0, 0.0))):
            task._state.poses[0, :2] = point
            task._compute_rewards(np.array([0]))
            told.append(task.facts["choice"][0])
        first, second = points[0][0], points[1][0]
        assert told == ([first] * 3 if kept else [first, second, NO_CHOICE])
        env.close()


@pytest.mark.parametrize("name", PROBES)
def test_a_probe_keeps_the_contract(name: str) -> None:
    """Gymnasium's checker; twins; batch and single; branched; the revealed twin."""
    settings: dict[str, Any] = {"mapper": "albot1", "journeys": 2}
    env, other = gymnasium.make(name, **settings), gymnasium.make(name, **settings)
    check_env(env.unwrapped, skip_render_check=True)
    batch = gymnasium.make_vec(name, num_envs=3, **settings)
    revealed = gymnasium.make(f"{name[:-3]}Revealed-v0", **settings)
    seen, info = env.reset(seed=5)
    rows, infos = batch.reset(seed=[4, 5, 6])
    shown, _ = revealed.reset(seed=5)
    state = None
    for step in range(20):
        np.testing.assert_array_equal(rows[1], seen)
        for key in ("trial", "choice", "world", "distance_home"):
            assert infos[key][1] == info[key]
        true_home = revealed.get_wrapper_attr("observation_config").decode(TRUE_HOME, shown)
        away = np.hypot(*(info["start"] - info["pose"])[:2])
        assert np.hypot(*true_home) == pytest.approx(away, abs=1e-3)
        if step == 10:
            state = env.unwrapped.get_state()  # type: ignore[attr-defined]
        seen, *_, info = env.step(AHEAD)
        rows, _, _, _, infos = batch.step(np.stack([AHEAD] * 3))
        shown, *_ = revealed.step(AHEAD)
    other.reset(seed=8)
    other.unwrapped.set_state(state)  # type: ignore[attr-defined]
    for _ in range(10):
        again, *_, there = other.step(AHEAD)
    np.testing.assert_array_equal(again, seen)
    assert (there["trial"], there["choice"]) == (info["trial"], info["choice"])
    batch.close()


def test_numbered_tours_lead_through_the_trials_in_turn() -> None:
    env = gymnasium.make(RECTANGLE, mapper="none", journeys=3)
    assert {env.reset(seed=seed)[1]["trial"] for seed in range(20)} == set(SCENES[RECTANGLE].trials)
    env.close()


@pytest.mark.parametrize(
    ("settings", "expected"),
    [
        ({"config": ProbeConfig(trial="door shut")}, r"config.trial: expected one of doorway shut"),
        ({"journeys": -1}, "journeys"),
        (
            {"config": ProbeConfig(observations=ObservationConfig(parts=("laser", "way")))},
            "hints=True, found way",
        ),
        ({"mapper": "albot2"}, "albot2"),
    ],
)
def test_what_a_probe_does_not_have_is_refused(settings: dict[str, Any], expected: str) -> None:
    with pytest.raises(InputError, match=expected):
        gymnasium.make(DETOUR, **settings)


def test_no_other_world_and_no_other_start_is_accepted() -> None:
    env = gymnasium.make(DETOUR, world="square-loop", mapper="none")
    with pytest.raises(InputError, match=r"world: expected probe-detour, found square-loop"):
        env.reset(seed=1)
    env = gymnasium.make(DETOUR, mapper="none")
    with pytest.raises(InputError, match=r"options.start: expected the scene's own start"):
        env.reset(seed=1, options={"start": (5.0, 5.0, 0.0)})
    env.reset(seed=1, options={"start": 0})


def test_a_robot_too_wide_for_the_scene_is_refused() -> None:
    from albot_core.robot import RobotConfig

    with pytest.raises(InputError):
        gymnasium.make(DETOUR, robot=RobotConfig(radius=0.75, wheel_base=0.6), mapper="none")

"""Stress runs: which episodes there are; whatever is broken is found, and shown by `play`."""

from __future__ import annotations

import dataclasses
import re
import shlex
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from albot_agents.registry import EXPLORE, agent_names, find_agent
from albot_cli.main import main
from albot_core.errors import InputError
from albot_core.mappers.registry import mapper_config, mapper_spec
from albot_core.maps.layers import MapSnapshot, PlaceNode, SegmentsLayer
from albot_core.robot import ROBOTS
from albot_env.recording.reader import EpisodeReader
from albot_env.tasks.core import single
from albot_env.tasks.core.driving import DrivingTask
from albot_env.tasks.core.vector import VectorEnv
from albot_env.tasks.explore.env import ExploreVectorEnv
from albot_maps import World, load_world, load_worlds
from albot_maps.generators.spec import KINDS
from albot_stress.campaign import Campaign
from albot_stress.episodes import (
    Episode,
    Outcome,
    Violation,
    plan_jobs,
)
from albot_stress.running import Checks, run_episode, run_job


def plan(spec: str, count: int = 3, first: int = 0, agents: tuple[str, ...] = ("random",)):
    campaign = Campaign(worlds=(spec,), agents=agents, count=count, seed=first, steps=20)
    campaign.check()
    return campaign.episodes()


def test_a_kind_stands_for_worlds_whose_seeds_count_up():
    episodes = plan("random:maze", first=7)
    assert [(each.world, each.seed) for each in episodes] == [
        ("random:maze:7", 7),
        ("random:maze:8", 8),
        ("random:maze:9", 9),
    ]


def test_parameters_come_after_the_seed():
    worlds = [each.world for each in plan("random:office?rooms=8&clutter=0", count=2)]
    assert worlds == ["random:office:0?rooms=8&clutter=0", "random:office:1?rooms=8&clutter=0"]


def test_random_alone_stands_for_all_kinds_in_turn():
    worlds = [each.world for each in plan("random", count=8, first=5)]
    assert worlds == [f"random:{kind}:5" for kind in KINDS] + [
        f"random:{kind}:6" for kind in KINDS[:2]
    ]


@pytest.mark.parametrize("spec", ["square-loop", "random:office:42?rooms=6"])
def test_one_world_is_run_with_several_seeds(spec: str):
    assert [(each.world, each.seed) for each in plan(spec, first=2)] == [
        (spec, 2),
        (spec, 3),
        (spec, 4),
    ]


def test_every_agent_drives_in_every_world():
    episodes = plan("square-loop", count=2, agents=("gap-explorer", "random"))
    assert [(each.seed, each.agent) for each in episodes] == [
        (0, "gap-explorer"),
        (0, "random"),
        (1, "gap-explorer"),
        (1, "random"),
    ]


@pytest.mark.parametrize(
    ("spec", "found"),
    [
        ("random:ofice", "did you mean office"),
        ("random:office?room=8", "did you mean rooms"),
        ("random:office?rooms=200&width=8", "random:office:0"),
        ("random?rooms=8", "after a kind"),
        ("random:", "one of the kinds"),
        ("office-rong", "did you mean office-ring"),
    ],
)
def test_worlds_that_are_none(spec: str, found: str):
    with pytest.raises(InputError, match=found):
        plan(spec)


def test_seeds_beyond_the_last_are_refused():
    with pytest.raises(InputError, match="seed"):
        plan("random:office", first=2**64 - 2)


def test_a_violation_names_the_command_that_shows_it():
    episode = Episode(
        world="random:office:3?rooms=8&clutter=0", agent="random", mapper="none", seed=3, steps=20
    )
    command = Violation(episode=episode, step=7, what="").command
    assert shlex.split(command) == [
        "albot", "play", "--world", "random:office:3?rooms=8&clutter=0", "--agent", "random",
        "--mapper", "none", "--seed", "3", "--steps", "7",
    ]  # fmt: skip
    tuned = dataclasses.replace(episode, mapper_config_file=Path("my thresholds.yaml"))
    assert "--mapper-config 'my thresholds.yaml'" in tuned.command(7)
    at_reset = Violation(episode=episode, step=0, what="").command
    assert at_reset.endswith("--steps 1")


SOUND = Episode(world="square-loop", agent="random", mapper="none", seed=3, steps=30)
Step = tuple[Any, Any, Any, Any, dict[str, Any]]


def mapper_for(agent: str, usual: str = "none") -> str:
    """The mapper with which an agent can act: a trained one sees what its mapper shows."""
    entry = find_agent(agent)
    return usual if entry.file is None else entry.mapper


def run(episode: Episode = SOUND) -> Outcome:
    return run_episode(episode, checks=Checks(beams=1.0))


@pytest.mark.parametrize("agent", agent_names(EXPLORE))
@pytest.mark.parametrize("kind", KINDS)
def test_nothing_is_wrong_in_random_worlds(kind: str, agent: str):
    world, mapper = f"random:{kind}:1", mapper_for(agent)
    episode = dataclasses.replace(SOUND, world=world, agent=agent, mapper=mapper)
    assert run(episode) == Outcome(episode=episode, steps=30, violations=())


@pytest.mark.parametrize("robot", ROBOTS)
def test_nor_with_any_robot(robot: str):
    world = "random:apartment:1?people=3&boxes=4&doors=2"
    episode = dataclasses.replace(SOUND, world=world, robot=robot, agent="gap-explorer", steps=60)
    assert run(episode) == Outcome(episode=episode, steps=60, violations=())
    assert f"--robot {robot}" in episode.command(3)


@pytest.mark.parametrize("agent", agent_names(EXPLORE))
def test_nor_where_things_move(agent: str):
    world = "random:apartment:1?people=3&boxes=4&doors=2"
    mapper = mapper_for(agent)
    episode = dataclasses.replace(SOUND, world=world, agent=agent, mapper=mapper, steps=60)
    assert run(episode) == Outcome(episode=episode, steps=60, violations=())


def test_a_thing_that_sensors_miss_is_found(monkeypatch: pytest.MonkeyPatch):
    """As if the robot's senses met its things where they were before."""
    whole, first = DrivingTask.obstacle_outlines, []

    def obstacles(self: DrivingTask) -> tuple[np.ndarray, np.ndarray]:
        outlines, rows = whole.fget(self)
        first.append(outlines.copy())
        return first[0], rows

    monkeypatch.setattr(DrivingTask, "obstacle_outlines", property(obstacles))
    world = "random:apartment:1?people=3&boxes=4&doors=2"
    [violation, *_] = run(dataclasses.replace(SOUND, world=world, steps=200)).violations
    assert re.search(r"(beam|sonar) \d+ (sees|hears)", violation.what)


def test_a_box_in_a_wall_is_found(monkeypatch: pytest.MonkeyPatch):
    """As if its one box had been pushed aside by 20 m."""
    whole = DrivingTask.obstacle_outlines

    def obstacles(self: DrivingTask) -> tuple[np.ndarray, np.ndarray]:
        outlines, rows = whole.fget(self)
        found = outlines.copy()
        found[2:6] += 20.0 * (len(pushes) > 5)
        pushes.append(1)
        return found, rows

    pushes: list[int] = []
    monkeypatch.setattr(DrivingTask, "obstacle_outlines", property(obstacles))
    world = "random:apartment:1?people=3&boxes=1&doors=2"
    [violation, *_] = run(dataclasses.replace(SOUND, world=world)).violations
    assert violation.what.startswith("box 0 went through wall")


@pytest.mark.parametrize("mapper", ["albot1", "odometry"])
def test_nor_with_a_mapper_inside(mapper: str):
    assert run(dataclasses.replace(SOUND, mapper=mapper)).violations == ()


def test_the_mapper_inside_has_the_thresholds_that_were_asked_for():
    spec = mapper_spec("odometry")
    episode = dataclasses.replace(
        SOUND, mapper="odometry", mapper_config=mapper_config(spec, {"capacity": 7})
    )
    assert run(episode).violations == ()
    (found,) = run(dataclasses.replace(episode, mapper="albot1")).violations
    assert "Albot1Config" in found.what


def test_episodes_run_together_as_each_runs_alone(monkeypatch: pytest.MonkeyPatch):
    """Poses and violations, in worlds with movables and without; one episode is stopped."""
    seen: dict[str, list[np.ndarray]] = {}
    whole = ExploreVectorEnv.step

    def step(self: ExploreVectorEnv, actions: Any) -> Step:
        result = whole(self, actions)
        for row, world in enumerate(result[4]["world"]):
            seen.setdefault(world, []).append(result[4]["pose"][row].copy())
            if world == load_world("random:maze:3").name and result[4]["time"][row] > 1.55:
                result[1][row] += 1
        return result

    monkeypatch.setattr(ExploreVectorEnv, "step", step)
    worlds = ("random:apartment:1?people=3&boxes=4&doors=2", "random:maze:3", "square-loop")
    episodes = [
        dataclasses.replace(SOUND, world=world, seed=seed, agent="gap-explorer")
        for seed, world in enumerate(worlds)
    ]
    together = run_job((tuple(episodes),), lambda _: None)
    poses, seen = seen, {}
    assert together == [run(episode) for episode in episodes]
    assert [outcome.steps for outcome in together] == [30, 16, 30]
    for world, alone in seen.items():
        assert np.array_equal(poses[world][: len(alone)], alone)


def test_jobs_hold_the_same_worlds_for_all_agents():
    """Agents whose environments are alike are stepped in one batch, others in one of their own."""
    agents = ("gap-explorer", "onward-follower", "random")
    episodes = plan("square-loop", count=5, agents=agents)
    jobs = plan_jobs(episodes, processes=2)
    named = [[[(each.seed, each.agent) for each in group] for group in job] for job in jobs]
    alike = [[(seed, agents[0]), (seed, agents[2])] for seed in range(5)]
    other = [(seed, agents[1]) for seed in range(5)]
    assert named == [
        [[*alike[0], *alike[1], *alike[2]], other[:3]],
        [[*alike[3], *alike[4]], other[3:]],
    ]


def test_each_step_is_told_before_it_is_taken():
    counts: list[int] = []
    run_episode(dataclasses.replace(SOUND, steps=3), counts.append)
    assert counts[:4] == [0, 1, 2, 3]


def no_number(step: Step) -> Step:
    return *step[:4], {**step[4], "position_error": np.full(1, np.nan)}


def no_observation(step: Step) -> Step:
    return step[0] + np.float32(3), *step[1:]


def wrong_sum(step: Step) -> Step:
    return step[0], step[1] + 1, *step[2:]


def lost_key(step: Step) -> Step:
    return *step[:4], {key: value for key, value in step[4].items() if key != "room"}


def far_away(step: Step) -> Step:
    return *step[:4], {**step[4], "pose": step[4]["pose"] + (20, 0, 0)}


def in_a_wall(step: Step) -> Step:
    poses = step[4]["pose"].copy()
    walls = load_world(SOUND.world).walls
    poses[:, 0] = walls[:, [0, 2]].min() + 0.1
    return *step[:4], {**step[4], "pose": poses}


def dying(step: Step) -> Step:
    raise RuntimeError("the wheels\nfell off")


@pytest.mark.parametrize(
    ("broken", "invariant", "found"),
    [
        (no_number, "info", "info position_error holds nan"),
        (no_observation, "observation", "the observation lies outside its space"),
        (wrong_sum, "reward", r"the reward is .*, its terms add up to"),
        (lost_key, "info", "info lacks the key room of the reset"),
        (far_away, "body", "went through wall"),
        (in_a_wall, "body", "deep in wall"),
        (dying, "error", r"RuntimeError: the wheels fell off \(test_running.py:\d+\)"),
    ],
)
def test_what_is_broken_is_found_at_its_step(
    broken: Callable[[Step], Step], invariant: str, found: str, monkeypatch: pytest.MonkeyPatch
):
    whole = ExploreVectorEnv.step

    def step(self: ExploreVectorEnv, actions: Any) -> Step:
        result = whole(self, actions)
        return broken(result) if round(10 * result[4]["time"][0]) == 8 else result

    monkeypatch.setattr(ExploreVectorEnv, "step", step)
    outcome = run()
    assert outcome.violations[0].invariant == invariant
    assert outcome.steps == 8
    assert {violation.step for violation in outcome.violations} == {8}
    assert re.search(found, outcome.violations[0].what)
    assert "\n" not in outcome.violations[0].what


def test_a_world_that_cannot_be_made_is_found():
    outcome = run(dataclasses.replace(SOUND, world="random:office:5?rooms=200&width=8"))
    assert outcome.steps == 0
    assert outcome.violations[0].what.startswith("InputError: random:office:5?")


def lacking(world: World) -> World:
    """A world without its inner walls, for the environment alone."""
    middle = world.walls.reshape(-1, 2, 2).mean(axis=1)
    x_min, y_min, x_max, y_max = world.bounds
    outer = np.isin(middle[:, 0], (x_min, x_max)) | np.isin(middle[:, 1], (y_min, y_max))
    return dataclasses.replace(world, walls=world.walls[outer], glass=world.glass[outer])


def test_a_wall_that_is_not_there_is_seen_through_and_play_shows_the_same(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    whole = VectorEnv.__init__

    def without_walls(self: VectorEnv, num_envs: int, world: Any, **settings: Any) -> None:
        whole(self, num_envs, [lacking(each) for each in world], **settings)

    monkeypatch.setattr(VectorEnv, "__init__", without_walls)
    monkeypatch.setattr(
        single, "load_worlds", lambda spec, _: load_worlds(lacking(load_world(spec)))
    )
    monkeypatch.chdir(tmp_path)
    [violation, *_] = run().violations
    seen = re.search(r"beam (\d+) sees (\S+) m, through a surface at (\S+) m", violation.what)
    assert seen is not None, violation.what
    shown = played(violation.command, monkeypatch)
    beam, length = int(seen[1]), float(seen[2])
    assert abs(shown[violation.step].reading.laser.ranges[beam] - length) < 0.002
    capsys.readouterr()


@pytest.mark.parametrize("agent", agent_names(EXPLORE))
def test_play_runs_the_same_episode(
    agent: str,
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
):
    """The poses of an episode that stops in the middle are those that `play` records."""
    mapper = mapper_for(agent, "odometry")
    episode = dataclasses.replace(SOUND, world="random:office:4", agent=agent, mapper=mapper)
    poses: list[np.ndarray] = []
    whole = ExploreVectorEnv.step

    def step(self: ExploreVectorEnv, actions: Any) -> Step:
        result = whole(self, actions)
        poses.append(result[4]["pose"][0])
        return wrong_sum(result) if len(poses) == 25 else result

    with monkeypatch.context() as breaking:
        breaking.setattr(ExploreVectorEnv, "step", step)
        [violation] = run(episode).violations
    monkeypatch.chdir(tmp_path)
    shown = played(violation.command, monkeypatch)
    assert len(shown) == 26
    assert all(np.array_equal(a.pose, b) for a, b in zip(shown[1:], poses, strict=True))
    # Who drives home is there.
    moved = np.hypot(*(poses[-1] - poses[0])[:2]) + abs(poses[-1] - poses[0])[2]
    assert moved > 0.1 or agent not in ("gap-explorer", "random")
    capsys.readouterr()


def played(command: str, monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """What `albot play` records when called by this command."""
    monkeypatch.setattr(sys, "argv", [*shlex.split(command), "--json"])
    with pytest.raises(SystemExit) as ended:
        main()
    assert not ended.value.code
    return list(EpisodeReader(Path("episode.mcap")).moments())


MAPPED = dataclasses.replace(SOUND, world="random:office:3", mapper="albot1", agent="gap-explorer")
ALL = Checks(beams=1.0, maps_every=5, replays=1.0)


def found_in(episode: Episode, steps: int = 30) -> set[str]:
    """The invariants that an episode violates with all checks."""
    outcome = run_episode(dataclasses.replace(episode, steps=steps), checks=ALL)
    return {violation.invariant for violation in outcome.violations}


@pytest.mark.parametrize("mapper", ["albot1", "odometry", "none"])
def test_maps_beliefs_and_replays_are_sound(mapper: str):
    assert found_in(dataclasses.replace(MAPPED, mapper=mapper), 60) == set()


def test_faults_do_not_count_as_wrong_readings():
    faults = "laser-dropout:at=0.1m,lasting=2s"
    assert found_in(dataclasses.replace(MAPPED, mapper="none", faults=faults), 60) == set()


def test_a_mapper_that_looks_at_the_truth_is_found(monkeypatch: pytest.MonkeyPatch):
    """Its estimates are drawn towards the true pose by a hair."""
    whole = DrivingTask._hear

    def hear(self: DrivingTask, rows: np.ndarray, readings: Any) -> None:
        whole(self, rows, readings)
        self._state.beliefs[rows, 0] += 1e-12 * self._state.poses[rows, 0]

    monkeypatch.setattr(DrivingTask, "_hear", hear)
    assert "beliefs" in found_in(dataclasses.replace(MAPPED, mapper="none"))


def test_a_map_with_a_place_that_nobody_enters_is_found(monkeypatch: pytest.MonkeyPatch):
    whole = VectorEnv.snapshot

    def snapshot(self: VectorEnv, environment: int) -> MapSnapshot:
        alone = PlaceNode(id=999, label="", pose=np.zeros(3), middle=np.zeros(2))
        graph = whole(self, environment).place_graph
        return MapSnapshot(layers=(dataclasses.replace(graph, nodes=(*graph.nodes, alone)),))

    monkeypatch.setattr(VectorEnv, "snapshot", snapshot)
    assert found_in(MAPPED) == {"places"}


def test_a_map_that_is_not_finite_is_found(monkeypatch: pytest.MonkeyPatch):
    surfaces = SegmentsLayer(segments=np.full((1, 4), np.inf))
    monkeypatch.setattr(
        VectorEnv, "snapshot", lambda self, environment: MapSnapshot(layers=(surfaces,))
    )
    assert found_in(MAPPED) == {"map"}


def test_an_environment_that_remembers_earlier_ones_is_found(monkeypatch: pytest.MonkeyPatch):
    """Each robot that is made has other noise than the one before: no recording can be replayed."""
    whole, made = DrivingTask._set_out, []

    def set_out(self: DrivingTask, row: int, world: World, start: Any, key: int) -> None:
        made.append(row)
        whole(self, row, world, start, key + len(made))

    monkeypatch.setattr(DrivingTask, "_set_out", set_out)
    assert found_in(dataclasses.replace(MAPPED, mapper="none")) == {"replay"}

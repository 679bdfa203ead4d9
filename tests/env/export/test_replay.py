"""An episode led through its environment again: the same to the last bit, or an error."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest

from albot_core.errors import InputError
from albot_env.export.replay import replay
from albot_env.export.transitions import exact_action
from albot_env.recording.reader import EpisodeReader
from albot_env.recording.writer import EpisodeWriter
from albot_env.tasks.explore.env import ExploreEnv
from albot_maps import load_world
from tests.env import quick
from tests.env.export.conftest import Recorded, check_same, record_episode

Record = Callable[..., Recorded]
EXPLORE = "Albot/Explore-v0"


def _replay(path: Path) -> Any:
    return replay(EpisodeReader(path), path.name)


@pytest.mark.parametrize(
    ("task", "settings"),
    [
        (EXPLORE, {"mapper": "odometry"}),
        (EXPLORE, {"observation": "dict", "action": "discrete", "odometer": "poor"}),
        ("Albot/Homing-v0", {"config": quick.STROLL}),
        ("Albot/HomingByMap-v0", {"config": quick.STROLL_BY_MAP, "observation": "dict"}),
        ("Albot/ExploreAndHome-v1", {"mapper": "none"}),
        ("Albot/PlaceRecognition-v0", {"config": quick.GLANCE, "journeys": 4}),
        ("Albot/Probe-Detour-v0", {"world": "probe-detour"}),
    ],
)
def test_what_is_made_again_is_what_was(task: str, settings: Any, record: Record) -> None:
    path, was = record(task, **settings)
    if not was["terminations"][-1]:
        assert was["truncations"][-1]
    check_same(_replay(path), was)


@pytest.fixture(scope="module")
def explored(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An episode of exploring."""
    return record_episode(tmp_path_factory.mktemp("explored"), EXPLORE, mapper="odometry")[0]


def _changed(path: Path, change: Callable[[Any, list[Any]], Any]) -> Path:
    """Write an episode whose header and moments were changed."""
    reader = EpisodeReader(path)
    header, moments = change(reader.header, list(reader.moments()))
    out = path.with_name("changed.mcap")
    writer = EpisodeWriter(out)
    writer.begin(header)
    for moment in moments:
        writer.add(moment)
    writer.close()
    return out


def _set(number: int, **fields: Any) -> Callable[[Any, list[Any]], Any]:
    def change(header: Any, moments: list[Any]) -> Any:
        made = {name: get(moments[number]) for name, get in fields.items()}
        moments[number] = replace(moments[number], **made)
        return header, moments

    return change


def _spec(**fields: Any) -> Callable[[Any, list[Any]], Any]:
    return lambda header, moments: (replace(header, spec={**header.spec, **fields}), moments)


def _kwargs(**fields: Any) -> Callable[[Any, list[Any]], Any]:
    return lambda header, moments: (
        replace(header, spec={**header.spec, "kwargs": {**header.spec["kwargs"], **fields}}),
        moments,
    )


def _reach(moment: Any) -> Any:
    scan = moment.reading.laser
    ranges = scan.ranges.copy()
    ranges[7] += 1e-9
    return replace(moment.reading, laser=replace(scan, ranges=ranges))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (_set(2, reward=lambda moment: np.nextafter(moment.reward, 9)), ("step 2", "reward")),
        (_set(4, pose=lambda moment: moment.pose + 1e-12), ("step 4", "pose")),
        (_set(3, facts=lambda moment: {**moment.facts, "coverage": 2}), ("facts.coverage 2",)),
        (_set(0, belief=lambda moment: moment.belief + 1), ("the reset", "belief")),
        (_set(5, reading=_reach), ("step 5", "laser[7]")),
        (_set(1, action=lambda moment: -moment.action), ("step 1",)),
        (_set(1, action=lambda moment: moment.action[:2]), ("step 1", "shape (2,)")),
        (_set(1, action=lambda _: None), ("step 1", "an action")),
        (lambda header, moments: (replace(header, seed=4), moments), ("the reset",)),
        (lambda header, moments: (replace(header, seed=None), moments), ("seed",)),
        (lambda header, moments: (replace(header, spec=None), moments), ("gymnasium.make",)),
        (lambda header, moments: (header, moments[:1]), ("at least one step",)),
        (_spec(id="Albot/Nowhere-v0"), ("spec.id", "Albot/Nowhere-v0")),
        (_spec(id="CartPole-v1", kwargs={}), ("spec.id", "an environment of albot")),
        (_spec(id="os:system"), ("spec.id", "os:system")),
        (_spec(kwargs=[1]), ("spec.kwargs",)),
        (_spec(max_episode_steps=3), ("spec.max_episode_steps", "6 steps or more")),
        (_spec(max_episode_steps="many"), ("spec.max_episode_steps", "many")),
        (_kwargs(world="nowhere"), ("spec.kwargs", "nowhere")),
        (_kwargs(colour="red"), ("spec.kwargs", "colour")),
        (_kwargs(mapper="antigravity:albot9"), ("spec.kwargs.mapper", "antigravity")),
        (_kwargs(config={"observations": {"laser_sectors": 10**10}}), ("spec.kwargs",)),
        (_kwargs(config={"observations": {"laser": {"beams": 10**10}}}), ("spec.kwargs",)),
    ],
)
def test_another_episode_is_one_clear_error(
    change: Any, words: tuple[str, ...], explored: Path
) -> None:
    changed = _changed(explored, change)
    with pytest.raises(InputError) as error:
        _replay(changed)
    for word in ("changed.mcap", *words):
        assert word in str(error.value)


def test_an_end_that_comes_sooner_is_a_difference(record: Record) -> None:
    path, was = record("Albot/Homing-v0", config=quick.STROLL, max_episode_steps=40)
    assert was["terminations"][-1]
    twice = _changed(path, lambda header, moments: (header, [*moments, moments[-1]]))
    with pytest.raises(InputError, match="another step as recorded, found the end"):
        _replay(twice)


def test_no_name_in_a_file_imports_a_module(explored: Path) -> None:
    spec = _spec(entry_point="antigravity:Env", additional_wrappers=[{"entry_point": "os:x"}])
    check = _replay(_changed(explored, spec))
    assert check.spec["entry_point"] == "albot_env.tasks.explore.env:ExploreEnv"
    assert check.spec["additional_wrappers"] == []


def test_an_episode_that_was_broken_off_counts_as_truncated(explored: Path) -> None:
    part = _replay(_changed(explored, lambda header, moments: (header, moments[:4])))
    assert part.truncations.tolist() == [False, False, True]
    assert part.spec["max_episode_steps"] == 6000


def test_the_time_limit_is_known_where_the_recorder_was_told(tmp_path: Path) -> None:
    env = gymnasium.make(EXPLORE, world="square-loop", mapper="none", max_episode_steps=3)
    inside: Any = env.unwrapped
    inside.spec, inside.recorder = env.spec, EpisodeWriter(tmp_path / "a.mcap")
    env.reset(seed=1)
    for _ in range(3):
        env.step(np.zeros(3, np.float32))
    env.close()
    assert _replay(tmp_path / "a.mcap").spec["max_episode_steps"] == 3


def test_an_environment_with_a_world_of_its_own_says_so(tmp_path: Path) -> None:
    env = ExploreEnv(load_world("square-loop"), mapper="none")
    env.recorder = EpisodeWriter(tmp_path / "a.mcap")
    env.reset(seed=1)
    env.step(np.zeros(3, np.float32))
    env.close()
    with pytest.raises(InputError, match=r"how its environment is made"):
        _replay(tmp_path / "a.mcap")


def test_actions_with_more_digits_than_their_space_are_kept(tmp_path: Path) -> None:
    env = gymnasium.make(EXPLORE, world="square-loop", mapper="none")
    inside: Any = env.unwrapped
    inside.recorder = EpisodeWriter(tmp_path / "a.mcap")
    env.reset(seed=1)
    given = [[0.1, 0.2, -1.0], [0.5, 0.5, 7.0]]
    for action in given:
        env.step(np.array(action))
    env.close()
    found = _replay(tmp_path / "a.mcap")
    assert (found.actions.dtype, found.actions.tolist()) == (np.float64, given)


def test_actions_in_the_type_of_their_space() -> None:
    spaces = gymnasium.spaces
    box, several = spaces.Box(-1, 1, (2,), np.float32), spaces.MultiDiscrete((3, 4))
    cases = [
        (box, np.array((0.1, -0.0), np.float32)),
        (several, np.array((2, 3))),
        (spaces.Discrete(7), np.int64(6)),
        (spaces.MultiBinary(3), np.array((0, 1, 1), np.int8)),
    ]
    for space, action in cases:
        recorded = json.loads(json.dumps(np.atleast_1d(np.array(action, np.float64)).tolist()))
        again = exact_action(space, recorded)
        assert again.dtype == space.dtype
        assert again.tobytes() == np.asarray(action, space.dtype).tobytes()
        assert space.contains(again if space.shape else again[()])
    assert exact_action(spaces.Discrete(7), [2.5]).dtype == np.float64

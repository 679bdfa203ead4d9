"""What every registered environment promises, whichever form and mapper."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.wrappers import FlattenObservation

import albot_env
from albot_core.errors import InputError
from albot_core.plain_data import to_plain
from albot_core.robot import ROBOTS
from albot_env.tasks.core.settings import check_seed
from albot_env.tasks.probe.task import PROBES
from albot_maps import World
from albot_maps.generators.spec import KINDS
from tests.env import quick

FORMS = ("flat", "dict")
MAPPERS = ("odometry", "albot1")
STEPS = 60


OF_PLACES = {"place", "exit", "way"}
"""The parts of observations that only tell of the places that a mapper knows: in one place, or
without such a mapper, they stand still."""
OF_TRAVEL = {"confidence"}
"""Home is certain, to a number's last digit, for the first metres, and many drive no more here;
test_observation.py sees what comes then."""


def _make(environment: str, **options: Any) -> gymnasium.Env[Any, Any]:
    settings = {"world": quick.LOOP, "mapper": "odometry", **quick.SETTINGS.get(environment, {})}
    settings |= options
    return gymnasium.make(environment, **settings)


def _rollout(env: gymnasium.Env[Any, Any], seed: int, steps: int = STEPS) -> list[Any]:
    rng = np.random.default_rng(3)
    seen: list[Any] = [env.reset(seed=seed)]
    assert env.spec is not None
    actions = quick.drawn_actions(env.spec.id, rng, steps)
    seen.extend(env.step(action) for action in actions)
    return seen


def _arrays(value: Any) -> list[np.ndarray]:
    """All arrays inside an observation or an info."""
    if isinstance(value, np.ndarray):
        return [value]
    if isinstance(value, dict):
        return [array for item in value.values() for array in _arrays(item)]
    if isinstance(value, tuple | list):
        return [array for item in value for array in _arrays(item)]
    return []


def _same(one: Any, other: Any) -> bool:
    """Whether two outcomes are the same to the last bit."""
    if isinstance(one, np.ndarray):
        return one.dtype == other.dtype and one.tobytes() == other.tobytes()
    if isinstance(one, dict):
        return one.keys() == other.keys() and all(_same(one[k], other[k]) for k in one)
    if isinstance(one, tuple | list):
        return len(one) == len(other) and all(map(_same, one, other))
    return bool(one == other)


def test_every_task_is_registered() -> None:
    folders = (Path(albot_env.__file__).parent / "tasks").glob("*/env.py")
    assert {*quick.IDS, *PROBES} == {
        name for name in gymnasium.registry if name[:6] == "Albot/" and "Revealed" not in name
    }
    assert len(quick.IDS) + 1 == len(list(folders))  # The probes are in one folder.


WORLDS = [
    "square-loop",
    *(f"random:{kind}:1" for kind in KINDS),
    "random:apartment:1?people=1&boxes=1&doors=1",
]


@pytest.mark.parametrize("environment", quick.DRIVEN)
@pytest.mark.parametrize(
    "options", quick.cycled(world=WORLDS, **quick.SENSORS), ids=lambda made: "-".join(made.values())
)
def test_every_kind_of_world_and_every_sensor(environment: str, options: dict[str, str]) -> None:
    """Gymnasium finds nothing wrong, twins are the same, no part stands still."""
    settings = {"observation": "dict", "mapper": "none", **options}
    settings["world"] = quick.loaded(options["world"])
    env, twin = _make(environment, **settings), _make(environment, **settings)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(env.unwrapped, skip_render_check=True)
    seen = _rollout(env, 2)
    assert _same(seen, _rollout(twin, 2))
    assert all(step[0] in env.observation_space for step in seen)
    for name in seen[0][0]:
        values = {step[0][name].tobytes() for step in seen}
        if name not in OF_TRAVEL:
            assert len(values) == 1 if name in OF_PLACES else len(values) > 3, name


@pytest.mark.parametrize(
    ("environment", "form", "mapper"),
    [
        (environment, form, MAPPERS[(i + j) % len(MAPPERS)])
        for i, environment in enumerate(quick.IDS)
        for j, form in enumerate(FORMS)
    ],
)
def test_gymnasium_finds_nothing_wrong(
    environment: str, form: str, mapper: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")  # It opens the window too.
    env = _make(environment, observation=form, mapper=mapper, render_mode="rgb_array")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(env.unwrapped)


@pytest.mark.parametrize("environment", quick.IDS)
@pytest.mark.parametrize("form", FORMS)
def test_the_same_seed_gives_the_same_episode(environment: str, form: str) -> None:
    one, other = (_make(environment, observation=form, mapper="albot1") for _ in range(2))
    other.reset(seed=99)  # An episode before must leave nothing behind.
    other.step(quick.still(environment))
    assert _same(_rollout(one, 7), _rollout(other, 7))
    assert not _same(_rollout(one, 7), _rollout(one, 8))


@pytest.mark.parametrize("environment", quick.DRIVEN)
@pytest.mark.parametrize("form", FORMS)
def test_observations_are_inside_alive_and_their_own(environment: str, form: str) -> None:
    env = _make(environment, observation=form)
    seen = [step[0] for step in _rollout(env, 1)]
    assert all(observation in env.observation_space for observation in seen)
    arrays = [_arrays(observation) for observation in seen]
    names = list(seen[0]) if form == "dict" else [form]
    for name, part in zip(names, zip(*arrays, strict=True), strict=True):
        assert (
            name in OF_PLACES | OF_TRAVEL or len({array.tobytes() for array in part}) > STEPS / 10
        )
    for k, ours in enumerate(arrays[1:], 1):
        assert not any(np.shares_memory(a, b) for a in ours for b in arrays[k - 1])


@pytest.mark.parametrize("environment", quick.IDS)
def test_flattened_parts_are_the_flat_observation(environment: str) -> None:
    """So a policy goes from one form to the other."""
    flattened = FlattenObservation(_make(environment, observation="dict"))
    flat = _make(environment, observation="flat")
    assert flattened.observation_space == flat.observation_space
    for one, other in zip(_rollout(flattened, 1), _rollout(flat, 1), strict=True):
        np.testing.assert_array_equal(one[0], other[0])


@pytest.mark.parametrize("environment", quick.IDS)
def test_info_has_the_same_keys_from_the_reset_on(environment: str) -> None:
    env = _make(environment)
    seen = _rollout(env, 2)
    keys = [sorted(step[-1]) for step in seen]
    terms = [sorted(step[-1]["reward_terms"]) for step in seen]
    assert all(key == keys[0] for key in keys)
    assert all(term == terms[0] for term in terms)


@pytest.mark.parametrize("environment", quick.IDS)
def test_a_reward_is_the_sum_of_its_terms(environment: str) -> None:
    for step in _rollout(_make(environment), 4)[1:]:
        assert step[1] == pytest.approx(sum(step[-1]["reward_terms"].values()), abs=1e-12)


@pytest.mark.parametrize("environment", quick.DRIVEN)
def test_a_time_limit_truncates(environment: str) -> None:
    env = _make(environment, max_episode_steps=5)
    ends = [(step[2], step[3]) for step in _rollout(env, 1, steps=5)[1:]]
    assert ends == [(False, False)] * 4 + [(False, True)]


@pytest.mark.parametrize("environment", quick.IDS)
def test_the_start_is_drawn(environment: str) -> None:
    journeys = {"journeys": 1} if environment in quick.SETTINGS else {}
    env = _make(environment, world="office-ring", **journeys)
    starts = {tuple(env.reset(seed=seed)[1]["start"]) for seed in range(12)}
    assert len(starts) == 3


@pytest.mark.parametrize("environment", quick.DRIVEN)
@pytest.mark.parametrize(
    ("action", "found"),
    [
        ([np.nan, 0], "nan"),
        ([-np.inf, 0], "-inf"),
        ([0, 0, 0], r"shape \(\d,\)"),
        (0.5, r"shape \(\)"),
        (["fast", 0], "fast"),
        (None, r"shape|nan|None"),
    ],
)
def test_an_action_that_is_none_is_refused(environment: str, action: Any, found: str) -> None:
    env = _make(environment).unwrapped
    env.reset(seed=1)
    assert env.action_space.shape is not None
    (numbers,) = env.action_space.shape
    if isinstance(action, list):
        action = [*action, *[0] * (numbers - 2)]
    expected = f"{environment}, action: expected {numbers} finite numbers.*{found}"
    with pytest.raises(InputError, match=expected):
        env.step(action)


@pytest.mark.parametrize("environment", quick.DRIVEN)
def test_numbers_beyond_the_limits_are_those_at_the_limits(environment: str) -> None:
    """A normal distribution draws any number, and 1 is not the same in all arithmetics."""
    env = _make(environment).unwrapped
    seen = []
    for actions in (
        [[1, 1, -1], [-1, -0.5, -1], [1, 1, 1]],
        [[1.0000001, 9e9, -1.5], [-1.1, -0.5, -3], [2, 1, 1e300]],
    ):
        env.reset(seed=1)
        said = quick.saying(environment, np.array(actions))
        seen.append([env.step(action) for action in said])
    assert _same(*seen)


@pytest.mark.parametrize("environment", quick.IDS)
@pytest.mark.parametrize(
    ("options", "found"),
    [
        *quick.UNKNOWN,
        ({"world": "office-rong"}, "office-rong"),
        ({"mapr": "none"}, r"settings among .*, found .* 'mapr' \(did you mean mapper\?\)$"),
    ],
)
def test_settings_that_are_none_are_refused(
    environment: str, options: dict[str, str], found: str
) -> None:
    with pytest.raises(InputError, match=found):
        _make(environment, **options)


def test_a_task_without_journeys_takes_no_number_of_them() -> None:
    with pytest.raises(
        InputError, match=r"Albot/Explore-v0: expected settings .*found .* 'journeys'"
    ):
        _make("Albot/Explore-v0", journeys=1)


@pytest.mark.parametrize("environment", quick.IDS)
@pytest.mark.parametrize(
    "options", [{"place": 1}, {"start": 99}, {"start": (1, 2)}, {"start": "here"}]
)
def test_reset_options_that_are_none_are_refused(environment: str, options: Any) -> None:
    with pytest.raises(InputError, match=environment):
        _make(environment).reset(seed=1, options=options)


@pytest.mark.parametrize("environment", quick.IDS)
@pytest.mark.parametrize(
    ("seed", "found"), [(-1, "-1"), (True, "True"), (2**128, "one of 129 bits")]
)
def test_a_seed_that_is_none_is_refused(environment: str, seed: int, found: str) -> None:
    with pytest.raises(InputError, match=rf"seed: expected a whole number .*, found {found}$"):
        _make(environment).reset(seed=seed)


@pytest.mark.parametrize(
    ("seed", "found"),
    [(1.5, "1.5"), ("3", "'3'"), ([1], r"\[1\]"), (1 << 200, "one of 201 bits")],
)
def test_what_is_no_seed_is_told(seed: Any, found: str) -> None:
    expected = "a whole number from 0 to 2¹²⁸ − 1"
    with pytest.raises(InputError, match=f"^Task, seed: expected {expected}, found {found}$"):
        check_seed(seed, "Task")


@pytest.mark.parametrize("environment", quick.IDS)
@pytest.mark.parametrize("seed", [0, 2**32, np.uint64(2**64 - 1), 2**128 - 1])
def test_a_seed_has_up_to_128_bits(environment: str, seed: Any) -> None:
    one, other = _make(environment), _make(environment)
    assert _same([one.reset(seed=seed)], [other.reset(seed=int(seed))])


@pytest.mark.parametrize("environment", quick.IDS)
def test_stepping_before_a_reset_or_after_the_end_is_an_error(environment: str) -> None:
    env = _make(environment).unwrapped
    with pytest.raises(gymnasium.error.ResetNeeded):
        env.step(quick.still(environment))
    env.reset(seed=1)
    env.close()
    env.close()  # Once more is no harm.
    closed = f"{environment}: the environment is closed"
    with pytest.raises(gymnasium.error.ClosedEnvironmentError, match=closed):
        env.step(quick.still(environment))
    with pytest.raises(gymnasium.error.ClosedEnvironmentError, match=closed):
        env.reset(seed=1)


@pytest.mark.parametrize("environment", quick.IDS)
def test_gymnasium_finds_nothing_wrong_where_there_is_no_display(
    environment: str, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "SDL_VIDEODRIVER"):
        monkeypatch.delenv(name, raising=False)
    check_env(_make(environment).unwrapped)
    assert "nobody sees the window" in caplog.text


@pytest.mark.parametrize("robot", ROBOTS)
@pytest.mark.parametrize("environment", quick.IDS)
def test_every_robot_does_every_task(environment: str, robot: str) -> None:
    env, twin = _make(environment, robot=robot), _make(environment, robot=to_plain(ROBOTS[robot]))
    assert env.get_wrapper_attr("robot_config") == ROBOTS[robot]
    seen = _rollout(env, 2, 30)
    assert _same(seen, _rollout(twin, 2, 30))
    batch = gymnasium.make_vec(
        environment,
        num_envs=2,
        **{"world": quick.LOOP, "mapper": "odometry", **quick.SETTINGS.get(environment, {})},
        robot=robot,
    )
    observations, _ = batch.reset(seed=2)
    assert _same(observations[0], seen[0][0])
    assert batch.get_attr("robot_config") == (ROBOTS[robot],) * 2


@pytest.mark.parametrize("environment", quick.IDS)
def test_a_robot_too_wide_for_the_world_is_refused(environment: str) -> None:
    with pytest.raises(InputError, match=r"random:office:1.*that a robot of radius 0.46 m reaches"):
        gymnasium.make(environment, world="random:office:1", robot={"radius": 0.46})
    with pytest.raises(InputError, match=r"robot: expected one of pioneer-3dx, kobuki, peoplebot"):
        gymnasium.make(environment, robot="pioneer")


@pytest.mark.parametrize("robot", ROBOTS)
def test_a_robot_stops_where_its_body_meets_the_wall(robot: str, two_rooms: World) -> None:
    env = gymnasium.make("Albot/Explore-v0", world=two_rooms, mapper="none", robot=robot)
    env.reset(seed=1, options={"start": (2.0, 1.0, np.pi)})
    for _ in range(60):
        *_, info = env.step(np.array((1.0, 0.0, -1.0), np.float32))
    assert info["collided"]
    assert info["pose"][0] == pytest.approx(ROBOTS[robot].radius, abs=0.01)

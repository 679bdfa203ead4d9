"""Replay of a recorded episode in its environment, which makes the observations again.

Episode files hold actions, rewards and readings, but no observations: these depend on the
environment's settings, and there are many. The environment is made again by the spec in the header,
and is led through the recorded actions. Each step must be the recorded one, to the last bit.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import islice
from typing import Any

import gymnasium
import numpy as np
from gymnasium.envs.registration import load_env_creator

from albot_core.errors import InputError
from albot_core.mappers.registry import MAPPERS, NO_MAPPER
from albot_env.export.transitions import (
    Transitions,
    TransitionsLog,
    environment_spec,
    spec_from_plain,
)
from albot_env.recording.episode import EpisodeHeader, Moment
from albot_env.recording.reader import EpisodeReader
from albot_env.tasks.core.settings import DEFAULT_WORLD
from albot_env.tasks.core.single import SingleEnv

_FIELDS = (
    "reward",
    "terms",
    "pose",
    "belief",
    "home",
    "path_length",
    "collided",
    "room",
    "updates",
    "matched_reading",
    "facts",
)
"""Fields of a moment that are compared, besides its reading."""
_REPAIR = "made again; was it recorded by another version, or on another kind of machine?"


def replay(reader: EpisodeReader, source: object) -> Transitions:
    """Run an episode's environment again with the recorded actions; return its transitions.

    Args:
        reader: The episode. Of one that was never closed, the intact part is replayed.
        source: Its file, for errors.

    Raises:
        InputError: The file is damaged, or has no step; it does not tell its environment or its
            seed; the environment cannot be made; or what it does is not what was recorded.
    """
    header = reader.header
    plain = _plain_spec(header, reader.measure()[0], source)
    env = _make(plain, source)
    inside = env.unwrapped
    assert isinstance(inside, SingleEnv)
    inside.agent, inside.recorder = header.agent, (again := _Latest())
    try:
        moments = reader.moments()
        observation, _ = env.reset(seed=header.seed)
        _check_header(header, again.header, source)
        for moment in islice(moments, 1):
            _check_moment(moment, again.moment, source, 0)
        log = TransitionsLog(
            spec=plain,
            observation_space=env.observation_space,
            action_space=env.action_space,
            seed=header.seed or 0,
            agent=header.agent,
            observation=observation,
        )
        _step_through(env, moments, log, again, source)
        return log.transitions()
    finally:
        env.close()


class _Latest:
    """A recorder that keeps the header and the latest moment."""

    def begin(self, header: EpisodeHeader) -> None:
        """Keep the header."""
        self.header = header

    def add(self, moment: Moment) -> None:
        """Keep the moment."""
        self.moment = moment

    def close(self) -> None:
        """Do nothing."""


def _step_through(
    env: gymnasium.Env[Any, Any],
    moments: Iterator[Moment],
    log: TransitionsLog,
    again: _Latest,
    source: object,
) -> None:
    """Take the recorded steps, compare each, and take it down."""
    over = ""
    for step, moment in enumerate(moments, 1):
        place = f"step {step}"
        if over:
            raise InputError(source, "another step as recorded", f"{over} {_REPAIR}", place=place)
        if moment.action is None:
            raise InputError(source, "an action", "none", place=place)
        try:
            action = log.action(moment.action)
            observation, reward, terminated, truncated, _ = env.step(action)
        except InputError as error:
            raise InputError(source, error.expected, error.found, place=place) from None
        _check_moment(moment, again.moment, source, step)
        log.add(action, observation, float(reward), terminated, truncated)
        over = "the end" if terminated or truncated else ""


def _plain_spec(header: EpisodeHeader, steps: int, source: object) -> dict[str, Any]:
    """Return the spec of an episode's environment.

    No name in a file makes this import a module: the environment and its mapper must be known.
    """
    if not steps:
        raise InputError(source, "an episode with at least one step", "its first moment alone")
    if header.spec is None:
        expected = "an episode that tells how its environment is made (by gymnasium.make, the "
        expected += "world given by its spec)"
        raise InputError(source, expected, "one that does not")
    if header.seed is None:
        raise InputError(source, "an episode with the seed of its reset", "one without")
    task, kwargs = header.spec.get("id"), header.spec.get("kwargs")
    if not isinstance(task, str) or task not in gymnasium.registry:
        raise InputError(source, "an environment that is registered", repr(task), place="spec.id")
    entry_point = gymnasium.spec(task).entry_point
    maker: Any = load_env_creator(entry_point) if isinstance(entry_point, str) else entry_point
    if not (isinstance(maker, type) and issubclass(maker, SingleEnv)):
        raise InputError(source, "an environment of albot", task, place="spec.id")
    if not isinstance(kwargs, Mapping):
        expected = "the environment's settings by name"
        raise InputError(source, expected, repr(kwargs), place="spec.kwargs")
    mapper = kwargs.get("mapper", NO_MAPPER)
    if mapper != NO_MAPPER and str(mapper).rpartition(":")[2] not in MAPPERS:
        expected = f"a mapper, one of {', '.join(MAPPERS)}"
        found = f"{mapper!r} (one from outside is known once its module is imported)"
        raise InputError(source, expected, found, place="spec.kwargs.mapper")
    settings = {"world": gymnasium.spec(task).kwargs.get("world", DEFAULT_WORLD), **kwargs}
    settings.pop("render_mode", None)
    limit = header.spec.get("max_episode_steps")
    if limit is None:  # An environment does not know the limit of the wrapper around it.
        usual = gymnasium.spec(task).max_episode_steps
        limit = usual if usual is not None and steps <= usual else None
    elif not isinstance(limit, int) or limit < steps:
        expected = f"{steps} steps or more, as many as were recorded"
        raise InputError(source, expected, repr(limit), place="spec.max_episode_steps")
    return environment_spec(task, {**settings, "max_episode_steps": limit})


def _make(plain: Mapping[str, Any], source: object) -> gymnasium.Env[Any, Any]:
    """Make an environment by its spec."""
    place = "spec.kwargs"
    try:
        return gymnasium.make(spec_from_plain(plain))
    except (gymnasium.error.Error, TypeError, ValueError) as error:
        for cause in (error.__cause__, error):  # Gymnasium raises some errors as others.
            if isinstance(cause, InputError):
                place = f"{place}, {cause.source}{f', {cause.place}' if cause.place else ''}"
                raise InputError(source, cause.expected, cause.found, place=place) from None
        expected = "settings with which the environment can be made"
        raise InputError(source, expected, str(error), place=place) from None


def _check_header(then: EpisodeHeader, now: EpisodeHeader, source: object) -> None:
    """Raise InputError if the episode begins otherwise than it was recorded."""
    for name in ("walls", "start", "robot_radius", "laser", "sonar", "way_out"):
        _check_same(name, getattr(then, name), getattr(now, name), source, "the reset")


def _check_moment(then: Moment, now: Moment, source: object, step: int) -> None:
    """Raise InputError if a moment is not the recorded one."""
    place = f"step {step}" if step else "the reset"
    for name in _FIELDS:
        _check_same(name, getattr(then, name), getattr(now, name), source, place)
    recorded, made = then.reading, now.reading
    for name in ("stamp", "motion", "scene", "compass"):
        _check_same(name, getattr(recorded, name), getattr(made, name), source, place)
    for name in ("laser", "sonar"):
        ours, theirs = getattr(recorded, name), getattr(made, name)
        if ours is not None and theirs is not None:  # The header says which there are.
            _check_same(name, _heard(ours.ranges), _heard(theirs.ranges), source, place)


def _heard(ranges: np.ndarray) -> np.ndarray:
    """Return ranges as a file holds them, which has 0 for no return."""
    return np.where(np.isfinite(ranges), ranges, 0.0)


def _check_same(name: str, then: Any, now: Any, source: object, place: str) -> None:
    is_array = isinstance(then, np.ndarray)
    if np.array_equal(then, now) if is_array else then == now:
        return
    if isinstance(then, Mapping):
        key = next(key for key in {**then, **now} if then.get(key) != now.get(key))
        name, then, now = f"{name}.{key}", then.get(key), now.get(key)
    if is_array and then.shape == now.shape and then.size > 3:
        wrong = int(np.flatnonzero(then != now)[0])
        name, then, now = f"{name}[{wrong}]", then.flat[wrong], now.flat[wrong]
    raise InputError(source, f"{name} {_text(then)}", f"{_text(now)} {_REPAIR}", place=place)


def _text(value: Any) -> str:
    return repr(value.tolist() if isinstance(value, np.ndarray | np.generic) else value)

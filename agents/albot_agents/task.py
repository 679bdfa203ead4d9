"""Tasks: the environments by name, and the settings of each."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any, get_args

import gymnasium
from gymnasium.envs.registration import load_env_creator

import albot_env
from albot_core.errors import InputError, did_you_mean
from albot_core.plain_data import Location, read_fields

assert albot_env.__doc__  # Importing it registers the environments.

PREFIX = "Albot/"


def task_names() -> tuple[str, ...]:
    """Return the ids of all tasks."""
    return tuple(sorted(name for name in gymnasium.registry if name.startswith(PREFIX)))


def untwinned(task: str) -> str:
    """Return the task of which one is the revealed twin, or itself if it is no twin."""
    return task.replace("Revealed-", "-")


def is_probe(task: str) -> bool:
    """Return whether a task is a probe, a fixed scene in which agents for homing are tested."""
    return task.startswith(f"{PREFIX}Probe-")


def own_world(task: str) -> str | None:
    """Return the only world of a task; None if any world will do."""
    world: str | None = gymnasium.spec(task).kwargs.get("world")
    return world


def check_task(task: str) -> None:
    """Check that a task exists.

    Raises:
        InputError: No task has this id; the message suggests the closest one.
    """
    tasks = task_names()
    if task not in tasks:
        found = f"{task or 'nothing'}{did_you_mean(task, tasks)}"
        raise InputError("task", f"one of {', '.join(tasks)}", found)


def short_name(task: str) -> str:
    """Return the short name of a task: `explore-and-home` for `Albot/ExploreAndHome-v1`."""
    words = re.sub(r"-v\d+$", "", task.removeprefix(PREFIX))
    return re.sub(r"(?<=[a-z])(?=[A-Z])", "-", words).lower()


def find_task(name: str) -> str:
    """Return the id of a task, given its id or its short name.

    Raises:
        InputError: No task has this name; the message suggests the closest one.
    """
    tasks = {known: task for task in task_names() for known in (task, short_name(task))}
    if name not in tasks:
        names = [f"{short_name(task)} ({task})" for task in task_names()]
        found = f"{name or 'nothing'}{did_you_mean(name, tasks)}"
        raise InputError("task", f"one of {', '.join(names)}", found)
    return tasks[name]


def batch_settings(task: str) -> dict[str, Any]:
    """Return the settings of a batch of a task's environments: name to type."""
    return _settings(gymnasium.spec(task).vector_entry_point)


def single_settings(task: str) -> dict[str, Any]:
    """Return the settings of a single environment of a task: name to type."""
    return _settings(gymnasium.spec(task).entry_point)


def config_kind(task: str) -> Any:
    """Return the dataclass of a task's configuration."""
    kinds = get_args(single_settings(task)["config"])
    return next(kind for kind in kinds if kind is not type(None))


def read_settings(task: str, data: Any, where: Location) -> dict[str, Any]:
    """Parse the settings of a batch of a task's environments from plain data.

    Raises:
        InputError: A setting is unknown, or its value has the wrong type; with the place.
    """
    known = {
        name: kind
        for name, kind in batch_settings(task).items()
        if name not in ("num_envs", "autoreset_mode")
    }
    return read_fields(known, data, where)


def single_env_settings(task: str, settings: Mapping[str, Any]) -> dict[str, Any]:
    """Return those settings of a batch that a single environment has too."""
    known = single_settings(task)
    return {name: value for name, value in settings.items() if name in known}


def _settings(entry_point: Any) -> dict[str, Any]:
    """Return an environment's settings: name to type."""
    maker: Any = load_env_creator(entry_point)
    kinds: dict[str, Any] = maker.settings()
    return kinds

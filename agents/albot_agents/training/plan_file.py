"""Read, check and write training plans in YAML, and derive their environments' settings."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Mapping, Sequence
from importlib import resources
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np

from albot_agents.evaluation.plan import Trial, parse_seeds, plan_trials
from albot_agents.task import check_task, read_settings
from albot_agents.training.demonstrations import LARGEST, Lesson, read_demonstrations
from albot_agents.training.plan import EvaluationPlan, StagePlan, TrainingPlan
from albot_agents.training.plan_check import (
    MEMORY,
    agent_network,
    check_algorithm,
    check_claims,
    check_device,
    check_metric,
    check_policy,
    check_spaces,
)
from albot_agents.training.pretrain_plan import PretrainPlan
from albot_agents.training.teachers import TaughtEnvironments
from albot_core.config_document import to_yaml
from albot_core.errors import InputError
from albot_core.files import write_text
from albot_core.plain_data import Location, deep_merge, read_config
from albot_core.yaml_document import YamlDocument, read_yaml

_SHIPPED = resources.files("albot_agents.training") / "configs"


def read_plan(
    path: Path,
    task: str | None = None,
    *,
    tried: bool = True,
    saved: bool = False,
    pretrained: bool = False,
    **changes: Any,
) -> TrainingPlan:
    """Read the plan in a YAML file.

    Args:
        path: The file.
        task: The task; None for the one that the file names.
        tried: Whether the plan's environments are made once, to check what its settings are for.
        saved: Whether a run has saved it, so that fields without use may have values.
        pretrained: Whether the pretraining is over, so that its agent or file is needed no more.
        changes: Values of top-level keys that replace the file's, which must be valid anyway, and
            `robot`, which replaces that of `env`. None replaces nothing.

    Raises:
        InputError: The file is missing or not YAML, has an unknown key or an invalid value, is for
            another task, or requests a GPU where there is none.
    """
    return _plan(
        read_yaml(path), path, task, changes, tried=tried, saved=saved, pretrained=pretrained
    )


def shipped_plan(task: str, *, tried: bool = True, **changes: Any) -> TrainingPlan:
    """Return the project's plan for a task; arguments as for `read_plan`.

    Raises:
        InputError: The project has no plan for the task.
    """
    check_task(task)
    file = _SHIPPED / f"{task.rpartition('/')[2]}.yml"
    if not file.is_file():
        raise InputError("--config", f"a file, because no plan comes with {task}", "none")
    document = YamlDocument(file.read_text(encoding="utf-8"), file.name)
    return _plan(document, file.name, task, changes, tried=tried)


def plan_text(plan: TrainingPlan) -> str:
    """Return a plan as YAML with comments, which `read_plan` reads back."""
    return to_yaml(plan, f"A training plan for {plan.task}; None is written null.")


def save_plan(plan: TrainingPlan, path: Path) -> None:
    """Write a plan as `plan_text` returns it.

    Raises:
        InputError: The file cannot be written.
    """
    write_text(path, plan_text(plan))


def stage_settings(
    plan: TrainingPlan, stage: StagePlan, where: Location = MEMORY
) -> dict[str, Any]:
    """Return the settings of a stage's batch, with a list of worlds distributed in turn.

    Raises:
        InputError: A setting is unknown, or its value is invalid for the plan.
    """
    settings = _read_settings(plan, deep_merge(plan.env, stage.env), where)
    return _distributed(settings, plan.n_envs)


def pretraining_settings(plan: TrainingPlan, where: Location = MEMORY) -> dict[str, Any]:
    """Return the settings of the environments of the pretraining.

    They are those of the last stage, overridden by those of the pretraining.

    Raises:
        InputError: As for `stage_settings`.
    """
    assert plan.pretrain is not None
    last = deep_merge(plan.env, plan.stages[-1].env)
    env = deep_merge(last, plan.pretrain.env)
    settings = _read_settings(plan, env, where, plan.pretrain.n_envs, "pretrain.n_envs")
    return _distributed(settings, plan.pretrain.n_envs)


def claims_settings(plan: TrainingPlan, where: Location = MEMORY) -> dict[str, Any]:
    """Return the settings, those of the last stage, of the environments for learning claims.

    Raises:
        InputError: As for `stage_settings`.
    """
    assert plan.claims is not None
    env, count = deep_merge(plan.env, plan.stages[-1].env), plan.claims.n_envs
    return _distributed(_read_settings(plan, env, where, count, "claims.n_envs"), count)


def first_world(settings: Mapping[str, Any]) -> dict[str, Any]:
    """Return the settings of a batch of one environment."""
    worlds = settings.get("world")
    return {**settings, "world": worlds[0]} if isinstance(worlds, list) else dict(settings)


def evaluation_settings(plan: TrainingPlan, where: Location = MEMORY) -> dict[str, Any]:
    """Return the settings of the evaluations' environments, without their worlds.

    They are those of the last stage, overridden by those of the evaluation.

    Raises:
        InputError: A setting is unknown, or its value is invalid for the plan.
    """
    assert plan.evaluation is not None
    last = deep_merge(plan.env, plan.stages[-1].env)
    settings = _read_settings(plan, deep_merge(last, plan.evaluation.env), where)
    settings.pop("world", None)
    return settings


def _plan(
    document: YamlDocument,
    source: object,
    task: str | None,
    changes: Mapping[str, Any],
    *,
    tried: bool,
    saved: bool = False,
    pretrained: bool = False,
) -> TrainingPlan:
    where = Location(source, place=document.place)
    data = document.data
    if isinstance(data, dict):
        named = data.get("task")
        if task is not None and named not in (None, "", task):
            raise where.at("task").error(task, str(named))
        data = {**data, "task": task or named or ""}
    plan = read_config(TrainingPlan, data, where)
    with where.relocate_errors():
        check_task(plan.task)
        given = {name: value for name, value in changes.items() if value is not None}
        if "robot" in given:
            given["env"] = {**plan.env, "robot": given.pop("robot")}
        plan = dataclasses.replace(plan, **given)
        if not saved:
            plan.check_unused_fields()
    if tried:
        try_plan(plan, where, pretrained=pretrained)
    return plan


def try_plan(plan: TrainingPlan, where: Location, *, pretrained: bool = False) -> None:
    """Check what a plan's settings are for, by making its environments once.

    Args:
        plan: The plan.
        where: Location of the plan, for errors.
        pretrained: As for `read_plan`.

    Raises:
        InputError: Settings are invalid, or the learner cannot work with them, or the plan requests
            a GPU where there is none.
    """
    check_device(plan, where)
    batch = _check_environments(plan, where)
    if plan.pretrain is not None and not pretrained:
        _check_pretraining(plan, plan.pretrain, batch, where)


def _check_environments(plan: TrainingPlan, where: Location) -> Any:
    """Return a batch of the first stage, closed.

    Raises:
        InputError: Settings are invalid, or the learner cannot work with them.
    """
    _read_settings(plan, plan.env, where.at("env"))
    for k, stage in enumerate(plan.curriculum):
        _read_settings(plan, stage.env, where.at("curriculum", k, "env"))
    if plan.evaluation is not None:
        place = where.at("evaluation", "env")
        if "world" in plan.evaluation.env:
            raise place.at("world").error("worlds in evaluation.worlds alone", "some here")
        _read_settings(plan, plan.evaluation.env, place)
        _check_evaluation_worlds(plan, plan.evaluation, where.at("evaluation", "worlds"))
    batches: list[Any] = []
    for k, stage in enumerate(plan.stages):
        place = where.at("curriculum", k, "env") if plan.curriculum else where.at("env")
        settings = stage_settings(plan, stage, place)
        batches.append(_try_out(plan, stage.env, settings, where.at("env"), place))
        check_spaces(batches[0], batches[-1], place)
    actions = batches[0].single_action_space
    check_algorithm(plan, batches[0].single_observation_space, actions, where)
    seen = batches[0].observation_config
    check_policy(plan.policy, seen, actions, where)
    agent_network(plan, seen, batches[0].single_observation_space, actions, where)
    if plan.evaluation is not None:
        place = where.at("evaluation", "env")
        settings = evaluation_settings(plan, place)
        batch = _try_out(plan, plan.evaluation.env, settings, where.at("env"), place)
        check_spaces(batches[0], batch, place)
    check_metric(plan, batches[0].fact_names, where)
    check_claims(plan, seen, batches[0].action_config, where)
    if plan.claims is not None:
        claims_settings(plan, where.at("env"))
    return batches[0]


def _check_pretraining(
    plan: TrainingPlan, pretrain: PretrainPlan, batch: Any, where: Location
) -> None:
    """Raise InputError if an agent cannot demonstrate, or if demonstrations do not fit.

    Args:
        plan: The plan.
        pretrain: Its pretraining.
        batch: A batch of the first stage.
        where: Location of the plan.
    """
    place = where.at("pretrain")
    settings = pretraining_settings(plan, place.at("env"))
    own = _try_out(plan, pretrain.env, settings, where.at("env"), place.at("env"))
    check_spaces(batch, own, place.at("env"))
    (length,) = own.single_observation_space.shape
    if pretrain.demonstrations:
        lesson = Lesson.of(plan.task, settings, own)
        read_demonstrations(Path(pretrain.demonstrations), lesson, length)
        return
    most = LARGEST // (length * np.dtype(np.float16).itemsize)
    if pretrain.steps > most:
        expected = f"at most {most:,} samples of {length:,} numbers each"
        raise place.at("steps").error(expected, f"{pretrain.steps:,}")
    try:
        TaughtEnvironments(plan.task, pretrain.agent, 1, first_world(settings)).close()
    except InputError as error:
        found = f"{pretrain.agent} ({error.found})"
        raise place.at("agent").error(error.expected, found) from None


def _distributed(settings: dict[str, Any], count: int) -> dict[str, Any]:
    """Return settings with a list of worlds distributed over `count` environments in turn."""
    worlds = settings.get("world")
    if isinstance(worlds, list):
        settings["world"] = [worlds[k % len(worlds)] for k in range(count)]
    return settings


def _read_settings(
    plan: TrainingPlan,
    env: Mapping[str, Any],
    where: Location,
    count: int | None = None,
    name: str = "n_envs",
) -> dict[str, Any]:
    """Parse settings of `count` environments, by default those of the training, made flat.

    `name` is that of the plan's field for their number.

    Raises:
        InputError: As for `read_settings`; or a list has no world, or one that no environment
            would get.
    """
    settings = read_settings(plan.task, env, where)
    if settings.get("observation") == "dict":
        # Networks take a row of numbers. `FlattenObservation` would make the same of a dict, by a
        # contract of all environments, but would copy every part at every step.
        settings["observation"] = "flat"
    worlds = settings.get("world")
    count = plan.n_envs if count is None else count
    if isinstance(worlds, list) and not 1 <= len(worlds) <= count:
        expected = f"at least one world, and at most {name}, {count}"
        raise where.at("world").error(expected, str(len(worlds)))
    return settings


def evaluation_trials(plan: TrainingPlan, worlds: Sequence[str]) -> list[Trial]:
    """Return the episodes of the evaluations in some worlds, for the robot of the plan.

    Raises:
        InputError: The world of the first or of the last episode cannot be loaded.
    """
    assert plan.evaluation is not None
    env = deep_merge(deep_merge(plan.env, plan.stages[-1].env), plan.evaluation.env)
    robot = {"robot": env["robot"]} if "robot" in env else {}
    return plan_trials(plan.task, "", worlds, parse_seeds(str(plan.evaluation.seeds)), robot)


def _check_evaluation_worlds(
    plan: TrainingPlan, evaluation: EvaluationPlan, where: Location
) -> None:
    """Raise InputError for a spec of which the first or the last world cannot be loaded."""
    for k, spec in enumerate(evaluation.worlds):
        try:
            evaluation_trials(plan, (spec,))
        except InputError as error:
            place = where.at(k)
            raise place.error(error.expected, f"{spec!r} ({error.found})") from None


def _try_out(
    plan: TrainingPlan,
    own: Mapping[str, Any],
    settings: Mapping[str, Any],
    where: Location,
    own_place: Location,
) -> Any:
    """Make one environment in each world of a stage; return the batch, closed.

    Args:
        plan: The plan.
        own: The settings that the stage itself gives.
        settings: All settings of the stage.
        where: Location of the plan's settings.
        own_place: Location of the stage's own settings.

    Raises:
        InputError: The settings are invalid; the error names the place in the plan.
    """
    given = dict(settings)
    if isinstance(given.get("world"), list):
        given["world"] = list(dict.fromkeys(given["world"]))
    count = len(given["world"]) if isinstance(given.get("world"), list) else 1
    try:
        batch: Any = gymnasium.make_vec(plan.task, num_envs=count, **given)
    except InputError as error:
        words = re.findall(r"\w+", f"{error.source} {error.place}")
        named = [name for name in words if name in settings][:1]
        place = (own_place if set(named) & own.keys() else where).at(*named)
        place_text = place.place(place.path)
        if error.place and [error.place] != named:
            place_text = f"{place_text}, {error.place}"
        raise InputError(place.source, error.expected, error.found, place=place_text) from None
    batch.close()
    return batch

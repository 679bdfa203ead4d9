"""Run the episodes of one agent together, in a batch of environments.

A batch costs less a step than single environments, and each episode is the same in both, to the
last bit.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode

from albot_agents.agent import EnvironmentConfigs, choose_action
from albot_agents.evaluation.plan import Trial
from albot_agents.evaluation.trial import EpisodeLog, Outcome
from albot_agents.registry import make_agent
from albot_agents.task import batch_settings
from albot_env.recording.episode import FirstEpisode, Recorder


def can_run_together(task: str) -> bool:
    """Return whether a batch is worthwhile in a task.

    Robots start without a journey, which would be made for each alone; and all episodes are of one
    length, because in a batch one that is over begins again until all are over.
    """
    limit = gymnasium.spec(task).max_episode_steps
    return limit is not None and "journeys" not in batch_settings(task)


def run_together(
    trials: Sequence[Trial],
    on_step: Callable[[int], None] = lambda _: None,
    recorders: Sequence[Recorder] = (),
) -> list[Outcome]:
    """Run episodes of one agent, with the same settings, to their ends; as `run_trial` does each.

    Args:
        trials: The episodes.
        on_step: Called before each step with its number.
        recorders: A recorder for each episode, which is closed at its end; none by default.

    Raises:
        InputError: There is no such world, mapper or sensor.
    """
    batch = _make_batch(trials)
    try:
        if recorders:
            batch.unwrapped.set_attr("recorder", [FirstEpisode(each) for each in recorders])
            batch.unwrapped.set_attr("agent", [trial.agent for trial in trials])
        agents = [_make_agent(batch, trial) for trial in trials]
        on_step(0)
        seeds = [trial.seed for trial in trials]
        observations, infos = batch.reset(seed=seeds)
        configs = _configs(batch)
        logs = [
            EpisodeLog(trial, configs, _observation(observations, k), _Info(infos, k))
            for k, trial in enumerate(trials)
        ]
        spaces = batch.single_observation_space, batch.single_action_space
        kept = [
            trial.begin_log(_observation(observations, k), spaces)
            if trial.keeps_transitions
            else None
            for k, trial in enumerate(trials)
        ]
        ended = np.zeros(len(trials), np.bool_)
        while not all(log.over for log in logs):
            on_step(max(log.steps for log in logs) + 1)
            # All drive on, though what one does that was over no longer counts. With the same seed,
            # no other journey need be made.
            if ended.any():
                observations, _ = batch.reset(seed=seeds, options={"reset_mask": ended})
            shown = [_observation(observations, k) for k in range(len(trials))]
            actions = [
                choose_action(agent, seen, _Info(infos, k))
                for k, (agent, seen) in enumerate(zip(agents, shown, strict=True))
            ]
            observations, rewards, terminated, truncated, infos = batch.step(np.array(actions))
            ended = terminated | truncated
            for k, (log, transitions) in enumerate(zip(logs, kept, strict=True)):
                if not log.over:
                    seen = _observation(observations, k)
                    log.add(seen, _Info(infos, k), over=bool(ended[k]))
                    if transitions is not None:
                        ends = bool(terminated[k]), bool(truncated[k])
                        transitions.add(actions[k], seen, float(rewards[k]), *ends)
    finally:
        batch.close()
    return [
        replace(log.outcome, transitions=None if each is None else each.transitions())
        for log, each in zip(logs, kept, strict=True)
    ]


def _make_batch(trials: Sequence[Trial]) -> Any:
    return gymnasium.make_vec(
        trials[0].task,
        num_envs=len(trials),
        world=[trial.loaded_world for trial in trials],
        autoreset_mode=AutoresetMode.DISABLED,
        **{"threads": 1, **trials[0].settings},
    )


def _make_agent(batch: Any, trial: Trial) -> Any:
    """Make an agent for an environment of a batch, and begin its episode as `begin_episode`."""
    agent = make_agent(trial.agent, _configs(batch))
    agent.reset(np.random.default_rng((trial.seed, 1)), batch.single_action_space)
    return agent


def _configs(batch: Any) -> EnvironmentConfigs:
    """Return what an agent is told of a batch's environments."""
    names = "observation_config", "action_config", "robot_config"
    return EnvironmentConfigs(*(getattr(batch, name) for name in names))


def _observation(observations: Any, k: int) -> Any:
    """Return the observation of one environment, flat or in parts."""
    if isinstance(observations, Mapping):
        return {name: rows[k] for name, rows in observations.items()}
    return observations[k]


class _Info(Mapping[str, Any]):
    """The info of one environment of a batch, without the terms of its reward.

    It looks up what is asked for: most of an info is asked for at an episode's end alone.

    Args:
        infos: The batch's infos, which the batch's next step changes.
        k: Number of the environment.
    """

    def __init__(self, infos: Mapping[str, Any], k: int) -> None:
        self._infos, self._k = infos, k

    def __getitem__(self, name: str) -> Any:
        """Return what the info holds under a name."""
        values = self._infos[name]
        if name.startswith("_") or not isinstance(values, np.ndarray):
            raise KeyError(name)
        return values[self._k]

    def __iter__(self) -> Iterator[str]:
        """Go through the names."""
        return (name for name in self._infos if name in self)

    def __len__(self) -> int:
        """Return the number of names."""
        return sum(1 for _ in self)

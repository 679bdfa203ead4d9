"""Run episodes together in a batch of environments, and check every step of each."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Generator, Sequence
from contextlib import closing
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode

from albot_agents.agent import Agent, EnvironmentConfigs, begin_episode, choose_action
from albot_agents.engine.engine import Crash, Engine, name_error
from albot_agents.registry import EXPLORE, make_agent
from albot_core.errors import InputError
from albot_core.ranges import FROM_ONE, SHARE, check_fields
from albot_env.export.replay import replay
from albot_env.recording.reader import EpisodeReader
from albot_env.recording.writer import EpisodeWriter
from albot_env.stress.batch import DEFAULTS, BatchChecker, info_of, row_of
from albot_env.stress.beliefs import BeliefChecker
from albot_env.stress.checks import ERROR, Finding, Limits
from albot_maps import World
from albot_stress.episodes import Episode, Job, Outcome, Violation, alone

OnStep = Callable[[int], None]


@dataclass(frozen=True, kw_only=True)
class Checks:
    """What is checked how often."""

    beams: float = 0.125
    """Share of the beams and sonars that are compared with the surfaces at each step, in turns."""
    maps_every: int = 25
    """Number of steps between two looks at all of a map; one more is at the end."""
    beliefs: float = 1.0
    """Share of the episodes whose readings are given to a second mapper as they come."""
    replays: float = 0.002
    """Share of the episodes that are recorded and replayed from the file."""
    limits: Limits = DEFAULTS
    """The tolerances."""

    def __post_init__(self) -> None:
        check_fields(self, SHARE, "beams", "beliefs", "replays")
        check_fields(self, FROM_ONE, "maps_every")
        if not self.beams:
            raise InputError("Checks.beams", "a share above 0", "0")


_CHECKS = Checks()


def run_jobs(
    jobs: Sequence[Job], engine: Engine, checks: Checks = _CHECKS
) -> Generator[Outcome, None, None]:
    """Yield the outcomes of all episodes, as they come. Closing the iterator ends all processes.

    The episodes of a job in which a process died are run again, each for itself.
    """
    waiting = list(jobs)
    while waiting:
        died: list[Job] = []
        with closing(engine.run(partial(run_job, checks=checks), waiting)) as results:
            for done in results:
                if not isinstance(done.result, Crash):
                    yield from done.result
                elif sum(map(len, done.task)) > 1:
                    died += alone(done.task)
                else:
                    yield _crashed(done.task[0][0], done.result)
        waiting = died


def _crashed(episode: Episode, crash: Crash) -> Outcome:
    """Return the outcome of an episode in which the process died each time that it was run.

    If the step is not known, the command that reproduces it has all steps.
    """
    step = episode.steps if crash.step is None else crash.step
    return violated(episode, step, [Finding(ERROR, crash.cause)])


def run_job(job: Job, on_step: OnStep, checks: Checks = _CHECKS) -> list[Outcome]:
    """Run the episodes of a job; its worlds are loaded once for all groups.

    Args:
        job: The job.
        on_step: Called before each step with its number; 0 for the reset.
        checks: What is checked.
    """
    worlds: dict[tuple[str, float], World] = {}
    outcomes: list[Outcome] = []
    for group in job:
        sound: list[Episode] = []
        for episode in group:
            key = episode.world, episode.radius
            try:
                if key not in worlds:
                    worlds[key] = episode.load_world()
            except Exception as error:  # noqa: BLE001  (any exception is a finding)
                outcomes.append(violated(episode, 0, [Finding(ERROR, name_error(error))]))
            else:
                sound.append(episode)
        if sound:
            loaded = [worlds[episode.world, episode.radius] for episode in sound]
            outcomes += run_group(sound, loaded, checks, on_step)
    return outcomes


def run_episode(
    episode: Episode, on_step: OnStep = lambda _: None, checks: Checks = _CHECKS
) -> Outcome:
    """Run an episode to its end, or to the first step with a violation.

    An exception in the environment or the agent is a violation too.

    Args:
        episode: The episode.
        on_step: Called before each step with its number; 0 for the reset.
        checks: What is checked.
    """
    return run_job(((episode,),), on_step, checks)[0]


def run_group(
    episodes: Sequence[Episode], worlds: Sequence[World], checks: Checks, on_step: OnStep
) -> list[Outcome]:
    """Run episodes with the same settings together, each as if it were alone.

    If an exception ends the batch, each is run alone, to find those that raise it.

    Args:
        episodes: The episodes.
        worlds: The world of each.
        checks: What is checked.
        on_step: Called before each step with its number; 0 for the reset.
    """
    run = _GroupRun(episodes, worlds, checks)
    try:
        outcomes = run.outcomes(on_step)
    except Exception as error:  # noqa: BLE001  (any exception is a finding)
        cause = name_error(error)
    else:
        return [_with_replay(outcome, checks) for outcome in outcomes]
    if len(episodes) == 1:
        return [violated(episodes[0], run.step, [Finding(ERROR, cause)])]
    outcomes = [
        run_group([episode], [world], checks, on_step)[0]
        for episode, world in zip(episodes, worlds, strict=True)
    ]
    if not any(outcome.violations for outcome in outcomes):
        what = f"in a batch of {len(episodes)}, but not alone: {cause}"
        outcomes[0] = violated(episodes[0], run.step, [Finding(ERROR, what)])
    return outcomes


class _GroupRun:
    """A run of episodes with the same settings.

    Args:
        episodes: The episodes.
        worlds: The world of each.
        checks: What is checked.
    """

    def __init__(
        self, episodes: Sequence[Episode], worlds: Sequence[World], checks: Checks
    ) -> None:
        self._episodes, self._worlds, self._checks = episodes, worlds, checks
        self._violated: dict[int, Outcome] = {}
        self._over = np.zeros(len(episodes), np.bool_)
        self.step = 0
        """Number of the step that was begun last; 0 for the reset."""

    def outcomes(self, on_step: OnStep) -> list[Outcome]:
        """Run to the end; return the outcome of each episode."""
        on_step(0)
        batch = make_batch(self._episodes, self._worlds)
        try:
            agents = make_agents(batch, self._episodes)
            return self._run(batch.unwrapped, agents, on_step)
        finally:
            batch.close()

    def _run(self, batch: Any, agents: Sequence[Agent], on_step: OnStep) -> list[Outcome]:
        checks, count = self._checks, len(self._episodes)
        checker = BatchChecker(
            batch,
            self._worlds,
            share=checks.beams,
            maps_every=checks.maps_every,
            limits=checks.limits,
        )
        beliefs = self._belief_checker(batch)
        observations, infos = batch.reset(seed=[episode.seed for episode in self._episodes])
        self._note(checker.after_reset(observations, infos))
        if beliefs is not None:
            self._note(beliefs.after_reset(infos["belief"]))
        lengths = np.zeros(count, np.int64)
        idle = batch.single_action_space.sample()
        while not all(self._over[row] or row in self._violated for row in range(count)):
            self.step += 1
            on_step(self.step)
            actions = [
                idle if self._over[row] else _action(agent, observations, infos, row)
                for row, agent in enumerate(agents)
            ]
            observations, rewards, terminated, truncated, infos = batch.step(np.array(actions))
            lengths[~self._over] = self.step
            self._note(checker.after_step(observations, rewards, infos))
            if beliefs is not None:
                self._note(beliefs.after_step(infos["belief"]))
            ended = (terminated | truncated) & ~self._over
            if ended.any():
                self._note(checker.check_maps())
            self._over |= ended
            if (terminated | truncated).any() and not self._over.all():
                options = {"reset_mask": terminated | truncated}
                observations, infos = batch.reset(options=options)
        return [
            self._violated.get(row)
            or Outcome(episode=episode, steps=int(lengths[row]), violations=())
            for row, episode in enumerate(self._episodes)
        ]

    def _belief_checker(self, batch: Any) -> BeliefChecker | None:
        """Return what compares the beliefs of some of the episodes; None if it cannot.

        Other tasks tell their mappers of the way back, and faults may delay readings.
        """
        first, chosen = self._episodes[0], round(self._checks.beliefs * len(self._episodes))
        if first.task != EXPLORE or first.faults is not None or not chosen:
            return None
        return BeliefChecker(batch, np.arange(chosen))

    def _note(self, found: dict[int, list[Finding]]) -> None:
        """Keep what is wrong with episodes that are not over and have had no violation."""
        for row, findings in found.items():
            if row not in self._violated and not self._over[row]:
                self._violated[row] = violated(self._episodes[row], self.step, findings)


def make_batch(episodes: Sequence[Episode], worlds: Sequence[World]) -> Any:
    """Make the environments of episodes that differ in nothing but their worlds, seeds and agents.

    Raises:
        InputError: There is no such mapper or agent, or the robot lacks a sensor that the mapper
            needs.
    """
    return gymnasium.make_vec(
        episodes[0].task,
        num_envs=len(episodes),
        world=list(worlds),
        autoreset_mode=AutoresetMode.DISABLED,
        **{"threads": 1, **episodes[0].settings},
    )


def check_episode(episode: Episode) -> None:
    """Make an episode's environment, agent and checks, to see whether there can be such.

    Raises:
        InputError: There cannot.
    """
    world = episode.load_world()
    batch = make_batch([episode], [world])
    try:
        BatchChecker(batch.unwrapped, [world])
        make_agents(batch, [episode])
    finally:
        batch.close()


def make_agents(batch: Any, episodes: Sequence[Episode]) -> list[Agent]:
    """Make the agent of each environment of a batch, and begin its episode as `begin_episode`.

    Raises:
        InputError: The agent cannot act in such an environment.
    """
    batch = batch.unwrapped
    configs = EnvironmentConfigs(batch.observation_config, batch.action_config, batch.robot_config)
    agents = [make_agent(episode.agent, configs) for episode in episodes]
    for agent, episode in zip(agents, episodes, strict=True):
        agent.reset(np.random.default_rng((episode.seed, 1)), batch.single_action_space)
    return agents


def _action(agent: Agent, observations: Any, infos: Any, row: int) -> Any:
    info = info_of(infos, row) if agent.knows_truth else {}
    return choose_action(agent, row_of(observations, row), info)


def _with_replay(outcome: Outcome, checks: Checks) -> Outcome:
    """Return an outcome with what its replay finds, if the episode is one of those replayed."""
    episode = outcome.episode
    every = round(1 / checks.replays) if checks.replays else 0
    if outcome.violations or not every or episode.seed % every:
        return outcome
    try:
        wrong = check_replay(episode)
    except Exception as error:  # noqa: BLE001  (any exception is a finding)
        return violated(episode, outcome.steps, [Finding(ERROR, name_error(error))])
    if wrong is None:
        return outcome
    return violated(episode, outcome.steps, [Finding("replay", wrong)])


def check_replay(episode: Episode) -> str | None:
    """Record an episode, and replay the file; return how they differ, or None."""
    with tempfile.TemporaryDirectory(prefix="albot-") as folder:
        path = Path(folder) / "episode.mcap"
        record_episode(episode, path)
        try:
            replay(EpisodeReader(path), "the recording")
        except InputError as error:
            return f"{error.place}: {error.expected} was recorded, and {error.found}"
    return None


def record_episode(episode: Episode, path: Path, steps: int | None = None) -> None:
    """Run an episode alone, and write it to a file.

    Args:
        episode: The episode.
        path: The file.
        steps: Number of steps after which it ends; None for the episode's own.
    """
    env = episode.make()
    try:
        agent = make_agent(episode.agent, EnvironmentConfigs.of(env))
        recorder = EpisodeWriter(path)
        env.set_wrapper_attr("recorder", recorder)
        env.set_wrapper_attr("agent", episode.agent)
        observation, info = begin_episode(env, agent, episode.seed)
        for _ in range(steps or episode.steps):
            action = choose_action(agent, observation, info)
            observation, _, terminated, truncated, info = env.step(action)
            if terminated or truncated:
                break
    finally:
        env.close()


def violated(episode: Episode, step: int, findings: Sequence[Finding]) -> Outcome:
    """Return the outcome of an episode in which these findings were made after a step."""
    violations = tuple(
        Violation(episode=episode, step=step, what=found.what, invariant=found.invariant)
        for found in findings
    )
    return Outcome(episode=episode, steps=step, violations=violations)

"""Run one episode of an evaluation and measure it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from jaxtyping import Float64

from albot_agents.agent import EnvironmentConfigs, begin_episode, choose_action
from albot_agents.engine.engine import Crash
from albot_agents.evaluation.map_figures import MapFigures
from albot_agents.evaluation.plan import Trial
from albot_agents.evaluation.recordings import Recording, Recordings
from albot_agents.registry import make_agent
from albot_core.geometry.types import Pose
from albot_env.export.transitions import Transitions
from albot_env.recording.episode import Recorder

HORIZON = 200
"""Driven distance over which coverage is measured (m)."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Outcome:
    """The measurements of an episode."""

    trial: Trial
    """The episode."""
    info: Mapping[str, Any]
    """The last info: the ground truth at the end; and what the map was like (`MapFigures`)."""
    start: Pose
    """Pose of home (world frame)."""
    begin: Pose
    """Pose at the beginning of the episode (world frame)."""
    path: Float64[np.ndarray, "steps 2"]
    """The agent's path (m, world frame)."""
    collisions: int
    """Number of times that the robot came into contact with something."""
    rooms: int = 0
    """Number of rooms that the robot can reach."""
    coverage_curve: Float64[np.ndarray, "samples"] = field(default_factory=lambda: np.empty(0))
    """The share of the ground covered after each metre of the path (`sample_curve`)."""
    recording: Recording | None = None
    """Its files; None if it was not recorded, or not kept."""
    transitions: Transitions | None = None
    """What was observed, done and earned, if the trial keeps it (`Trial.keeps_transitions`)."""

    @property
    def agent(self) -> str:
        """The agent's name."""
        return self.trial.agent

    @property
    def world(self) -> str:
        """The world's spec."""
        return self.trial.world

    @property
    def seed(self) -> int:
        """Seed of the episode."""
        return self.trial.seed

    @property
    def driven(self) -> float:
        """Length of the path (m)."""
        return float(np.hypot(*np.diff(self.path, axis=0).T).sum())

    @property
    def coverage_auc(self) -> float | None:
        """Mean share of ground covered over the first `HORIZON` metres; None if not measured."""
        return area_under(self.coverage_curve) if len(self.coverage_curve) else None


@dataclass(frozen=True, kw_only=True)
class FailedTrial:
    """An episode whose process died each time that it was run, or that ended in a bug."""

    trial: Trial
    """The episode."""
    crash: Crash
    """What happened."""

    @property
    def facts(self) -> dict[str, Any]:
        """What is told of it: the episode, the step, what happened, the command that plays it."""
        trial, crash = self.trial, self.crash
        facts = {"task": trial.task, "agent": trial.agent, "world": trial.world, "seed": trial.seed}
        command = trial.command(crash.step)
        return facts | {"step": crash.step, "what": crash.cause, "command": command}

    @property
    def text(self) -> str:
        """It as lines of text."""
        trial = self.trial
        first = f"failed: {trial.agent} in {trial.world}, seed {trial.seed}, {self.crash}"
        return "\n  ".join([first, *trial.command(self.crash.step).splitlines()])


def run_trial(
    trial: Trial,
    on_step: Callable[[int], None] = lambda _: None,
    recorder: Recorder | None = None,
) -> Outcome:
    """Run an episode to its end.

    Args:
        trial: The episode.
        on_step: Called before each step with its number.
        recorder: Records the episode, and is closed at its end.

    Raises:
        InputError: There is no such world, mapper or sensor.
    """
    env = trial.make() if recorder is None else trial.make_recorded(recorder)
    try:
        configs = EnvironmentConfigs.of(env)
        agent = make_agent(trial.agent, configs)
        on_step(0)
        observation, info = begin_episode(env, agent, trial.seed)
        log = EpisodeLog(trial, configs, observation, info)
        spaces = env.observation_space, env.action_space
        kept = trial.begin_log(observation, spaces) if trial.keeps_transitions else None
        while not log.over:
            on_step(log.steps + 1)
            action = choose_action(agent, observation, info)
            observation, reward, terminated, truncated, info = env.step(action)
            log.add(observation, info, over=terminated or truncated)
            if kept is not None:
                kept.add(action, observation, float(reward), terminated, truncated)
    finally:
        env.close()
    return replace(log.outcome, transitions=None if kept is None else kept.transitions())


class EpisodeLog:
    """What is measured of an episode as it runs.

    Args:
        trial: The episode.
        configs: The environment's configurations of observations and actions.
        observation: The first observation.
        info: The first info.
    """

    def __init__(
        self,
        trial: Trial,
        configs: EnvironmentConfigs,
        observation: Any,
        info: Mapping[str, Any],
    ) -> None:
        self.over = False
        """Whether it has ended."""
        self._trial, self._info = trial, info
        self._begin = info["pose"].copy()
        self._path, self._coverages = [self._begin[:2]], [info.get("coverage")]
        self._explores = info["path_length"] == 0.0  # No outward journey covered ground.
        self._collisions, self._touched = 0, False
        self._maps = MapFigures(configs, observation, info)

    @property
    def steps(self) -> int:
        """Number of steps so far."""
        return len(self._path) - 1

    def add(self, observation: Any, info: Mapping[str, Any], *, over: bool) -> None:
        """Add what came of a step, and whether the episode has ended with it."""
        self._path.append(info["pose"][:2].copy())
        self._coverages.append(info.get("coverage"))
        touches = bool(info["collided"])
        self._collisions += touches and not self._touched
        self._maps.add(observation, info)
        self._touched, self._info, self.over = touches, info, over
        if over:
            self._info = {**info, **self._maps.end(observation, info)}

    @property
    def outcome(self) -> Outcome:
        """The measurements of the episode, which has ended."""
        path = np.array(self._path)
        return Outcome(
            trial=self._trial,
            info=self._info,
            start=self._info["start"],
            begin=self._begin,
            path=path,
            collisions=self._collisions,
            **(_explored(self._trial, path, self._coverages) if self._explores else {}),
        )


def _explored(
    trial: Trial, path: Float64[np.ndarray, "steps 2"], coverages: Sequence[float | None]
) -> dict[str, Any]:
    """Return `rooms` and `coverage_curve`; nothing if the task measures no coverage."""
    known = [share for share in coverages if share is not None]
    if not known:
        return {}
    rooms = len(trial.loaded_world.reachable_rooms)
    return {"rooms": rooms, "coverage_curve": sample_curve(path, known)}


def sample_curve(
    path: Float64[np.ndarray, "steps 2"], coverages: Sequence[float]
) -> Float64[np.ndarray, "samples"]:
    """Return the share of ground covered after 0, 1, 2, … `HORIZON` metres.

    The share is interpolated between steps, and constant after the last one.

    Args:
        path: The robot's position at each step (m).
        coverages: The share covered at each step.
    """
    driven = np.append(0.0, np.hypot(*np.diff(path, axis=0).T).cumsum())
    # Looking around on the spot costs no distance: of the steps at one position, the last counts.
    last = np.append(np.diff(driven) > 0, True)
    shares = np.asarray(coverages)[last]
    return np.asarray(np.interp(np.arange(HORIZON + 1.0), driven[last], shares))


def area_under(curve: Float64[np.ndarray, "samples"]) -> float:
    """Return the mean of an evenly sampled curve by the trapezoidal rule; 1 means all at once."""
    return float((curve[1:] + curve[:-1]).mean() / 2)


def run_recorded(
    trial: Trial, on_step: Callable[[int], None], /, recordings: Recordings
) -> Outcome:
    """Run and record an episode.

    Args:
        trial: The episode.
        on_step: Called before each step with its number.
        recordings: Where it is recorded.

    Raises:
        InputError: There is no such world, mapper or sensor, or a file cannot be written.
    """
    outcome = run_trial(trial, on_step, recordings.recorder(trial))
    return replace(outcome, recording=recordings.keep(trial, outcome.info))

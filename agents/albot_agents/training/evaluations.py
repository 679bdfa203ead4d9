"""Evaluations during training: always the same episodes, by mean actions or as the agent acts."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import torch
from gymnasium.vector import AutoresetMode
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.policies import BasePolicy

from albot_agents.task import batch_settings
from albot_agents.trained.network import DRIVEN
from albot_agents.training.journeys import MadeJourneys, prepare_journeys
from albot_agents.training.plan import TrainingPlan
from albot_agents.training.plan_file import evaluation_settings, evaluation_trials
from albot_core.archive import read_arrays
from albot_core.errors import InputError
from albot_core.files import atomic_write

FILE = "evaluations.npz"
_KINDS: dict[str, tuple[int, Any]] = {
    "timesteps": (1, np.int64),
    "results": (2, np.float64),
    "ep_lengths": (2, np.int64),
    "successes": (2, np.float64),
    "spl": (2, np.float64),
}
"""The arrays of the file, those of stable-baselines3's `EvalCallback` and `spl`: number of
dimensions (evaluations, or evaluations and episodes) and data type."""
_LARGEST = 1 << 26
"""Largest unpacked size of the file (bytes)."""


class Evaluations:
    """Evaluates a policy repeatedly, and keeps the results in a file.

    Args:
        plan: The plan.
        path: The file of the results; it is read if it exists.
        samples: Results after more samples than this, which no checkpoint holds, are dropped.

    Raises:
        InputError: There is no such world or setting, or the file holds something else.
    """

    def __init__(self, plan: TrainingPlan, path: Path, samples: int) -> None:
        assert plan.evaluation is not None
        trials = evaluation_trials(plan, plan.evaluation.worlds)
        self._seeds = [trial.seed for trial in trials]
        self._draws = plan.policy.sampled and not plan.evaluation.deterministic
        self._draws_statements = plan.policy.sampled_statements
        settings = evaluation_settings(plan)
        if "journeys" in batch_settings(plan.task):
            settings["journeys"] = 1  # One fixed journey per start, which is kept.
        self._task, self._settings = plan.task, settings
        self._batch: Any = gymnasium.make_vec(
            plan.task,
            num_envs=len(trials),
            world=[trial.world for trial in trials],
            autoreset_mode=AutoresetMode.SAME_STEP,
            **settings,
        )
        self._path = path
        self._results: dict[str, np.ndarray] = _read_results(path, len(trials), samples)

    @property
    def best(self) -> tuple[float, float]:
        """The best score so far; minus infinity if there is none."""
        scores = [self._score(k) for k in range(len(self._results["timesteps"]))]
        return max(scores, default=(-np.inf, -np.inf))

    @property
    def samples(self) -> int:
        """Number of samples at the last evaluation; 0 if there is none."""
        return int(self._results["timesteps"][-1]) if len(self._results["timesteps"]) else 0

    @property
    def count(self) -> int:
        """Number of evaluations."""
        return len(self._results["timesteps"])

    @property
    def last(self) -> dict[str, float | None]:
        """Means of the last evaluation: `success_rate`, `spl`, `return`; None if unknown."""
        if not len(self._results["timesteps"]):
            return {}
        names = {"success_rate": "successes", "spl": "spl", "return": "results"}
        rows = {name: self._results[key][-1] for name, key in names.items()}
        return {
            name: None if np.isnan(row).any() else float(row.mean()) for name, row in rows.items()
        }

    @property
    def curve(self) -> dict[str, list[float]]:
        """The learning curve: `samples`, mean `return`, and if known `success_rate` and `spl`."""
        names = {"return": "results", "success_rate": "successes", "spl": "spl"}
        curve = {"samples": self._results["timesteps"].astype(float).tolist()}
        means = {name: self._results[key].mean(axis=1) for name, key in names.items()}
        return curve | {
            name: row.tolist() for name, row in means.items() if not np.isnan(row).any()
        }

    def prepare_journeys(
        self, report: Callable[[str], None], made: MadeJourneys | None = None
    ) -> None:
        """Make the episodes' journeys in parallel, before the first evaluation would make them.

        Args:
            report: Called with the progress as text.
            made: As of `prepare_journeys`.
        """
        prepare_journeys(self._task, self._batch, self._settings, report, made)

    def measure(self, learner: BaseAlgorithm) -> bool:
        """Evaluate the current policy and write the results; return whether it is the best so far.

        Raises:
            InputError: The file cannot be written.
        """
        best = self.best
        ends = self._run(learner)
        for name, row in ends.items():
            self._results[name] = np.concatenate((self._results[name], row[np.newaxis]))
        with atomic_write(self._path) as stream:
            np.savez(stream, **self._results)  # type: ignore[arg-type]
        return self._score(-1) > best

    def close(self) -> None:
        """Close the environments."""
        self._batch.close()

    def _score(self, k: int) -> tuple[float, float]:
        """Return an evaluation's score: success rate first, then mean return."""
        rate = float(self._results["successes"][k].mean())
        return (0.0 if np.isnan(rate) else rate), float(self._results["results"][k].mean())

    def _run(self, learner: BaseAlgorithm) -> dict[str, np.ndarray]:
        """Run one episode in each environment; return the results by name of the array."""
        count = len(self._seeds)
        figures = {"successes": "is_success", "spl": "spl"}
        ends: dict[str, Any] = {name: np.full(count, np.nan) for name in figures}
        returns, lengths = np.zeros(count), np.zeros(count, np.int64)
        running, state = np.ones(count, np.bool_), None
        starts = np.ones(count, np.bool_)
        observations, _ = self._batch.reset(seed=self._seeds)
        draws = np.random.default_rng(self._seeds)
        while running.any():
            actions, state = self._act(learner.policy, observations, state, starts, draws)
            observations, rewards, ended, truncated, infos = self._batch.step(actions)
            returns[running] += rewards[running]
            lengths[running] += 1
            starts = ended | truncated
            over = starts & running
            for name, key in figures.items():
                if over.any() and key in infos["final_info"]:
                    ends[name][over] = infos["final_info"][key][over]
            running &= ~starts
        timesteps = np.array(learner.num_timesteps)
        return ends | {"timesteps": timesteps, "results": returns, "ep_lengths": lengths}

    def _act(
        self,
        policy: BasePolicy,
        observations: Any,
        state: Any,
        starts: np.ndarray,
        draws: np.random.Generator,
    ) -> tuple[np.ndarray, Any]:
        """Return the actions, the mean ones or drawn as by the agent, and a recurrent state."""
        mean, after = policy.predict(observations, state, starts, deterministic=True)
        if not self._draws:
            return mean, after
        devices = [policy.device] if policy.device.type == "cuda" else []
        with torch.random.fork_rng(devices):  # The training's own random numbers stay as they are.
            torch.manual_seed(int(draws.integers(1 << 31)))
            actions, _ = policy.predict(observations, state, starts, deterministic=False)
        if not self._draws_statements:
            actions[:, DRIVEN:] = mean[:, DRIVEN:]
        return actions, after


def _read_results(path: Path, episodes: int, samples: int) -> dict[str, np.ndarray]:
    """Read the results up to `samples` samples; return empty arrays if there is no file."""
    if not path.exists():
        return {
            name: np.zeros((0, episodes)[:dimensions], kind)
            for name, (dimensions, kind) in _KINDS.items()
        }
    arrays = read_arrays(path, "file of evaluations", _LARGEST)
    if arrays.keys() != _KINDS.keys():
        raise InputError(path, f"the arrays {', '.join(_KINDS)}", ", ".join(sorted(arrays)))
    for name, (dimensions, kind) in _KINDS.items():
        shape = (len(np.atleast_1d(arrays["timesteps"])), episodes)[:dimensions]
        if arrays[name].shape != shape or arrays[name].dtype != kind:
            found = f"{arrays[name].shape} of {arrays[name].dtype}"
            raise InputError(path, f"{shape} of {np.dtype(kind)}", found, place=f"{name}.npy")
    kept = arrays["timesteps"] <= samples
    return {name: arrays[name][kept] for name in _KINDS}
